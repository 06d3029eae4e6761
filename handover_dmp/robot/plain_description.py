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
A plain description that every engine interprets alike.

Pinocchio and PyBullet interpret some URDFs differently. PyBullet gives links without inertia
1 kg, and sets unphysical inertia to zero. Pinocchio silently drops the inertia and all shapes of a
link if it does not support one of them. Both fail on a mesh that is missing or broken. The plain
description contains nothing that they interpret differently, and the changes are reported.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
import re
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

from handover_dmp.common.arrays import Array
from handover_dmp.robot.limits import JointLimits
from handover_dmp.robot.mesh_files import find_mesh, LOOKED_IN
from handover_dmp.robot.mesh_reading import why_not_collided, why_not_drawn
import numpy as np
import pinocchio as pin

Element = ElementTree.Element

SIZES = {
    'box': 'size',
    'cylinder': 'radius length',
    'sphere': 'radius',
    'capsule': 'radius length',
}
"""The shapes of a URDF other than meshes, and the attributes that each must have."""
MISSING = 'a missing mesh'
UNREADABLE = 'an unreadable mesh'
MOMENTS = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
ROUNDING = 1e-6
"""Smaller changes, relative to the inertia, are not reported."""
ROOM = 1e-9
"""Margin of a repaired inertia to the bound of physical ones, relative to it."""
ASSUMED_MASS_KG = 1.0
"""Mass assumed for a moving link if the engines cannot move it without one."""
ASSUMED_INERTIA_KG_M2 = 1e-3
"""Inertia of the same about every axis: a ball of 50 mm radius."""
IMMOVABLE_KG_M2 = 1e-8
"""Smallest eigenvalue of a mass matrix below which a motion moves almost no mass."""
SAMPLED = 6


@dataclass(frozen=True)
class Meshes:
    """
    The meshes of a description.

    Attributes:
        found: the files.
        missing: names in the description of meshes that do not exist.
        unreadable: names of meshes that exist and cannot be read.

    """

    found: tuple[Path, ...]
    missing: tuple[str, ...]
    unreadable: tuple[str, ...] = ()


def parse_xml(text: str) -> Element:
    """
    Parse a URDF like the parsers of ROS, which ignore namespaces.

    Args:
        text: text of the file; prefixes such as `<sensor:camera>` need not be declared, and
            `<?xml … ?>` need not be at the very start.

    Returns:
        Its root; prefixes are part of the names.

    Raises:
        ElementTree.ParseError: it is not XML.

    """
    builder = ElementTree.TreeBuilder()
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(re.sub(r'<\?xml.*?\?>', '', text, count=1).lstrip('\ufeff \t'), True)
    except expat.ExpatError as error:
        raise ElementTree.ParseError(str(error)) from error
    root: Element = builder.close()
    return root


def ends_of(joint: Element) -> tuple[str, str]:
    """
    Return the links that a joint connects.

    Args:
        joint: the joint.

    Returns:
        Its parent and its child; empty if it names none.

    """
    parent, child = joint.find('parent'), joint.find('child')
    return (
        '' if parent is None else parent.get('link', ''),
        '' if child is None else child.get('link', ''),
    )


