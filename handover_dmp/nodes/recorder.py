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
Node `recorder`: records topics, byte for byte, to a rosbag2 folder with MCAP files.

It records the topics of its namespace and those that all graphs share; in the root, all topics.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
import sys
from time import monotonic, sleep

from diagnostic_msgs.msg import DiagnosticArray
from handover_dmp.common.errors import DataError
from handover_dmp.nodes.arm import load_arm
from handover_dmp.nodes.diagnostics import Attendance, full_name, report_condition
from handover_dmp.nodes.node import HandoverNode, NO_EVENTS
from handover_dmp.nodes.parameters import ARM, DRIVER, fixed
from handover_dmp.nodes.qos import is_installed, message_class, qos_profile
from handover_dmp.nodes.rest import is_left_out_at_rest, OFTEN_SAID, Reports, Rest
from handover_dmp.nodes.spin import run
from handover_dmp.nodes.transforms import TransformRecorder
from handover_dmp.recording import BagWriter, Qos
from handover_dmp.recording.messages import string
from handover_dmp.topics import (
    CLOCK,
    DIAGNOSTICS,
    HAND_POSE,
    INFO,
    JOINT_STATES,
    OPTIONAL,
    STATE,
    TOPICS,
)
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from std_msgs.msg import String

OF_ALL_GRAPHS = {'/rosout', '/parameter_events'} | {
    topic.name for topic in TOPICS if topic.is_global
}
LOOK_S = 0.5
LOOKS_UNTIL_CERTAIN = 10
"""Looks after which the offers of publishers are checked even if their number is unchanged."""
LOOK_AGAIN_S = 0.01
QUEUE = 2000
ON_THE_WAY_S = 0.05
LAST_WORD_S = 1.0
"""Time to wait for the last reports of further nodes after that of a node, s."""


