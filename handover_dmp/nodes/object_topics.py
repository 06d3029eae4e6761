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

"""The topics of a session in which `robot_sim` simulates the object."""

from __future__ import annotations

from math import inf

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, Vector3, WrenchStamped
from handover_dmp.common.arrays import Array
from handover_dmp.common.settings import parameters_of
from handover_dmp.nodes.conversions import nanoseconds, pose_message, position_of
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.nodes.parameters import parameters_from, Values
from handover_dmp.simulation.arm import SimulatedArm
from handover_dmp.simulation.carried_object import CarriedObjectOptions, Holder
from handover_dmp.simulation.partner_grip import PartnerGripOptions
from handover_dmp.topics import (
    GRIPPER_COMMAND,
    HAND_POSE,
    HAND_TRUTH,
    OBJECT_HOLDER,
    OBJECT_POSE,
    WRIST_WRENCH,
)
import numpy as np
from std_msgs.msg import String

OBJECT = parameters_from(CarriedObjectOptions, PartnerGripOptions)
TRUTH_LOST_S = 0.2
"""Age of the true pose of the hand beyond which that of the tracker is used, s."""


def carried_object(values: Values) -> CarriedObjectOptions:
    """
    Read the parameters of the object.

    Args:
        values: parameters of the node.

    Returns:
        The object and how the partner handles it.

    Raises:
        UsageError: the object is invalid.

    """
    partner = PartnerGripOptions(**parameters_of(PartnerGripOptions, values))
    return CarriedObjectOptions(**parameters_of(CarriedObjectOptions, values), partner=partner)


class ObjectTopics:
    """Publishes the object, subscribes to gripper and hand; does nothing without an object."""

    def __init__(self, node: HandoverNode, arm: SimulatedArm) -> None:
        """
        Connect the topics.

        Args:
            node: node of the topics.
            arm: arm that carries the object.

        """
        self._node, self._arm = node, arm
        self._holder: Holder | None = None
        self._hands: list[tuple[int, Array]] = []
        self._truth_s = -inf
        if not arm.carries:
            return
        self._wrench = node.advertise(WRIST_WRENCH)
        self._pose = node.advertise(OBJECT_POSE)
        self._said_holder = node.advertise(OBJECT_HOLDER)
        node.subscribe(GRIPPER_COMMAND, lambda message: arm.set_gripper(message.data))
        node.subscribe(HAND_TRUTH, self._on_truth)
        node.subscribe(HAND_POSE, self._on_hand)

    def _on_truth(self, message: PoseStamped) -> None:
        self._truth_s = self._node.arrival_s()
        self._take(message)

    def _on_hand(self, message: PoseStamped) -> None:
        if self._node.arrival_s() - self._truth_s > TRUTH_LOST_S:
            self._take(message)

    def _take(self, message: PoseStamped) -> None:
        stamp_ns, position = nanoseconds(message.header.stamp), np.array(position_of(message))
        if self._node.lockstep:
            self._hands.append((stamp_ns, position))
        else:
            self._arm.set_partner_hand(position)

    def before(self, period_ns: int) -> None:
        """
        Move the partner's hand, before a period of lockstep.

        It moves to its position of one period before, which has arrived for sure, so that runs
        are reproducible.

        Args:
            period_ns: start of the period, ns.

        """
        known = [hand for hand in self._hands if hand[0] < period_ns]
        if known:
            self._arm.set_partner_hand(known[-1][1])
            del self._hands[: len(known)]

    def tell(self, time: Time) -> None:
        """
        Publish the wrench on the wrist, the pose of the object, and its holder if it changed.

        Args:
            time: stamp of both.

        """
        if not self._arm.carries:
            return
        header_frame, wrench = self._node.frame, self._arm.wrench
        message = WrenchStamped()
        message.header.stamp, message.header.frame_id = time, header_frame
        message.wrench.force = _vector(wrench.force)
        message.wrench.torque = _vector(wrench.torque)
        self._wrench.publish(message)
        position, quaternion = self._arm.object_pose
        pose = pose_message(time, position, quaternion.tolist(), frame=header_frame)
        self._pose.publish(pose)
        if self._arm.holder is not self._holder:
            self._holder = self._arm.holder
            self._said_holder.publish(String(data=self._holder.value))


def _vector(values: Array) -> Vector3:
    x, y, z = values.tolist()
    return Vector3(x=x, y=y, z=z)
