# Everything that a user or a contributor needs; `make help` lists it.
#
# All of it happens in .venv, with ROS 2 Jazzy from the Python package index. Choose the Python with
# `make PYTHON=python3.12 …`.

PYTHON ?= python3
VENV ?= .venv

BIN := $(VENV)/bin
# A new version of one of these means that the packages have to be installed again.
METADATA := setup.py setup.cfg pyproject.toml

# A ROS 2 of the system that this shell has sourced does not mix with the one in .venv.
unexport AMENT_PREFIX_PATH COLCON_PREFIX_PATH CMAKE_PREFIX_PATH PYTHONPATH
unexport RMW_IMPLEMENTATION ROS_DISTRO ROS_VERSION ROS_PYTHON_VERSION
ifdef AMENT_PREFIX_PATH
unexport LD_LIBRARY_PATH
endif
export PIP_DISABLE_PIP_VERSION_CHECK = 1

# Tests neither hear other robots on the network nor other tests on this machine.
ISOLATED = ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_DOMAIN_ID=$$(($$$$ % 100 + 1))
# As many processes as there are processors; test/conftest.py says which tests belong together.
PYTEST = $(ISOLATED) $(BIN)/python -m pytest -n auto

.PHONY: help demo test longtest lint format bench clean

help:
	@echo 'make demo       install what is needed, run one handover, write runs/<name>/'
	@echo 'make test       install what is needed, run the tests'
	@echo 'make longtest   those too that take minutes each'
	@echo 'make lint       what test/test_lint.py checks, file by file'
	@echo 'make format     put every Python file into shape'
	@echo 'make bench      measure speed and accuracy beside peers'
	@echo 'make clean      remove .venv and what builds and tools left; runs/ stays'

demo: $(VENV)/.demo
	$(BIN)/handover_dmp demo

test: $(VENV)/.test
	$(PYTEST)

longtest: $(VENV)/.test
	$(PYTEST) -m 'slow or not slow'

lint: $(VENV)/.test
	$(BIN)/ament_flake8 --exclude .venv build install log -- .
	$(BIN)/ament_pep257 .
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(VENV)/.test
	$(BIN)/python scripts/add_licence_header.py
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: $(VENV)/.bench
	$(ISOLATED) $(BIN)/handover_dmp bench

clean:
	rm -rf $(VENV) build dist install log *.egg-info
	rm -rf .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Each file below stands for "is installed".

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info < (3, 14))' || { \
	    echo "Python 3.10 to 3.13 is needed, and '$(PYTHON)' is not: make PYTHON=python3.12" >&2; \
	    exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip

$(VENV)/.demo: $(METADATA) | $(BIN)/python
	@echo 'installing (some minutes; from Python 3.12 on PyBullet is compiled, some more)'
	$(BIN)/python -m pip install --quiet --editable '.[ros]'
	@touch $@

$(VENV)/.test: $(METADATA) | $(BIN)/python
	@echo 'installing (some minutes; from Python 3.12 on PyBullet is compiled, some more)'
	$(BIN)/python -m pip install --quiet --editable '.[ros,test,lint]'
	@touch $@ $(VENV)/.demo

$(VENV)/.bench: $(METADATA) | $(BIN)/python
	@echo 'installing (some minutes; from Python 3.12 on PyBullet is compiled, some more)'
	$(BIN)/python -m pip install --quiet --editable '.[ros,bench]'
	@touch $@ $(VENV)/.demo