class Recorder(HandoverNode):
    """The recorder as a node."""

    NAME = 'recorder'
    PARAMETERS = (
        fixed('folder', 'Folder of the bag; it must not exist'),
        fixed('topics', 'Topics to record; empty: all'),
        fixed('info', 'JSON about the run, recorded as a message of /handover/info'),
        fixed(
            'rest_s',
            'Time without a handover after which fast streams are no longer recorded, s; 0: they '
            'always are',
            0.0,
            1e6,
        ),
        *ARM,
        *DRIVER,
        fixed('transforms', 'Whether to write /tf of this arm if nobody publishes it'),
        fixed('compression', 'Compression of the chunks', choices=('zstd', 'lz4', 'none')),
        fixed('chunk_size', 'Size at which a chunk is closed, bytes', 1024, 2**26),
        fixed('flush_period_s', 'Maximum time for which a message stays in memory, s', 0.01, 60.0),
        fixed('split_size', 'Maximum size of a file, bytes; 0: no limit', 0, 2**40),
        fixed('split_duration_s', 'Maximum duration of a file, s; 0: no limit', 0.0, 1e6),
    )

    def __init__(self) -> None:
        """Make the bag, subscribe to the known topics, look for more."""
        super().__init__()
        values = self.values
        self._writer = BagWriter(
            Path(values['folder']),
            compression=values['compression'],
            chunk_size=values['chunk_size'],
            flush_period_s=values['flush_period_s'],
            split_size=values['split_size'],
            split_duration_s=values['split_duration_s'],
        )
        self._space = self.get_namespace()
        self._wanted = {
            self.resolve_topic_name(name, only_expand=True) for name in values['topics'] if name
        }
        self._attendance = Attendance(self._space)
        self._heard: dict[str, Subscription] = {}
        self._types: dict[str, str] = {}
        self._offered: dict[str, list[Qos]] = {}
        self._not_installed: set[str] = set()
        self._publisher_counts: dict[str, int] = {}
        self._looks = 0
        self._failure = ''
        self._rest = Rest(values['rest_s'])
        self._table = {topic.within(self._space): topic for topic in TOPICS}
        self._streams = {name for name, t in self._table.items() if is_left_out_at_rest(t)}
        self._transforms: TransformRecorder | None = None
        if values['transforms']:
            self._transforms = TransformRecorder(self, load_arm(self), self._writer)
        for name, topic in self._table.items():
            # at once, before the offers are known, so that nothing of the start is missed
            if self._is_wanted(name) and topic is not INFO and is_installed(topic.type_name):
                self._subscribe(name, topic.type_name, qos_profile(topic.quality))
        # remapped topics are recorded under their names here
        self._moved = {self.resolve_topic_name(name) for name in self._heard} - set(self._heard)
        if values['info']:
            self._write_info(values['info'])
        self.serve('ready', self._unheard)
        self.every(LOOK_S, self._look, wall=True)
        self.every(values['flush_period_s'], self._flush, wall=True)
        report_condition(self, self._condition)
        which = ', '.join(sorted(self._wanted)) or f'every topic of {self._space}'
        self.say(f'records {which} into {values["folder"]}')

    def finish(self) -> None:
        """
        Write all messages up to now, and close the bag, since a node may have to wait to leave.

        If all nodes are told to end at once, this one lets the others finish first.
        """
        self._take_until_ended(lambda present: present <= {full_name(self)})
        super().finish()
        self._take_until_ended(lambda present: full_name(self) not in present)
        try:
            self._writer.close()
            self.say(f'recorded {self._writer.message_count} messages')
        except DataError as error:
            self._fail(error)

    def _take_until_ended(self, ended: Callable[[set[str]], bool]) -> None:
        """Record messages that are on their way, while the nodes leave one after the other."""
        sleep(ON_THE_WAY_S)
        self._take()
        present = set(self._attendance.present)
        deadline_s = monotonic() + LAST_WORD_S
        while not ended(self._attendance.present) and monotonic() < deadline_s:
            sleep(LOOK_AGAIN_S)
            self._take()
            if present - self._attendance.present:
                present = set(self._attendance.present)
                deadline_s = monotonic() + LAST_WORD_S

    def _take(self) -> None:
        for subscription in self._heard.values():
            with subscription.handle:
                # no more than a queue holds, since others may continue to send
                for _ in range(QUEUE):
                    taken = subscription.handle.take_message(
                        subscription.msg_type, subscription.raw
                    )
                    if taken is None:
                        break
                    subscription.callback(taken[0])

    def _unheard(self) -> str:
        """Tell which of the streams to be recorded are still missing."""
        streams = sorted(self._wanted - self._table.keys()) + [
            name
            for name, topic in self._table.items()
            if topic.quality in OFTEN_SAID
            and topic is not HAND_POSE
            and self._is_wanted(name)
            and (topic is not CLOCK or self.lockstep)
            and (topic not in OPTIONAL or self.count_publishers(name))
        ]
        streams += self._hands()
        unheard = [name for name in streams if name not in self._writer.topics]
        return f'nothing yet on {", ".join(unheard)}' if unheard else ''

    def _hands(self) -> list[str]:
        """Return the topics of the trackers, present or expected."""
        usual = HAND_POSE.within(self._space)
        names = {name for name, _ in self.get_topic_names_and_types()}
        names = names - self._table.keys() | {usual}
        hands = [
            name
            for name in sorted(names)
            if name.startswith(usual.removesuffix('pose')) and self.count_publishers(name)
        ]
        return [name for name in hands or [usual] if self._is_wanted(name)]

    def _is_wanted(self, name: str) -> bool:
        if self._wanted:
            return name in self._wanted
        return name.startswith(f'{self._space.rstrip("/")}/') or name in OF_ALL_GRAPHS

    def _look(self) -> None:
        """Find new topics, and publishers that offer less than was requested."""
        publishers = {
            name: self.count_publishers(name)
            for name, _ in self.get_topic_names_and_types()
            if name not in self._moved and self._is_wanted(name)
        }
        before, self._publisher_counts = self._publisher_counts, publishers
        self._looks += 1
        for name, count in publishers.items():
            if count == before.get(name) and self._looks % LOOKS_UNTIL_CERTAIN:
                continue
            ends = self.get_publishers_info_by_topic(name)
            offered = self._note_offered(name, [end.qos_profile for end in ends])
            # not the types of subscriptions, since ours may be a guess
            types = {end.topic_type for end in ends}
            if not offered or len(types) != 1:
                continue
            type_name, subscription = types.pop(), self._heard.get(name)
            if (
                subscription
                and _suits(subscription.qos_profile, offered)
                and (name in self._writer.topics or self._types[name] == type_name)
            ):
                continue
            if self._has_type(name, type_name):
                subscribe = partial(self._subscribe, name, type_name, _weakest(offered))
                if subscription:
                    self.replace(self._heard.pop(name), subscribe)
                else:
                    subscribe()

    def _note_offered(self, name: str, offered: list[QoSProfile]) -> list[QoSProfile]:
        """Store the offers of the publishers of a topic for the bag."""
        known = self._offered.setdefault(name, [])
        now = [Qos.from_profile(profile) for profile in offered]
        # publishers that are gone did offer theirs
        both = now + [profile for profile in known if profile not in now]
        if both != known:
            self._offered[name] = both
            self._writer.set_offered(name, both)
        return offered

    def _has_type(self, name: str, type_name: str) -> bool:
        """Tell whether the messages of a topic are installed; warn once if not."""
        if name in self._not_installed:
            return False
        if is_installed(type_name):
            return True
        self._not_installed.add(name)
        self.get_logger().warning(f'{name}: {type_name} is not installed, so it is not recorded')
        return False

    def _subscribe(self, name: str, type_name: str, request: QoSProfile) -> None:
        queue = QoSProfile(
            depth=QUEUE, reliability=request.reliability, durability=request.durability
        )
        self._types[name] = type_name
        self._heard[name] = self.create_subscription(
            message_class(type_name),
            name,
            self._writing(name, type_name),
            queue,
            event_callbacks=NO_EVENTS,
            raw=True,
        )

    def _writing(self, name: str, type_name: str) -> Callable[[bytes], None]:
        writer, attendance = self._writer, self._attendance
        rest, streams, reports = self._rest, name in self._streams, Reports()
        tells_state = name == STATE.within(self._space)

        def write(data: bytes) -> None:
            if self._failure:
                return
            time_ns = self.now_ns()
            try:
                if name not in writer.topics:
                    ends = self.get_publishers_info_by_topic(name)
                    self._note_offered(name, [end.qos_profile for end in ends])
                    writer.add_topic(name, type_name, self._offered[name] or self._by_table(name))
                if tells_state:
                    for kept in rest.hear(deserialize_message(data, String).data, time_ns):
                        self._keep(*kept)
                left_out = streams
                if name == DIAGNOSTICS.name:
                    told = deserialize_message(data, DiagnosticArray)
                    attendance.hear(told)
                    left_out = not reports.are_news(told, time_ns)
                if not (left_out and rest.keeps(name, data, time_ns)):
                    self._keep(name, data, time_ns)
            except DataError as error:
                self._fail(error)

        return write

    def _keep(self, name: str, data: bytes, time_ns: int) -> None:
        """Write a message and, after joint states, the transforms of the links."""
        self._writer.write(name, data, time_ns)
        if self._transforms is not None and name == JOINT_STATES.within(self._space):
            self._transforms.hear(data, time_ns)

    def _by_table(self, name: str) -> tuple[Qos, ...]:
        """Return the default offer of a topic of our table, if no publisher was seen."""
        if name not in self._table:
            return ()
        reliability, durability, _ = self._table[name].quality.value
        return (Qos(reliability, durability),)

    def _write_info(self, text: str) -> None:
        name = INFO.within(self._space)
        self._writer.add_topic(name, INFO.type_name, self._by_table(name))
        self._writer.write_message(name, string(text), self.get_clock().now().nanoseconds)

    def _flush(self) -> None:
        if not self._failure:
            try:
                self._writer.flush()
            except DataError as error:
                self._fail(error)

    def _fail(self, error: DataError) -> None:
        """Report once that recording has ended; the rest of the graph continues."""
        self._failure = str(error)
        self.exit_code = error.exit_code
        self.get_logger().error(f'recording ended: {error}')

    def _condition(self) -> tuple[str, dict[str, str]]:
        return self._failure, {'messages': str(self._writer.message_count)}


def _suits(request: QoSProfile, offered: list[QoSProfile]) -> bool:
    """Tell whether a subscription is compatible with every publisher."""
    weakest = _weakest(offered)
    reliable = request.reliability in (weakest.reliability, ReliabilityPolicy.BEST_EFFORT)
    durable = request.durability in (weakest.durability, DurabilityPolicy.VOLATILE)
    return reliable and durable


def _weakest(offered: list[QoSProfile]) -> QoSProfile:
    """Request no more than every publisher offers, so that none is missed."""
    reliable = all(o.reliability == ReliabilityPolicy.RELIABLE for o in offered)
    latched = all(o.durability == DurabilityPolicy.TRANSIENT_LOCAL for o in offered)
    return QoSProfile(
        depth=QUEUE,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def main() -> int:
    """Run the node."""
    return run(Recorder)


if __name__ == '__main__':
    sys.exit(main())
