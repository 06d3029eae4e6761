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
One description that every engine reads alike.

Pinocchio and PyBullet differ in what they make of a URDF: PyBullet gives links without inertia
1 kg, and sets inertia that is not physical to zero; Pinocchio leaves the inertia and all shapes
of a link out where it does not know one of them, without a word; both give up on a mesh that is
missing or broken. What both are to read holds nothing that they read differently, and says what
had to be changed.
"""

from __future__ import annotations

from collections.abc import Sequence
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
"""The shapes of a URDF beside the mesh, and what each must say of itself."""
MISSING = 'a mesh that is not there'
UNREADABLE = 'a mesh that cannot be read'
MOMENTS = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
ROUNDING = 1e-6
"""What is off by less, relative to the inertia, is not worth a word."""
ROOM = 1e-9
"""How far inside what is physical a repaired inertia lies, relative to it."""
ASSUMED_MASS_KG = 1.0
"""Of a moving link that the engines cannot move without one."""
ASSUMED_INERTIA_KG_M2 = 1e-3
"""Of the same about every axis: a ball of 50 mm radius."""
IMMOVABLE_KG_M2 = 1e-8
"""Smallest eigenvalue of a mass matrix below which a motion moves as good as nothing."""
SAMPLED = 6


@dataclass(frozen=True)
class Meshes:
    """
    The meshes that a description names.

    Attributes:
        found: the files.
        missing: names, as the description has them, of those that are not there.
        unreadable: names of those that are there and cannot be read.

    """

    found: tuple[Path, ...]
    missing: tuple[str, ...]
    unreadable: tuple[str, ...] = ()


def parse_xml(text: str) -> Element:
    """
    Parse a URDF as the parsers of ROS do, which know nothing of namespaces.

    Args:
        text: of the file; prefixes such as `<sensor:camera>` need not be declared, and its
            `<?xml … ?>` need not be at the very start.

    Returns:
        Its root; prefixes are a part of the names.

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


