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

"""Monitoring of one tracker: its rate, its distance from the hand, whether it is frozen."""

from __future__ import annotations

from collections import deque
import math
from typing import NamedTuple

from handover_dmp.common.arrays import Point
from handover_dmp.tracking.tracker import Tracker

# Number of poses that are compared with their noise together.
_POSES_TOGETHER = 8.0
_DISAGREES, _AGREES = 6.0, 2.0
_MAX_SURPRISE = 30.0
_PATH_S = 4.0
_PATH_STEP_S = 0.03
_LASTING = 10


class TrackerReport(NamedTuple):
    """
    Report on a tracker since the last report, or once more the last one if no pose was due since.

    Attributes:
        name: name of the tracker.
        rate_hz: poses per second, by their stamps, including refused ones.
        age_s: age of the newest pose used, s; infinite before any.
        bias_m: (3,) bias of its poses, m.
        refused: share of refused poses.
        distance_m: root-mean-square distance of its poses from the hand, without the bias, m; NaN
            if there was no hand to compare with.
        fault: why it is excluded, or its fault; empty if there is none.

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
    Collects statistics of a tracker.

    Attributes:
        tracker: its parameters.
        disagrees: whether its poses are farther from the hand than noise explains.
        clock_off_s: offset of its clock, s; 0 if none was found.
        path: stamp (s) and position (m) of a selection of its poses of the last seconds.
        min_age_s: minimum age of its poses at arrival, s.
        used_s: stamp of its newest pose used, s.
        used_at_s: time of its use, s.
        outliers: number of consecutive outliers since it last saw the hand.
        left_s: stamp of the first outlier since its newest pose used, s; -∞ if there is none.

    """

    def __init__(self, tracker: Tracker) -> None:
        """
        Begin without a pose.

        Args:
            tracker: its parameters.

        """
        self.tracker = tracker
        self.heard = 0
        self._refused = 0
        self.used_s = -math.inf
        self._newest_s = -math.inf
        self._reported_s = -math.inf
        self._squares = 0.0
        self._compared = 0
        self._intervals = 0
        self._report: TrackerReport | None = None
        self.forget()

    def forget(self) -> None:
        """Forget the hand; the counts are kept."""
        self.same: tuple[float, float, Point] | None = None
        self.used_at_s = -math.inf
        self.outliers = 0
        self.left_s = -math.inf
        self.disagrees = False
        self.clock_off_s = 0.0
        self.surprise = 1.0
        self.min_age_s = math.inf
        self.path: deque[tuple[float, Point]] = deque()

    @property
    def unchanged_s(self) -> float:
        """Time for which its poses have been bitwise equal, by their stamps, s."""
        return 0.0 if self.same is None else self.same[1] - self.same[0]

    @property
    def is_left_out(self) -> bool:
        """Whether its poses are excluded, even if they are close to the hand."""
        return self.disagrees or self.clock_off_s != 0.0

    def see(self, stamp: float, place: Point, now_s: float | None) -> None:
        """Record a valid pose, m, with its stamp and the present time, s."""
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
        """Record the squared distance of a pose relative to that for noise alone."""
        self.surprise += (min(surprise, _MAX_SURPRISE) - self.surprise) / _POSES_TOGETHER
        self.disagrees = self.surprise > (_AGREES if self.disagrees else _DISAGREES)

    def count(self, reason: str, stamp: float, distance: float) -> None:
        """Count a pose with its reason for refusal (or none), stamp, s, and distance, m."""
        self.heard += 1
        if reason:
            self._refused += 1
        if math.isfinite(stamp):
            if math.isfinite(self._newest_s):
                self._intervals += 1
            else:
                self._reported_s = stamp
            self._newest_s = max(self._newest_s, stamp)
        if math.isfinite(distance):
            self._squares += distance * distance
            self._compared += 1

    def report(self, age_s: float, bias_m: Point) -> TrackerReport:
        """Return the report with the given age (s) and bias (m), and begin the next one."""
        last = self._report
        if last and last.rate_hz and not self.heard and age_s - last.age_s < 1.0 / last.rate_hz:
            # no pose was due since: a node that ends reports once more, maybe at once
            return last._replace(age_s=age_s, bias_m=bias_m, fault=self._fault())
        elapsed = self._newest_s - self._reported_s
        self._report = TrackerReport(
            self.tracker.name,
            self._intervals / elapsed if elapsed > 0.0 else 0.0,
            age_s,
            bias_m,
            self._refused / self.heard if self.heard else 0.0,
            math.sqrt(self._squares / self._compared) if self._compared else math.nan,
            self._fault(),
        )
        self._reported_s = self._newest_s
        self.heard = self._refused = self._compared = self._intervals = 0
        self._squares = 0.0
        return self._report

    def _fault(self) -> str:
        name = self.tracker.name
        if self.clock_off_s:
            late = 'late' if self.clock_off_s > 0.0 else 'early'
            return (
                f'{name} stamps its poses {abs(self.clock_off_s):.2f} s too {late}, left out: '
                f'correct its clock, or {name}.delay_s'
            )
        if self.disagrees or self.outliers >= _LASTING:
            return f'{name} is farther from the hand than its noise explains, left out'
        return ''
