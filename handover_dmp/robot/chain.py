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

"""A robot description as a tree, and its chain of joints that carries the wrist."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from math import isfinite, isnan
import re
from xml.etree import ElementTree

from handover_dmp.robot import descriptions
from handover_dmp.robot.descriptions import ArmEntry
from handover_dmp.robot.effective_limits import effective_limits, EffectiveLimits, KnownLimits
from handover_dmp.robot.errors import RobotDescriptionError
from handover_dmp.robot.plain_description import ends_of, parse_xml, pose_of, written
import numpy as np
import pinocchio as pin

Element = ElementTree.Element

MIN_JOINTS = 2
MAX_NAMED = 12
"""Maximum number of links that an error names."""
KINDS = ('revolute', 'continuous', 'prismatic')
"""Joint types that an arm can have."""
MACRO = re.compile(r'\$\{|\$\((arg|find|eval|env|optenv|dirname)\b')
"""Occurs in the attributes of an unexpanded xacro."""
VECTORS = ('xyz', 'rpy')
LIMITS = ('lower', 'upper', 'velocity', 'effort', 'acceleration', 'jerk')
SOFT_LIMITS = ('soft_lower_limit', 'soft_upper_limit')
NUMBERS = {
    'limit': LIMITS,
    'safety_controller': SOFT_LIMITS,
    'mimic': ('multiplier', 'offset'),
    'origin': VECTORS,
    'axis': VECTORS,
}
"""Elements of joints and links, and their numeric attributes."""


@dataclass(frozen=True)
class KnownArm:
    """
    The data of `config/robots.yaml` for the arm of a description.

    Attributes:
        entry: its entry there; None for an unknown arm.
        limits: limits of the entry, by joint.
        home: joint name to home position, rad.
        remark: a remark if the entry of that name does not fit; otherwise empty.

    """

    entry: ArmEntry | None = None
    limits: KnownLimits = field(default_factory=KnownLimits)
    home: Mapping[str, float] = field(default_factory=dict)
    remark: str = ''


def parse_description(text: str, origin: str) -> Element:
    """
    Parse a URDF.

    Args:
        text: text of the URDF.
        origin: its origin, for error messages.

    Returns:
        Its root.

    Raises:
        RobotDescriptionError: it is not a URDF, or a numeric attribute is invalid.

    """
    try:
        tree = parse_xml(text)
    except ElementTree.ParseError as error:
        raise RobotDescriptionError(f'{origin}: not XML: {error}') from error
    if tree.tag != 'robot':
        raise RobotDescriptionError(f'{origin}: no <robot> element; is it a URDF?')
    parts = tree.findall('joint') + tree.findall('link')
    values = [
        value for part in parts for element in part.iter() for value in element.attrib.values()
    ]
    if any(element.tag.startswith('xacro:') for element in tree) or any(map(MACRO.search, values)):
        raise RobotDescriptionError(
            f'{origin}: an unexpanded xacro: rename it to end in .xacro, or expand it: '
            'xacro FILE > robot.urdf'
        )
    for part in parts:
        _check_numbers(part, origin)
    return tree


def _check_numbers(part: Element, origin: str) -> None:
    """Name the first invalid number; Pinocchio only reports that there is one."""
    for element in part.iter():
        for key in NUMBERS.get(element.tag, ()):
            text, count = element.get(key), 3 if key in VECTORS else 1
            if text is not None and _count_numbers(text, key) != count:
                wanted = 'a number' if count == 1 else f'{count} numbers'
                raise RobotDescriptionError(
                    f'{origin}: {key}="{text}" of <{element.tag}> of {part.tag} '
                    f'{part.get("name")!r} is not {wanted}'
                )


def _count_numbers(text: str, key: str) -> int:
    """Count the numbers in a text; 0 if it contains anything else."""
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        return 0
    # a limit may be infinite
    sound = isfinite if key in VECTORS else lambda number: not isnan(number)
    return len(numbers) if all(map(sound, numbers)) else 0


def known_arm(tree: Element, origin: str, name: str = '') -> KnownArm:
    """
    Find the data of `config/robots.yaml` for an arm.

    Args:
        tree: root of its description.
        origin: origin of the description, for error messages.
        name: its name there, if the arm was requested by it; then only its values count.

    Returns:
        The data; empty if the entry of that `<robot name>` does not fit.

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
        remark=f'has the name of {entry.name} in config/robots.yaml, but other links: '
        'treated as an unknown arm'
    )


