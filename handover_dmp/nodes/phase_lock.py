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
arrival, and goes on when the input stops; moving the timer once gives it the short wait as well.
"""

from __future__ import annotations

from statistics import median
from time import perf_counter, sleep

from rclpy.timer import Timer

WATCHED = 40
SAME_RATE = 3
SHORTEST_S = 0.0002
LONGEST_S = 0.0015
WANTED_S = 0.0006


class PhaseLock:
    """Moves a timer so that it fires some tenths of a millisecond after its input."""

    def __init__(self, timer: Timer) -> None:
        """
        Take the timer.

        Args:
            timer: of the same rate as the input; while the rates differ it is left alone.

        """
        self._timer = timer
        self._arrived_s = 0.0
        self._arrivals = 0
        self._ages_s: list[float] = []
        self._off = False

    def arrived(self) -> None:
        """Note that the input has come; move the timer if it is off."""
        self._arrived_s = perf_counter()
        self._arrivals += 1
        if self._off:
            self._off = False
            sleep(WANTED_S)
            self._timer.reset()

    def ticked(self) -> None:
        """Note that the timer has fired."""
        self._ages_s.append(perf_counter() - self._arrived_s)
        if len(self._ages_s) < WATCHED:
            return
        same_rate = abs(self._arrivals - WATCHED) <= SAME_RATE
        self._off = same_rate and not SHORTEST_S < median(self._ages_s) < LONGEST_S
        self._ages_s.clear()
        self._arrivals = 0
