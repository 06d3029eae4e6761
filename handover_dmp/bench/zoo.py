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

"""
A zoo of arms, found by their joints in folders of robot descriptions.

This module identifies arms from the tree of joints alone, independently of the package, so that
the package's results can be compared with it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
import re
from xml.etree import ElementTree

from handover_dmp.common.arrays import Array
from handover_dmp.robot.descriptions import example_robot_data_folder, pybullet_data_folder
from handover_dmp.robot.plain_description import parse_xml
import numpy as np

Element = ElementTree.Element

MOVING = ('revolute', 'continuous', 'prismatic')
MIN_ALONE = 3
"""Least number of revolute joints of an arm that is the whole robot."""
MIN_BESIDE = 6
"""Least number of joints of an arm of a robot with other limbs."""
LEG = re.compile(r'foot|feet|ankle|sole|toe|leg|hip|wheel', re.IGNORECASE)
HAND_JOINT = re.compile(r'grip|finger|thumb|jaw', re.IGNORECASE)
HAND_LINK = re.compile(r'finger|thumb|jaw|knuckle', re.IGNORECASE)
TOOL = ('tool0', 'flange', 'tool', 'tcp', 'ee_link', 'eef', 'effector', 'tip')
"""Parts of frame names at the end of an arm, the best ones first."""
NO_LIMIT = 1e3
"""Larger numbers in a description mean no limit."""


@dataclass(frozen=True)
class ZooArm:
    """
    An arm in a file.

    Attributes:
        name: name of the file, relative to the searched folder.
        path: path of the file.
        wrist_frame: a link at its end.
        base_frame: its first link; empty for the root of a robot that is one arm.
        joint_names: joints, from the base on.

    """

    name: str
    path: Path
    wrist_frame: str
    base_frame: str
    joint_names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class FileLimits:
    """
    The joint limits of a description, read without the package's own rules.

    Attributes:
        lower: (n,), rad or m; -inf if missing.
        upper: (n,), rad or m; inf if missing.
        velocity: (n,), rad/s or m/s; inf if missing.

    """

    lower: Array
    upper: Array
    velocity: Array


def zoo() -> Iterator[ZooArm]:
    """
    Find the arms of example-robot-data and of PyBullet.

    Yields:
        The arms.

    Raises:
        RobotDescriptionError: one of the packages is not installed.

    """
    for folder in (example_robot_data_folder() / 'robots', pybullet_data_folder()):
        yield from arms_in(folder)


def arms_in(folder: Path) -> Iterator[ZooArm]:
    """
    Find serial arms.

    An arm is a chain of joints without a branch. Each joint moves independently, and three are
    revolute. It starts at the root or, for a robot with several limbs, is the first limb of six
    joints or more that is no leg. A gripper's joint at its end does not count.

    Args:
        folder: folder to search recursively.

    Yields:
        One arm per file, sorted by file name.

    """
    for path in sorted(folder.rglob('*.urdf')):
        try:
            robot = parse_xml(path.read_text(encoding='utf-8'))
        except (ElementTree.ParseError, UnicodeDecodeError):
            continue
        found = _arm_of(robot)
        if found is not None:
            wrist, base, joints = found
            yield ZooArm(str(path.relative_to(folder)), path, wrist, base, joints)


def file_limits(text: str, joint_names: Sequence[str]) -> FileLimits:
    """
    Read the joint limits of a description.

    Args:
        text: text of the description.
        joint_names: names of the joints.

    Returns:
        The narrower of hard and soft limits of each joint.

    """
    joints = {joint.get('name'): joint for joint in parse_xml(text).findall('joint')}
    rows = []
    for name in joint_names:
        joint = joints[name]
        hard, soft = joint.find('limit'), joint.find('safety_controller')
        lower, upper, velocity = (_told(hard, key) for key in ('lower', 'upper', 'velocity'))
        if joint.get('type') == 'continuous' or not lower < upper:
            lower, upper = -inf, inf
        given = {} if soft is None else soft.attrib
        ends = [given.get(f'soft_{side}_limit') for side in ('lower', 'upper')]
        # files that only set the gains have 0 for both limits
        if any(float(end or 0.0) for end in ends):
            lower = lower if ends[0] is None else max(lower, float(ends[0]))
            upper = upper if ends[1] is None else min(upper, float(ends[1]))
        rows.append(
            (
                lower if lower > -NO_LIMIT else -inf,
                upper if upper < NO_LIMIT else inf,
                velocity if 0.0 < velocity < NO_LIMIT else inf,
            )
        )
    return FileLimits(*np.array(rows, dtype=float).T)


def _told(element: Element | None, key: str) -> float:
    return 0.0 if element is None else float(element.get(key, 0.0))


def _arm_of(robot: Element) -> tuple[str, str, tuple[str, ...]] | None:
    """Return wrist, base and joints of the first arm of a robot."""
    below: dict[str, list[Element]] = {}
    carried = set()
    for joint in robot.findall('joint'):
        parent, child = _end(joint, 'parent'), _end(joint, 'child')
        below.setdefault(parent, []).append(joint)
        carried.add(child)
    roots = [link.get('name', '') for link in robot.findall('link')]
    roots = [name for name in roots if name not in carried]
    if len(roots) != 1:
        return None
    trunk, ahead = _limb(roots, below)
    limbs = list(_limbs(ahead, below))
    beside = [limb for limb in limbs if len(limb) >= MIN_BESIDE and not _is_leg(limb, below)]
    if beside:
        return _described(beside[0], below, _end(beside[0][0], 'parent'))
    alone = _without_gripper(trunk)
    return _described(alone, below, '') if len(alone) >= MIN_ALONE else None


def _limbs(group: list[str], below: dict[str, list[Element]]) -> Iterator[list[Element]]:
    """Yield the limbs after a branch, without grippers, nearest first."""
    groups = [group]
    for each in groups:
        for joint in _moving_from(each, below):
            limb, after = _limb([_end(joint, 'child')], below, [joint])
            yield _without_gripper(limb)
            groups.append(after)


def _is_leg(limb: list[Element], below: dict[str, list[Element]]) -> bool:
    return any(map(LEG.search, _rigid(_end(limb[-1], 'child'), below)))


def _limb(
    group: list[str], below: dict[str, list[Element]], begun: Sequence[Element] = ()
) -> tuple[list[Element], list[str]]:
    """Follow joints from a rigid group of links until they branch or end."""
    limb = list(begun)
    while True:
        group = [link for start in group for link in _rigid(start, below)]
        moving = _moving_from(group, below)
        if len(moving) != 1:
            return limb, group
        limb.append(moving[0])
        group = [_end(moving[0], 'child')]


def _rigid(link: str, below: dict[str, list[Element]]) -> list[str]:
    """Return the links fixed to a link, itself first."""
    group = [link]
    for each in group:
        group += [_end(j, 'child') for j in below.get(each, []) if j.get('type') == 'fixed']
    return group


def _moving_from(group: Sequence[str], below: dict[str, list[Element]]) -> list[Element]:
    """Return the independently moving joints on a rigid group."""
    joints = [joint for link in group for joint in below.get(link, [])]
    return [j for j in joints if j.get('type') in MOVING and j.find('mimic') is None]


def _without_gripper(limb: list[Element]) -> list[Element]:
    arm = list(limb)
    while arm and (
        HAND_JOINT.search(arm[-1].get('name', '')) or HAND_LINK.search(_end(arm[-1], 'child'))
    ):
        arm.pop()
    return arm if sum(joint.get('type') != 'prismatic' for joint in arm) >= MIN_ALONE else []


def _described(
    arm: list[Element], below: dict[str, list[Element]], base: str
) -> tuple[str, str, tuple[str, ...]]:
    ends = _rigid(_end(arm[-1], 'child'), below)
    named = [link for tool in TOOL for link in ends if link.lower().endswith(tool)]
    return [*named, ends[0]][0], base, tuple(joint.get('name', '') for joint in arm)


def _end(joint: Element, end: str) -> str:
    element = joint.find(end)
    return '' if element is None else element.get('link', '')
