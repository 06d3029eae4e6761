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
The clock of a recording whose people wait: it slows down, stops, and continues.

Its rate is 1 except for ramps of 0.2 s to and from a standstill, which is exactly at the given
time. So a played-back person moves with a continuous velocity, and otherwise exactly as recorded.
"""

from __future__ import annotations

from bisect import bisect_right
import math
from typing import NamedTuple

RAMP_S = 0.2
"""Time from full rate to a standstill, s."""
_ROUNDING_S = 1e-9


class _Piece(NamedTuple):
    """A piece with a linear change of the rate: its start, and the reading and rate there."""

    since_s: float
    at_s: float
    rate: float
    change: float


class WaitingClock:
    """
    Time of a recording as a function of time of day; it stands still at the beginning.

    All times in s. Past readings never change: a command to wait or to continue only affects the
    future.
    """

    def __init__(self, start_s: float, wait_s: float = math.inf) -> None:
        """
        Start at 0, from a standstill.

        Args:
            start_s: time of the recording at 0.
            wait_s: time of the recording at which it stands still; infinite: it runs on.

        """
        self._pieces = [_Piece(0.0, start_s, 0.0, 0.0)]
        self.go_on(0.0, wait_s)

    def recorded(self, time_s: float) -> float:
        """
        Return the reading of the clock.

        Args:
            time_s: time of day; before 0 the reading is that at 0.

        Returns:
            The time of the recording.

        """
        return self._state(max(time_s, 0.0))[0]

    def rate(self, time_s: float) -> float:
        """Return its rate at a time of day, 0 to 1."""
        return self._state(max(time_s, 0.0))[1]

    def go_on(self, time_s: float, wait_s: float = math.inf) -> None:
        """
        Change the time of the next standstill.

        Args:
            time_s: time of day from which this applies.
            wait_s: time of the recording; infinite: it runs on. If it is too late to stop there,
                it stops as soon as it can.

        """
        at_s, rate = self._state(time_s)
        self._pieces = [piece for piece in self._pieces if piece.since_s < time_s]
        left_s = wait_s - at_s
        if left_s <= _braking(rate):
            # too late to stop there
            self._stop(time_s, at_s, rate, _braking(rate))
            return
        # the maximum rate from which it still stops in time
        peak = min(1.0, math.sqrt(left_s / RAMP_S + 0.5 * rate * rate))
        since_s, at_s = self._add(time_s, at_s, rate, 1.0 / RAMP_S, RAMP_S * (peak - rate))
        if math.isinf(wait_s):
            self._add(since_s, at_s, 1.0, 0.0, 0.0)
            return
        cruise_s = max(wait_s - at_s - _braking(peak), 0.0) / peak
        since_s, at_s = self._add(since_s, at_s, peak, 0.0, cruise_s)
        self._stop(since_s, at_s, peak, wait_s - at_s)

    def when(self, recorded_s: float) -> float:
        """
        Return the time of day for a time of the recording.

        Args:
            recorded_s: time of the recording.

        Returns:
            Time of day; infinite if it will wait before.

        """
        for piece, after in zip(self._pieces, [*self._pieces[1:], None], strict=True):
            left_s = recorded_s - piece.at_s
            if after is not None and after.at_s < recorded_s - _ROUNDING_S:
                continue
            if left_s <= _ROUNDING_S:
                return piece.since_s
            if piece.change == 0.0:
                return piece.since_s + left_s / piece.rate if piece.rate > 0.0 else math.inf
            root = piece.rate * piece.rate + 2.0 * piece.change * left_s
            if root >= 0.0 or after is not None:
                return piece.since_s + (math.sqrt(max(root, 0.0)) - piece.rate) / piece.change
        return math.inf

    def _stop(self, since_s: float, at_s: float, rate: float, left_s: float) -> None:
        """Stop within the remaining time of the recording."""
        if left_s > _ROUNDING_S:
            duration_s = 2.0 * left_s / rate
            since_s, at_s = self._add(since_s, at_s, rate, -rate / duration_s, duration_s)
        self._pieces.append(_Piece(since_s, at_s, 0.0, 0.0))

    def _add(
        self, since_s: float, at_s: float, rate: float, change: float, duration_s: float
    ) -> tuple[float, float]:
        """Add a piece; return the beginning of the next one, and the reading there."""
        self._pieces.append(_Piece(since_s, at_s, rate, change))
        end_s = at_s + (rate + 0.5 * change * duration_s) * duration_s
        return since_s + duration_s, end_s

    def _state(self, time_s: float) -> tuple[float, float]:
        number = bisect_right(self._pieces, time_s, key=lambda piece: piece.since_s) - 1
        since_s, at_s, rate, change = self._pieces[max(number, 0)]
        elapsed_s = max(time_s - since_s, 0.0)
        return at_s + (rate + 0.5 * change * elapsed_s) * elapsed_s, rate + change * elapsed_s


def _braking(rate: float) -> float:
    """Return by how much the reading advances while the clock stops, s."""
    return 0.5 * RAMP_S * rate * rate
