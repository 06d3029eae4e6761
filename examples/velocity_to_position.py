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

"""Integrate joint velocities for an arm that takes joint positions, such as KUKA's by its FRI."""

from handover_dmp.nodes.qos import qos_profile
from handover_dmp.nodes.spin import run
from handover_dmp.topics import JOINT_COMMAND, JOINT_STATES
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray


class VelocityToPosition(Node):
    """Publishes ~/positions, in the order of the parameter `joints`."""

    def __init__(self) -> None:
        super().__init__('velocity_to_position')
        self.joints = self.declare_parameter('joints', [f'lbr_A{i}' for i in range(1, 8)]).value
        self.measured, self.positions, self.last_ns = None, None, 0
        self.publisher = self.create_publisher(Float64MultiArray, '~/positions', 1)
        for topic, kind in ((JOINT_STATES, JointState), (JOINT_COMMAND, Float64MultiArray)):
            call = self.measure if kind is JointState else self.move
            self.create_subscription(kind, topic.name, call, qos_profile(topic.quality))

    def measure(self, message: JointState) -> None:
        if set(self.joints) <= set(message.name):
            self.measured = np.array(message.position)[[*map(message.name.index, self.joints)]]

    def move(self, message: Float64MultiArray) -> None:
        now_ns = self.get_clock().now().nanoseconds
        step_s, self.last_ns = (now_ns - self.last_ns) / 1e9, now_ns
        if self.positions is None or not 0.0 < step_s <= 0.02:  # anew, from where the arm is now
            self.positions, step_s = self.measured, 0.0
        if self.positions is not None:  # and never more than 0.1 rad from where the arm is
            moved = self.positions + np.array(message.data) * step_s
            self.positions = np.clip(moved, self.measured - 0.1, self.measured + 0.1)
            self.publisher.publish(Float64MultiArray(data=self.positions))


if __name__ == '__main__':
    run(VelocityToPosition)
