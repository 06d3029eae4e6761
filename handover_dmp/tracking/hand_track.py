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
The track of one hand, from the poses of all trackers in the order of their measurement.

A constant-velocity Kalman filter with white acceleration noise, and a bias for each tracker with a
learnt one. The state of an axis is (position, velocity, bias, bias, ...). The three axes share one
covariance, since they share the model and the noise. It is so small that plain floats are several
times as fast as NumPy. A late pose is inserted by its stamp; later ones are filtered again.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
import math
from typing import NamedTuple, TypeAlias

from handover_dmp.common.arrays import Point
from handover_dmp.tracking.hand_filter import HandFilter
from handover_dmp.tracking.tracker import Tracker

SAME_STAMP_S = 1e-7
_FIRST_SPEED_DEVIATION = 0.5
# Bounds the work of one update for any stream.
_MAX_POSES_KEPT = 32
# Maximum width of the gate after a gap, relative to its initial width.
_MAX_GATE = 3.0
# Standard deviations beyond which the error of a pose is not noise.
_GATE_DEVIATIONS = 6.0
_BIAS_GATE_DEVIATIONS = 3.0
_NO_BIAS = -1


class Bias(NamedTuple):
    """
    Estimate of a tracker's bias at one time.

    Attributes:
        mean: (3,) m.
        position: its covariance with the position, m².
        velocity: its covariance with the velocity, m²/s.
        biases: (k,) its covariance with each bias, including itself, m².

    """

    mean: Point
    position: float
    velocity: float
    biases: tuple[float, ...]


# State of the hand at one time: x, y, z, vx, vy, vz; the covariances of one axis (position,
# position-velocity, velocity); the biases.
State: TypeAlias = tuple[
    float, float, float, float, float, float, float, float, float, tuple[Bias, ...]
]


class TrackedPose(NamedTuple):
    """
    A pose that was used.

    Attributes:
        stamp: time of the measurement, s.
        place: m, position from the tracker.
        variance: its variance on each axis, m².
        bias: index of its tracker's bias in the state; -1 if it has none.
        tracker: number of the tracker.
        state: state of the filter after it.

    """

    stamp: float
    place: Point
    variance: float
    bias: int
    tracker: int
    state: State


class Sight(NamedTuple):
    """
    Comparison of a pose with its prediction.

    Attributes:
        outcome: why it was refused; empty if it was used.
        distance: distance from the prediction, m; NaN if there was none.
        surprise: its square relative to the mean for noise alone; NaN likewise.

    """

    outcome: str
    distance: float = math.nan
    surprise: float = math.nan


