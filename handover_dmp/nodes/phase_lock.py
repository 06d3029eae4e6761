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
A timer that fires shortly after its input has come, without depending on it.

Two timers of one rate in two processes keep whatever offset they started with, so that an input
may wait for almost a period. A loop on its own timer has less jitter than one that answers on
arrival, and goes on when the input stops; moving the timer gives it the short wait as well. It is
moved on if it falls where other messages come, since it would have to wait for those.
"""

from __future__ import annotations

from collections.abc import Callable
from statistics import median
from time import perf_counter, sleep
from typing import Any

from rclpy.timer import Timer

WATCHED = 40
LONGEST_WATCH = 2000
SAME_RATE = 0.1
SHORTEST_S = 0.0003
LONGEST_S = 0.0025
STRIDE_S = 0.0004
AT_ONCE_S = 0.00005
"""A timer that fires so soon after a message was dealt with has probably waited for that."""
OFTEN = 0.1


class PhaseLock:
    """Moves a timer so that it fires soon after its input, when nothing else is to be done."""

    def __init__(self) -> None:
        """Begin without a timer."""
        self._timer: Timer | None = None
        self._watch = WATCHED
        self._arrived_s = 0.0
        self._arrivals = 0
        self._busy_until_s = 0.0
        self._waited = 0
        self._ages_s: list[float] = []
        self._wanted_s: float | None = None

    def drive(self, timer: Timer) -> None:
        """
        Take the timer.

        Args:
            timer: of the same rate as the input; while the rates differ it is left alone.

        """
        self._timer = timer

    def watched(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        """
        Note when a callback has ended.

        Args:
            callback: of a subscription.

        Returns:
            The same with that.

        """

        def noted(message: Any) -> None:
            callback(message)
            self._busy_until_s = perf_counter()

        return noted

    def arrived(self) -> None:
        """Note that the input has come; move the timer if it is to be moved."""
        self._arrived_s = perf_counter()
        self._arrivals += 1
        if self._wanted_s is not None and self._timer is not None:
            sleep(self._wanted_s)
            self._wanted_s = None
            self._timer.reset()

    def ticked(self) -> None:
        """Note that the timer has fired."""
        now_s = perf_counter()
        self._ages_s.append(now_s - self._arrived_s)
        self._waited += now_s - self._busy_until_s < AT_ONCE_S
        if len(self._ages_s) < self._watch:
            return
        age_s = median(self._ages_s)
        same_rate = abs(self._arrivals / self._watch - 1.0) < SAME_RATE
        waits = self._waited > OFTEN * self._watch
        self._ages_s.clear()
        self._arrivals = self._waited = 0
        too_far = not SHORTEST_S < age_s < LONGEST_S
        if same_rate and (too_far or waits):
            self._wanted_s = STRIDE_S + (SHORTEST_S if too_far else age_s)
            # every move costs a period of another length, so there are ever fewer of them
            self._watch = min(2 * self._watch, LONGEST_WATCH)
