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
Poses of the hand from trackers: of any message type, in any frame, one body among several.

For every node that follows the hand. The type of the topic is looked up once a second, so a
tracker may start before or after the node.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from handover_dmp.common.arrays import Point
from handover_dmp.common.errors import UsageError
from handover_dmp.mocap.message_bodies import bodies, Body
from handover_dmp.nodes.conversions import NANOSECONDS, nanoseconds
from handover_dmp.nodes.node import HandoverNode, NO_EVENTS
from handover_dmp.topics import HAND_POSE
from handover_dmp.tracking.pose_messages import BodyChooser, TYPES
from handover_dmp.tracking.tracker import PATIENCE_PERIODS
from rclpy.time import Time as RosTime

try:
    import tf2_ros  # type: ignore[import-not-found]
except ImportError:  # optional: the wheels of ROS 2 do not have it
    tf2_ros = None


ROUNDING_S = 1e-6
MAX_LAG_S = 0.1
"""Age relative to the hand up to which the newest transform of tf2 is used, s."""


class HandPose(NamedTuple):
    """
    A pose of the hand from a tracker.

    Attributes:
        stamp_ns: time of the measurement, ns; the present if the message has no stamp.
        tracker: name of the tracker.
        pose: in the frame of the node.

    """

    stamp_ns: int
    tracker: str
    pose: Body


class HandInputs:
    """
    Passes on the poses of all trackers; in lockstep, those of a period together.

    Attributes:
        begun: whether a pose has arrived.

    """

    def __init__(
        self,
        node: HandoverNode,
        take: Callable[[HandPose], None],
        refuse: Callable[[str, str, str], None],
        look: Callable[[], None],
    ) -> None:
        """
        Subscribe.

        Args:
            node: with the parameters `HAND`, and `ONE_TRACKER` of each.
            take: gets each pose, even an invalid one; in lockstep when `release` is called.
            refuse: gets, for each refused message, the tracker and the reason, as a word
                and a sentence.
            look: is called in lockstep when a pose has arrived.

        Raises:
            UsageError: the parameters of a tracker are invalid.

        """
        self._node = node
        self._take = take
        self._look = look
        self._waiting: list[HandPose] = []
        self._names: list[str] = list(node.values['trackers'])
        self._newest_ns: dict[str, int] = {}
        self._inputs = [
            HandInput(node, name, partial(self._on_hand, name), partial(refuse, name))
            for name in self._names
        ]

    @property
    def begun(self) -> bool:
        """Whether a tracker has published a pose."""
        return bool(self._newest_ns)

    @property
    def named(self) -> str:
        """Return the names of the topics, after namespaces and remaps."""
        node = self._node
        topics = [str(node.values[f'{name}.topic']) for name in self._names]
        return ', '.join(map(node.resolve_topic_name, topics))

    def placed(self, position: Point, header: Any) -> Point | None:
        """
        Transform another point that a tracker sees to the frame of the node.

        Args:
            position: (3,) m.
            header: names its frame and the time.

        Returns:
            (3,) m; None if the transform of its frame is unknown.

        """
        if header.frame_id == self._node.frame:
            return position
        found = (one.placed(position, header) for one in self._inputs)
        return next((place for place in found if place is not None), None)

    def are_there(self, tick_ns: int, timeout_s: float) -> bool:
        """
        Tell, in lockstep, whether no pose has to be waited for.

        Args:
            tick_ns: time of the period, ns.
            timeout_s: age at which the hand is given up, s.

        Returns:
            Whether the newest pose of every tracker has arrived or is given up.

        """
        values = self._node.values
        for name in self._names:
            # a tracker that has not been heard yet may miss the first poses of simulated time
            age_s = (tick_ns - self._newest_ns.get(name, 0)) / NANOSECONDS
            age_s -= values[f'{name}.latency_s']
            period_s = 1.0 / values[f'{name}.rate_hz']
            if period_s - ROUNDING_S <= age_s < max(timeout_s, PATIENCE_PERIODS * period_s):
                return False
        return True

    def release(self) -> None:
        """Pass on the poses of a period of lockstep, in an order that is always the same."""
        waiting, self._waiting = self._waiting, []
        for pose in sorted(
            waiting, key=lambda one: (one.stamp_ns, self._names.index(one.tracker))
        ):
            self._take(pose)

    def _on_hand(self, name: str, time: Time, pose: Body) -> None:
        node = self._node
        heard = HandPose(node.hand_stamp_ns(time), name, pose)
        if not node.lockstep:
            self._take(heard)
        # poses may be repeated, since they may have been lost
        elif heard.stamp_ns != self._newest_ns.get(name):
            self._waiting.append(heard)
        self._newest_ns[name] = heard.stamp_ns
        if node.lockstep:
            self._look()


