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
Play a bag as `ros2 bag play` does, for tests: the bytes as they are, when they were recorded.

    python play_bag.py BAG [--delay S] [--loops COUNT] [--clock HZ] [--heard TOPIC LISTENERS]...

With `--heard` it begins when so many listen to that topic, however long that takes; with `--clock`
it says the time of the recording on `/clock`.
"""

from __future__ import annotations

import argparse
from importlib.util import find_spec
from pathlib import Path
import sys
from threading import Event, Thread
from time import monotonic, sleep

from builtin_interfaces.msg import Time
from handover_dmp.nodes.qos import message_class
import rclpy
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader
from rosgraph_msgs.msg import Clock

DEPTH = 10  # that of rosbag2, where the recorded one is not known


def main() -> int:
    """Play."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('bag', type=Path)
    parser.add_argument('--delay', type=float, default=0.0)
    parser.add_argument('--loops', type=int, default=1)
    parser.add_argument('--clock', type=float, default=0.0)
    parser.add_argument(
        '--heard', nargs=2, action='append', default=[], metavar=('TOPIC', 'LISTENERS')
    )
    words = parser.parse_args()
    rclpy.init()
    node = rclpy.create_node('play_bag')
    with Reader(words.bag) as reader:
        # as rosbag2 leaves out types that are not installed
        played = [c for c in reader.connections if find_spec(c.msgtype.partition('/')[0])]
        publishers = {c.id: publisher(node, c) for c in played}
        offered = {c.topic: publishers[c.id] for c in played}
        messages = [(c.id, time_ns, data) for c, time_ns, data in reader.messages(played)]
    for topic, listeners in words.heard:
        while offered[topic].get_subscription_count() < int(listeners):
            sleep(0.02)
    sleep(words.delay)
    clock = Ticker(node, words.clock, messages[0][1])
    for _ in range(words.loops):
        begun_s = clock.begin()
        for number, time_ns, data in messages:
            due_s = begun_s + (time_ns - messages[0][1]) * 1e-9
            sleep(max(0.0, due_s - monotonic()))
            publishers[number].publish(bytes(data))
    clock.end()
    node.destroy_node()
    rclpy.shutdown()
    return 0


class Ticker:
    """Says the time of the recording so many times a second, as the thread of rosbag2 does."""

    def __init__(self, node: Node, rate_hz: float, first_ns: int) -> None:
        self._publisher = node.create_publisher(Clock, '/clock', DEPTH) if rate_hz else None
        self._rate_hz = rate_hz
        self._first_ns = first_ns
        self._ended = Event()
        self._begun_s = monotonic()
        self._thread = Thread(target=self._run)
        if rate_hz:
            self._thread.start()

    def begin(self) -> float:
        self._begun_s = monotonic()
        return self._begun_s

    def end(self) -> None:
        self._ended.set()
        if self._rate_hz:
            self._thread.join()

    def _run(self) -> None:
        assert self._publisher is not None
        while not self._ended.wait(1.0 / self._rate_hz):
            time_ns = self._first_ns + round((monotonic() - self._begun_s) * 1e9)
            time = Time(sec=time_ns // 10**9, nanosec=time_ns % 10**9)
            self._publisher.publish(Clock(clock=time))


def publisher(node: Node, connection: Connection) -> Publisher:
    """Offer a topic as it was offered when it was recorded."""
    offered = connection.ext.offered_qos_profiles[0]
    profile = QoSProfile(
        depth=DEPTH,
        reliability=ReliabilityPolicy[offered.reliability.name],
        durability=DurabilityPolicy[offered.durability.name],
    )
    return node.create_publisher(message_class(connection.msgtype), connection.topic, profile)


if __name__ == '__main__':
    sys.exit(main())
