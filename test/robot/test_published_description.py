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

"""A description that others can show: its meshes are files, its root is not the room."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import unquote, urlparse
from xml.etree import ElementTree

from handover_dmp.robot.descriptions import Description
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.published_description import (
    published_description,
    root_link,
    shown_root,
)
import numpy as np
import pytest

FRAME = 'world'


@pytest.fixture(scope='module', params=['lwr4', 'iiwa14', 'panda', 'ur5'])
def arm(request) -> RobotModel:
    return RobotModel.load(request.param)


def published(model: RobotModel) -> str:
    return published_description(model.urdf_text, model.urdf_path.parent, FRAME)


def test_every_mesh_is_a_file_on_this_machine(arm: RobotModel) -> None:
    """As RViz and Foxglove open them: by scheme and path, from any folder."""
    meshes = list(ElementTree.fromstring(published(arm)).iter('mesh'))
    assert len(meshes) == len(list(ElementTree.fromstring(arm.urdf_text).iter('mesh')))
    for mesh in meshes:
        address = urlparse(mesh.get('filename', ''))
        assert (address.scheme, address.netloc) == ('file', '')
        assert Path(unquote(address.path)).stat().st_size > 0


def test_it_is_the_same_arm(arm: RobotModel) -> None:
    text = published(arm)
    topic = Path('/robot_description')
    other = RobotModel.load(Description(str(topic), '', topic, text))
    assert other.joint_names == arm.joint_names
    np.testing.assert_array_equal(other.limits.velocity, arm.limits.velocity)
    q = 0.5 * (arm.limits.one_turn[0] + arm.home)
    for one, two in zip(arm.wrist_pose(q), other.wrist_pose(q), strict=True):
        np.testing.assert_allclose(one, two, atol=1e-12)
    assert other.meshes.missing == ()
    # and said again, it stays as it is
    assert published_description(text, topic.parent, FRAME) == text


def test_no_link_is_called_as_the_frame(arm: RobotModel) -> None:
    links = [link.get('name') for link in ElementTree.fromstring(published(arm)).iter('link')]
    assert FRAME not in links
    assert len(set(links)) == len(links)
    if arm.name == 'ur5':
        assert root_link(arm.urdf_text) == FRAME
        assert shown_root(arm.urdf_text, FRAME) == 'arm_world' == root_link(published(arm))
        # in another frame, it may keep its name
        assert shown_root(arm.urdf_text, 'hall') == FRAME
    else:
        assert root_link(published(arm)) == root_link(arm.urdf_text)


def test_meshes_by_path_and_package_with_awkward_names(tmp_path: Path) -> None:
    package = tmp_path / 'some package'
    (package / 'meshes').mkdir(parents=True)
    (package / 'package.xml').write_text('<package><name>some_arm</name></package>')
    for name in ('a b.stl', 'c.stl'):
        (package / 'meshes' / name).write_bytes(b'solid')
    text = (
        '<robot name="r"><link name="arm_world"/><link name="world"><visual><geometry>'
        '<mesh filename="meshes/a b.stl"/></geometry></visual><collision><geometry>'
        '<mesh filename="package://some_arm/meshes/c.stl"/></geometry></collision><visual>'
        '<geometry><mesh filename="package://nowhere/d.stl"/></geometry></visual></link>'
        '<joint name="j" type="fixed"><parent link="world"/><child link="arm_world"/></joint>'
        '</robot>'
    )
    robot = ElementTree.fromstring(published_description(text, package, FRAME))
    names = [mesh.get('filename') for mesh in robot.iter('mesh')]
    assert names == [
        (package / 'meshes' / 'a b.stl').as_uri(),
        (package / 'meshes' / 'c.stl').as_uri(),
        'package://nowhere/d.stl',  # not here: left for who may find it
    ]
    assert [link.get('name') for link in robot.iter('link')] == ['arm_world', 'arm_arm_world']
    assert robot.find('joint/parent').get('link') == 'arm_arm_world'


def test_a_description_that_is_fine_is_left_alone() -> None:
    model = RobotModel.load('lwr4')
    assert published(model) is model.urdf_text
