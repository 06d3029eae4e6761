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

"""A robot description as a tree, and the chain of joints in it that carries the wrist."""

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
from handover_dmp.robot.plain_description import parse_xml
import numpy as np
import pinocchio as pin

Element = ElementTree.Element

MIN_JOINTS = 2
MAX_NAMED = 12
"""Links that an error names."""
KINDS = ('revolute', 'continuous', 'prismatic')
"""Types of joints that an arm can have."""
MACRO = re.compile(r'\$\{|\$\((arg|find|eval|env|optenv|dirname)\b')
"""What stands in the attributes of a xacro that has not been expanded."""
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
    parts = tree.findall('joint') + tree.findall('link')
    values = [
        value for part in parts for element in part.iter() for value in element.attrib.values()
    ]
    if any(element.tag.startswith('xacro:') for element in tree) or any(map(MACRO.search, values)):
        raise RobotDescriptionError(
            f'{origin}: a xacro that is not expanded: let its name end in .xacro, or expand it: '
            'xacro FILE > robot.urdf'
        )
    for part in parts:
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
                    f'{part.get("name")!r} is not {wanted}'
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


def check_link(tree: Element, link: str | None, what: str, origin: str) -> None:
    """
    Refuse a link that is not there.

    Args:
        tree: root of the description.
        link: its name; none is all right.
        what: it is to be, `wrist` or `base`.
        origin: of the description, for error messages.

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
    Find the joints that carry the wrist, each of which the arm can move by itself.

    Args:
        tree: root of the description.
        wrist_frame: link of the wrist.
        base_frame: link that the arm begins at; None: the root.
        origin: of the description, for error messages.

    Returns:
        The joints, from the base on.

    Raises:
        RobotDescriptionError: there is none, or one that cannot be moved by itself.

    """
    chain = moving_joints(tree, wrist_frame, origin, base_frame)
    for joint in chain:
        name, kind = joint.get('name'), joint.get('type')
        if kind not in KINDS:
            raise RobotDescriptionError(
                f'{origin}: joint {name!r} is {kind}; only {", ".join(KINDS)} can carry the wrist '
                f'{wrist_frame!r}; --base-frame (node parameter base_frame) begins the arm behind '
                'it'
            )
        mimic = joint.find('mimic')
        if mimic is not None:
            raise RobotDescriptionError(
                f'{origin}: joint {name!r} mimics {mimic.get("joint")!r}; the joints that carry '
                f'the wrist {wrist_frame!r} must move one by one'
            )
        axis = joint.find('axis')
        if axis is not None and not any(map(float, axis.get('xyz', '1 0 0').split())):
            raise RobotDescriptionError(f'{origin}: joint {name!r} has an axis of no direction')
    if len(chain) < MIN_JOINTS:
        where = f' from {base_frame!r}' if base_frame else ''
        names = ', '.join(repr(joint.get('name')) for joint in chain)
        moved = f'only joint {names} moves' if chain else 'no joint moves'
        raise RobotDescriptionError(
            f'{origin}: {moved} {wrist_frame!r}{where}; an arm has {MIN_JOINTS} joints or more'
        )
    return chain


def moving_joints(
    tree: Element, link: str, origin: str, base_frame: str | None = None
) -> tuple[Element, ...]:
    """
    Find the joints that move a link, from the base on.

    Args:
        tree: root of the description, which has passed `check_tree`.
        link: which link.
        origin: of the description, for error messages.
        base_frame: link to begin at; None: the root.

    Returns:
        Those that are not fixed.

    Raises:
        RobotDescriptionError: the link does not hang on `base_frame`.

    """
    carriers = _carriers(tree)
    chain: list[Element] = []
    above = link
    while above in carriers and above != base_frame:
        joint = carriers.pop(above)
        above = ends_of(joint)[0]
        if joint.get('type') != 'fixed':
            chain.insert(0, joint)
    if base_frame is not None and above != base_frame:
        raise RobotDescriptionError(
            f'{origin}: {link!r} does not hang on the base {base_frame!r}; say another '
            '--base-frame (node parameter base_frame)'
        )
    return tuple(chain)


def _carriers(tree: Element) -> dict[str, Element]:
    """Index the joints by the link that they carry."""
    return {ends_of(joint)[1]: joint for joint in tree.findall('joint')}


def ends_of(joint: Element) -> tuple[str, str]:
    """
    Tell between which links a joint is.

    Args:
        joint: which.

    Returns:
        The links that it hangs on and carries, empty where it names none.

    """
    parent, child = joint.find('parent'), joint.find('child')
    return (
        '' if parent is None else parent.get('link', ''),
        '' if child is None else child.get('link', ''),
    )


def hold_still(tree: Element, chain: Sequence[Element]) -> None:
    """
    Fix the joints that are not of the chain at their neutral values.

    That is zero, or the limit that is nearest to it; of a joint that mimics another, what it then
    shows.

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
        along = np.array(_vector(axis, 'xyz', '1 0 0'))
        way = values[name] * along / (np.linalg.norm(along) or 1.0)
        moved = pin.SE3(np.eye(3), way) if kind == 'prismatic' else pin.SE3(pin.exp3(way), 0 * way)
        turn = pin.rpy.rpyToMatrix(np.array(_vector(origin, 'rpy', '0 0 0')))
        place = pin.SE3(turn, np.array(_vector(origin, 'xyz', '0 0 0'))) * moved
        origin.set('xyz', ' '.join(map(repr, place.translation.tolist())))
        origin.set('rpy', ' '.join(map(repr, pin.rpy.matrixToRpy(place.rotation).tolist())))


def _neutral(joint: Element, held: Mapping[str, Element], passed: int) -> float:
    """Return where a joint that is held stands, rad or m; one that mimics in a circle is at 0."""
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


def _vector(element: Element | None, key: str, default: str) -> list[float]:
    text = default if element is None else element.get(key, default)
    return [float(word) for word in text.split()]


def check_tree(tree: Element, origin: str) -> None:
    """
    Refuse links and joints that do not form one tree.

    Args:
        tree: root of the description.
        origin: of the description, for error messages.

    Raises:
        RobotDescriptionError: says where they do not.

    """
    links = [link.get('name', '') for link in tree.findall('link')]
    joints = [joint.get('name', '') for joint in tree.findall('joint')]
    for kind, names in (('link', links), ('joint', joints)):
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise RobotDescriptionError(f'{origin}: more than one {kind} is {", ".join(twice)}')
    carried: dict[str, str] = {}
    for joint in tree.findall('joint'):
        name, ends = joint.get('name'), ends_of(joint)
        for which, end in zip(('parent', 'child'), ends, strict=True):
            if not end:
                raise RobotDescriptionError(f'{origin}: joint {name!r} lacks its {which}')
            if end not in links:
                raise RobotDescriptionError(
                    f'{origin}: the {which} of joint {name!r} is {end!r}, which is no link'
                )
        parent, child = ends
        if child in carried:
            raise RobotDescriptionError(
                f'{origin}: {child!r} hangs on both {carried[child]!r} and {parent!r}; '
                'links and joints must form a tree'
            )
        carried[child] = parent
    roots = [link for link in links if link not in carried]
    if len(roots) > 1:
        raise RobotDescriptionError(
            f'{origin}: nothing joins {", ".join(roots)}; links and joints must form one tree'
        )
    for start in links:
        link = start
        for _ in links:
            link = carried.get(link, '')
        if link:
            raise RobotDescriptionError(f'{origin}: the joints about {start!r} form a loop')
