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
The hand as a tracker tells it: of any type, in any frame, one body among several.

For every node that follows the hand. What type the topic has is looked up once a second, so that a
tracker may be there first or come later.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from builtin_interfaces.msg import Time
from handover_dmp.common.errors import UsageError
from handover_dmp.mocap.no_pose import no_pose
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.topics import HAND_POSE
from handover_dmp.tracking.pose_messages import BodyChooser, READERS, SeenPose
from rclpy.subscription import Subscription
from rclpy.time import Time as RosTime

try:
    import tf2_ros  # type: ignore[import-not-found]
except ImportError:  # never required: the wheels of ROS 2 have none
    tf2_ros = None


class HandInput:
    """Hands on each pose of the hand, its position in the frame of the node."""

    def __init__(
        self,
        node: HandoverNode,
        take: Callable[[Time, SeenPose], None],
        refuse: Callable[[str, str], None],
    ) -> None:
        """
        Subscribe.

        Args:
            node: with the parameters `HAND`.
            take: gets the stamp of each pose, and the pose; also one that is none.
            refuse: gets, of each message that was not used, the reason, as a word and a sentence.

        Raises:
            UsageError: the parameters `tracker.*` make no sense.

        """
        self._node = node
        self._take = take
        self._refuse = refuse
        self._chooser = BodyChooser(node.values['tracker.body'])
        self._transforms: dict[str, Callable[[Any], tuple[float, float, float]]] = {}
        if node.values['tracker.frame']:
            from handover_dmp.tracking.frames import FixedTransform

            self._transforms[node.values['tracker.frame']] = FixedTransform(
                node.values['tracker.position'], node.values['tracker.quaternion']
            )
        self._buffer: Any = None
        self._type = node.values['tracker.type'] or HAND_POSE.type_name
        self._subscription = self._listen(self._type)
        if not node.values['tracker.type']:
            node.once_per_second.add(self._look)

    def _listen(self, type_name: str) -> Subscription:
        if type_name not in READERS:
            raise UsageError(f'messages of type {type_name}: none of {", ".join(READERS)}')

        def heard(message: Any) -> None:
            self._on(type_name, message)

        try:
            if type_name == HAND_POSE.type_name:
                return self._node.subscribe(HAND_POSE, heard)
            return self._node.subscribe(replace(HAND_POSE, type_name=type_name), heard)
        except ImportError as error:
            raise UsageError(
                f'messages of type {type_name}: their package is not installed here'
            ) from error

    def _look(self) -> None:
        """Listen to what is published where that is of another type."""
        name = self._node.resolve_topic_name(HAND_POSE.relative)
        publishers = self._node.get_publishers_info_by_topic(name)
        types = {publisher.topic_type for publisher in publishers}
        if not types or self._type in types:
            return
        # DDS allows a process one type a topic
        self._node.destroy_subscription(self._subscription)
        self._chooser.names.clear()
        self._type = min(types, key=lambda type_name: (type_name not in READERS, type_name))
        try:
            self._subscription = self._listen(self._type)
        except UsageError as error:
            self._refuse('other_type', f'{name}: {error}')
            self._type = HAND_POSE.type_name
            self._subscription = self._listen(self._type)

    def _on(self, type_name: str, message: Any) -> None:
        pose = self._chooser.choose(READERS[type_name](message))
        if isinstance(pose, str):
            # of messages about one body each, those about others are no concern of ours
            if pose != 'other_body' or type_name != 'geometry_msgs/msg/TransformStamped':
                self._refuse(pose, self._of_the_bodies(pose))
            return
        frame = message.header.frame_id
        # a zero that was moved to another frame would be none
        if frame != self._node.frame and not no_pose(*pose[1:3]):
            place = self._placed(pose.position, message.header)
            if place is None:
                self._refuse('other_frame', self._of_the_frame(frame))
                return
            pose = pose._replace(position=place)
        self._take(message.header.stamp, pose)

    def _placed(
        self, position: tuple[float, float, float], header: Any
    ) -> tuple[float, float, float] | None:
        if header.frame_id in self._transforms:
            return self._transforms[header.frame_id](position)
        if tf2_ros is None or not header.frame_id:
            return None
        if self._buffer is None:
            self._buffer = tf2_ros.Buffer()
            self._listener = tf2_ros.TransformListener(self._buffer, self._node)
        try:
            found = self._buffer.lookup_transform(
                self._node.frame, header.frame_id, RosTime.from_msg(header.stamp)
            ).transform
        except tf2_ros.TransformException:
            return None
        from handover_dmp.tracking.frames import FixedTransform

        at, turn = found.translation, found.rotation
        return FixedTransform((at.x, at.y, at.z), (turn.x, turn.y, turn.z, turn.w))(position)

    def _of_the_frame(self, frame: str) -> str:
        missing = 'tf2_ros is not installed' if tf2_ros is None else 'which knows none'
        return (
            f'hand in frame {frame!r}, not {self._node.frame!r}: tell its transform by '
            f'tracker.frame, tracker.position and tracker.quaternion, or by tf2 ({missing})'
        )

    def _of_the_bodies(self, reason: str) -> str:
        names = ', '.join(sorted(self._chooser.names)) or 'none'
        return f'hand {reason.replace("_", " ")}: choose by tracker.body; seen are {names}'