def described_limits(text: str, joint_names: Sequence[str], origin: str) -> EffectiveLimits:
    """
    Find the limits of joints from a description alone, e.g. for any recorded arm.

    Args:
        text: text of the description.
        joint_names: the joints.
        origin: origin of the description, for error messages.

    Returns:
        The limits of an arm with this description.

    Raises:
        RobotDescriptionError: it is not a URDF, or lacks a joint.

    """
    tree = parse_description(text, origin)
    joints = {joint.get('name'): joint for joint in tree.findall('joint')}
    missing = [name for name in joint_names if name not in joints]
    if missing:
        raise RobotDescriptionError(f'{origin}: no joint {", ".join(missing)}')
    known = known_arm(tree, origin)
    chosen = [joints[name] for name in joint_names]
    return effective_limits(chosen, known.limits, descriptions.default_limits(), origin)


def check_link(tree: Element, link: str | None, what: str, origin: str) -> None:
    """
    Check that a link exists.

    Args:
        tree: root of the description.
        link: its name; None is accepted.
        what: its role, `wrist` or `base`.
        origin: origin of the description, for error messages.

    Raises:
        RobotDescriptionError: there is no such link.

    """
    links = [element.get('name', '') for element in tree.findall('link')]
    if link and link not in links:
        near = get_close_matches(link, links, MAX_NAMED, 0.0)
        raise RobotDescriptionError(
            f'{origin}: no link {link!r} for the {what}; it has {", ".join(near)}'
            + (f' and {len(links) - len(near)} more' if len(links) > len(near) else '')
        )


def chain_between(
    tree: Element, wrist_frame: str, base_frame: str | None, origin: str
) -> tuple[Element, ...]:
    """
    Find the joints that carry the wrist, and check that they are independent.

    Args:
        tree: root of the description.
        wrist_frame: the wrist link.
        base_frame: first link of the arm; None: the root.
        origin: origin of the description, for error messages.

    Returns:
        The joints, from the base on.

    Raises:
        RobotDescriptionError: there is none, or one cannot be moved independently.

    """
    chain = moving_joints(tree, wrist_frame, origin, base_frame)
    for joint in chain:
        name, kind = joint.get('name'), joint.get('type')
        if kind not in KINDS:
            raise RobotDescriptionError(
                f'{origin}: joint {name!r} is of type {kind}; only {", ".join(KINDS)} joints can '
                f'carry the wrist {wrist_frame!r}; to begin the arm behind it, set --base-frame '
                '(node parameter base_frame)'
            )
        mimic = joint.find('mimic')
        if mimic is not None:
            raise RobotDescriptionError(
                f'{origin}: joint {name!r} mimics {mimic.get("joint")!r}; the joints that carry '
                f'the wrist {wrist_frame!r} must be independent'
            )
        axis = joint.find('axis')
        if axis is not None and not any(map(float, axis.get('xyz', '1 0 0').split())):
            raise RobotDescriptionError(f'{origin}: joint {name!r} has an axis of zero length')
    if len(chain) < MIN_JOINTS:
        where = f' from {base_frame!r}' if base_frame else ''
        names = ', '.join(repr(joint.get('name')) for joint in chain)
        moved = f'only joint {names} moves' if chain else 'no joint moves'
        raise RobotDescriptionError(
            f'{origin}: {moved} {wrist_frame!r}{where}; an arm needs at least {MIN_JOINTS} joints'
        )
    return chain


def moving_joints(
    tree: Element, link: str, origin: str, base_frame: str | None = None
) -> tuple[Element, ...]:
    """
    Find the joints that move a link, beginning at the base.

    Args:
        tree: root of the description, which has passed `check_tree`.
        link: the link.
        origin: origin of the description, for error messages.
        base_frame: first link; None: the root.

    Returns:
        The joints that are not fixed.

    Raises:
        RobotDescriptionError: `base_frame` does not carry the link.

    """
    carriers = {ends_of(joint)[1]: joint for joint in tree.findall('joint')}
    chain: list[Element] = []
    above = link
    while above in carriers and above != base_frame:
        joint = carriers.pop(above)
        above = ends_of(joint)[0]
        if joint.get('type') != 'fixed':
            chain.insert(0, joint)
    if base_frame is not None and above != base_frame:
        raise RobotDescriptionError(
            f'{origin}: the base {base_frame!r} does not carry {link!r}; set another '
            '--base-frame (node parameter base_frame)'
        )
    return tuple(chain)


