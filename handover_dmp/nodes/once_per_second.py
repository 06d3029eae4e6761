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
Work of a node that is due once a second, done in the pause between two periods.

It is also done at the start and before the end, so that runs of less than a second lack nothing.

A separate timer would keep its phase relative to the timer of the periods, since a second is a
whole number of them: if the two coincided, they would do so every second, and one period in two
hundred would be late, the next one early.
"""

from __future__ import annotations

from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

INTERVAL_S = 1.0


class OncePerSecond:
    """
    Does its jobs once a second, right after a period; without periods, on a timer.

    Attributes:
        stage: stage of the node: `start`, `running` or `end`.

    """

    def __init__(self, node: Node) -> None:
        """
        Start without jobs.

        Args:
            node: node whose executor does them.

        """
        self.stage = 'start'
        self._jobs: list[Callable[[], object]] = []
        self._due = False
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(INTERVAL_S, self._remind, clock=clock)

    def add(self, job: Callable[[], object]) -> None:
        """
        Add a job.

        Args:
            job: function that takes much less than a period.

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
        """Do the jobs that are due."""
        if self._due:
            self._due = False
            # so that the next reminder also comes in such a pause
            self._timer.reset()
            self._do_all()

    def _do_all(self) -> None:
        for job in self._jobs:
            job()

    def _remind(self) -> None:
        # jobs that no period has done by now
        self.period_ended()
        self._due = True
