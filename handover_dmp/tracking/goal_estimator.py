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
Estimate of position and velocity of the partner's hand, from real streams of poses.

A Kalman filter of the hand (`HandTrack`) uses the poses of one or several trackers. The estimator
adds what real streams need: invalid and repeated poses are dropped, outliers are rejected, and
the result is predicted to the time of the query.

When a lost hand is seen again, it is accepted at once if it can have moved there meanwhile, and
elsewhere only after many consistent poses: a lasting outlier is still an outlier. While another
tracker still sees the hand, a tracker that has left it is not used at all.

Several trackers check each other. While another one sees the hand, a tracker is excluded and named
if its poses stay bitwise equal, if they are farther from the hand than its noise explains, or if
its clock differs from that of a better one.

Measured with the default parameters, for one tracker (checked by the tests):

    rate of the poses, Hz                            200     120      60      24
    noise of the position / noise of a pose         0.63    0.73    0.85    0.96
    noise of the speed, m/s for 1 mm on a pose     0.037   0.039   0.041   0.036
    lag at constant speed, mm                          0       0       0       0
    lag at 1 m/s², mm                              0.085   0.094   0.096   0.070
    lag of the speed, ms                              13      14      15      17
    reaches of the synthetic takes, 0.5 mm noise, poses 30 ms old, queried at 200 Hz:
    error of the position, mm rms                    2.0     2.4     2.9     4.4
    error of the newest pose itself, mm rms         12.6    14.0    15.8    21.5
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
import math
from typing import NamedTuple

from handover_dmp.common.arrays import Point
from handover_dmp.common.errors import UsageError
from handover_dmp.mocap.no_pose import no_pose
from handover_dmp.tracking.hand_filter import HandFilter
from handover_dmp.tracking.hand_track import HandTrack
from handover_dmp.tracking.tracker import Tracker
from handover_dmp.tracking.tracker_watch import TrackerReport, TrackerWatch

_FUTURE_S = 0.005
_MAX_COORDINATE_M = 100.0
# Number of poses for which a hand must be seen again amid outliers, however close it is. A hand
# that was seen less often may have been an outlier itself.
_FEW_POSES = 3
_MAX_CANDIDATES = 4
# Interval of the comparison of clocks, and offset from which they count as different.
_CLOCKS_S = 1.0
_CLOCK_OFF_S = 0.05
_CLOCK_DEVIATIONS = 4.0


class HandEstimate(NamedTuple):
    """
    The hand at the time of the query.

    Attributes:
        position: x, y, z in m.
        velocity: x, y, z in m/s.
        stamp_s: time of the newest pose used, s, with the tracker's `delay_s` subtracted.
        deviation_m: standard deviation of the position on each axis according to the filter, m;
            it does not include a bias common to all trackers.

    """

    position: Point
    velocity: Point
    stamp_s: float
    deviation_m: float


