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

"""A bag opened alone shows the arm, in its place, moving; as rosbags reads it, by Pinocchio."""

from __future__ import annotations

from pathlib import Path

from handover_dmp.handover.lockstep import simulate
from handover_dmp.handover.scenario import make_scenario
from handover_dmp.recording import message_definition
from handover_dmp.robot.descriptions import ArmChoice
from handover_dmp.runs.bag import write_run_bag
from handover_dmp.runs.folder import run_info
import numpy as np
import pinocchio as pin
import pytest

highlevel = pytest.importorskip('rosbags.highlevel')
typesys = pytest.importorskip('rosbags.typesys')

FRAME = 'world'


def place(transform) -> pin.SE3:
    way, turn = transform.translation, transform.rotation
    return pin.XYZQUATToSE3(np.array([way.x, way.y, way.z, turn.x, turn.y, turn.z, turn.w]))


def in_room(carried: dict[str, tuple[str, pin.SE3]], frame: str) -> pin.SE3:
    """Go up from frame to frame, as tf2 does."""
    if frame == FRAME:
        return pin.SE3.Identity()
    parent, placement = carried[frame]
    return in_room(carried, parent) * placement


@pytest.mark.sample(2)
@pytest.mark.parametrize('robot', ['lwr4', 'ur5'])
def test_the_arm_of_a_bag_stands_where_it_stood_and_moves_as_it_moved(
    tmp_path: Path, robot: str
) -> None:
    scenario = make_scenario(arm=ArmChoice(robot))
    write_run_bag(tmp_path / 'bag', scenario, simulate(scenario), run_info(scenario, 1.0))
    described, states, wrists, moved = '', {}, {}, {}
    fixed: dict[str, tuple[str, pin.SE3]] = {}
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    with highlevel.AnyReader([tmp_path / 'bag'], default_typestore=store) as bag:
        kinds = {c.topic: c.msgtype for c in bag.connections}
        latched = {
            c.topic: c.ext.offered_qos_profiles[0].durability.name.lower()
            for c in bag.connections
            if c.topic.startswith('/tf') or c.topic == '/robot_description'
        }
        for connection, _, data in bag.messages():
            message = bag.deserialize(data, connection.msgtype)
            if connection.topic == '/robot_description':
                described = message.data
            elif connection.topic == '/joint_states':
                stamp = message.header.stamp
                states[stamp.sec, stamp.nanosec] = dict(
                    zip(message.name, message.position, strict=True)
                )
            elif connection.topic == '/wrist/pose':
                stamp, at = message.header.stamp, message.pose.position
                wrists[stamp.sec, stamp.nanosec] = (at.x, at.y, at.z)
            elif connection.topic in ('/tf', '/tf_static'):
                parts = {
                    part.child_frame_id: (part.header.frame_id, place(part.transform))
                    for part in message.transforms
                }
                stamp = message.transforms[0].header.stamp
                if connection.topic == '/tf_static':
                    fixed |= parts
                else:
                    moved[stamp.sec, stamp.nanosec] = parts
    assert kinds['/tf'] == kinds['/tf_static'] == 'tf2_msgs/msg/TFMessage'
    assert latched == {
        '/tf': 'volatile', '/tf_static': 'transient_local',
        '/robot_description': 'transient_local',
    }  # fmt: skip
    model = pin.buildModelFromXML(described)
    data = model.createData()
    bodies = [f.name for f in model.frames if f.type == pin.FrameType.BODY]
    root = bodies[0] if bodies[0] != 'universe' else bodies[1]
    assert fixed[root][0] == FRAME
    assert not fixed[root][1].isIdentity()
    assert len(moved) > 50
    for stamp in list(moved)[::10]:
        q = np.array([states[stamp][name] for name in list(model.names)[1:]])
        pin.framesForwardKinematics(model, data, q)
        carried = fixed | moved[stamp]
        for body in bodies:
            expected = fixed[root][1] * data.oMf[model.getFrameId(body, pin.FrameType.BODY)]
            assert in_room(carried, body).isApprox(expected, 1e-9), body
        # and the wrist's own topic says the same
        wrist = 'wrist' if robot == 'lwr4' else 'tool0'
        np.testing.assert_allclose(in_room(carried, wrist).translation, wrists[stamp], atol=1e-9)


def test_the_definition_of_transforms_needs_no_ros() -> None:
    definition = message_definition('tf2_msgs/msg/TFMessage')
    assert 'geometry_msgs/TransformStamped[] transforms' in definition.text
    assert 'MSG: geometry_msgs/Quaternion' in definition.text
    assert definition.type_hash.startswith('RIHS01_')
