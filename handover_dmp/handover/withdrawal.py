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
The way back after an exchange: home along the path that the arm came, or as learnt.

The path that the arm came is a `Trace` of its commands without loops, so the detours of a hand are
not repeated. A `Way` puts a uniform cubic B-spline p through points: twice continuously
differentiable, with rounded corners. The motion along it has minimum jerk,

    x(θ) = p(m(θ/T)), m(u) = 10u³ − 15u⁴ + 6u⁵,

with T the shortest duration within bounds on speed and acceleration. If the points are those of a
learnt movement, they are evenly spaced in its own time instead. A `WayFollower` follows it on a
clock of its own with a rate from 0 to 1: slow near the hand, stopped if a lost hand is ahead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import dist, hypot, sqrt
from typing import NamedTuple

from handover_dmp.common.arrays import Vector
from handover_dmp.common.settings import dmp_setting
from handover_dmp.common.vectors import minus, plus, scaled_by
from handover_dmp.dmp import DmpState
from handover_dmp.dmp.primitive import Primitive
import numpy as np

TRACE_SPACING_M = 0.005
"""Distance between points of a trace; a path that returns this close to itself is a loop."""
SEGMENT_M = 0.02
"""Length of a segment of a way, and radius of its corners, m."""
MIN_SEGMENTS = 4
CHECKED = 101
CHECKED_OF_SEGMENT = 4
"""Minimum number of points at which speed and acceleration of a way are checked."""
WAY_SHARE = 0.25
"""Share of the acceleration limit for following a way at full rate."""
PAUSE_SHARE = 0.5
"""Share of the same for stopping on it."""
RESUMING_RATE = 2.0
"""1/s; increase of the clock's rate after a stop."""
TRACKING_RATE = 10.0
"""1/s; rate at which the command returns to a way after a push; critically damped."""
ARRIVED_M = 1e-3
ARRIVED_SPEED = 0.02
"""Distance to the end of a way, m, and speed, m/s, below which it is completed."""
LEARNT_SAMPLES = 101
MIN_SPEED = 1e-9
ASIDE_M = 0.0005
"""A way approaches a point if it comes closer to it by more than this, m."""


@dataclass(frozen=True)
class WithdrawalOptions:
    """Options of the way back."""

    speed: float = dmp_setting(
        'session.withdrawal_speed',
        'Maximum speed of the wrist on its way home and to the object, m/s',
        0.01,
        2.0,
    )
    near_m: float = dmp_setting(
        'session.near_m',
        'Distance to the exchange position, as it would be with the hand now, within which '
        'near_speed holds, m; the bound ends at twice that distance',
        0.001,
        2.0,
    )
    near_speed: float = dmp_setting(
        'session.near_speed',
        'Maximum speed of the wrist near the exchange position, and while the hand is lost, m/s',
        0.001,
        2.0,
    )

    def speed_at(self, distance_m: float) -> float:
        """
        Return the maximum speed of the wrist.

        Args:
            distance_m: distance from the wrist to the present exchange position, m.

        Returns:
            m/s.

        """
        further = max(0.0, distance_m / self.near_m - 1.0)
        return min(self.speed, self.near_speed + further * (self.speed - self.near_speed))


class Trace:
    """The commanded path of the wrist from its start to now, without loops."""

    def __init__(self, start: Vector) -> None:
        """
        Begin the trace.

        Args:
            start: first point, m.

        """
        self._points = [start]

    def add(self, position: Vector) -> None:
        """
        Add a point; everything after an earlier point close to it was a loop, and is removed.

        Args:
            position: m.

        """
        for kept, point in enumerate(self._points, start=1):
            if dist(point, position) < TRACE_SPACING_M:
                del self._points[kept:]
                return
        self._points.append(position)

    @property
    def start(self) -> Vector:
        """Start of the trace, m."""
        return self._points[0]

    def is_at_start(self, position: Vector) -> bool:
        """
        Return whether a position is the start.

        Args:
            position: m.

        Returns:
            Whether it is, and the trace has no other points.

        """
        return len(self._points) == 1 and dist(position, self.start) < TRACE_SPACING_M

    def back_from(self, position: Vector) -> list[Vector]:
        """
        Return the path back to the start.

        Args:
            position: present position of the wrist, m.

        Returns:
            Points, m, beginning there.

        """
        return [position, *reversed(self._points)]


