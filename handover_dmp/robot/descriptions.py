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

"""The description files of arms, and their additional data in `config/robots.yaml`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
import sys
from typing import Any

from handover_dmp.common.plain_yaml import load_plain
from handover_dmp.common.quiet_pybullet import silenced
from handover_dmp.common.resources import share_path
from handover_dmp.robot.effective_limits import DefaultLimits, KnownLimits, QUANTITIES
from handover_dmp.robot.errors import RobotDescriptionError
from handover_dmp.robot.mesh_files import find_package, LOOKED_IN


@dataclass(frozen=True)
class ArmEntry:
    """
    One entry of `config/robots.yaml`.

    Attributes:
        name: name of the arm here.
        urdf_name: the name in the `<robot>` element of its URDF.
        urdf: location of the URDF, see `urdf_file`.
        wrist_frame: the wrist link.
        limits: `velocity` (rad/s), `effort` (Nm), `acceleration` (rad/s²) and `jerk` (rad/s³)
            along the chain, as far as the entry has them.
        home: home configuration, rad; empty if the entry has none.

    """

    name: str
    urdf_name: str
    urdf: str
    wrist_frame: str
    limits: dict[str, tuple[float, ...]]
    home: tuple[float, ...]

    def fits(self, joint_names: Sequence[str]) -> bool:
        """
        Return whether the entry fits a chain.

        Args:
            joint_names: joints of the chain that ends in `wrist_frame`.

        Returns:
            Whether each of its lists has one number per joint.

        """
        rows = [*self.limits.values(), *([self.home] if self.home else [])]
        return all(len(row) == len(joint_names) for row in rows)

    def known_limits(self, joint_names: Sequence[str], *, rules: bool) -> KnownLimits:
        """
        Assign the limits of the entry to the joints.

        Args:
            joint_names: joints of the chain that ends in `wrist_frame`.
            rules: whether only these count.

        Returns:
            The limits by joint.

        """
        by_joint = {
            joint: {quantity: row[i] for quantity, row in self.limits.items()}
            for i, joint in enumerate(joint_names)
        }
        return KnownLimits(self.name, rules, by_joint)


@cache
def _table() -> tuple[dict[str, ArmEntry], DefaultLimits]:
    tree = load_plain(share_path('config/robots.yaml').read_text(encoding='utf-8'))
    defaults = tree.pop('default')
    return {name: _entry(name, entry) for name, entry in tree.items()}, DefaultLimits(
        position_rad=float(defaults.pop('position')),
        **{key: float(value) for key, value in defaults.items()},
    )


def known_arms() -> dict[str, ArmEntry]:
    """
    Read `config/robots.yaml`.

    Returns:
        The arms by name.

    """
    return _table()[0]


def default_limits() -> DefaultLimits:
    """
    Read the defaults of `config/robots.yaml` for unknown joints.

    Returns:
        The defaults.

    """
    return _table()[1]


def entry_for_urdf(urdf_name: str) -> ArmEntry | None:
    """
    Find the entry for the arm of a URDF.

    Args:
        urdf_name: the name in its `<robot>` element.

    Returns:
        The entry; None if there is none.

    """
    entries = known_arms().values()
    return next((entry for entry in entries if entry.urdf_name == urdf_name), None)


@dataclass(frozen=True)
class ArmChoice:
    """
    The arm selected by a user; empty fields are taken from the description or the recording.

    Attributes:
        robot: see `read_description`.
        wrist_frame: the wrist link.
        base_frame: first link of the chain.

    """

    robot: str = ''
    wrist_frame: str = ''
    base_frame: str = ''


@dataclass(frozen=True)
class Description:
    """
    A robot description and its origin.

    Attributes:
        asked_for: the name of `config/robots.yaml`, the file (with the arguments of a xacro) or
            the topic.
        name: name in `config/robots.yaml`, if the arm was requested by it; otherwise empty.
        path: path of the file, beside which its meshes may lie, or the topic.
        text: the URDF.

    """

    asked_for: str
    name: str
    path: Path
    text: str


def read_description(robot: str | Path) -> Description:
    """
    Read the description of an arm.

    Args:
        robot: a name of `config/robots.yaml`, or the path of a URDF or xacro, optionally followed
            by arguments of the xacro (`arm.urdf.xacro name:=value`).

    Returns:
        Its description.

    Raises:
        RobotDescriptionError: there is no such arm or file, or it cannot be read.

    """
    asked_for = str(robot)
    if asked_for in known_arms():
        path = urdf_file(asked_for)
        return Description(asked_for, asked_for, path, _read(path))
    words = [asked_for] if Path(asked_for).expanduser().is_file() else asked_for.split()
    path = urdf_file(words[0] if len(words) > 1 and '.xacro' in words[0] else asked_for)
    if path.suffix == '.xacro':
        arguments = words[1:]
        asked_for = ' '.join([str(path), *arguments])
        return Description(asked_for, '', path, expanded(path, arguments))
    return Description(str(path), '', path, _read(path))


def expanded(path: Path, arguments: Sequence[str] = ()) -> str:
    """
    Expand a xacro.

    Args:
        path: path of the file.
        arguments: arguments, each `name:=value`.

    Returns:
        The URDF.

    Raises:
        RobotDescriptionError: it cannot be expanded; the error says why.

    """
    wrong = [word for word in arguments if ':=' not in word]
    if wrong:
        raise RobotDescriptionError(f'{path}: {wrong[0]!r} is not an argument name:=value')
    # imported here: this takes 0.2 s and is needed for a xacro only
    from unittest.mock import patch

    import xacro
    from xacro import substitution_args

    def find(package: str) -> str:
        """Find a package like its meshes; xacro itself finds only installed ones."""
        found = find_package(package, path.parent)
        if found is None:
            raise ValueError(f'package {package!r} not found ({LOOKED_IN})')
        return str(found)

    mappings = dict(word.split(':=', 1) for word in arguments)
    try:
        with (
            silenced(),
            patch.object(substitution_args, '_eval_find', find),
            patch.dict(substitution_args._eval_dict, find=find),
        ):
            text = xacro.process_file(str(path), mappings=mappings).toxml()
    # xacro evaluates expressions, which may raise anything
    except Exception as error:
        raise RobotDescriptionError(f'{path}: xacro cannot expand it: {_fault(error)}') from error
    return str(text)


def _fault(error: Exception) -> str:
    """Return in one line why a xacro cannot be expanded; its errors are nested."""
    from xacro.substitution_args import ArgException

    cause, places = error, []
    while isinstance(inner := getattr(cause, 'exc', None), Exception):
        places.append(str(getattr(cause, 'suffix', None) or ''))
        cause = inner
    if isinstance(cause, ArgException):
        return f'its argument {cause} is missing: add {cause}:=value after the file'
    return ' '.join(' '.join([str(cause) or type(cause).__name__, *places]).split())


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding='utf-8')
    except UnicodeDecodeError as error:
        raise RobotDescriptionError(f'{path}: not UTF-8: save it in that encoding') from error


def urdf_file(robot: str | Path) -> Path:
    """
    Find the URDF of an arm.

    Args:
        robot: a name of `config/robots.yaml`, or the path of a URDF.

    Returns:
        The path of the file.

    Raises:
        RobotDescriptionError: there is no such arm or file, or its package is not installed.

    """
    entry = known_arms().get(str(robot))
    if entry is None:
        path = Path(robot).expanduser()
        if not path.is_file():
            names = ', '.join(known_arms())
            raise RobotDescriptionError(f'{robot}: neither a URDF file nor one of {names}')
        return path.resolve()
    collection, _, rest = entry.urdf.partition('/')
    if collection == 'pybullet_data':
        path = pybullet_data_folder() / rest
    elif collection == 'example-robot-data':
        path = example_robot_data_folder() / rest
    else:
        return share_path(entry.urdf)
    if not path.is_file():
        raise RobotDescriptionError(f'{path}: the URDF of {entry.name} does not exist')
    return path


def pybullet_data_folder() -> Path:
    """
    Find the models of PyBullet without loading PyBullet.

    Returns:
        Their folder.

    Raises:
        RobotDescriptionError: the package is not installed.

    """
    found = find_spec('pybullet_data')
    if found is None or not found.submodule_search_locations:
        raise RobotDescriptionError('pybullet_data is not installed: pip install pybullet')
    return Path(next(iter(found.submodule_search_locations)))


def example_robot_data_folder() -> Path:
    """
    Find the models of example-robot-data, which is usually installed beside Pinocchio.

    Returns:
        Its share folder, the one that holds `robots/`.

    Raises:
        RobotDescriptionError: the package is not installed.

    """
    found = find_spec('pinocchio')
    prefixes = [*Path(found.origin).parents] if found and found.origin else []
    # it may be installed by pip although Pinocchio comes with the system's ROS 2
    prefixes += [Path(folder, 'cmeel.prefix') for folder in sys.path]
    for prefix in prefixes:
        folder = prefix / 'share' / 'example-robot-data'
        if (folder / 'robots').is_dir():
            return folder
    raise RobotDescriptionError(
        'example-robot-data is not installed: pip install example-robot-data'
    )


def _entry(name: str, entry: dict[str, Any]) -> ArmEntry:
    return ArmEntry(
        name=name,
        urdf_name=entry['urdf_name'],
        urdf=entry['urdf'],
        wrist_frame=entry['wrist_frame'],
        limits={key: tuple(map(float, entry[key])) for key in QUANTITIES if key in entry},
        home=tuple(map(float, entry.get('home', ()))),
    )