def make_plain(
    robot: Element, folder: Path | None, chain: Sequence[Element]
) -> tuple[Meshes, list[str]]:
    """
    Leave in a description what every engine reads alike.

    Args:
        robot: its root; changed in place.
        folder: where it lies; None where it came without a file.
        chain: the joints that move the wrist.

    Returns:
        Its meshes, and what had to be changed that a user should know. What is wrong with the
        inertia of a link that does not move with the chain changes nothing.

    """
    # Pinocchio's parser refuses every version but 1.0
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
    instead = f'drawn as capsules; {left} of {len(moved)} moving links are kept off the rest'
    for name, why in list(unreadable.items())[:1]:
        remarks.insert(
            0,
            f'{_listed(broken)}: {len(unreadable)} of {len(found)} meshes cannot be read, '
            f'{found[name]} for one ({why}): {instead}',
        )
    if missing:
        remarks.insert(
            0,
            f'{_listed(lost)}: {len(missing)} of {len(found)} meshes not found, {missing[0]} for '
            f'one ({LOOKED_IN}): {instead}',
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
        Names of the links, those that are fixed to a moving one among them.

    """
    children: dict[str, list[str]] = {}
    for joint in robot.findall('joint'):
        parent, child = joint.find('parent'), joint.find('child')
        if parent is not None and child is not None:
            children.setdefault(parent.get('link', ''), []).append(child.get('link', ''))
    ends = [joint.find('child') for joint in chain]
    ahead = [end.get('link', '') for end in ends if end is not None]
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
    """Put the geometry of a part plainly; return what is wrong with it if that cannot be."""
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
        shape.set('scale', _written(scale))
        return ''
    if shape.tag not in SIZES:
        return f'a shape <{shape.tag}> that the engines do not know, left out'
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
        origin = part.find('origin')
        given = {} if origin is None else origin.attrib
        placed = _pose(given.get('xyz', '0 0 0'), given.get('rpy', '0 0 0'))
        half = np.array([0.0, 0.0, float(capsule.get('length', '')) / 2])
        radius = float(capsule.get('radius', ''))
        for piece in add_capsule(link, part.tag, placed.act(-half), placed.act(half), radius):
            piece.extend(part.findall('material'))
        link.remove(part)


def add_capsule(
    link: Element, tag: str, start: Array, end: Array, radius: float
) -> tuple[Element, ...]:
    """
    Add a capsule to a link, as a cylinder and two balls: a URDF knows no capsule.

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
    rpy = _written(pin.rpy.matrixToRpy(turn).tolist())
    pieces = []
    for shape, place in (('cylinder', (start + end) / 2), ('sphere', start), ('sphere', end)):
        sizes = {'radius': repr(radius)}
        if shape == 'cylinder':
            sizes['length'] = repr(length)
        piece = ElementTree.SubElement(link, tag)
        ElementTree.SubElement(piece, 'origin', xyz=_written(place.tolist()), rpy=rpy)
        ElementTree.SubElement(ElementTree.SubElement(piece, 'geometry'), shape, sizes)
        pieces.append(piece)
    return tuple(pieces)


def _plain_inertial(link: Element) -> str:
    """Give a link an inertia that every engine takes as it is, zero where it has none."""
    inertials = link.findall('inertial')
    for inertial in inertials:
        link.remove(inertial)
    mass, centre, moments, fault = _inertia_of(inertials[0] if inertials else None)
    repaired = _physical(moments)
    if np.abs(repaired - moments).max() > ROUNDING * np.abs(moments).max():
        fault = 'inertia that no body can have, replaced by the nearest that one can'
    _write_inertial(link, mass, centre, repaired)
    return fault


def _inertia_of(inertial: Element | None) -> tuple[float, str, Array, str]:
    """Read mass, place and inertia of a link, and say what is wrong with them."""
    nothing = 0.0, '0 0 0', np.zeros((3, 3))
    if inertial is None:
        return *nothing, ''
    origin, mass, inertia = (inertial.find(tag) for tag in ('origin', 'mass', 'inertia'))
    place = {} if origin is None else origin.attrib
    kg = _numbers('' if mass is None else mass.get('value', ''))
    told = {} if inertia is None else inertia.attrib
    values = [_numbers(told.get(key, '0')) for key in MOMENTS]
    if len(kg) != 1 or not all(len(value) == 1 for value in values):
        return *nothing, 'an <inertial> that is not in numbers, left out'
    if kg[0] < 0.0:
        return *nothing, f'a mass of {kg[0]:g} kg, left out'
    xx, xy, xz, yy, yz, zz = moments_given = [value[0] for value in values]
    if kg[0] == 0.0:
        return *nothing, 'inertia without mass, left out' if any(moments_given) else ''
    moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    turn = _pose('0 0 0', place.get('rpy', '0 0 0')).rotation
    return kg[0], place.get('xyz', '0 0 0'), turn @ moments @ turn.T, ''


def _physical(moments: Array) -> Array:
    """
    Return the nearest inertia that a body can have.

    A distribution of mass has second moments ½tr(I)·1 − I that are nowhere negative.
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
    Find the joints that an engine could not move, since they carry nothing that has inertia.

    Args:
        model: of Pinocchio, of a chain.
        limits: of its joints.

    Returns:
        Their indices; with `ASSUMED_MASS_KG` on each the mass matrix is regular at all of a
        handful of configurations.

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
    Give links of a plain description an inertia that nobody has measured.

    Args:
        robot: its root; changed in place.
        links: their names.

    Returns:
        What a user should know.

    """
    for link in robot.findall('link'):
        if link.get('name') in links:
            mass, centre, moments, _ = _inertia_of(link.find('inertial'))
            link.remove(link.findall('inertial')[0])
            more = ASSUMED_INERTIA_KG_M2 * np.eye(3)
            _write_inertial(link, mass or ASSUMED_MASS_KG, centre, moments + more)
    return (
        f'{_listed(links)}: nothing that moves has inertia there, {ASSUMED_MASS_KG:g} kg assumed; '
        'the motion does not depend on it, the torques of the simulation do'
    )


def _pose(xyz: str, rpy: str) -> Any:
    roll, pitch, yaw = _numbers(rpy)
    return pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), np.array(_numbers(xyz)))


def _numbers(text: str) -> list[float]:
    """Read numbers; none where one of them is none."""
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        return []
    return numbers if all(map(isfinite, numbers)) else []


def _written(numbers: Sequence[float]) -> str:
    return ' '.join(repr(float(number)) for number in numbers)
