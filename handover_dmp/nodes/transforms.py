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

"""Transforms of the arm's links: published if tf2 is installed, recorded in any case."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf
from time import monotonic

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from handover_dmp.common.arrays import Array
from handover_dmp.nodes.conversions import NANOSECONDS, nanoseconds
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.nodes.qos import is_installed, message_class
from handover_dmp.recording import BagWriter, Qos
from handover_dmp.recording.messages import transforms
from handover_dmp.robot.joint_states import JointStateReader
from handover_dmp.robot.link_frames import LinkFrames, LinkTransform
from handover_dmp.robot.model import RobotModel
from handover_dmp.topics import TF, TF_PERIOD_S, TF_STATIC, Topic
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

PERIOD_NS = round(TF_PERIOD_S * NANOSECONDS)
DISCOVERY_S = 0.5
"""Time within which whoever publishes transforms is known, once joint states are received, s."""


def frame_prefix(namespace: str) -> str:
    """
    Return the prefix of the links of an arm in a namespace, since all arms share `/tf`.

    Args:
        namespace: namespace of the node, e.g. `/left`.

    Returns:
        E.g. `left/`; empty in the root namespace.

    """
    inner = namespace.strip('/')
    return f'{inner}/' if inner else ''


def transform_messages(time: Time, links: Iterable[LinkTransform]) -> list[TransformStamped]:
    """
    Make the transforms of a message.

    Args:
        time: their stamp.
        links: poses of the links.

    Returns:
        One transform for each link.

    """
    made = []
    for link in links:
        message = TransformStamped(child_frame_id=link.child)
        message.header.stamp, message.header.frame_id = time, link.parent
        place, turn = message.transform.translation, message.transform.rotation
        place.x, place.y, place.z = link.position
        turn.x, turn.y, turn.z, turn.w = link.quaternion
        made.append(message)
    return made


class TransformPublisher:
    """Publishes the pose of the arm and, if nobody else describes the arm, of its links."""

    def __init__(self, node: HandoverNode, model: RobotModel, *, alone: bool) -> None:
        """
        Publish the fixed transforms.

        Args:
            node: node that publishes.
            model: the arm.
            alone: whether nobody else, e.g. `robot_state_publisher`, describes the arm.

        """
        self._links = LinkFrames(model, node.frame, frame_prefix(node.get_namespace()))
        self._publisher: Publisher | None = None
        self._told = -1
        if not is_installed(TF.type_name):
            return
        fixed = self._links.fixed if alone else self._links.fixed[:1]
        kind = message_class(TF.type_name)
        # they hold at any time of any clock
        links = transform_messages(Time(), fixed)
        node.advertise(TF_STATIC).publish(kind(transforms=links))
        if alone:
            self._publisher, self._kind = node.advertise(TF), kind

    def tell(self, time: Time, joint_positions: Array) -> None:
        """
        Publish the links, if somebody listens and it is time.

        Args:
            time: time of the joint positions.
            joint_positions: (n,) rad.

        """
        if self._publisher is None or not self._publisher.get_subscription_count():
            return
        period = nanoseconds(time) // PERIOD_NS
        if period != self._told:
            self._told = period
            links = transform_messages(time, self._links.moving(joint_positions))
            self._publisher.publish(self._kind(transforms=links))


class TransformRecorder:
    """Computes the transforms from the joint states for a bag, if nobody publishes them."""

    def __init__(self, node: HandoverNode, model: RobotModel, writer: BagWriter) -> None:
        """
        Prepare the arm.

        Args:
            node: node that records.
            model: the arm, at its base placement.
            writer: writer of the bag.

        """
        self._node, self._writer = node, writer
        self._links = LinkFrames(model, node.frame, frame_prefix(node.get_namespace()))
        self._reader = JointStateReader(model.joint_names, node.values['joint_prefix'])
        self._told: int | None = None
        self._may_be_published = is_installed(TF.type_name)
        self._begun_s = inf

    def hear(self, data: bytes, log_time_ns: int) -> None:
        """
        Write the transforms of the links.

        Args:
            data: a message of the joint states.
            log_time_ns: time of its arrival, ns.

        Raises:
            DataError: the bag cannot be written.

        """
        if self._are_published():
            return
        message = deserialize_message(data, JointState)
        time_ns = nanoseconds(message.header.stamp)
        first, period = self._told is None, time_ns // PERIOD_NS
        if period == self._told:
            return
        found = self._reader.read(message.name, message.position, message.velocity)
        if isinstance(found, str):
            return
        self._told = period
        if first:
            self._write(TF_STATIC, time_ns, self._links.fixed, log_time_ns)
        self._write(TF, time_ns, self._links.moving(found[0]), log_time_ns)

    def _are_published(self) -> bool:
        """Tell whether somebody publishes the transforms, or may still be discovered."""
        if not self._may_be_published:
            return False
        now_s = monotonic()
        self._begun_s = min(self._begun_s, now_s)
        discovers = now_s < self._begun_s + DISCOVERY_S
        return discovers or self._node.count_publishers(TF.name) > 0

    def _write(
        self, topic: Topic, time_ns: int, links: Iterable[LinkTransform], log_time_ns: int
    ) -> None:
        reliability, durability, _ = topic.quality.value
        self._writer.add_topic(topic.name, topic.type_name, Qos(reliability, durability))
        self._writer.write_message(topic.name, transforms(time_ns, links), log_time_ns)
