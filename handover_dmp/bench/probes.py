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
Probes and references for the graph: an empty timer, a sleep loop, a bare round trip.

Each probe runs as a separate process beside the graph: `python -m handover_dmp.bench.probes WHAT
FILE` creates an empty text file when it runs, and writes its times, in s, into it on SIGTERM.
Probes have the priority of the nodes, except the conductor, which keeps the graph in motion.
"""

from __future__ import annotations

from itertools import cycle
from pathlib import Path
import signal
import sys
from time import perf_counter, sleep, time

from handover_dmp.common.settings import defaults
from handover_dmp.handover.controller import MOVING
from handover_dmp.nodes.conversions import NANOSECONDS, period_of
from handover_dmp.nodes.once_per_second import OncePerSecond
from handover_dmp.nodes.qos import qos_profile
from handover_dmp.nodes.spin import run
from handover_dmp.topics import JOINT_COMMAND, Quality, STATE
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

PERIOD_S = 0.005
JOINTS = 7
LOOK_S = 0.02
MAX_HANDOVER_S = 20.0
# The hand jumps back to its start; `dmp` must be reset after that, and only then start.
AGAIN = (
    ('/robot_sim/reset', '/robot_sim/resume', '/hand_tracker/replay'),
    ('/dmp/reset',),
    ('/dmp/start',),
)


class _Probe(Node):  # type: ignore[misc]
    """A node that records times."""

    def __init__(self, name: str, file: Path, priority: int) -> None:
        super().__init__(name)
        self.declare_parameter('thread_priority', priority)
        self.times: list[float] = []
        self._file = file
        self.once_per_second = OncePerSecond(self)
        self.once_per_second.add(file.touch)

    def destroy_node(self) -> None:
        self._file.write_text('\n'.join(map(repr, self.times)), encoding='utf-8')
        super().destroy_node()


class EmptyTimer(_Probe):
    """A timer at 200 Hz that only records its calls."""

    def __init__(self, file: Path, priority: int) -> None:
        """Start the timer."""
        super().__init__('empty_timer', file, priority)
        self.create_timer(PERIOD_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _tick(self) -> None:
        self.times.append(time())
        self.once_per_second.period_ended()


class Echo(_Probe):
    """Sends joint states back."""

    def __init__(self, file: Path, priority: int) -> None:
        """Connect."""
        super().__init__('echo', file, priority)
        qos = qos_profile(Quality.SENSOR)
        publisher = self.create_publisher(JointState, '/probe/back', qos)
        self.create_subscription(JointState, '/probe/out', publisher.publish, qos)


class Ping(_Probe):
    """Sends joint states at 200 Hz and records their round-trip times, s."""

    def __init__(self, file: Path, priority: int) -> None:
        """Connect and start."""
        super().__init__('ping', file, priority)
        qos = qos_profile(Quality.SENSOR)
        self._publisher = self.create_publisher(JointState, '/probe/out', qos)
        self._message = JointState(position=[0.0] * JOINTS)
        self._sent_s = 0.0
        self.create_subscription(JointState, '/probe/back', self._back, qos)
        self.create_timer(PERIOD_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _tick(self) -> None:
        self._sent_s = perf_counter()
        self._publisher.publish(self._message)

    def _back(self, _message: JointState) -> None:
        self.times.append(perf_counter() - self._sent_s)


class Listener(_Probe):
    """Records the answered period, the arrival, s, and the motion of each joint command."""

    def __init__(self, file: Path, priority: int) -> None:
        """Connect."""
        super().__init__('listener', file, priority)
        qos = qos_profile(JOINT_COMMAND.quality)
        self.create_subscription(Float64MultiArray, JOINT_COMMAND.name, self._on_command, qos)

    def _on_command(self, message: Float64MultiArray) -> None:
        heard_s = time()
        period_ns = period_of(message)
        if period_ns is not None:
            self.times += (period_ns / NANOSECONDS, heard_s, float(any(message.data)))


class Conductor(_Probe):
    """Starts one handover after the other, and records the start of each, s."""

    def __init__(self, file: Path, priority: int) -> None:
        """Connect; start as soon as all services are available."""
        super().__init__('conductor', file, priority)
        self._orders = {
            name: self.create_client(Trigger, name) for names in AGAIN for name in names
        }
        self._steps = cycle(AGAIN)
        self._answers: list[Future] = []
        self._state = ''
        self._give_up_s = 0.0
        self.create_subscription(String, STATE.name, self._on_state, qos_profile(STATE.quality))
        self.create_timer(LOOK_S, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_state(self, message: String) -> None:
        self._state = message.data

    def _look(self) -> None:
        # an arm that was stopped by a stalled machine never arrives
        is_on = self._state in MOVING and perf_counter() < self._give_up_s
        asked = all(answer.done() for answer in self._answers)
        if is_on or not asked or not all(o.service_is_ready() for o in self._orders.values()):
            return
        names = next(self._steps)
        self._answers = [self._orders[name].call_async(Trigger.Request()) for name in names]
        if names is AGAIN[-1]:
            self.times.append(time())
            self._give_up_s = perf_counter() + MAX_HANDOVER_S


def sleep_loop(file: Path) -> None:
    """
    Sleep from period to period without ROS, until SIGTERM.

    Args:
        file: output file for the times, s.

    """
    ended: list[int] = []
    signal.signal(signal.SIGTERM, lambda caught, _frame: ended.append(caught))
    file.touch()
    times = []
    due_s = perf_counter()
    while not ended:
        times.append(time())
        due_s += PERIOD_S
        sleep(max(0.0, due_s - perf_counter()))
    file.write_text('\n'.join(map(repr, times)), encoding='utf-8')


KINDS = {
    'empty': EmptyTimer,
    'echo': Echo,
    'ping': Ping,
    'listener': Listener,
    'conductor': Conductor,
}


def main() -> int:
    """Run one probe."""
    what, file = sys.argv[1], Path(sys.argv[2])
    if what == 'sleep':
        sleep_loop(file)
        return 0
    kind = KINDS[what]
    priority = 0 if what == 'conductor' else defaults('dmp')['thread_priority']
    return run(lambda: kind(file, priority), [])


if __name__ == '__main__':
    sys.exit(main())
