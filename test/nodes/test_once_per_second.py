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

"""Housekeeping in a real executor: in the pause behind a period, or alone where there are none."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from time import monotonic
from typing import Any

from handover_dmp.nodes.once_per_second import INTERVAL_S, OncePerSecond
from handover_dmp.nodes.shutdown import shut_down
import pytest
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.experimental import EventsExecutor
from rclpy.node import Node

pytestmark = pytest.mark.ros

PERIOD_S = 0.005


@pytest.fixture
def node() -> Iterator[Node]:
    rclpy.init(args=[])
    node = rclpy.create_node('house', use_global_arguments=False)
    yield node
    shut_down(node)


def _spin_until(node: Node, jobs: list[Any], count: int) -> None:
    executor = EventsExecutor()
    executor.add_node(node)
    end_s = monotonic() + 60.0
    while len(jobs) < count and monotonic() < end_s:
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()


def test_a_job_is_done_once_a_second_right_behind_a_period(node: Node) -> None:
    once_per_second = OncePerSecond(node)
    within, jobs = [], []

    def period() -> None:
        within.append(True)
        once_per_second.period_ended()
        within.clear()

    once_per_second.add(lambda: jobs.append((monotonic(), bool(within))))
    node.create_timer(PERIOD_S, period, clock=Clock(clock_type=ClockType.STEADY_TIME))
    _spin_until(node, jobs, 3)
    times, behind_a_period = zip(*jobs, strict=True)
    assert len(jobs) == 3
    assert all(behind_a_period)
    assert min(later - earlier for earlier, later in pairwise(times)) > 0.9 * INTERVAL_S


def test_a_life_of_less_than_a_second_has_a_start_and_an_end(node: Node) -> None:
    once_per_second = OncePerSecond(node)
    stages: list[str] = []
    once_per_second.add(lambda: stages.append(once_per_second.stage))
    once_per_second.start()
    once_per_second.finish()
    assert stages == ['start', 'end']


def test_jobs_are_done_in_their_order_without_periods_too(node: Node) -> None:
    once_per_second = OncePerSecond(node)
    jobs: list[tuple[str, float]] = []
    begun_s = monotonic()
    for name in ('first', 'second'):
        once_per_second.add(lambda name=name: jobs.append((name, monotonic() - begun_s)))
    _spin_until(node, jobs, 4)
    names, times = zip(*jobs, strict=True)
    assert names == ('first', 'second') * 2
    assert times[0] > 1.8 * INTERVAL_S
    assert times[2] - times[0] > 0.9 * INTERVAL_S