class HandTrack:
    """
    The newest consistent poses, in order, with the filter's state after each.

    Attributes:
        poses: oldest first.
        count: number of poses since the track began.
        seen: number of a tracker to the stamp of its newest pose, s.
        is_plausible: whether the hand can have moved to the first pose from where it was last
            seen.

    """

    def __init__(
        self, parameters: HandFilter, trackers: Sequence[Tracker], before: HandTrack | None = None
    ) -> None:
        """
        Begin without a pose.

        Args:
            parameters: parameters of the filter.
            trackers: the trackers.
            before: the previous track, whose biases are kept.

        """
        self.parameters = parameters
        self.poses: list[TrackedPose] = []
        self.count = 0
        self.seen: dict[int, float] = {}
        self.is_plausible = False
        self._density = parameters.acceleration_noise**2
        # a reference tracker has no bias; without one, the first tracker is the reference
        learnt = [number for number, one in enumerate(trackers) if one.bias == 'learnt']
        if len(learnt) == len(trackers):
            del learnt[0]
        self._bias_of = {number: place for place, number in enumerate(learnt)}
        self._drifts = [trackers[number].bias_drift ** 2 for number in learnt]
        self._max_poses = _MAX_POSES_KEPT * len(trackers)
        self._biases = [
            # the given bias is subtracted before
            ((0.0, 0.0, 0.0), trackers[number].bias_deviation_m ** 2)
            for number in learnt
        ]
        if before is not None:
            self._biases = before.biases()

    def biases(self) -> list[tuple[Point, float]]:
        """Return each learnt bias, m, and its variance, m²."""
        if not self.poses:
            return self._biases
        known = self.poses[-1].state[9]
        return [(bias.mean, bias.biases[place]) for place, bias in enumerate(known)]

    def add(
        self,
        stamp: float,
        place: Point,
        tracker: int,
        variance: float,
        *,
        only_look: bool = False,
    ) -> Sight:
        """
        Process a pose.

        Args:
            stamp: time of the measurement, s.
            place: m, position with the given bias subtracted.
            tracker: number of its tracker.
            variance: its variance on each axis, m².
            only_look: whether only to compare it with the prediction.

        Returns:
            Whether it was used, and its distance from the prediction.

        """
        poses, bias = self.poses, self._bias_of.get(tracker, _NO_BIAS)
        if not poses:
            if only_look:
                return Sight('outlier')
            first = self._first(place, variance, bias)
            poses.append(TrackedPose(stamp, place, variance, bias, tracker, first))
            self.count = 1
            self.seen[tracker] = stamp
            return Sight('')
        index = len(poses) if stamp > poses[-1].stamp else bisect_left(poses, (stamp,))
        for near in poses[max(index - 1, 0): index + 1]:  # fmt: skip
            if near.tracker == tracker and abs(near.stamp - stamp) <= SAME_STAMP_S:
                return Sight('repeated')
        if index == 0 or poses[-1].stamp - stamp > self.parameters.late_limit_s:
            return Sight('late')
        before = poses[index - 1]
        elapsed = stamp - before.stamp
        state = self._predict(before.state, elapsed)
        distance, surprise, gate = self._compare(state, elapsed, place, bias, variance)
        if elapsed > self.parameters.lost_s or distance > gate:
            return Sight('outlier', distance, surprise)
        if only_look:
            return Sight('', distance, surprise)
        state = _correct(state, place, bias, variance)
        poses.insert(index, TrackedPose(stamp, place, variance, bias, tracker, state))
        for later in range(index + 1, len(poses)):
            pose = poses[later]
            state = self._predict(state, pose.stamp - poses[later - 1].stamp)
            state = _correct(state, pose.place, pose.bias, pose.variance)
            poses[later] = pose._replace(state=state)
        self.count += 1
        self.seen[tracker] = max(stamp, self.seen.get(tracker, stamp))
        oldest = poses[-1].stamp - self.parameters.late_limit_s
        while len(poses) > self._max_poses or (len(poses) > 2 and poses[1].stamp < oldest):
            del poses[0]
        return Sight('', distance, surprise)

    def reaches(self, stamp: float, place: Point, tracker: int) -> bool:
        """Return whether a hand can have moved from the newest pose to a later one, s and m."""
        if not self.poses:
            return True
        last = self.poses[-1]
        reach = self.parameters.hand_speed * (stamp - last.stamp)
        seen, again = self.unbiased(last.place, last.tracker), self.unbiased(place, tracker)
        return math.dist(seen, again) <= reach

    def unbiased(self, place: Point, tracker: int) -> Point:
        """Subtract the learnt bias of a tracker from a position, m."""
        x, y, z = self.bias(tracker)
        return (place[0] - x, place[1] - y, place[2] - z)

    def deviation(self, ahead_s: float) -> float:
        """Return the standard deviation of each axis, m, at a time after the newest pose, s."""
        p, c, s = self.poses[-1].state[6:9]
        p += ahead_s * (2.0 * c + ahead_s * (s + self._density * ahead_s / 3.0))
        return math.sqrt(max(p, 0.0))

    def bias(self, tracker: int) -> Point:
        """Return the learnt bias of a tracker in addition to the given one, m."""
        place = self._bias_of.get(tracker, _NO_BIAS)
        return (0.0, 0.0, 0.0) if place == _NO_BIAS else self.biases()[place][0]

    def _first(self, place: Point, variance: float, bias: int) -> State:
        """Initialise the state with the first position."""
        x, y, z = place
        count = len(self._biases)
        rows = [[0.0] * count for _ in range(count)]
        crossed = [0.0] * count
        for k, (_, own) in enumerate(self._biases):
            rows[k][k] = own
        if bias != _NO_BIAS:
            (bx, by, bz), own = self._biases[bias]
            x, y, z = x - bx, y - by, z - bz
            variance += own
            crossed[bias] = -own
        biases = tuple(
            Bias(mean, crossed[k], 0.0, tuple(rows[k])) for k, (mean, _) in enumerate(self._biases)
        )
        return (x, y, z, 0.0, 0.0, 0.0, variance, 0.0, _FIRST_SPEED_DEVIATION**2, biases)

    def _compare(
        self, state: State, elapsed: float, place: Point, bias: int, variance: float
    ) -> tuple[float, float, float]:
        """Return distance (m), surprise and gate (m) of a pose."""
        parameters = self.parameters
        dx, dy, dz = place[0] - state[0], place[1] - state[1], place[2] - state[2]
        spread = state[6] + variance
        base = max(parameters.outlier_distance_m, _GATE_DEVIATIONS * math.sqrt(variance))
        if bias != _NO_BIAS:
            (bx, by, bz), with_position, _, biases = state[9][bias]
            dx, dy, dz = dx - bx, dy - by, dz - bz
            spread += biases[bias] + 2.0 * with_position
            base += _BIAS_GATE_DEVIATIONS * math.sqrt(max(biases[bias], 0.0))
        square = dx * dx + dy * dy + dz * dz
        moved = 0.5 * parameters.hand_acceleration * elapsed * elapsed
        gate = min(base + moved, _MAX_GATE * base)
        return math.sqrt(square), square / (3.0 * (spread + moved * moved)), gate

    def _predict(self, state: State, dt: float) -> State:
        """Predict over dt, s."""
        x, y, z, vx, vy, vz, p, c, s, biases = state
        noise = self._density * dt
        if biases:
            biases = tuple(
                Bias(
                    mean,
                    with_position + dt * with_velocity,
                    with_velocity,
                    tuple(
                        other + self._drifts[k] * dt if at == k else other
                        for at, other in enumerate(others)
                    ),
                )
                for k, (mean, with_position, with_velocity, others) in enumerate(biases)
            )
        return (
            x + dt * vx,
            y + dt * vy,
            z + dt * vz,
            vx,
            vy,
            vz,
            p + dt * (2.0 * c + dt * (s + noise / 3.0)),
            c + dt * (s + noise / 2.0),
            s + noise,
            biases,
        )


