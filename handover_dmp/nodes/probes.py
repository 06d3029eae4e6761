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
What the graph is measured against: an empty timer, a plain sleep loop, a bare round trip.

Run as processes of their own beside the graph: `python -m handover_dmp.nodes.probes WHAT SECONDS
FILE` writes its times, in s, to a text file. The empty timer is there as one writes it at first
and, as `urgent`, with the real-time priority of the nodes; the round trip has that too.
"""

from __future__ import annotations

from pathlib import Path
import sys
from time import perf_counter, sleep, time

from handover_dmp.nodes.qos import qos_profile
from handover_dmp.nodes.spinning import run
from handover_dmp.settings import defaults
from handover_dmp.topics import Quality
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from sensor_msgs.msg import JointState

PERIOD_S = 0.005
JOINTS = 7


class _Probe(Node):  # type: ignore[misc]
    """A node that ends by itself and keeps times."""

    def __init__(self, name: str, seconds: float, file: Path, priority: int) -> None:
        super().__init__(name)
        self.declare_parameter('thread_priority', priority)
        self.times: list[float] = []
        self.ended = False
        self._end_s = perf_counter() + seconds
        self._file = file

    def destroy_node(self) -> None:
        self._file.write_text('\n'.join(map(repr, self.times)), encoding='utf-8')
        super().destroy_node()

    def look_at_the_time(self) -> None:
        self.ended = perf_counter() > self._end_s


class EmptyTimer(_Probe):
    """A timer at 200 Hz that does nothing but note when it is called."""

    def __init__(self, seconds: float, file: Path, priority: int) -> None:
        """Start the timer."""
        super().__init__('empty_timer', seconds, file, priority)
        self.create_timer(PERIOD_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _tick(self) -> None:
        self.times.append(time())
        self.look_at_the_time()


class Echo(_Probe):
    """Sends joint states back."""

    def __init__(self, seconds: float, file: Path, priority: int) -> None:
        """Connect."""
        super().__init__('echo', seconds, file, priority)
        qos = qos_profile(Quality.SENSOR)
        publisher = self.create_publisher(JointState, '/probe/back', qos)
        self.create_subscription(JointState, '/probe/out', publisher.publish, qos)
        self.create_timer(0.1, self.look_at_the_time)


class Ping(_Probe):
    """Sends joint states out at 200 Hz and notes how long each takes to come back, s."""

    def __init__(self, seconds: float, file: Path, priority: int) -> None:
        """Connect and start."""
        super().__init__('ping', seconds, file, priority)
        qos = qos_profile(Quality.SENSOR)
        self._publisher = self.create_publisher(JointState, '/probe/out', qos)
        self._message = JointState(position=[0.0] * JOINTS)
        self._sent_s = 0.0
        self.create_subscription(JointState, '/probe/back', self._back, qos)
        self.create_timer(PERIOD_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _tick(self) -> None:
        self._sent_s = perf_counter()
        self._publisher.publish(self._message)
        self.look_at_the_time()

    def _back(self, _message: JointState) -> None:
        self.times.append(perf_counter() - self._sent_s)


def sleep_loop(seconds: float, file: Path) -> None:
    """
    Sleep from period to period without ROS.

    Args:
        seconds: how long.
        file: gets the times, s.

    """
    times = []
    begun_s = due_s = perf_counter()
    while due_s < begun_s + seconds:
        times.append(time())
        due_s += PERIOD_S
        sleep(max(0.0, due_s - perf_counter()))
    file.write_text('\n'.join(map(repr, times)), encoding='utf-8')


def main() -> int:
    """Run one probe."""
    what, seconds, file = sys.argv[1], float(sys.argv[2]), Path(sys.argv[3])
    if what == 'sleep':
        sleep_loop(seconds, file)
        return 0
    kind = {'empty': EmptyTimer, 'urgent': EmptyTimer, 'echo': Echo, 'ping': Ping}[what]
    priority = 0 if what == 'empty' else defaults('dmp')['thread_priority']
    return run(lambda: kind(seconds, file, priority), [])


if __name__ == '__main__':
    sys.exit(main())
