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

"""Which file describes an arm, and what `config/robots.yaml` says about it beyond that file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from handover_dmp.common.resources import share_path
from handover_dmp.robot.errors import RobotDescriptionError
import yaml


@dataclass(frozen=True)
class ArmEntry:
    """
    One entry of `config/robots.yaml`.

    Attributes:
        name: what the arm is called here.
        urdf_name: the name in the `<robot>` element of its URDF.
        urdf: where the URDF lies, see `urdf_file`; empty for the entry of an unknown arm.
        wrist_frame: the link whose frame follows the wrist; None where the entry has none.
        velocity: limits along the chain that replace the URDF's, rad/s.
        effort: the same, Nm.
        acceleration: limits along the chain, rad/s²; a URDF cannot hold them.
        jerk: the same, rad/s³.
        home: the posture to come back to, rad.
        default_acceleration: for joints that `acceleration` does not cover, rad/s².
        default_effort: for joints without one in the URDF, Nm.
        default_jerk_time_s: from rest to full acceleration, for joints that `jerk` does not cover.

    """

    name: str
    urdf_name: str
    urdf: str
    wrist_frame: str | None
    velocity: tuple[float, ...] | None
    effort: tuple[float, ...] | None
    acceleration: tuple[float, ...] | None
    jerk: tuple[float, ...] | None
    home: tuple[float, ...] | None
    default_acceleration: float
    default_effort: float
    default_jerk_time_s: float


@cache
def known_arms() -> dict[str, ArmEntry]:
    """
    Read `config/robots.yaml`.

    Returns:
        The arms by their names here.

    """
    tree = yaml.safe_load(share_path('config/robots.yaml').read_text(encoding='utf-8'))
    fallback = tree.pop('default')
    return {name: _entry(name, entry, fallback) for name, entry in tree.items()}


def entry_for_urdf(urdf_name: str) -> ArmEntry:
    """
    Find what is known about the arm of a URDF.

    Args:
        urdf_name: the name in its `<robot>` element.

    Returns:
        The entry of that arm, or one that holds only the defaults.

    """
    for entry in known_arms().values():
        if entry.urdf_name == urdf_name:
            return entry
    tree = yaml.safe_load(share_path('config/robots.yaml').read_text(encoding='utf-8'))
    return _entry(urdf_name, {}, tree['default'])


def urdf_file(robot: str | Path) -> Path:
    """
    Find the URDF of an arm.

    Args:
        robot: a name of `config/robots.yaml`, or the path of a URDF.

    Returns:
        The path of the file.

    Raises:
        RobotDescriptionError: there is no such arm or file, or the package that holds it is not
            installed.

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
        return _existing(pybullet_data_folder() / rest, entry.name)
    if collection == 'example-robot-data':
        return _existing(example_robot_data_folder() / rest, entry.name)
    return share_path(entry.urdf)


def pybullet_data_folder() -> Path:
    """
    Find the models that come with PyBullet, without loading PyBullet.

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
    Find the models of example-robot-data, which installs beside Pinocchio.

    Returns:
        Its share folder, the one that holds `robots/`.

    Raises:
        RobotDescriptionError: the package is not installed.

    """
    found = find_spec('pinocchio')
    for prefix in Path(found.origin).parents if found and found.origin else ():
        folder = prefix / 'share' / 'example-robot-data'
        if (folder / 'robots').is_dir():
            return folder
    raise RobotDescriptionError(
        'example-robot-data is not installed: pip install example-robot-data'
    )


def _existing(path: Path, name: str) -> Path:
    if not path.is_file():
        raise RobotDescriptionError(f'{path}: the URDF of {name} is not there')
    return path


def _entry(name: str, entry: dict[str, Any], fallback: dict[str, float]) -> ArmEntry:
    def numbers(key: str) -> tuple[float, ...] | None:
        return tuple(map(float, entry[key])) if key in entry else None

    return ArmEntry(
        name=name,
        urdf_name=entry.get('urdf_name', name),
        urdf=entry.get('urdf', ''),
        wrist_frame=entry.get('wrist_frame'),
        velocity=numbers('velocity'),
        effort=numbers('effort'),
        acceleration=numbers('acceleration'),
        jerk=numbers('jerk'),
        home=numbers('home'),
        default_acceleration=float(fallback['acceleration']),
        default_effort=float(fallback['effort']),
        default_jerk_time_s=float(fallback['jerk_time_s']),
    )