class HandInput:
    """Passes on each pose of one tracker, transformed to the frame of the node."""

    def __init__(
        self,
        node: HandoverNode,
        name: str,
        take: Callable[[Time, Body], None],
        refuse: Callable[[str, str], None],
    ) -> None:
        """
        Subscribe.

        Args:
            node: with the parameters `ONE_TRACKER` of it.
            name: of the tracker.
            take: gets the stamp of each pose and the pose, even an invalid one.
            refuse: gets, for each refused message, the reason, as a word and a sentence.

        Raises:
            UsageError: the parameters of the tracker are invalid.

        """
        self._node = node
        self._name = name
        self._topic: str = node.values[f'{name}.topic']
        self._take = take
        self._refuse = refuse
        self._chooser = BodyChooser(node.values[f'{name}.body'])
        self._transforms: dict[str, Callable[[Point], Point]] = {}
        if frame := node.values[f'{name}.frame']:
            from handover_dmp.tracking.frames import FixedTransform

            self._transforms[frame] = FixedTransform(
                node.values[f'{name}.position'], node.values[f'{name}.quaternion']
            )
        self._buffer: Any = None
        self._is_type_given = bool(node.values[f'{name}.type'])
        self._listen(node.values[f'{name}.type'] or HAND_POSE.type_name)
        if not self._is_type_given:
            node.once_per_second.add(self._look)

    def _listen(self, type_name: str) -> None:
        if type_name not in TYPES:
            raise UsageError(f'messages of type {type_name}; expected one of {", ".join(TYPES)}')

        heard = partial(self._on, type_name)
        events = None if self._is_type_given else NO_EVENTS
        try:
            self._subscription = self._node.subscribe(
                HAND_POSE, heard, self._topic, type_name, events
            )
        except ImportError as error:
            raise UsageError(
                f'messages of type {type_name}: their package is not installed'
            ) from error
        self._type = type_name

    def _look(self) -> None:
        """Subscribe to the published type if it is another one."""
        name = self._node.resolve_topic_name(self._topic)
        publishers = self._node.get_publishers_info_by_topic(name)
        types = {publisher.topic_type for publisher in publishers}
        if types and self._type not in types:
            best = min(types, key=lambda type_name: (type_name not in TYPES, type_name))
            self._node.replace(self._subscription, partial(self._listen_to_other, name, best))

    def _listen_to_other(self, name: str, type_name: str) -> None:
        self._chooser.names.clear()
        try:
            self._listen(type_name)
        except UsageError as error:
            self._refuse('other_type', f'{name}: {error}')
            self._listen(HAND_POSE.type_name)

    def _on(self, type_name: str, message: Any) -> None:
        pose = self._chooser.choose(bodies(message) or [])
        if isinstance(pose, str):
            # messages about single other bodies are ignored
            if pose != 'other_body' or type_name != 'geometry_msgs/msg/TransformStamped':
                self._refuse(pose, self._of_the_bodies(pose))
            return
        frame = message.header.frame_id
        # zeros must be noticed before they are moved to another frame
        if frame != self._node.frame and not pose.is_lost:
            place = self.placed(pose.position, message.header)
            if place is None:
                self._refuse('other_frame', self._of_the_frame(frame))
                return
            pose = pose._replace(position=place)
        self._take(message.header.stamp, pose)

    def placed(self, position: Point, header: Any) -> Point | None:
        """
        Transform a position to the frame of the node.

        Args:
            position: (3,) m.
            header: names its frame, which is another one, and the time.

        Returns:
            (3,) m; None if neither parameters nor tf2 give the transform of that frame.

        """
        if header.frame_id in self._transforms:
            return self._transforms[header.frame_id](position)
        if tf2_ros is None or not header.frame_id:
            return None
        if self._buffer is None:
            self._buffer = tf2_ros.Buffer()
            self._listener = tf2_ros.TransformListener(self._buffer, self._node)
        found = self._by_tf2(header)
        if found is None:
            return None
        from handover_dmp.tracking.frames import FixedTransform

        at, turn = found.translation, found.rotation
        return FixedTransform((at.x, at.y, at.z), (turn.x, turn.y, turn.z, turn.w))(position)

    def _by_tf2(self, header: Any) -> Any:
        """Return the transform at the time of the hand, or the newest if it is hardly older."""
        frames, dated = (self._node.frame, header.frame_id), self._node.is_stamped(header.stamp)
        look_up = partial(self._buffer.lookup_transform, *frames)
        try:
            if dated:
                with suppress(tf2_ros.ExtrapolationException):
                    return look_up(RosTime.from_msg(header.stamp)).transform
            newest = look_up(RosTime())
        except tf2_ros.TransformException:
            return None
        lag_ns = nanoseconds(header.stamp) - nanoseconds(newest.header.stamp)
        usable = not dated or 0 <= lag_ns <= MAX_LAG_S * NANOSECONDS
        return newest.transform if usable else None

    def _of_the_frame(self, frame: str) -> str:
        missing = 'tf2_ros is not installed' if tf2_ros is None else 'which does not know it then'
        return (
            f'hand in frame {frame!r}, not {self._node.frame!r}: give its transform by '
            f'{self._name}.frame, {self._name}.position and {self._name}.quaternion, or by tf2 '
            f'({missing})'
        )

    def _of_the_bodies(self, reason: str) -> str:
        names = ', '.join(sorted(self._chooser.names)) or 'none'
        return f'hand {reason.replace("_", " ")}: set {self._name}.body to one of: {names}'
