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

"""What is noticed of one tracker while it is heard: how often, how far off, whether it hangs."""

from __future__ import annotations

from collections import Counter, deque
import math
from typing import NamedTuple

from handover_dmp.common.arrays import Point
from handover_dmp.tracking.tracker import Tracker

# So many poses of it are judged together, whether noise explains how far off they are.
_POSES_TOGETHER = 8.0
_DISAGREES, _AGREES = 6.0, 2.0
_MAX_SURPRISE = 30.0
_PATH_S = 4.0
_PATH_STEP_S = 0.03
_LASTING = 10


class TrackerReport(NamedTuple):
    """
    How a tracker does, since it was last asked for.

    Attributes:
        name: of the tracker.
        rate_hz: poses a second, by their stamps, those that were refused among them.
        age_s: of the newest pose that was used, s; infinite before any.
        bias_m: (3,) of its poses, m.
        refused: share of its poses that were not used.
        distance_m: of its poses from the hand, root mean square, the bias taken off, m; NaN where
            there was no hand to compare them with.
        fault: why it is left out, or what is wrong with it; empty if all is well.

    """

    name: str
    rate_hz: float
    age_s: float
    bias_m: Point
    refused: float
    distance_m: float
    fault: str


class TrackerWatch:
    """
    Keeps in mind how a tracker did.

    Attributes:
        tracker: what was told of it.
        rejected: how many of its poses were not used, ever, by reason.
        disagrees: whether its poses are further from the hand than noise explains.
        clock_off_s: by how much its clock is off, s; 0 while it is not.
        path: stamp (s) and place (m) of its poses, now and then, of the last seconds.
        min_age_s: least age of its poses when they came, s.
        used_s: stamp of its newest pose that was used, s.
        used_at_s: when that was, s.
        outliers: how many poses it has told in a row from where the hand is not, after it had it.

    """

    def __init__(self, tracker: Tracker) -> None:
        """
        Begin without a pose.

        Args:
            tracker: what is told of it.

        """
        self.tracker = tracker
        self.rejected: Counter[str] = Counter()
        self.heard = 0
        self._refused = 0
        self.used_s = -math.inf
        self._newest_s = -math.inf
        self._reported_s = -math.inf
        self._squares = 0.0
        self._compared = 0
        self.forget()

    def forget(self) -> None:
        """Forget the hand; the counts go on."""
        self.same: tuple[float, float, Point] | None = None
        self.used_at_s = -math.inf
        self.outliers = 0
        self.disagrees = False
        self.clock_off_s = 0.0
        self.surprise = 1.0
        self.min_age_s = math.inf
        self.path: deque[tuple[float, Point]] = deque()

    @property
    def unchanged_s(self) -> float:
        """For how long its poses have been the same to the last bit, by their stamps, s."""
        return 0.0 if self.same is None else self.same[1] - self.same[0]

    @property
    def is_left_out(self) -> bool:
        """Whether its poses are not used, however near they lie."""
        return self.disagrees or self.clock_off_s != 0.0

    def see(self, stamp: float, place: Point, now_s: float | None) -> None:
        """Take note of a pose that is one, at a stamp and now in s, m."""
        since = stamp if self.same is None or self.same[2] != place else self.same[0]
        self.same = (since, max(since, stamp), place)
        if now_s is not None:
            self.min_age_s = min(self.min_age_s, now_s - stamp)
        if self.path and stamp < self.path[-1][0] - _PATH_S:
            # its clock was set back
            self.path.clear()
        if not self.path or stamp >= self.path[-1][0] + _PATH_STEP_S:
            self.path.append((stamp, place))
            while self.path[0][0] < stamp - _PATH_S:
                self.path.popleft()

    def judge(self, surprise: float) -> None:
        """Take note of how much more a pose was off than noise explains, squared."""
        self.surprise += (min(surprise, _MAX_SURPRISE) - self.surprise) / _POSES_TOGETHER
        self.disagrees = self.surprise > (_AGREES if self.disagrees else _DISAGREES)

    def count(self, reason: str, stamp: float, distance: float) -> None:
        """Count a pose, refused for a reason or not, at a stamp in s, so far (m) from the hand."""
        self.heard += 1
        if reason:
            self._refused += 1
            self.rejected[reason] += 1
        if math.isfinite(stamp):
            self._newest_s = max(self._newest_s, stamp)
        if math.isfinite(distance):
            self._squares += distance * distance
            self._compared += 1

    def report(self, age_s: float, bias_m: Point) -> TrackerReport:
        """Sum up, with age (s) and bias (m) as they are, and begin anew."""
        elapsed = self._newest_s - self._reported_s
        known = math.isfinite(elapsed) and elapsed > 0.0
        report = TrackerReport(
            self.tracker.name,
            self.heard / elapsed if known else 0.0,
            age_s,
            bias_m,
            self._refused / self.heard if self.heard else 0.0,
            math.sqrt(self._squares / self._compared) if self._compared else math.nan,
            self._fault(),
        )
        self._reported_s = self._newest_s
        self.heard = self._refused = self._compared = 0
        self._squares = 0.0
        return report

    def _fault(self) -> str:
        name = self.tracker.name
        if self.clock_off_s:
            late = 'late' if self.clock_off_s > 0.0 else 'early'
            return (
                f'{name} stamps its poses {abs(self.clock_off_s):.2f} s too {late}, left out: set '
                f'its clock, or {name}.delay_s'
            )
        if self.disagrees or self.outliers >= _LASTING:
            return f'{name} is further from the hand than its noise explains, left out'
        return ''