class Motion(NamedTuple):
    """
    A point of a way at a time.

    Attributes:
        position: m.
        velocity: m/s, by the clock of the way.
        acceleration: m/s², by the same.

    """

    position: Vector
    velocity: Vector
    acceleration: Vector


class Way:
    """
    A smooth motion through points, from rest to rest.

    Attributes:
        duration_s: T, s.

    """

    def __init__(
        self,
        places: Sequence[Vector],
        *,
        speed: float,
        acceleration: float,
        duration_s: float | None = None,
    ) -> None:
        """
        Put a way through points.

        Args:
            places: points, m, at least two; the last one is the end.
            speed: bound on the speed, m/s.
            acceleration: bound on the acceleration, m/s².
            duration_s: duration of points that are evenly spaced in time, s; longer if a bound
                requires it. If left out, minimum jerk, as fast as the bounds permit.

        """
        self._minimum_jerk = duration_s is None
        nodes = _evenly_spaced(places) if duration_s is None else list(places)
        before = minus(scaled_by(nodes[0], 2.0), nodes[1])
        after = minus(scaled_by(nodes[-1], 2.0), nodes[-2])
        # nodes extrapolated beyond the ends make the spline begin and end at the first and last
        self._nodes = [before, *nodes, after]
        self._segments = len(nodes) - 1
        self.duration_s = duration_s or 1.0
        checked = max(CHECKED, CHECKED_OF_SEGMENT * self._segments)
        motions = [self.at(self.duration_s * k / (checked - 1)) for k in range(checked)]
        self.duration_s *= max(
            max(hypot(*motion.velocity) for motion in motions) / speed,
            sqrt(max(hypot(*motion.acceleration) for motion in motions) / acceleration),
            0.0 if duration_s is None else 1.0,
            MIN_SPEED,
        )

    @property
    def end(self) -> Vector:
        """End of the way, m."""
        return self._nodes[-2]

    def at(self, time_s: float) -> Motion:
        """
        Return the point of the way at a time.

        Args:
            time_s: time since its beginning, by its own clock, s.

        Returns:
            Position, velocity and acceleration; at rest beyond its ends.

        """
        u = time_s / self.duration_s
        if u >= 1.0:
            still = (0.0,) * len(self.end)
            return Motion(self.end, still, still)
        u = max(u, 0.0)
        done, first, second = u, 1.0, 0.0
        if self._minimum_jerk:
            done = _done(u)
            first = 30.0 * u * u * (1.0 - u) * (1.0 - u)
            second = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)
        along = done * self._segments
        number = min(int(along), self._segments - 1)
        t = along - number
        per_s, n = 1.0 / self.duration_s, self._segments
        speed, change = first * n * per_s, second * n * per_s * per_s
        s = 1.0 - t
        place = (
            s * s * s,
            4.0 + t * t * (3.0 * t - 6.0),
            4.0 + s * s * (3.0 * s - 6.0),
            t * t * t,
        )
        slope = (-s * s, t * (3.0 * t - 4.0), -s * (3.0 * s - 4.0), t * t)
        bend = (s, 3.0 * t - 2.0, 3.0 * s - 2.0, t)
        end = number + 4
        four = self._nodes[number:end]
        position = _combined(place, four, 1.0 / 6.0)
        direction = _combined(slope, four, 0.5)
        bending = _combined(bend, four, 1.0)
        return Motion(
            position,
            scaled_by(direction, speed),
            plus(scaled_by(bending, speed * speed), scaled_by(direction, change)),
        )

    def rest_of(self, time_s: float) -> list[Vector]:
        """
        Return the remaining points.

        Args:
            time_s: time since its beginning, s.

        Returns:
            Points, m, including the end.

        """
        u = min(max(time_s / self.duration_s, 0.0), 1.0)
        done = _done(u) if self._minimum_jerk else u
        following, last = int(done * self._segments) + 2, self._segments + 1
        return [*self._nodes[following:last], self.end]

    def leads_nearer(self, time_s: float, place: Vector) -> bool:
        """
        Return whether the way approaches a point next.

        Args:
            time_s: time since its beginning, s.
            place: the point, m.

        Returns:
            Whether it does so within the next segment.

        """
        here = self.at(time_s).position
        distance = dist(here, place)
        for soon in self.rest_of(time_s):
            if dist(soon, here) >= SEGMENT_M:
                return dist(soon, place) < distance
            if dist(soon, place) < distance - ASIDE_M:
                return True
        return dist(self.end, place) < distance - ASIDE_M