def _correct(state: State, place: Point, bias: int, variance: float) -> State:
    """Update with a measured position, m, and its variance, m²."""
    x, y, z, vx, vy, vz, p, c, s, biases = state
    dx, dy, dz = place[0] - x, place[1] - y, place[2] - z
    # covariances of the measurement with position, velocity and biases
    seen_p, seen_c = p, c
    total = p + variance
    if biases:
        seen = [one.position for one in biases]
        if bias != _NO_BIAS:
            (bx, by, bz), with_position, with_velocity, others = biases[bias]
            dx, dy, dz = dx - bx, dy - by, dz - bz
            seen_p, seen_c = p + with_position, c + with_velocity
            seen = [one + other for one, other in zip(seen, others, strict=True)]
            total = seen_p + seen[bias] + variance
        corrected = []
        for one, of_bias in zip(biases, seen, strict=True):
            gain = of_bias / total
            (bx, by, bz), with_position, with_velocity, others = one
            corrected.append(
                Bias(
                    (bx + gain * dx, by + gain * dy, bz + gain * dz),
                    with_position - gain * seen_p,
                    with_velocity - gain * seen_c,
                    tuple(other - gain * also for other, also in zip(others, seen, strict=True)),
                )
            )
        biases = tuple(corrected)
    gain, speed_gain = seen_p / total, seen_c / total
    return (
        x + gain * dx,
        y + gain * dy,
        z + gain * dz,
        vx + speed_gain * dx,
        vy + speed_gain * dy,
        vz + speed_gain * dz,
        p - gain * seen_p,
        c - gain * seen_c,
        s - speed_gain * seen_c,
        biases,
    )