def make_plain(
    robot: Element, folder: Path | None, chain: Sequence[Element]
) -> tuple[Meshes, list[str]]:
    """
    Reduce a description to what every engine interprets alike.

    Args:
        robot: its root; changed in place.
        folder: its folder; None if it did not come from a file.
        chain: the joints that move the wrist.

    Returns:
        Its meshes, and remarks about changes. Faults in the inertia of links that do not move
        with the chain are not reported, since they have no effect.

    """
    # Pinocchio's parser accepts version 1.0 only
    robot.attrib = {key: value for key, value in robot.attrib.items() if key == 'name'}
    for material in robot.iter('material'):
        for texture in material.findall('texture'):
            material.remove(texture)
    materials = {m.get('name') for m in robot.iter('material') if m.find('color') is not None}
    moved = moved_links(robot, chain)
    found: dict[str, Path | None] = {}
    unreadable: dict[str, str] = {}
    faults: dict[str, list[str]] = {}
    for link in robot.findall('link'):
        name = link.get('name', '')
        for part in list(link):
            if part.tag not in ('visual', 'collision', 'inertial'):
                link.remove(part)
        for part in [p for p in link if p.tag != 'inertial']:
            if fault := _plain_shape(part, folder, found, unreadable):
                faults.setdefault(fault, []).append(name)
                link.remove(part)
            for material in part.findall('material'):
                if material.find('color') is None and material.get('name') not in materials:
                    part.remove(material)
        if (fault := _plain_inertial(link)) and name in moved:
            faults.setdefault(fault, []).append(name)
        _split_capsules(link)
    for element in list(robot):
        colourless = element.tag == 'material' and element.find('color') is None
        if colourless or element.tag not in ('link', 'joint', 'material'):
            robot.remove(element)
    lost, broken = faults.pop(MISSING, []), faults.pop(UNREADABLE, [])
    remarks = [f'{_listed(names)}: {fault}' for fault, names in faults.items()]
    missing = tuple(name for name, path in found.items() if path is None)
    solid = [link for link in robot.findall('link') if link.find('collision') is not None]
    left = len(moved.intersection(link.get('name', '') for link in solid))
    instead = f'drawn as capsules; collision checks for {left} of {len(moved)} moving links'
    for name, why in list(unreadable.items())[:1]:
        remarks.insert(
            0,
            f'{_listed(broken)}: {len(unreadable)} of {len(found)} meshes cannot be read, '
            f'e.g. {found[name]} ({why}): {instead}',
        )
    if missing:
        remarks.insert(
            0,
            f'{_listed(lost)}: {len(missing)} of {len(found)} meshes not found, '
            f'e.g. {missing[0]} ({LOOKED_IN}): {instead}',
        )
    read = tuple(path for name, path in found.items() if path and name not in unreadable)
    return Meshes(read, missing, tuple(unreadable)), remarks


def moved_links(robot: Element, chain: Sequence[Element]) -> set[str]:
    """
    Find the links that move with a chain of joints.

    Args:
        robot: root of the description.
        chain: the joints, those of `robot`.

    Returns:
        Names of the links, including those fixed to a moving one.

    """
    children: dict[str, list[str]] = {}
    for joint in robot.findall('joint'):
        parent, child = ends_of(joint)
        children.setdefault(parent, []).append(child)
    ahead = [ends_of(joint)[1] for joint in chain]
    moved: set[str] = set()
    while ahead:
        link = ahead.pop()
        if link not in moved:
            moved.add(link)
            ahead += children.get(link, [])
    return moved


def _listed(names: Sequence[str]) -> str:
    unique = list(dict.fromkeys(names))
    return ', '.join(unique[:4]) + (f' and {len(unique) - 4} more' if len(unique) > 4 else '')


def _plain_shape(
    part: Element, folder: Path | None, found: dict[str, Path | None], unreadable: dict[str, str]
) -> str:
    """Reduce the geometry of a part; return the fault if that is impossible."""
    geometry = part.find('geometry')
    shape = geometry[0] if geometry is not None and len(geometry) else None
    if shape is None or geometry is None:
        return f'a {part.tag} without geometry, left out'
    for other in list(geometry)[1:]:
        geometry.remove(other)
    if shape.tag == 'mesh':
        name = shape.get('filename', '')
        if name not in found:
            found[name] = find_mesh(name, folder)
        path = found[name]
        if path is None:
            return MISSING
        scale = _numbers(shape.get('scale', '1'))
        if len(scale) not in (1, 3):
            return f'a mesh of scale {shape.get("scale")!r}, left out'
        scale = scale * 3 if len(scale) == 1 else scale
        why = why_not_drawn(path) if part.tag == 'visual' else why_not_collided(path, scale)
        if why:
            unreadable.setdefault(name, why)
            return UNREADABLE
        shape.set('filename', str(path))
        shape.set('scale', written(scale))
        return ''
    if shape.tag not in SIZES:
        return f'a shape <{shape.tag}> that the engines do not support, left out'
    sizes = [_numbers(shape.get(key, '')) for key in SIZES[shape.tag].split()]
    wanted = 3 if shape.tag == 'box' else 1
    if not all(len(size) == wanted and min(size) >= 0.0 for size in sizes):
        return f'a {shape.tag} without size, left out'
    return ''


