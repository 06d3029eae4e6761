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
Five nodes that exchange the messages of the graph and do nothing else: its least possible cost.

Messages have the same types, sizes, rates and qualities of service; the nodes are in Python and
use the same executor. In lockstep they wait for each other as the nodes of the graph do.
"""

from __future__ import annotations

from base64 import b64decode, b64encode
from collections.abc import Callable, Iterable, Sequence
from functools import partial
import json
from pathlib import Path
import sys
from time import monotonic
from typing import Any

from handover_dmp.common.settings import defaults
from handover_dmp.nodes.conversions import nanoseconds, stamp
from handover_dmp.nodes.graph import Graph, NODES
from handover_dmp.nodes.hand_tracker import AGAIN_S
from handover_dmp.nodes.lockstep import ASK_AGAIN_S
from handover_dmp.nodes.qos import message_class, qos_profile
from handover_dmp.nodes.recorder import QUEUE
from handover_dmp.nodes.spin import run
from handover_dmp.topics import (
    CLOCK,
    DEMONSTRATOR_POSE,
    DIAGNOSTICS,
    HAND_FUSED,
    HAND_POSE,
    HAND_TRUTH,
    IK_STATUS,
    JOINT_COMMAND,
    JOINT_STATES,
    MARKERS,
    PHASE,
    POSE_COMMAND,
    Topic,
    TWIST_COMMAND,
    WRIST_POSE,
)
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message, serialize_message
from std_srvs.srv import SetBool, Trigger

PERIOD_NS = 5_000_000
LOOK_S = 0.02
COMMAND = (POSE_COMMAND, TWIST_COMMAND)
MESSAGES = (
    CLOCK, JOINT_STATES, HAND_POSE, HAND_TRUTH, DEMONSTRATOR_POSE, WRIST_POSE, *COMMAND, PHASE,
    HAND_FUSED, JOINT_COMMAND, IK_STATUS, MARKERS, DIAGNOSTICS,
)  # fmt: skip
HEARD = {
    'recorder': MESSAGES,
    'hand_tracker': (CLOCK,),
    'dmp': (HAND_POSE, WRIST_POSE, IK_STATUS),
    'priority_ik': (HAND_POSE, JOINT_STATES, *COMMAND),
    'robot_sim': (JOINT_COMMAND,),
}
"""Subscriptions by node."""
Rules = dict[str, tuple[tuple[tuple[Topic, ...], tuple[Topic, ...]], ...]]
IN_LOCKSTEP: Rules = {
    'hand_tracker': (((CLOCK,), (HAND_POSE, HAND_TRUTH, DEMONSTRATOR_POSE)),),
    'dmp': (((HAND_POSE, WRIST_POSE), (*COMMAND, PHASE, HAND_FUSED)),),
    'priority_ik': (
        ((JOINT_STATES,), (WRIST_POSE,)),
        ((HAND_POSE, *COMMAND), (JOINT_COMMAND, IK_STATUS)),
    ),
}
"""By node, the messages that it publishes when it has received all inputs of a period."""
AT_REST: Rules = {'priority_ik': ((COMMAND, (JOINT_COMMAND, WRIST_POSE)),)}
STEADY: dict[str, tuple[tuple[tuple[Topic, ...], str, float], ...]] = {
    'hand_tracker': (
        ((HAND_POSE,), 'rate_at_rest_hz', 0.0),
        ((HAND_TRUTH, DEMONSTRATOR_POSE), '', 1.0 / AGAIN_S),
    ),
    'dmp': (
        (COMMAND, 'rate_at_rest_hz', 0.0),
        ((PHASE, HAND_FUSED), 'status_rate_at_rest_hz', 0.0),
        ((MARKERS,), '', 1.0),
    ),
    'priority_ik': (((IK_STATUS,), 'status_rate_at_rest_hz', 0.0),),
    'robot_sim': (((JOINT_STATES,), 'rate_at_rest_hz', 0.0),),
}
"""By node, its messages at rest on the wall clock, with rate, or the parameter of the rate."""


class EmptyGraph(Graph):
    """The five empty nodes."""

    def __init__(
        self, folder: Path, messages: Path, *, lockstep: bool, namespace: str = '/'
    ) -> None:
        """
        Prepare the nodes.

        Args:
            folder: folder for the parameters and the logs.
            messages: file written by `keep_messages`.
            lockstep: whether they wait for each other; otherwise they are at rest on the wall
                clock.
            namespace: their namespace.

        """
        parameters = {name: {'messages': str(messages)} for name in NODES}
        super().__init__(folder, parameters, lockstep=lockstep, namespace=namespace)

    def words(self, name: str) -> list[str]:
        """Return the Python arguments to run a node."""
        return ['-m', 'handover_dmp.bench.empty_graph', name]


def keep_messages(graph: Graph, file: Path, timeout_s: float) -> None:
    """
    Save one message of each kind for an empty graph.

    Args:
        graph: the real graph, in motion.
        file: file to write.
        timeout_s: longest wait for all messages, s.

    """
    kept: dict[str, str] = {}

    def keep(topic: Topic, message: Any) -> None:
        kept[topic.name] = b64encode(serialize_message(message)).decode()

    subscriptions = [
        graph.node.create_subscription(
            message_class(topic.type_name),
            topic.relative,
            partial(keep, topic),
            qos_profile(topic.quality),
        )
        for topic in MESSAGES
    ]
    deadline_s = monotonic() + timeout_s
    while len(kept) < len(MESSAGES) and monotonic() < deadline_s:
        graph.spin()
    for subscription in subscriptions:
        graph.node.destroy_subscription(subscription)
    file.write_text(json.dumps(kept), encoding='utf-8')


class EmptyNode(Node):  # type: ignore[misc]
    """A node that answers messages with messages."""

    def __init__(self, name: str) -> None:
        """Connect."""
        super().__init__(name)
        self.declare_parameter('messages', '')
        self.declare_parameter('lockstep', False)
        file = Path(self.get_parameter('messages').value)
        lockstep = self.get_parameter('lockstep').value
        self._kept: dict[str, str] = json.loads(file.read_text(encoding='utf-8'))
        self._sent: dict[Topic, tuple[Publisher, Any]] = {}
        self._times_ns: dict[Topic, int] = {}
        self._rules = (IN_LOCKSTEP if lockstep else AT_REST).get(name, ())
        steady = () if lockstep else STEADY.get(name, ())
        for _, answers in self._rules:
            self._advertise(answers)
        for topics, parameter, rate_hz in (*steady, ((DIAGNOSTICS,), '', 1.0)):
            self._advertise(topics)
            every_s = 1.0 / (rate_hz or defaults(name)[parameter])
            self._every(every_s, partial(self._send_now, topics))
        if name == 'robot_sim':
            self._make_time(lockstep)
        for topic in HEARD[name]:
            self._listen(topic, raw=name == 'recorder')
        if name == 'recorder':
            self.create_service(Trigger, '~/ready', _yes)

    def _make_time(self, lockstep: bool) -> None:
        self._time_ns = 0
        self._runs = False
        self._asked_s = monotonic()
        self.create_service(SetBool, '~/pause', self._pause)
        if lockstep:
            self._advertise((JOINT_STATES, CLOCK))
            self._every(LOOK_S, self._ask_again)

    def _every(self, period_s: float, callback: Callable[[], None]) -> None:
        self.create_timer(period_s, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _advertise(self, topics: Iterable[Topic]) -> None:
        for topic in topics:
            kind = message_class(topic.type_name)
            text = self._kept.get(topic.name)
            message = deserialize_message(b64decode(text), kind) if text else kind()
            # also moves global topics into this graph, so that no other graph receives them
            name = topic.relative if topic is CLOCK else topic.name.lstrip('/')
            publisher = self.create_publisher(kind, name, qos_profile(topic.quality))
            self._sent[topic] = publisher, message

    def _listen(self, topic: Topic, *, raw: bool) -> None:
        quality = qos_profile(topic.quality)
        if raw:
            quality.depth = QUEUE
        name = topic.relative if topic is CLOCK else topic.name.lstrip('/')
        heard = _ignore if raw else partial(self._hear, topic)
        self.create_subscription(message_class(topic.type_name), name, heard, quality, raw=raw)

    def _hear(self, topic: Topic, message: Any) -> None:
        time_ns = self._times_ns[topic] = _time_ns(topic, message)
        if topic is JOINT_COMMAND:
            self._advance(time_ns)
        for needed, answers in self._rules:
            if topic in needed and all(self._times_ns.get(one) == time_ns for one in needed):
                self._send(answers, time_ns)

    def _send(self, topics: Sequence[Topic], time_ns: int) -> None:
        for topic in topics:
            publisher, message = self._sent[topic]
            _stamp(topic, message, time_ns)
            publisher.publish(message)

    def _send_now(self, topics: Sequence[Topic]) -> None:
        self._send(topics, self.get_clock().now().nanoseconds)

    # Simulated time

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._runs = not request.data
        response.success = True
        return response

    def _advance(self, answered_ns: int) -> None:
        if self._runs and answered_ns == self._time_ns:
            self._time_ns += PERIOD_NS
            self._ask()

    def _ask(self) -> None:
        self._asked_s = monotonic()
        self._send((JOINT_STATES, CLOCK), self._time_ns)

    def _ask_again(self) -> None:
        if monotonic() - self._asked_s > ASK_AGAIN_S:
            self._ask()


def _time_ns(topic: Topic, message: Any) -> int:
    """Return the time of a message's period, ns."""
    if topic in (JOINT_COMMAND, IK_STATUS):
        label: str = message.layout.dim[0].label
        return int(label) if label.isdecimal() else 0
    return nanoseconds(message.clock if topic is CLOCK else message.header.stamp)


def _stamp(topic: Topic, message: Any, time_ns: int) -> None:
    if topic is CLOCK:
        message.clock = stamp(time_ns)
    elif topic is JOINT_COMMAND:
        message.layout.dim[0].label = str(time_ns)
    elif topic not in (IK_STATUS, PHASE, MARKERS):
        message.header.stamp = stamp(time_ns)


def _ignore(_data: bytes) -> None:
    pass


def _yes(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
    response.success = True
    return response


if __name__ == '__main__':
    sys.exit(run(partial(EmptyNode, sys.argv[1])))
