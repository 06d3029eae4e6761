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

"""The limits of the joints, and the velocities that respect them at all future times."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

from handover_dmp.common.arrays import Array
import numpy as np


@dataclass(frozen=True, eq=False)
class JointLimits:
    """
    Limits of the joints.

    Attributes:
        lower: (n,), rad; -inf for a continuous joint.
        upper: (n,), rad; inf for a continuous joint.
        velocity: (n,), rad/s, in both directions.
        acceleration: (n,), rad/s², in both directions.
        effort: (n,), Nm, in both directions.
        jerk: (n,), rad/s³, in both directions.

    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    effort: Array
    jerk: Array

    def inside(self, joint_positions: Array, tolerance: float = 0.0) -> bool:
        """
        Return whether a configuration is within the position limits.

        Args:
            joint_positions: (n,), rad.
            tolerance: allowed excess, rad.

        Returns:
            Whether every joint is within its limits.

        """
        return bool(
            np.all(joint_positions >= self.lower - tolerance)
            and np.all(joint_positions <= self.upper + tolerance)
        )

    @property
    def one_turn(self) -> tuple[Array, Array]:
        """Return the ranges within ±π, (n,) each; 2π of a range that lies beyond."""
        lower, upper, turn = self.lower, self.upper, 2.0 * np.pi
        return (
            np.where(upper <= -np.pi, np.maximum(lower, upper - turn), np.maximum(lower, -np.pi)),
            np.where(lower >= np.pi, np.minimum(upper, lower + turn), np.minimum(upper, np.pi)),
        )


class VelocityBox:
    """
    Joint velocities for the next period that respect all limits, now and at all later times.

    Towards a position limit at distance d, the velocity of a joint is bounded by

        v ≤ −βa·dt + √((βa·dt)² + 2βa·d),

    from which braking at βa, period by period, ends at the limit: after a period at that bound,
    d' = d − v·dt, the bound has fallen by at most βa·dt. So with β ≤ 1 the intersection with
    v_previous ± a·dt is never empty, and a joint that is inside stays inside. β < 1 reserves
    acceleration for disturbances.

    If a joint starts outside (beyond a position limit, or too fast), the acceleration limit comes
    first: the joint brakes, and then returns, as fast as permitted. A joint beyond its position
    limit returns at the speed that the same formula gives for its distance.
    """

    def __init__(self, limits: JointLimits, braking_share: float) -> None:
        """
        Take the limits.

        Args:
            limits: limits of the joints.
            braking_share: β, above 0 and at most 1.

        Raises:
            ValueError: β is out of range; the box would not be recursively feasible.

        """
        if not 0.0 < braking_share <= 1.0:
            raise ValueError(f'braking share {braking_share} is not in (0, 1]')
        self._limits = limits
        self._braking = braking_share * limits.acceleration
        self._period = 0.0

    def bounds(
        self, joint_positions: Array, previous_velocity: Array, dt: float
    ) -> tuple[Array, Array]:
        """
        Compute the box.

        Args:
            joint_positions: (n,), rad.
            previous_velocity: (n,), rad/s, velocity of the period that ends now.
            dt: length of the next period, s.

        Returns:
            Lower and upper bounds, (n,) each, rad/s; the lower is never above the upper.

        """
        lows, highs = self.sides(joint_positions.tolist(), previous_velocity.tolist(), dt)
        return np.array(lows), np.array(highs)

    def sides(
        self, joint_positions: list[float], previous_velocity: list[float], dt: float
    ) -> tuple[list[float], list[float]]:
        """
        Compute the box in plain floats, which is twice as fast for a few joints.

        Args:
            joint_positions: n, rad.
            previous_velocity: n, rad/s, velocity of the period that ends now.
            dt: length of the next period, s.

        Returns:
            Lower and upper bounds, n each, rad/s; the lower is never above the upper.

        """
        if dt != self._period:
            self._prepare(dt)
        lows, highs = [], []
        state = zip(joint_positions, previous_velocity, self._joints, strict=True)
        for position, previous, joint in state:
            lower, upper, after, before, fastest, step, square, twice, change = joint
            low, high = -fastest, fastest
            if not after <= position <= before:  # close enough to a position limit
                room = upper - position
                if room >= 0.0:
                    high = sqrt(square + twice * room) - step
                    high = high if high < fastest else fastest
                else:
                    high = step - sqrt(square - twice * room)
                    high = high if high > -fastest else -fastest
                room = position - lower
                if room >= 0.0:
                    low = step - sqrt(square + twice * room)
                    low = low if low > -fastest else -fastest
                else:
                    low = sqrt(square - twice * room) - step
                    low = low if low < fastest else fastest
            slowest, quickest = previous - change, previous + change
            low = low if low > slowest else slowest
            high = high if high > slowest else slowest
            lows.append(low if low < quickest else quickest)
            highs.append(high if high < quickest else quickest)
        return lows, highs

    def brake(self, joint_positions: Array, previous_velocity: Array, dt: float) -> Array:
        """
        Compute the velocities in the box that are closest to zero.

        Args:
            joint_positions: (n,), rad.
            previous_velocity: (n,), rad/s.
            dt: length of the next period, s.

        Returns:
            Joint velocities, (n,), rad/s.

        """
        lower, upper = self.bounds(joint_positions, previous_velocity, dt)
        return np.minimum(np.maximum(lower, 0.0), upper)

    def _prepare(self, dt: float) -> None:
        """Compute the terms that depend only on the period."""
        limits, step = self._limits, self._braking * dt
        # braking distance from the maximum speed, rad
        room = ((limits.velocity + step) ** 2 - step**2) / (2.0 * self._braking)
        self._period = dt
        columns = (
            limits.lower,
            limits.upper,
            limits.lower + room,
            limits.upper - room,
            limits.velocity,
            step,
            step * step,
            2.0 * self._braking,
            limits.acceleration * dt,
        )
        self._joints = [tuple(map(float, joint)) for joint in zip(*columns, strict=True)]
