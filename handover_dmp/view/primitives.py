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
Smooth spheres and cylinders.

PyBullet's renderer draws spheres and cylinders with few facets. For pictures they are replaced by
finer meshes of a unit sphere and a unit cylinder, scaled to size.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from handover_dmp.common.arrays import Array
import numpy as np

SIDES = 48


def write_unit_meshes(folder: Path) -> tuple[Path, Path]:
    """
    Write a unit sphere and a unit cylinder as Wavefront OBJ files.

    Args:
        folder: folder of the files.

    Returns:
        The sphere, of radius 1; the cylinder, of radius 1 and length 1 along z around the origin.

    """
    sphere, cylinder = folder / 'sphere.obj', folder / 'cylinder.obj'
    latitude = np.linspace(-np.pi / 2, np.pi / 2, SIDES // 2 + 1)
    profile = np.column_stack([np.cos(latitude), np.sin(latitude)])
    _write_revolved(sphere, profile, profile)
    # Each edge twice, so that ends and side are shaded separately.
    profile = np.array([[0.0, -0.5], [1.0, -0.5], [1.0, -0.5], [1.0, 0.5], [1.0, 0.5], [0.0, 0.5]])
    normals = np.array([[0.0, -1.0], [0.0, -1.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    _write_revolved(cylinder, profile, normals)
    return sphere, cylinder


def _write_revolved(path: Path, profile: Array, normals: Array) -> None:
    """Revolve a profile of (radius, z) about the z axis."""
    angle = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
    lines = []
    for keyword, rows in (('v', profile), ('vn', normals)):
        for radius, z in rows:
            lines += [
                f'{keyword} {radius * np.cos(a):.6f} {radius * np.sin(a):.6f} {z:.6f}'
                for a in angle
            ]
    for ring in range(len(profile) - 1):
        for side in range(SIDES):
            a = ring * SIDES + side + 1
            b = ring * SIDES + (side + 1) % SIDES + 1
            for triangle in ((a, b, b + SIDES), (a, b + SIDES, a + SIDES)):
                lines.append('f ' + ' '.join(f'{corner}//{corner}' for corner in triangle))
    path.write_text('\n'.join(lines) + '\n', encoding='utf-8')


def refine(urdf_text: str, sphere: Path, cylinder: Path) -> str:
    """
    Replace the visual spheres and cylinders of a URDF by meshes.

    Args:
        urdf_text: the URDF; its collision shapes stay unchanged.
        sphere: mesh of the unit sphere.
        cylinder: mesh of the unit cylinder.

    Returns:
        The URDF with meshes.

    """
    tree = ElementTree.fromstring(urdf_text)
    for geometry in tree.iterfind('link/visual/geometry'):
        for shape in list(geometry):
            radius = float(shape.get('radius', '0'))
            if shape.tag == 'sphere':
                mesh, scale = sphere, (radius, radius, radius)
            elif shape.tag == 'cylinder':
                mesh, scale = cylinder, (radius, radius, float(shape.get('length', '0')))
            else:
                continue
            geometry.remove(shape)
            ElementTree.SubElement(
                geometry, 'mesh', filename=str(mesh), scale=' '.join(map(repr, scale))
            )
    return ElementTree.tostring(tree, encoding='unicode')
