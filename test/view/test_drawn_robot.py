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

"""An arm is seen, whatever its description lacks."""

from __future__ import annotations

from handover_dmp.robot.model import RobotModel
from handover_dmp.view.drawn_robot import drawn_description
import numpy as np
import pinocchio as pin
import pytest

JOINT = (
    '<joint name="j{i}" type="revolute"><parent link="{parent}"/><child link="l{i}"/>'
    '<origin xyz="0.1 0 0.2" rpy="0.3 0 0"/><axis xyz="0 1 0"/>'
    '<limit lower="-2" upper="2" velocity="1" effort="90"/></joint>'
)


def load(tmp_path, part):
    links = ''.join(f'<link name="{name}">{part}</link>' for name in ('l0', 'l1', 'l2'))
    joints = ''.join(
        JOINT.format(i=i, parent=parent) for i, parent in enumerate(('base', 'l0', 'l1'))
    )
    tool = (
        '<link name="tool"/><joint name="t" type="fixed"><parent link="l2"/><child link="tool"/>'
        '<origin xyz="0 0 0.15"/></joint>'
    )
    path = tmp_path / 'arm.urdf'
    path.write_text(f'<robot name="arm"><link name="base"/>{links}{joints}{tool}</robot>')
    return RobotModel.load(path)


def drawn(model):
    chain = model.pinocchio_model
    visual = pin.buildGeomFromUrdfString(chain, drawn_description(model), pin.GeometryType.VISUAL)
    data = visual.createData()
    pin.updateGeometryPlacements(chain, chain.createData(), visual, data, model.home)
    return [
        (item.parentJoint, type(item.geometry).__name__, place)
        for item, place in zip(visual.geometryObjects, data.oMg, strict=True)
    ]


def test_without_any_shape_rods_join_the_joints(tmp_path):
    model = load(tmp_path, '')
    shapes = drawn(model)
    assert {joint for joint, _, _ in shapes} == {0, 1, 2, 3}
    balls = [place.translation for _, name, place in shapes if name == 'Sphere']
    chain, data = model.pinocchio_model, model.pinocchio_data
    pin.forwardKinematics(chain, data, model.home)
    for point in [*(place.translation for place in data.oMi[1:]), model.wrist_pose(model.home)[0]]:
        assert min(np.linalg.norm(ball - point) for ball in balls) < 1e-9


def test_a_missing_mesh_is_stood_for_by_what_it_collides_with(tmp_path):
    part = (
        '<visual><geometry><mesh filename="package://none/a.dae"/></geometry></visual>'
        '<collision><origin xyz="0 0 0.1"/><geometry><sphere radius="0.07"/></geometry>'
        '</collision>'
    )
    model = load(tmp_path, part)
    shapes = [(joint, place) for joint, name, place in drawn(model) if name == 'Sphere']
    chain, data = model.pinocchio_model, model.pinocchio_data
    pin.forwardKinematics(chain, data, model.home)
    for joint in (1, 2, 3):
        centre = data.oMi[joint].act(np.array([0.0, 0.0, 0.1]))
        assert any(
            at == joint and np.linalg.norm(place.translation - centre) < 1e-9
            for at, place in shapes
        )


@pytest.mark.parametrize('robot', ['lwr4', 'panda'])
def test_an_arm_that_shows_itself_is_shown_as_it_is(robot):
    model = RobotModel.load(robot)
    raw = pin.buildGeomFromUrdfString(
        model.pinocchio_model, model.chain_text, pin.GeometryType.VISUAL
    )
    assert len(drawn(model)) == len(raw.geometryObjects) > 7
