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

from collections import deque
from statistics import median_low

WATCH = 1000
"""Periods after which a place is judged at the latest."""
LOOK = 20
"""Periods from one look at the place to the next."""
SAME_RATE = 0.1
"""Share by which there may be more or fewer inputs than periods."""
NEAREST_S = 0.0003
STRIDE_S = 0.0004
PLACES = range(6)
"""From the nearest to the input on, one stride after the other."""
WRONG_S = 0.00005
"""A period that is off by so much began or ended late, since something else was waited for."""
ON_TIME_S = 0.0002
"""By how much the input may be off when the timer is moved behind it."""
OFTEN = 0.01
"""Of the periods: 99 % of them shall be right."""
MUCH_BETTER = 0.5
"""Of the share of wrong periods here, what another place may promise at most to be worth it."""
KEEPING = 0.7
"""Weight of what is known of a place, beside what is seen there now."""
FADING = 0.95
"""What is left of a share after `WATCH` periods elsewhere."""


class PhaseLock:
    """
    Decides when a timer is to begin its periods anew, from when it fired and its input came.

    A place is left when `OFTEN` of `WATCH` periods were wrong there, however early that is plain.
    The share of wrong ones is kept, fading, and the timer stays until another place promises much
    less; a place that was never tried promises none.
    """

    def __init__(self, period_s: float, early_s: float = 0.0) -> None:
        """
        Begin to watch.

        Args:
            period_s: of the timer, s; of the input, too: while rates differ nothing is done.
            early_s: how long before a tick is due there is no more time for an input, s.

        """
        self._period_s = period_s
        self._nearest_s = NEAREST_S + early_s
        self._arrived_s = self._ticked_s = self._due_s = self._expected_s = self._moved_s = 0.0
        self._wrong: dict[int | None, float] = {}
        self._sent: int | None = None
        self._wanted: int | None = None
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
        if self._wanted is None or not self._is_on_time(now_s):
            return None
        wait_s = self._nearest_s + STRIDE_S * self._wanted
        self._sent, self._wanted = self._wanted, None
        self._watch()
        return wait_s

    def ticked(self, now_s: float, due_s: float) -> None:
        """
        Note that the timer has fired.

        Args:
            now_s: when, s.
            due_s: when it was to fire by its schedule, s.

        """
        if self._ticks > 0 and is_wrong(now_s - self._ticked_s, self._period_s):
            self._wrong_periods += 1
        self._ticks += 1
        self._ticked_s, self._due_s = now_s, due_s
        self._arrivals_s.append(self._arrived_s)
        if self._ticks % LOOK == 0:
            self._look()

    def moved(self, now_s: float) -> bool:
        """
        Note that the timer begins its periods anew.

        Args:
            now_s: when, s.

        Returns:
            Whether it is to fire at once: whether all its moves together, this one too, take it
            less far from where it began if it does. An input that is itself moved to and fro
            would lose a period at every turn.

        """
        self._moved_s += now_s - (self._due_s + self._period_s)
        fires = self._moved_s > -0.5 * self._period_s
        if not fires:
            self._moved_s += self._period_s
        return fires

    def _is_on_time(self, arrived_s: float) -> bool:
        """Whether an input came when it mostly does: behind one that is late no place is known."""
        return abs(_off_by(arrived_s - self._expected_s, self._period_s)) < ON_TIME_S

    def _watch(self) -> None:
        self._arrivals = self._ticks = self._wrong_periods = 0
        self._arrivals_s: deque[float] = deque(maxlen=LOOK)

    def _look(self) -> None:
        """Judge the place where the timer is, and move it if another one is worth it."""
        if abs(self._arrivals / self._ticks - 1.0) > SAME_RATE:
            self._wanted = None
            self._wrong.clear()
            self._watch()
            return
        place = self._place()
        # who moves it may be late as well
        if place not in PLACES and place - 1 != self._sent:
            self._wanted = self._best()
            return
        if self._wrong_periods > OFTEN * WATCH or self._ticks >= WATCH:
            wrong = self._wrong_periods / self._ticks
            # one bad spell of the machine is not the place's fault
            wrong += KEEPING * (self._wrong.get(place, wrong) - wrong)
            fading = FADING ** (self._ticks / WATCH)
            self._wrong = {known: fading * share for known, share in self._wrong.items()}
            # also of where it was sent, or that would be tried again and again without a result
            self._wrong |= dict.fromkeys((place, self._sent), wrong)
            best = self._best()
            if wrong > OFTEN and self._wrong.get(best, 0.0) < MUCH_BETTER * wrong:
                self._wanted = best
            self._watch()

    def _best(self) -> int:
        return min(PLACES, key=lambda place: self._wrong.get(place, 0.0))

    def _place(self) -> int:
        """Tell where behind the input, which is on time more often than not, the timer is due."""
        last_s = self._arrivals_s[-1]
        later_s = (_off_by(arrived_s - last_s, self._period_s) for arrived_s in self._arrivals_s)
        self._expected_s = last_s + median_low(later_s)
        behind_s = (self._due_s - self._expected_s) % self._period_s
        return round((behind_s - self._nearest_s) / STRIDE_S)


def is_wrong(between_s: float, period_s: float) -> bool:
    """
    Tell whether a period of a timer was too long or too short.

    Args:
        between_s: from one of its ticks to the next one seen, s.
        period_s: s.

    Returns:
        Whether that is off by more than `WRONG_S`, whether other periods are missing or not.

    """
    return abs(_off_by(between_s, period_s)) > WRONG_S


def _off_by(time_s: float, period_s: float) -> float:
    """Tell how far a time is from the nearest multiple of a period, s."""
    return (time_s + 0.5 * period_s) % period_s - 0.5 * period_s