def way_back(
    trace: Trace,
    position: Vector,
    options: WithdrawalOptions,
    acceleration_limit: float,
    learnt: Primitive | None = None,
) -> Way | None:
    """
    Plan the way home.

    Args:
        trace: path that the arm came.
        position: commanded position of the wrist, m.
        options: options of the way back.
        acceleration_limit: limit of the wrist command, m/s².
        learnt: learnt way back; the path that the arm came if left out.

    Returns:
        The way; None if the wrist is at home.

    """
    bounds = {'speed': options.speed, 'acceleration': WAY_SHARE * acceleration_limit}
    if trace.is_at_start(position):
        return None
    if learnt is None:
        return Way(trace.back_from(position), **bounds)
    times = np.linspace(0.0, learnt.duration_s, LEARNT_SAMPLES)
    places = learnt.rollout(times, trace.start, start=position).positions
    # a movement only converges to its goal; the remaining error is spread over the whole way
    done = [_done(u) for u in (times / times[-1]).tolist()]
    places = places + np.outer(done, np.array(trace.start) - places[-1])
    return Way([tuple(p) for p in places.tolist()], duration_s=learnt.duration_s, **bounds)


class WayFollower:
    """
    Follows a way with bounded acceleration, from any position and velocity.

    Attributes:
        way: the way.
        time_s: time on the clock of the way, s.
        rate: rate of that clock, 0 to 1.

    """

    def __init__(self, way: Way) -> None:
        """
        Begin a way.

        Args:
            way: the way to follow.

        """
        self.way = way
        self.time_s = 0.0
        self.rate = 1.0

    def has_arrived(self, command: DmpState) -> bool:
        """
        Return whether the way is completed.

        Args:
            command: the present command.

        Returns:
            Whether the command is at its end and almost at rest.

        """
        over = self.time_s >= self.way.duration_s
        there = dist(command.position, self.way.end) < ARRIVED_M
        return over and there and hypot(*command.velocity) < ARRIVED_SPEED

    def step(self, command: DmpState, dt: float, max_speed: float, limit: float) -> DmpState:
        """
        Advance by one period.

        Args:
            command: the command at the start of the period.
            dt: length of the period, s.
            max_speed: maximum speed on the way, m/s; 0 to stop.
            limit: bound on the acceleration, m/s².

        Returns:
            The command at the end of the period.

        """
        if dt <= 0.0:
            return command
        here = self.way.at(self.time_s)
        full = hypot(*here.velocity)
        wanted = min(1.0, max_speed / full) if full > MIN_SPEED else float(max_speed > 0.0)
        rate = min(self.rate + RESUMING_RATE * dt, wanted)
        rate = max(rate, self.rate - PAUSE_SHARE * limit / max(full, MIN_SPEED) * dt)
        self.time_s += 0.5 * (self.rate + rate) * dt
        then = self.way.at(self.time_s)
        change = []
        for x, v, place, v_here, v_then in zip(
            *command[:2], here.position, here.velocity, then.velocity, strict=True
        ):
            asked = rate * v_then - self.rate * v_here
            off = TRACKING_RATE * (place - x) + 2.0 * (self.rate * v_here - v)
            change.append(asked + TRACKING_RATE * off * dt)
        self.rate = rate
        return command.accelerated(change, dt, limit)


def _done(u: float) -> float:
    """Return the completed share of a minimum-jerk motion after a share of its time."""
    return u * u * u * (10.0 + u * (6.0 * u - 15.0))


def _combined(shares: Sequence[float], points: Sequence[Vector], factor: float) -> Vector:
    a, b, c, d = (factor * share for share in shares)
    return tuple(a * w + b * x + c * y + d * z for w, x, y, z in zip(*points, strict=True))


def _evenly_spaced(places: Sequence[Vector]) -> list[Vector]:
    """Resample the polyline through points evenly, ends included."""
    lengths = [0.0]
    for a, b in pairwise(places):
        lengths.append(lengths[-1] + dist(a, b))
    segments = max(MIN_SEGMENTS, round(lengths[-1] / SEGMENT_M))
    at = np.linspace(0.0, lengths[-1], segments + 1)
    columns = [np.interp(at, lengths, column) for column in np.array(places).T]
    return [tuple(p) for p in np.column_stack(columns).tolist()]
