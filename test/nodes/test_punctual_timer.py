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

"""When the periods of a punctual timer begin, by the schedule of its timer, in a real executor."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from time import monotonic, perf_counter

from handover_dmp.nodes.node import HandoverNode
from handover_dmp.nodes.parameters import TIMER
from handover_dmp.nodes.punctual_timer import PunctualTimer
from handover_dmp.nodes.shutdown import shut_down
import pytest
import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.timer import Timer

pytestmark = pytest.mark.ros

PERIOD_S = 0.005
PERIODS = 100
ROUNDING_S = 1e-6


class _Dmp(HandoverNode):
    """Has a timer with the defaults of `dmp`, and notes when it fires and periods begin."""

    NAME = 'dmp'
    PARAMETERS = TIMER

    def __init__(self) -> None:
        super().__init__()
        self.behind_s: list[float] = []
        self.waited_s: list[float] = []
        self.timer = PunctualTimer(self, PERIOD_S, self._period)

    def every(self, period_s: float, callback: Callable[[], None], *, wall: bool = False) -> Timer:
        def fire() -> None:
            self.fired_s = perf_counter()
            callback()

        self.bare_timer = super().every(period_s, fire, wall=wall)
        return self.bare_timer

    def _period(self) -> None:
        self.waited_s.append(perf_counter() - self.fired_s)
        self.behind_s.append(PERIOD_S - 1e-9 * self.bare_timer.time_until_next_call())


@pytest.fixture
def make_node() -> Iterator[type[_Dmp]]:
    made = []

    def make(*words: str) -> _Dmp:
        rclpy.init(args=['--ros-args', *words])
        made.append(_Dmp())
        return made[0]

    yield make
    shut_down(made[0])


def _spin(node: _Dmp) -> None:
    executor = EventsExecutor()
    executor.add_node(node)
    end_s = monotonic() + 60.0
    while len(node.behind_s) < PERIODS and monotonic() < end_s:
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    assert len(node.behind_s) >= PERIODS


@pytest.mark.parametrize('early_s', [0.0002, 0.0005])
def test_no_period_begins_before_it_is_due(make_node: type[_Dmp], early_s: float) -> None:
    node = make_node('-p', f'wake_early_s:={early_s}')
    _spin(node)
    assert min(node.behind_s) >= early_s - ROUNDING_S


def test_without_waking_early_it_begins_when_the_timer_fires(make_node: type[_Dmp]) -> None:
    node = make_node('-p', 'wake_early_s:=0.0')
    _spin(node)
    assert min(node.behind_s) >= 0.0
    assert min(node.waited_s) < 0.0001