class GoalEstimator:
    """
    Position and velocity of the hand, from stamped poses of one or several trackers.

    It handles any stream: poses that are invalid, repeated, late, out of order, outliers, from the
    future or from another clock are refused and counted.

    Attributes:
        parameters: parameters of the filter.
        trackers: the trackers.
        accepted: number of used poses since the beginning.
        rejected: number of refused poses since the beginning, by reason: those of `no_pose`,
            `frozen`, `future`, `repeated`, `late`, `outlier`; with several trackers also
            `disagrees`, `other_clock`.

    """

    def __init__(
        self, parameters: HandFilter | None = None, trackers: Sequence[Tracker] = ()
    ) -> None:
        """
        Make an estimator without a hand.

        Args:
            parameters: parameters of the filter; by default those of `config/handover.yaml`.
            trackers: the trackers; by default one with the parameters of `config/handover.yaml`.
                The first one is used if none is named.

        Raises:
            UsageError: two of them have the same name.

        """
        self.parameters = parameters or HandFilter()
        self.trackers = tuple(trackers) or (Tracker(),)
        self._numbers = {one.name: number for number, one in enumerate(self.trackers)}
        if len(self._numbers) < len(self.trackers):
            raise UsageError(f'two trackers have one name: {", ".join(self._numbers)}')
        self._watches = [TrackerWatch(one) for one in self.trackers]
        self.accepted = 0
        self.rejected: Counter[str] = Counter()
        self._track = HandTrack(self.parameters, self.trackers)
        self.reset()

    def __repr__(self) -> str:
        """Return a short description."""
        return f'GoalEstimator({self.accepted} poses, {sum(self.rejected.values())} refused)'

    def reset(self) -> None:
        """Forget the hand; counts and learnt biases are kept."""
        self._track = HandTrack(self.parameters, self.trackers, self._track)
        self._candidates: list[list[HandTrack]] = [[] for _ in self.trackers]
        self._now_s = -math.inf
        self._clocks_s = -math.inf
        for watch in self._watches:
            watch.forget()

    @property
    def is_disputed(self) -> bool:
        """Whether a tracker has left the hand, and none has seen it there since."""
        newest_s = self._track.poses[-1].stamp if self._track.poses else -math.inf
        return any(watch.left_s > newest_s for watch in self._watches)

    @property
    def unchanged_s(self) -> float:
        """Time for which the poses of every tracker have been bitwise equal, s."""
        return min(watch.unchanged_s for watch in self._watches)

    @property
    def timeout_s(self) -> float:
        """Age of the newest pose up to which no newer one is expected, s."""
        heard = self._watches if len(self._watches) == 1 else self._others(-1)
        return max((watch.tracker.timeout_s for watch in heard), default=0.0)

    def update(
        self,
        stamp_s: float,
        position: Sequence[float],
        now_s: float | None = None,
        orientation: Sequence[float] | None = None,
        covariance: Sequence[float] | None = None,
        tracker: str = '',
    ) -> str:
        """
        Process a pose.

        Args:
            stamp_s: time of the measurement, s.
            position: x, y, z in m.
            now_s: the present time on the clock of the stamps, s, if known; poses with later
                stamps are then refused.
            orientation: quaternion x, y, z, w, if the tracker has one; it is not followed, but
                some trackers mark invalid poses with it.
            covariance: (36,), m² and rad², likewise.
            tracker: name of its tracker; the first one if left out.

        Returns:
            The reason why it was refused, as in `rejected`; empty if it was used.

        """
        number = self._numbers[tracker] if tracker else 0
        watch = self._watches[number]
        told = watch.tracker
        x, y, z = position
        place = (float(x), float(y), float(z))
        stamp = float(stamp_s) - told.delay_s
        distance = math.nan
        reason = no_pose(place, orientation, covariance, self.parameters.max_deviation_m)
        if not reason:
            if told.bias != 'none':
                bx, by, bz = told.bias_m
                place = (place[0] - bx, place[1] - by, place[2] - bz)
            reason = self._refuse(number, stamp, place, now_s)
        if not reason:
            variance = told.variance
            if told.use_covariance and covariance is not None and any(covariance):
                variance = max(sum(covariance[k] for k in (0, 7, 14)) / 3.0, 1e-12) / told.weight
            reason, distance = self._follow(number, stamp, place, variance)
        watch.count(reason, stamp, distance)
        if reason:
            self.rejected[reason] += 1
            if reason == 'outlier' and watch.left_s == -math.inf:
                watch.left_s = stamp if now_s is None else min(stamp, now_s)
        else:
            self.accepted += 1
            watch.left_s = -math.inf
            watch.used_s = max(watch.used_s, stamp)
        return reason

    def refuse(self, reason: str, tracker: str = '') -> None:
        """
        Count a refused pose.

        Args:
            reason: the reason, one word.
            tracker: name of its tracker; the first one if left out.

        """
        self._watches[self._numbers[tracker] if tracker else 0].count(reason, math.nan, math.nan)
        self.rejected[reason] += 1

    def estimate(self, at_s: float) -> HandEstimate | None:
        """
        Return the hand at a time.

        Args:
            at_s: time of the query, s; usually the present, which compensates the age of the
                newest pose.

        Returns:
            The hand at that time; None before the first pose.

        """
        if not self._track.poses:
            return None
        newest = self._track.poses[-1]
        x, y, z, vx, vy, vz = newest.state[:6]
        limit = self.parameters.prediction_limit_s
        ahead = max(at_s - newest.stamp, -limit)
        ahead_s, share = ahead, 1.0
        if ahead > limit:
            # Uniform deceleration from full speed at `limit` to rest at twice that.
            braking = min(ahead - limit, limit)
            share = 1.0 - braking / limit if limit else 0.0
            ahead_s = limit + 0.5 * braking * (1.0 + share)
        return HandEstimate(
            (x + vx * ahead_s, y + vy * ahead_s, z + vz * ahead_s),
            (vx * share, vy * share, vz * share),
            newest.stamp,
            self._track.deviation(max(min(ahead, 2.0 * limit), 0.0)),
        )

    def report(self, now_s: float) -> list[TrackerReport]:
        """
        Report on each tracker since the last report.

        Args:
            now_s: the present time on the clock of the stamps, s.

        Returns:
            One report per tracker, in their order.

        """
        reports = []
        for number, watch in enumerate(self._watches):
            told, learnt = watch.tracker.bias_m, self._track.bias(number)
            if watch.tracker.bias == 'none':
                told = (0.0, 0.0, 0.0)
            bias = (told[0] + learnt[0], told[1] + learnt[1], told[2] + learnt[2])
            reports.append(watch.report(now_s - watch.used_s, bias))
        return reports

    def _refuse(self, number: int, stamp: float, place: Point, now_s: float | None) -> str:
        if not math.isfinite(stamp):
            return 'not_finite'
        if max(map(abs, place)) > _MAX_COORDINATE_M:
            return 'outlier'
        watch = self._watches[number]
        watch.see(stamp, place, now_s)
        if len(self._watches) > 1:
            self._now_s = max(self._now_s, stamp if now_s is None else now_s)
            if self._now_s >= self._clocks_s + _CLOCKS_S:
                self._clocks_s = self._now_s
                self._compare_clocks()
        if now_s is not None and stamp > now_s + _FUTURE_S:
            return 'future'
        if self.parameters.refuse_frozen and watch.unchanged_s > self.parameters.frozen_s:
            return 'frozen'
        others = self._others(number)
        # the prediction would be too long, and another tracker saw the hand later
        if others and self._now_s - stamp > self.parameters.prediction_limit_s:
            return 'late'
        # a live tracker always has noise, so the one that changes is used
        if watch.unchanged_s and any(not one.unchanged_s for one in others):
            return 'frozen'
        return ''

    def _others(self, number: int) -> list[TrackerWatch]:
        """List the other trackers that currently see the hand."""
        if len(self._watches) == 1:
            return []
        since_s = self._since_s()
        return [
            watch
            for other, watch in enumerate(self._watches)
            if other != number and watch.used_at_s >= since_s
        ]

    def _follow(
        self, number: int, stamp: float, place: Point, variance: float
    ) -> tuple[str, float]:
        """Return why a pose was refused, if so, and its distance from the hand, m."""
        watch, others = self._watches[number], self._others(number)
        left_out = bool(others) and watch.is_left_out
        sight = self._track.add(stamp, place, number, variance, only_look=left_out)
        outcome = sight.outcome
        if not outcome:
            watch.outliers = 0
            self._candidates[number].clear()
            variance = watch.tracker.variance
            if any(one.tracker.variance <= variance for one in others):
                watch.judge(sight.surprise)
        elif outcome == 'outlier' and others:
            # it saw the hand, and has left it
            watch.outliers += bool(watch.outliers or watch.used_at_s >= self._since_s())
        if left_out:
            return outcome or ('other_clock' if watch.clock_off_s else 'disagrees'), sight.distance
        elsewhere = outcome not in ('', 'repeated') and self._may_be_the_hand(watch, others)
        if elsewhere and self._consider(number, stamp, place, variance, bool(watch.outliers)):
            outcome = ''
        if not outcome:
            watch.used_at_s = self._now_s
        return outcome, sight.distance

    def _since_s(self) -> float:
        return self._now_s - self.parameters.lost_s

    @staticmethod
    def _may_be_the_hand(watch: TrackerWatch, others: Sequence[TrackerWatch]) -> bool:
        """Return whether a tracker may be right if it sees the hand elsewhere than the others."""
        if not others:
            return True
        best = min(one.tracker.variance for one in others)
        return not watch.outliers and watch.tracker.variance < best

    def _consider(
        self, number: int, stamp: float, place: Point, variance: float, doubted: bool
    ) -> bool:
        """Follow a few rejected candidates for the hand; accept one that is plausible."""
        candidates = self._candidates[number]
        amid_outliers = bool(candidates)
        for index, candidate in enumerate(candidates):
            outcome = candidate.add(stamp, place, number, variance).outcome
            if outcome == 'repeated':
                return False
            if not outcome:
                # The most recently followed candidate is dropped last.
                candidates.append(candidates.pop(index))
                break
        else:
            candidates.append(HandTrack(self.parameters, self.trackers, self._track))
            candidates[-1].add(stamp, place, number, variance)
            candidates[-1].is_plausible = not doubted and self._track.reaches(stamp, place, number)
            if len(candidates) > _MAX_CANDIDATES:
                del candidates[0]
        best = candidates[-1]
        needed = self.parameters.reacquire_poses
        if best.is_plausible:
            needed = min(needed, _FEW_POSES if amid_outliers else 1)
        elif self._track.count < _FEW_POSES:
            needed = min(needed, _FEW_POSES)
        if best.count < needed:
            return False
        former, self._track = self._track, best
        if best.is_plausible:
            best.count += former.count
        # If later poses fit the previous hand again, that one was right.
        former.is_plausible = True
        candidates[:] = [former]
        return True

    def _compare_clocks(self) -> None:
        """Find a tracker whose clock differs, while the hand moves enough to determine it."""
        # imported here: one tracker alone needs no NumPy
        from handover_dmp.tracking.clock_offset import clock_offset

        known = [watch for watch in self._watches if watch.path]
        if len(known) < 2:
            return
        best = min(known, key=lambda watch: watch.tracker.variance)
        for watch in known:
            found = None if watch is best else clock_offset(watch.path, best.path)
            if found is None:
                continue
            offset = found.offset_s
            watch.clock_off_s = best.clock_off_s = 0.0
            if abs(offset) < max(_CLOCK_OFF_S, _CLOCK_DEVIATIONS * found.deviation_s):
                continue
            # Poses arrive soon after their measurement, and never before.
            one_is_early = best.min_age_s < -_FUTURE_S
            if one_is_early or 0.0 < offset < best.min_age_s + _CLOCK_OFF_S:
                best.clock_off_s = -offset
            else:
                watch.clock_off_s = offset