def _split_capsules(link: Element) -> None:
    for part in list(link):
        capsule = part.find('geometry/capsule')
        if capsule is None:
            continue
        placed = pose_of(part.find('origin'))
        half = np.array([0.0, 0.0, float(capsule.get('length', '')) / 2])
        radius = float(capsule.get('radius', ''))
        for piece in add_capsule(link, part.tag, placed.act(-half), placed.act(half), radius):
            piece.extend(part.findall('material'))
        link.remove(part)


def add_capsule(
    link: Element, tag: str, start: Array, end: Array, radius: float
) -> tuple[Element, ...]:
    """
    Add a capsule to a link, as a cylinder and two balls: URDF has no capsules.

    Args:
        link: the link; changed in place.
        tag: `visual` or `collision`.
        start: (3,), m, one end of its axis, in the frame of the link.
        end: (3,), m, the other end.
        radius: m.

    Returns:
        The elements that were added.

    """
    axis = end - start
    length = float(np.linalg.norm(axis))
    turn = np.eye(3)
    if length > 0.0:
        upright = np.array([0.0, 0.0, 1.0])
        turn = pin.Quaternion.FromTwoVectors(upright, axis / length).toRotationMatrix()
    rpy = written(pin.rpy.matrixToRpy(turn))
    pieces = []
    for shape, place in (('cylinder', (start + end) / 2), ('sphere', start), ('sphere', end)):
        sizes = {'radius': repr(radius)}
        if shape == 'cylinder':
            sizes['length'] = repr(length)
        piece = ElementTree.SubElement(link, tag)
        ElementTree.SubElement(piece, 'origin', xyz=written(place), rpy=rpy)
        ElementTree.SubElement(ElementTree.SubElement(piece, 'geometry'), shape, sizes)
        pieces.append(piece)
    return tuple(pieces)


def _plain_inertial(link: Element) -> str:
    """Give a link an inertia that every engine accepts unchanged; zero if it has none."""
    inertials = link.findall('inertial')
    for inertial in inertials:
        link.remove(inertial)
    mass, centre, moments, fault = _inertia_of(inertials[0] if inertials else None)
    repaired = _physical(moments)
    if np.abs(repaired - moments).max() > ROUNDING * np.abs(moments).max():
        fault = 'physically impossible inertia, replaced by the nearest possible one'
    _write_inertial(link, mass, centre, repaired)
    return fault


def _inertia_of(inertial: Element | None) -> tuple[float, str, Array, str]:
    """Read mass, centre and inertia of a link, and describe faults in them."""
    nothing = 0.0, '0 0 0', np.zeros((3, 3))
    if inertial is None:
        return *nothing, ''
    origin, mass, inertia = (inertial.find(tag) for tag in ('origin', 'mass', 'inertia'))
    kg = _numbers('' if mass is None else mass.get('value', ''))
    told = {} if inertia is None else inertia.attrib
    values = [_numbers(told.get(key, '0')) for key in MOMENTS]
    if len(kg) != 1 or not all(len(value) == 1 for value in values):
        return *nothing, 'an <inertial> with values that are not numbers, left out'
    if kg[0] < 0.0:
        return *nothing, f'a mass of {kg[0]:g} kg, left out'
    xx, xy, xz, yy, yz, zz = moments_given = [value[0] for value in values]
    if kg[0] == 0.0:
        return *nothing, 'inertia without mass, left out' if any(moments_given) else ''
    moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    turn = pose_of(origin).rotation
    centre = '0 0 0' if origin is None else origin.get('xyz', '0 0 0')
    return kg[0], centre, turn @ moments @ turn.T, ''


