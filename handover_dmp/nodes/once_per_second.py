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
What a node does once a second beside its work, in the pause between two periods.

Also when it starts and before it ends, so that a run that is over within a second lacks nothing.

A timer of its own would keep its place relative to the timer of the periods, since a second is a
whole number of them: where the two coincide, they do so every second, and one period in two
hundred is late, the next one early.
"""

from __future__ import annotations

from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

INTERVAL_S = 1.0


class OncePerSecond:
    """
    Does its jobs once a second, right after a period; without periods, when it is time.

    Attributes:
        stage: of the node's life: `start`, `running` or `end`.

    """

    def __init__(self, node: Node) -> None:
        """
        Begin without jobs.

        Args:
            node: whose executor does them.

        """
        self.stage = 'start'
        self._jobs: list[Callable[[], object]] = []
        self._due = False
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(INTERVAL_S, self._remind, clock=clock)

    def add(self, job: Callable[[], object]) -> None:
        """
        Have one thing more done.

        Args:
            job: does it, in much less than a period.

        """
        self._jobs.append(job)

    def start(self) -> None:
        """Do all jobs for the first time, when the node is complete."""
        self._do_all()
        self.stage = 'running'

    def finish(self) -> None:
        """Do all jobs for the last time."""
        self.stage = 'end'
        self._do_all()

    def period_ended(self) -> None:
        """Do what is due."""
        if self._due:
            self._due = False
            # so that the next reminder, too, comes in such a pause
            self._timer.reset()
            self._do_all()

    def _do_all(self) -> None:
        for job in self._jobs:
            job()

    def _remind(self) -> None:
        # what no period has done by now
        self.period_ended()
        self._due = True
