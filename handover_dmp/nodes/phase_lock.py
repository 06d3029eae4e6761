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
arrival, and goes on when the input stops; moving the timer gives it the short wait as well. Where
the timer is often late, since something else of the same rate has the processor then, other
places behind the input are tried, and the best one is kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter, sleep

import numpy as np
from rclpy.timer import Timer

WATCH = 1000
LOOK = 20
SAME_RATE = 0.1
NEAREST_S = 0.0003
STRIDE_S = 0.0004
PLACES = range(6)
"""From the nearest to the input on, one stride after the other."""
LATE_S = 0.00005
"""Beyond its own schedule, a timer that fires so late has waited for something."""
ON_TIME_S = 0.0002
"""By how much the input may be off when the timer is moved behind it."""
UNDISTURBED = 0.25
"""Quantile of times behind the schedule that stands for a timer which waits for nothing."""
OFTEN = 0.005
"""Of the ticks: each that is late makes two periods wrong, and 99 % of them shall be right."""
MUCH_BETTER = 0.5
FADING = 0.9
"""What is left of a share after `WATCH` periods elsewhere."""


class PhaseLock:
    """
    Decides when a timer is to begin its periods anew, from when it fired and its input came.

    A place is left when it was late in `OFTEN` of `WATCH` periods, however early that is plain.
    The share of late ones is kept, fading, and the timer stays until another place promises much
    less; a place that was never tried promises none.
    """

    def __init__(self, period_s: float) -> None:
        """
        Begin to watch.

        Args:
            period_s: of the timer, s; of the input, too: while rates differ nothing is done.

        """
        self._period_s = period_s
        self._arrived_s = self._ticked_s = self._usual_age_s = 0.0
        self._late: dict[int, float] = {}
        self._wanted_s: float | None = None
        self._watch()

    def arrived(self, now_s: float) -> float | None:
        """
        Note that the input has come.

        Args:
            now_s: when, s.

        Returns:
            How long after that the timer is to fire, and begin its periods anew, s; None: it is
            well where it is.

        """
        self._arrived_s = now_s
        self._arrivals += 1
        if self._wanted_s is None or not self._is_on_time(now_s):
            return None
        wanted_s, self._wanted_s = self._wanted_s, None
        self._watch()
        return wanted_s

    def ticked(self, now_s: float) -> None:
        """
        Note that the timer has fired.

        Args:
            now_s: when, s.

        """
        self._ticked_s = now_s
        self._ticks_s.append(now_s)
        self._ages_s.append(now_s - self._arrived_s)
        if len(self._ticks_s) % LOOK == 0:
            self._look()

    def is_due(self, now_s: float) -> bool:
        """
        Tell whether a timer that is moved to now is to fire at once.

        Args:
            now_s: now, s.

        Returns:
            Whether the nearest of its old periods has not begun yet, so that there are as many
            periods as before.

        """
        return now_s - self._ticked_s > 0.5 * self._period_s

    def _is_on_time(self, arrived_s: float) -> bool:
        """Whether an input came when it mostly does: behind one that is late no place is known."""
        behind_s = arrived_s - self._ticked_s + self._usual_age_s
        half_s = 0.5 * self._period_s
        return abs((behind_s + half_s) % self._period_s - half_s) < ON_TIME_S

    def _watch(self) -> None:
        self._arrivals = 0
        self._ticks_s: list[float] = []
        self._ages_s: list[float] = []

    def _look(self) -> None:
        """Judge the place where the timer is, and move it if another one is worth it."""
        ticks = len(self._ticks_s)
        if abs(self._arrivals / ticks - 1.0) > SAME_RATE:
            self._wanted_s = None
            self._late.clear()
            self._watch()
            return
        # of those that were not late, or a place would be taken for the next one
        self._usual_age_s = float(np.quantile(self._ages_s[-LOOK:], UNDISTURBED))
        place = round((self._usual_age_s - NEAREST_S) / STRIDE_S)
        best = min(PLACES, key=lambda other: self._late.get(other, 0.0))
        if place not in PLACES:
            self._wanted_s = NEAREST_S + STRIDE_S * best
            return
        late = share_of_late(self._ticks_s, self._period_s)
        if late * ticks > OFTEN * WATCH or ticks >= WATCH:
            fading = FADING ** (ticks / WATCH)
            self._late = {known: fading * share for known, share in self._late.items()}
            self._late[place] = late
            if late > OFTEN and self._late.get(best, 0.0) < MUCH_BETTER * late:
                self._wanted_s = NEAREST_S + STRIDE_S * best
            self._watch()


def share_of_late(ticks_s: Sequence[float], period_s: float) -> float:
    """
    Tell how often a timer fired later than it does undisturbed.

    Args:
        ticks_s: when it fired, s.
        period_s: s.

    Returns:
        Share of the ticks more than `LATE_S` behind the first quarter of them, each in its own
        period, whether periods are missing between them or not.

    """
    ticks = np.asarray(ticks_s)
    offsets = ticks - ticks[0] - period_s * np.arange(len(ticks))
    # around the middle one, so that none lies on the seam of two periods; more are late than early
    offsets -= np.quantile(offsets, 0.5, method='lower')
    offsets = (offsets + period_s / 4.0) % period_s
    return float(np.mean(offsets > np.quantile(offsets, UNDISTURBED) + LATE_S))


class LockedTimer:
    """A timer that its phase lock keeps behind its input."""

    def __init__(self, timer: Timer | None, period_s: float) -> None:
        """
        Take the timer.

        Args:
            timer: to be moved; None if there is none, or it is to be left alone.
            period_s: its period, s.

        """
        self._timer = timer
        self._lock = PhaseLock(period_s)

    def arrived(self) -> None:
        """Note that the input has come; move the timer if that is worth it."""
        if self._timer is not None:
            wait_s = self._lock.arrived(perf_counter())
            if wait_s is not None:
                sleep(wait_s)
                self._timer.reset()
                if self._lock.is_due(perf_counter()):
                    self._timer.callback()

    def ticked(self) -> None:
        """Note that the timer has fired."""
        if self._timer is not None:
            self._lock.ticked(perf_counter())
