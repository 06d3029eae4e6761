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

"""The node `dmp` feels what hangs on the wrist, whatever the frame; and hears who has it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count
import time
from typing import Any

from geometry_msgs.msg import WrenchStamped
from handover_dmp.nodes.dmp import Dmp
from handover_dmp.nodes.graph import isolate
from handover_dmp.nodes.qos import message_class, qos_profile
from handover_dmp.robot.model import RobotModel
from handover_dmp.simulation.arm import SimulatedArm
from handover_dmp.simulation.carried_object import CarriedObjectOptions
from handover_dmp.topics import GRIPPER_COMMAND, OBJECT_HOLDER, Topic, WRIST_WRENCH
import numpy as np
import pytest
import rclpy
from rclpy.node import Node
from scipy.spatial.transform import Rotation
from std_msgs.msg import String

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

MASS_KG = 0.8
WEIGHT_N = MASS_KG * 9.81
MOUNTED = Rotation.from_euler('xyz', [0.4, -0.7, 1.1])
"""From the axes of the sensor to those of the wrist's link."""


def told_by(node: Node, topic: Topic) -> Any:
    return node.create_publisher(
        message_class(topic.type_name), topic.name, qos_profile(topic.quality)
    )


@pytest.fixture
def dmp() -> Iterator[Dmp]:
    isolate()
    quaternion = ', '.join(map(str, MOUNTED.as_quat()))
    rclpy.init(
        args=[
            '--ros-args', '-p', 'session.enabled:=true', '-p', 'session.wrench_frame:=sensor',
            '-p', f'session.wrench_quaternion:=[{quaternion}]',
        ]
    )  # fmt: skip
    node = Dmp()
    yield node
    node.destroy_node()
    rclpy.shutdown()


def until(node: Node, done: Callable[[], bool], tell: Callable[[], object]) -> None:
    end = time.monotonic() + 60.0
    while not done():
        assert time.monotonic() < end
        tell()
        rclpy.spin_once(node, timeout_sec=0.01)


def test_feels_the_weight_down_in_the_room_whatever_the_frame(
    dmp: Dmp, capfd: pytest.CaptureFixture[str]
) -> None:
    model = RobotModel.load('lwr4')
    with SimulatedArm(model, carried=CarriedObjectOptions(mass_kg=MASS_KG, noise_n=0.0)) as arm:
        arm.reset(model.home + [0.5, -0.3, 0.4, 0.2, -0.6, 0.7, 0.3])
        for _ in range(10):
            arm.command(np.zeros(model.dof))
            arm.advance(0.005)
        in_room = arm.wrench.force
        wrist = Rotation.from_matrix(model.wrist_pose(arm.joint_positions)[1])
    assert in_room == pytest.approx([0.0, 0.0, -WEIGHT_N], abs=1e-2)
    # what the sensor would say: it moves with the wrist, and is mounted askew
    in_sensor = (wrist * MOUNTED).inv().apply([0.0, 0.0, -WEIGHT_N])
    assert abs(in_sensor[2] + WEIGHT_N) > 1.0, 'else nothing is shown'

    assert dmp._wrench is not None
    wrench, publisher, stamps = dmp._wrench, told_by(dmp, WRIST_WRENCH), count(1)

    def felt(frame: str, force: Any, turned: Any) -> Any:
        message = WrenchStamped()
        message.header.frame_id = frame
        message.wrench.force.x, message.wrench.force.y, message.wrench.force.z = map(float, force)
        message.header.stamp.nanosec = next(stamps)
        stamp_ns = message.header.stamp.nanosec
        until(dmp, lambda: wrench._stamp_ns == stamp_ns, lambda: publisher.publish(message))
        return wrench.newest(turned)

    turned = tuple(wrist.as_quat().tolist())
    force, _ = felt('world', in_room, turned)
    assert force == pytest.approx([0.0, 0.0, -WEIGHT_N], abs=1e-2)
    force, arrival_s = felt('sensor', in_sensor, turned)
    assert force == pytest.approx([0.0, 0.0, -WEIGHT_N], abs=1e-6)
    assert arrival_s > 0.0
    # before the wrist is known, nobody can tell where that points
    assert felt('sensor', in_sensor, None) is None
    for _ in range(2):
        _, arrival_s = felt('tool0', in_sensor, turned)
        assert arrival_s == -np.inf
    said = capfd.readouterr().err
    assert said.count("is in frame 'tool0', neither 'world' nor session.wrench_frame") == 1


def test_begins_with_the_take_where_the_holder_says_so(dmp: Dmp) -> None:
    commands: list[bool] = []
    kind, profile = message_class(GRIPPER_COMMAND.type_name), qos_profile(GRIPPER_COMMAND.quality)
    dmp.create_subscription(kind, GRIPPER_COMMAND.name, lambda m: commands.append(m.data), profile)
    told_by(dmp, OBJECT_HOLDER).publish(String(data='partner'))
    until(dmp, lambda: commands[-1:] == [False], lambda: None)
    assert dmp._controller.starts_by == 'signal'
