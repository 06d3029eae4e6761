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

"""The fine meshes are the bodies that they stand for."""

from __future__ import annotations

from xml.etree import ElementTree

import coal
from handover_dmp.robot.model import RobotModel
from handover_dmp.view.primitives import refine, write_unit_meshes
import numpy as np
import pytest


@pytest.fixture
def meshes(tmp_path):
    return write_unit_meshes(tmp_path)


def corners(path, keyword='v'):
    rows = [
        line.split()[1:] for line in path.read_text().splitlines() if line.split()[0] == keyword
    ]
    return np.array(rows, dtype=float)


def test_another_reader_finds_the_same_volume(meshes):
    """Coal reads them through assimp; the volumes are a little below those of the round bodies."""
    for path, volume in zip(meshes, (4 / 3 * np.pi, np.pi), strict=True):
        mesh = coal.MeshLoader().load(str(path), np.ones(3))
        assert mesh.computeVolume() == pytest.approx(volume, rel=0.02)
        assert mesh.computeVolume() > 0  # the faces look outwards
        assert mesh.computeCOM() == pytest.approx([0, 0, 0], abs=1e-3)


def test_sizes_are_those_of_unit_bodies(meshes):
    sphere, cylinder = map(corners, meshes)
    assert np.linalg.norm(sphere, axis=1) == pytest.approx(1.0, abs=1e-5)
    assert np.hypot(*cylinder[:, :2].T).max() == pytest.approx(1.0, abs=1e-5)
    assert np.ptp(cylinder[:, 2]) == pytest.approx(1.0, abs=1e-6)


def test_normals_are_of_length_one_on_every_seen_face(meshes):
    sphere, _ = meshes
    assert corners(sphere, 'vn') == pytest.approx(corners(sphere), abs=1e-5)


def test_refined_urdf_shows_the_same_sizes_and_collides_as_before(meshes):
    text = RobotModel.load('lwr4').urdf_text
    fine = ElementTree.fromstring(refine(text, *meshes))
    before = ElementTree.fromstring(text)
    shapes = before.findall('link/visual/geometry/*')
    shown = fine.findall('link/visual/geometry/*')
    assert len(shown) == len(shapes) > 10
    for shape, mesh in zip(shapes, shown, strict=True):
        x, y, z = map(float, mesh.get('scale').split())
        assert mesh.tag == 'mesh'
        assert x == y == float(shape.get('radius'))
        assert z == float(shape.get('length', shape.get('radius')))
    collisions = [
        [ElementTree.tostring(element) for element in tree.findall('link/collision')]
        for tree in (before, fine)
    ]
    assert collisions[0] == collisions[1]