def hold_still(tree: Element, chain: Sequence[Element]) -> None:
    """
    Fix the joints outside the chain at their neutral values.

    The neutral value is zero, or the limit nearest to it; for a mimic joint it follows from the
    mimicked joint.

    Args:
        tree: root of the description; changed in place.
        chain: the joints that move.

    """
    held = {j.get('name', ''): j for j in tree.findall('joint') if j not in chain}
    values = {name: _neutral(joint, held, len(held)) for name, joint in held.items()}
    for name, joint in held.items():
        kind, axis, origin = joint.get('type'), joint.find('axis'), joint.find('origin')
        joint.set('type', 'fixed')
        if not values[name]:
            continue
        if origin is None:
            origin = ElementTree.SubElement(joint, 'origin')
        text = '1 0 0' if axis is None else axis.get('xyz', '1 0 0')
        along = np.array([float(word) for word in text.split()])
        way = values[name] * along / (np.linalg.norm(along) or 1.0)
        moved = pin.SE3(np.eye(3), way) if kind == 'prismatic' else pin.SE3(pin.exp3(way), 0 * way)
        place = pose_of(origin) * moved
        origin.set('xyz', written(place.translation))
        origin.set('rpy', written(pin.rpy.matrixToRpy(place.rotation)))


def _neutral(joint: Element, held: Mapping[str, Element], passed: int) -> float:
    """Return the position of a fixed joint, rad or m; 0 for a circle of mimic joints."""
    if joint.get('type') not in KINDS:
        return 0.0
    mimic = joint.find('mimic')
    if mimic is not None:
        other = held.get(mimic.get('joint', ''))
        shown = 0.0 if other is None or passed <= 0 else _neutral(other, held, passed - 1)
        return float(mimic.get('multiplier', 1.0)) * shown + float(mimic.get('offset', 0.0))
    limit = joint.find('limit')
    if limit is None or joint.get('type') == 'continuous':
        return 0.0
    lower, upper = float(limit.get('lower', 0.0)), float(limit.get('upper', 0.0))
    return min(max(0.0, lower), upper) if lower <= upper else 0.0


def check_tree(tree: Element, origin: str) -> None:
    """
    Check that links and joints form one tree.

    Args:
        tree: root of the description.
        origin: origin of the description, for error messages.

    Raises:
        RobotDescriptionError: they do not; the error says where.

    """
    links = [link.get('name', '') for link in tree.findall('link')]
    joints = [joint.get('name', '') for joint in tree.findall('joint')]
    for kind, names in (('link', links), ('joint', joints)):
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise RobotDescriptionError(f'{origin}: several {kind}s are named {", ".join(twice)}')
    carried: dict[str, str] = {}
    for joint in tree.findall('joint'):
        name, ends = joint.get('name'), ends_of(joint)
        for which, end in zip(('parent', 'child'), ends, strict=True):
            if not end:
                raise RobotDescriptionError(f'{origin}: joint {name!r} lacks its {which}')
            if end not in links:
                raise RobotDescriptionError(
                    f'{origin}: the {which} of joint {name!r} is {end!r}, which is not a link'
                )
        parent, child = ends
        if child in carried:
            raise RobotDescriptionError(
                f'{origin}: {child!r} has two parents, {carried[child]!r} and {parent!r}; '
                'links and joints must form a tree'
            )
        carried[child] = parent
    roots = [link for link in links if link not in carried]
    if len(roots) > 1:
        raise RobotDescriptionError(
            f'{origin}: no joint connects {", ".join(roots)}; links and joints must form one tree'
        )
    for start in links:
        link = start
        for _ in links:
            link = carried.get(link, '')
        if link:
            raise RobotDescriptionError(f'{origin}: the joints about {start!r} form a loop')