def _physical(moments: Array) -> Array:
    """
    Return the nearest physically possible inertia.

    The second moments of a mass distribution, ½tr(I)·1 − I, are positive semidefinite.
    """
    spread, axes = np.linalg.eigh(0.5 * np.trace(moments) * np.eye(3) - moments)
    minimum = ROOM * np.abs(spread).max()
    if spread.min() >= minimum:
        return moments
    kept = (axes * np.maximum(spread, minimum)) @ axes.T
    return np.asarray(np.trace(kept) * np.eye(3) - kept)


def _write_inertial(link: Element, mass: float, centre: str, moments: Array) -> None:
    inertial = ElementTree.SubElement(link, 'inertial')
    ElementTree.SubElement(inertial, 'origin', xyz=centre, rpy='0 0 0')
    ElementTree.SubElement(inertial, 'mass', value=repr(float(mass)))
    upper = moments[np.triu_indices(3)].tolist()
    ElementTree.SubElement(inertial, 'inertia', dict(zip(MOMENTS, map(repr, upper), strict=True)))


def immovable_joints(model: Any, limits: JointLimits) -> list[int]:
    """
    Find the joints that an engine could not move because they carry no inertia.

    Args:
        model: Pinocchio's model of a chain.
        limits: limits of its joints.

    Returns:
        Their indices; with `ASSUMED_MASS_KG` on each, the mass matrix is regular in all of a
        few configurations.

    """
    model, found = pin.Model(model), []
    data = model.createData()
    rng = np.random.default_rng(0)
    low, high = limits.one_turn
    assumed = pin.Inertia(ASSUMED_MASS_KG, np.zeros(3), ASSUMED_INERTIA_KG_M2 * np.eye(3))
    for q in [np.clip(0.0, low, high), *rng.uniform(low, high, (SAMPLED, model.nq))]:
        while True:
            upper = np.triu(pin.crba(model, data, q))
            values, vectors = np.linalg.eigh(upper + np.triu(upper, 1).T)
            joint = 1 + int(np.abs(vectors[:, 0]).argmax())
            if values[0] > IMMOVABLE_KG_M2 or joint in found:
                break
            model.inertias[joint] += assumed
            found.append(joint)
    return sorted(found)


def assume_inertia(robot: Element, links: Sequence[str]) -> str:
    """
    Give links of a plain description an assumed inertia.

    Args:
        robot: its root; changed in place.
        links: their names.

    Returns:
        A remark for the user.

    """
    for link in robot.findall('link'):
        if link.get('name') in links:
            mass, centre, moments, _ = _inertia_of(link.find('inertial'))
            link.remove(link.findall('inertial')[0])
            more = ASSUMED_INERTIA_KG_M2 * np.eye(3)
            _write_inertial(link, mass or ASSUMED_MASS_KG, centre, moments + more)
    return (
        f'{_listed(links)}: no moving part has inertia, {ASSUMED_MASS_KG:g} kg assumed; '
        'the motion does not depend on it, but the simulated torques do'
    )


def pose_of(origin: Element | None) -> Any:
    """
    Read the pose in an `<origin>`.

    Args:
        origin: the element; None: no displacement.

    Returns:
        The pose, a `pinocchio.SE3`.

    """
    given = {} if origin is None else origin.attrib
    roll, pitch, yaw = _numbers(given.get('rpy', '0 0 0'))
    place = np.array(_numbers(given.get('xyz', '0 0 0')))
    return pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), place)


def _numbers(text: str) -> list[float]:
    """Read numbers; an empty list if one of them is invalid."""
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        return []
    return numbers if all(map(isfinite, numbers)) else []


def written(numbers: Iterable[float]) -> str:
    """
    Write the numbers of an attribute, without loss.

    Args:
        numbers: the numbers.

    Returns:
        The text.

    """
    return ' '.join(repr(float(number)) for number in numbers)
