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

"""A robot description and the chain of joints in it that carries the wrist."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, isnan
from pathlib import Path
from xml.etree import ElementTree

from handover_dmp.robot import descriptions
from handover_dmp.robot.descriptions import ArmEntry
from handover_dmp.robot.effective_limits import effective_limits, EffectiveLimits, KnownLimits
from handover_dmp.robot.errors import RobotDescriptionError
from handover_dmp.robot.plain_description import parse_xml

Element = ElementTree.Element

VECTORS = ('xyz', 'rpy')
LIMITS = ('lower', 'upper', 'velocity', 'effort', 'acceleration', 'jerk')
SOFT_LIMITS = ('soft_lower_limit', 'soft_upper_limit')
NUMBERS = {'limit': LIMITS, 'safety_controller': SOFT_LIMITS, 'origin': VECTORS, 'axis': VECTORS}
"""Elements of joints and links, and those of their attributes that are numbers."""


@dataclass(frozen=True)
class KnownArm:
    """
    What `config/robots.yaml` knows of the arm of a description.

    Attributes:
        entry: its entry there; None for an unknown arm.
        limits: those of the entry, by joint.
        home: name of the joint to where it is at home, rad.
        remark: that an entry of its name is not one of this arm; else empty.

    """

    entry: ArmEntry | None = None
    limits: KnownLimits = field(default_factory=KnownLimits)
    home: Mapping[str, float] = field(default_factory=dict)
    remark: str = ''


def read(path: Path) -> tuple[str, Element]:
    """
    Read a URDF.

    Args:
        path: of the file.

    Returns:
        Its text and its root.

    Raises:
        RobotDescriptionError: it cannot be read or is no URDF.

    """
    try:
        text = path.read_text(encoding='utf-8')
    except UnicodeDecodeError as error:
        raise RobotDescriptionError(f'{path}: not UTF-8: save it in that encoding') from error
    return text, parse_description(text, str(path))


def parse_description(text: str, origin: str) -> Element:
    """
    Parse a URDF.

    Args:
        text: of the URDF.
        origin: where it comes from, for error messages.

    Returns:
        Its root.

    Raises:
        RobotDescriptionError: it is no URDF, or holds a number that is none.

    """
    try:
        tree = parse_xml(text)
    except ElementTree.ParseError as error:
        raise RobotDescriptionError(f'{origin}: not XML: {error}') from error
    if tree.tag != 'robot':
        raise RobotDescriptionError(f'{origin}: no <robot> element; is it a URDF?')
    for part in tree.findall('joint') + tree.findall('link'):
        _check_numbers(part, origin)
    return tree


def _check_numbers(part: Element, origin: str) -> None:
    """Name the first number that is none; Pinocchio only says that something is wrong."""
    for element in part.iter():
        for key in NUMBERS.get(element.tag, ()):
            text, count = element.get(key), 3 if key in VECTORS else 1
            if text is not None and _count_numbers(text, key) != count:
                wanted = 'a number' if count == 1 else f'{count} numbers'
                raise RobotDescriptionError(
                    f'{origin}: {key}="{text}" of <{element.tag}> of {part.tag} '
                    f'{part.get("name")!r} is not {wanted}; if it is a xacro, expand it first: '
                    'xacro FILE > robot.urdf'
                )


def _count_numbers(text: str, key: str) -> int:
    """Count the numbers of a text; 0 where it holds anything else."""
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        return 0
    # a limit may be infinite
    sound = isfinite if key in VECTORS else lambda number: not isnan(number)
    return len(numbers) if all(map(sound, numbers)) else 0


def known_arm(tree: Element, origin: str, name: str = '') -> KnownArm:
    """
    Find what `config/robots.yaml` knows of an arm.

    Args:
        tree: root of its description.
        origin: of the description, for error messages.
        name: there, if the arm was asked for by it; its numbers then hold alone.

    Returns:
        What is known; nothing where the entry of that `<robot name>` does not fit.

    Raises:
        RobotDescriptionError: the joints form no tree.

    """
    urdf_name = tree.get('name', '')
    entry = descriptions.known_arms()[name] if name else descriptions.entry_for_urdf(urdf_name)
    if entry is None:
        return KnownArm()
    links = {link.get('name') for link in tree.findall('link')}
    if entry.wrist_frame in links:
        chain = moving_joints(tree, entry.wrist_frame, origin)
        joints = [str(joint.get('name')) for joint in chain]
        if entry.fits(joints):
            home = dict(zip(joints, entry.home, strict=False))
            return KnownArm(entry, entry.known_limits(joints, rules=bool(name)), home)
    return KnownArm(
        remark=f'its name is that of {entry.name} in config/robots.yaml, its links are not: '
        'taken for an unknown arm'
    )


def described_limits(text: str, joint_names: Sequence[str], origin: str) -> EffectiveLimits:
    """
    Find the limits of joints from a description alone, whoever moved them.

    Args:
        text: of the description.
        joint_names: which joints.
        origin: of the description, for error messages.

    Returns:
        The limits that hold for an arm with this description.

    Raises:
        RobotDescriptionError: it is no URDF, or lacks a joint.

    """
    tree = parse_description(text, origin)
    joints = {joint.get('name'): joint for joint in tree.findall('joint')}
    missing = [name for name in joint_names if name not in joints]
    if missing:
        raise RobotDescriptionError(f'{origin}: no joint {", ".join(missing)}')
    known = known_arm(tree, origin)
    chosen = [joints[name] for name in joint_names]
    return effective_limits(chosen, known.limits, descriptions.default_limits(), origin)


def wrist_link(tree: Element, wrist_frame: str | None, origin: str) -> str:
    """
    Find the link that follows the wrist.

    Args:
        tree: root of the description.
        wrist_frame: the link, if it is known.
        origin: of the description, for error messages.

    Returns:
        Its name.

    Raises:
        RobotDescriptionError: there is no such link, or it could be one of several.

    """
    links = [link.get('name', '') for link in tree.findall('link')]
    if wrist_frame is not None:
        if wrist_frame not in links:
            raise RobotDescriptionError(
                f'{origin}: no link {wrist_frame!r} for the wrist; it has {", ".join(links)}'
            )
        return wrist_frame
    parents = {parent for _, parent in _by_child(tree, origin).values()}
    ends = [link for link in links if link not in parents]
    if len(ends) != 1:
        raise RobotDescriptionError(
            f'{origin}: say which link is the wrist; the chains end in {", ".join(ends)}'
        )
    return ends[0]


def chain_to(tree: Element, wrist_frame: str, origin: str) -> tuple[Element, ...]:
    """
    Find the joints that carry the wrist, each of which the arm can move by itself.

    Args:
        tree: root of the description.
        wrist_frame: the link.
        origin: of the description, for error messages.

    Returns:
        The joints, from the base on.

    Raises:
        RobotDescriptionError: there is none, or one that cannot be moved by itself.

    """
    chain = moving_joints(tree, wrist_frame, origin)
    for joint in chain:
        if joint.get('type') not in ('revolute', 'continuous', 'prismatic'):
            raise RobotDescriptionError(
                f'{origin}: joint {joint.get("name")!r} is {joint.get("type")}; '
                'only revolute, continuous and prismatic joints can carry the wrist'
            )
        mimic = joint.find('mimic')
        if mimic is not None:
            raise RobotDescriptionError(
                f'{origin}: joint {joint.get("name")!r} mimics {mimic.get("joint")!r}; '
                'the joints that carry the wrist must move one by one'
            )
    if not chain:
        raise RobotDescriptionError(f'{origin}: no joint moves {wrist_frame!r}')
    return chain


def moving_joints(tree: Element, link: str, origin: str) -> tuple[Element, ...]:
    """
    Find the joints that move a link, from the base on.

    Args:
        tree: root of the description.
        link: which link.
        origin: of the description, for error messages.

    Returns:
        Those that are not fixed.

    Raises:
        RobotDescriptionError: the joints form a loop.

    """
    by_child = _by_child(tree, origin)
    chain: list[Element] = []
    above: str | None = link
    passed = 0
    while above in by_child:
        joint, above = by_child[above]
        passed += 1
        if passed > len(by_child):
            raise RobotDescriptionError(f'{origin}: the joints form a loop')
        if joint.get('type') != 'fixed':
            chain.insert(0, joint)
    return tuple(chain)


def _by_child(tree: Element, origin: str) -> dict[str | None, tuple[Element, str | None]]:
    """Index the joints by the link that they carry, each with the link that it hangs on."""
    by_child = {}
    for joint in tree.findall('joint'):
        child, parent = joint.find('child'), joint.find('parent')
        if child is None or parent is None:
            raise RobotDescriptionError(
                f'{origin}: joint {joint.get("name")!r} lacks its parent or its child'
            )
        by_child[child.get('link')] = (joint, parent.get('link'))
    return by_child
