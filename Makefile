# Everything that a user or a contributor needs; `make help` lists it.
#
# Everything happens in .venv, with ROS 2 Jazzy from the Python package index. Choose the Python with
# `make PYTHON=python3.12 …`.

PYTHON ?= python3
VENV ?= .venv

BIN := $(VENV)/bin
# A separate environment for the linters, since they and their NumPy are pinned.
LINTERS ?= .venv-lint
# Environment of `make docs`.
SITE ?= .venv-docs
PYTHON_FILES := setup.py examples handover_dmp launch scripts test
# The packages are installed again when one of these changes.
METADATA := setup.py setup.cfg pyproject.toml

# A sourced ROS 2 of the system must not be mixed with the one in .venv.
unexport AMENT_PREFIX_PATH COLCON_PREFIX_PATH CMAKE_PREFIX_PATH PYTHONPATH
unexport RMW_IMPLEMENTATION ROS_DISTRO ROS_VERSION ROS_PYTHON_VERSION
ifdef AMENT_PREFIX_PATH
unexport LD_LIBRARY_PATH
endif
export PIP_DISABLE_PIP_VERSION_CHECK = 1
# Tests and graphs start hundreds of processes, which share compiled files.
unexport PYTHONDONTWRITEBYTECODE

# Tests are isolated from other robots on the network and other tests on this machine.
ISOLATED = ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_DOMAIN_ID=$$(($$$$ % 100 + 1))
# test/conftest.py sets the number of processes, and which tests belong together.
PYTEST = $(ISOLATED) $(BIN)/python -m pytest -n auto

.PHONY: help demo test test-ros2 longtest matrix coverage lint docs format bench clean

help:
	@echo 'make demo       install what is needed, run one handover, write runs/<name>/'
	@echo 'make test       install what is needed, run the tests'
	@echo 'make test-ros2  run the tests of the ros2 command, launch and launch_testing on the PATH'
	@echo 'make longtest   also run tests that take minutes, with new examples for all properties'
	@echo 'make matrix     run demo and tests on Python 3.10 to 3.13, and with the oldest libraries'
	@echo 'make coverage   measure the test coverage of each room'
	@echo 'make lint       check style and types, with pinned tools in a separate environment'
	@echo 'make docs       build the documentation with the reference of the code: build/site/'
	@echo 'make format     format every Python file'
	@echo 'make bench      measure speed and accuracy, compared with other libraries'
	@echo 'make clean      remove .venv and the output of builds and tools, but not runs/'

demo: $(VENV)/.demo
	$(BIN)/handover_dmp demo

test: $(VENV)/.test
	$(PYTEST)

# In the environment of ros2, in which this package is installed.
test-ros2:
	@AMENT_PREFIX_PATH='$(AMENT_PREFIX_PATH)' PYTHONPATH='$(PYTHONPATH)' \
	LD_LIBRARY_PATH='$(LD_LIBRARY_PATH)' $(ISOLATED) python3 -m pytest -m ros2 test

longtest: $(VENV)/.test
	$(PYTEST) -m 'slow or not slow' --hypothesis-profile=new

matrix:
	scripts/matrix.sh

coverage: $(VENV)/.coverage
	$(PYTEST) --cov=handover_dmp --cov-report=
	$(PYTEST) --cov=handover_dmp --cov-append --cov-report=json:$(VENV)/coverage.json \
	    --cov-report= -m slow test/cli/test_bench.py
	$(BIN)/python scripts/coverage_by_room.py $(VENV)/coverage.json

lint: $(LINTERS)/.lint
	$(LINTERS)/bin/ament_flake8 $(PYTHON_FILES)
	$(LINTERS)/bin/ament_pep257 --add-ignore D406 D407 -- $(PYTHON_FILES)
	$(LINTERS)/bin/ruff check .
	$(LINTERS)/bin/ruff format --check .
	$(LINTERS)/bin/mypy
	$(LINTERS)/bin/check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml

docs: $(SITE)/.docs
	PATH="$(SITE)/bin:$$PATH" $(SITE)/bin/mkdocs build --quiet
	@echo 'open build/site/index.html'

format: $(LINTERS)/.lint
	$(LINTERS)/bin/python scripts/add_licence_header.py
	$(LINTERS)/bin/ruff format .
	$(LINTERS)/bin/ruff check --fix .

bench: $(VENV)/.bench
	$(ISOLATED) $(BIN)/handover_dmp bench

clean:
	rm -rf $(VENV) $(LINTERS) $(SITE) .venv-* build dist install log *.egg-info
	rm -rf .pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage*
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Each file below stands for "is installed".

# Files in `lib/` and `share/` are copied, so their changes need a new install.
COPIED := $(filter-out %/__pycache__,$(wildcard config/* launch/* urdf/* scripts/* package.xml))
INSTALL = pip install --quiet

$(BIN)/python $(LINTERS)/bin/python $(SITE)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info < (3, 14))' || { \
	    echo "Python 3.10 to 3.13 is needed, and '$(PYTHON)' is not: make PYTHON=python3.12" >&2; \
	    exit 1; }
	$(PYTHON) -m venv $(@D)/..
	$@ -m pip install --quiet --upgrade pip

$(VENV)/.demo: $(METADATA) $(COPIED) | $(BIN)/python
	@echo 'installing (about a minute)'
	$(BIN)/python -m $(INSTALL) --editable '.[ros]'
	@touch $@

$(VENV)/.test: $(METADATA) $(COPIED) | $(BIN)/python
	@echo 'installing (about a minute)'
	$(BIN)/python -m $(INSTALL) --editable '.[ros,test]'
	@touch $@ $(VENV)/.demo

$(VENV)/.coverage: $(VENV)/.test
	$(BIN)/python -m $(INSTALL) --editable '.[ros,test,coverage]'
	@touch $@

$(VENV)/.bench: $(METADATA) $(COPIED) | $(BIN)/python
	@echo 'installing (some minutes)'
	$(BIN)/python -m $(INSTALL) --editable '.[ros,bench]'
	@touch $@ $(VENV)/.demo

$(LINTERS)/.lint: $(METADATA) | $(LINTERS)/bin/python
	@echo 'installing (about a minute)'
	$(LINTERS)/bin/python -m $(INSTALL) '.[lint]'
	@touch $@

$(SITE)/.docs: $(METADATA) | $(SITE)/bin/python
	@echo 'installing (about a minute)'
	$(SITE)/bin/python -m $(INSTALL) '.[docs]'
	@touch $@
