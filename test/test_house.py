# Copyright 2026 The handover_dmp authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What each room may know of the others, and what the package may need from outside."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import packages_distributions, requires
from pathlib import Path
import re
import sys
from xml.etree import ElementTree

from packaging.requirements import Requirement
import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'handover_dmp'
# For those that are not installed, or that hide their modules from the metadata.
DISTRIBUTIONS = {
    'PIL': 'pillow',
    'pink': 'pin-pink',
    'pinocchio': 'pin',
    'sklearn': 'scikit-learn',
    'umsgpack': 'u-msgpack-python',
    'yaml': 'pyyaml',
}
# Not of ROS, though its key in `package.xml` has the form of one that is.
LIBRARIES = {'pinocchio', 'xacro'}
ROS_ROOMS = ('nodes', 'recording', 'bench')
# From the ground up: a room may import from the floors below its own and from no other room.
FLOORS = (
    ('__init__', 'topics', 'common'),
    ('dmp', 'recording', 'robot'),
    ('mocap', 'simulation'),
    ('tracking',),
    ('handover', 'report'),
    ('evaluation', 'view'),
    ('runs',),
    ('nodes',),
    ('bench',),
    ('cli',),
    ('__main__',),
)
FLOOR_OF = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}


def test_no_two_test_files_have_one_name() -> None:
    names = [file.name for file in (ROOT / 'test').rglob('test_*.py')]
    assert sorted(names) == sorted(set(names))


def imports(file: Path) -> Iterator[str]:
    """Yield the full name of every module that a file imports, anywhere in it."""
    for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield from (f'{node.module}.{alias.name}' for alias in node.names)


def names_of_ros() -> set[str]:
    """Return the ROS packages that `package.xml` asks for."""
    root = ElementTree.parse(ROOT / 'package.xml').getroot()
    names = {str(element.text) for element in root if element.tag.endswith('depend')}
    return {name for name in names if re.fullmatch(r'[a-z0-9_]+', name)} - LIBRARIES


def requirements(*extras: str) -> set[str]:
    """Return the distributions that an install with these extras brings."""
    named = [Requirement(requirement) for requirement in requires('handover_dmp') or ()]
    return {
        normal(each.name)
        for each in named
        for extra in ('', *extras)
        # on the Python that has wheels of all of them
        if each.marker is None or each.marker.evaluate({'extra': extra, 'python_version': '3.11'})
    }


@cache
def installed_modules() -> Mapping[str, list[str]]:
    """Return the distributions of every module that is installed; it reads them all, once."""
    return packages_distributions()


def normal(name: str) -> str:
    """Return the one way to write the name of a distribution."""
    return re.sub(r'[-_.]+', '-', name).lower()


@cache
def distributions(module: str) -> set[str]:
    """Return the distributions that a top-level module may come from."""
    installed = installed_modules().get(module, [])
    return {normal(name) for name in [*installed, DISTRIBUTIONS.get(module, module)]}


@cache
def third_party() -> dict[str, set[str]]:
    """Return every module from outside, and the rooms that import it."""
    found: dict[str, set[str]] = {}
    for file in PACKAGE.rglob('*.py'):
        for name in imports(file):
            top = name.partition('.')[0]
            if top not in sys.stdlib_module_names and top != 'handover_dmp':
                found.setdefault(top, set()).add(file.relative_to(PACKAGE).parts[0])
    return found


def test_what_is_imported_is_declared() -> None:
    ros = names_of_ros()
    for module, rooms in third_party().items():
        if module in ros:
            assert rooms <= set(ROS_ROOMS), f'{module} belongs in {ROS_ROOMS}, not in {rooms}'
            continue
        declared = requirements(*(['bench'] if rooms == {'bench'} else []))
        assert distributions(module) & declared, f'{module}, of {rooms}, is not declared'


def test_what_is_declared_is_imported() -> None:
    used = {name for module in third_party() for name in distributions(module)}
    # example-robot-data has files for Pinocchio and no module.
    assert requirements() - used == {'example-robot-data'}


def test_ros_packages_that_are_declared_are_used() -> None:
    launch = (ROOT / 'launch' / 'handover.launch.py').read_text(encoding='utf-8')
    tests = {'ament_copyright', 'ament_flake8', 'ament_pep257', 'ros2launch'}
    used = third_party()
    for name in names_of_ros() - tests:
        assert name in used or name in launch, name


def room_of(file: Path) -> str:
    """Return the room of a file of the package, which for a loose module is its own name."""
    return file.relative_to(PACKAGE).parts[0].removesuffix('.py')


def imported_room(name: str) -> str | None:
    """Return the room that a full name of this package lies in, None for one of another."""
    package, _, inner = name.partition('.')
    room = inner.partition('.')[0]
    if package != 'handover_dmp':
        return None
    return room if (PACKAGE / room).is_dir() or (PACKAGE / f'{room}.py').is_file() else '__init__'


def test_every_room_has_its_floor() -> None:
    assert {room_of(file) for file in PACKAGE.rglob('*.py')} == set(FLOOR_OF)


@pytest.mark.parametrize('room', FLOOR_OF)
def test_a_room_imports_from_lower_floors_alone(room: str) -> None:
    for file in (file for file in PACKAGE.rglob('*.py') if room_of(file) == room):
        # the front door leads to every floor, but imports nothing before it is asked for it
        for name in [] if room == '__init__' else imports(file):
            other = imported_room(name)
            if other not in (None, room):
                message = f'{file.relative_to(ROOT)} imports {name}'
                assert FLOOR_OF[other] < FLOOR_OF[room], message


def test_nodes_know_nothing_of_each_other() -> None:
    nodes = (
        'robot_sim', 'hand_tracker', 'dmp', 'priority_ik', 'recorder', 'velocity_to_position',
        'calibration_motion',
    )  # fmt: skip
    for node in nodes:
        for name in imports(PACKAGE / 'nodes' / f'{node}.py'):
            for other in nodes:
                assert not f'{name}.'.startswith(f'handover_dmp.nodes.{other}.')


def public_names(file: Path) -> Iterator[str]:
    """Yield the functions, classes and types that a module makes public."""
    for node in ast.parse(file.read_text(encoding='utf-8')).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            name = node.targets[0].id
            yield from [name] if name[0].isupper() and not name.isupper() else []


def test_no_public_name_stands_for_two_things() -> None:
    # what every command and every node has to have, and short names of types
    everywhere = {'add_arguments', 'run', 'main', 'Array', 'Colour', 'Element', 'Vector'}
    found: dict[str, list[str]] = {}
    for file in PACKAGE.rglob('*.py'):
        for name in set(public_names(file)) - everywhere:
            if not name.startswith('_'):
                found.setdefault(name, []).append(str(file.relative_to(PACKAGE)))
    assert {name: files for name, files in found.items() if len(files) > 1} == {}
