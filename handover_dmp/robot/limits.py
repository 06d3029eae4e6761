"""The limits of the joints, and the velocities that keep all of them for ever."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class JointLimits:
    """
    What the joints can do.

    Attributes:
        lower: (n,), rad; -inf for a joint that turns for ever.
        upper: (n,), rad; inf for a joint that turns for ever.
        velocity: (n,), rad/s, either way.
        acceleration: (n,), rad/s², either way.
        effort: (n,), Nm, either way.
        jerk: (n,), rad/s³, either way.

    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    effort: Array
    jerk: Array

    def inside(self, joint_positions: Array, tolerance: float = 0.0) -> bool:
        """
        Say whether a posture is within the position limits.

        Args:
            joint_positions: (n,), rad.
            tolerance: rad allowed beyond them.

        Returns:
            Whether every joint is.

        """
        return bool(
            np.all(joint_positions >= self.lower - tolerance)
            and np.all(joint_positions <= self.upper + tolerance)
        )


class VelocityBox:
    """
    Joint velocities for the next period that break no limit now and force none to be broken later.

    Towards a position limit at distance d a joint may move at

        v ≤ −βa·dt + √((βa·dt)² + 2βa·d),

    from where braking at βa, one period after another, ends at the limit and not behind it: after
    a period at that bound, d' = d − v·dt, the bound has fallen by at most βa·dt. So with β ≤ 1 the
    intersection with v_previous ± a·dt is never empty, and once inside means inside for ever.
    β < 1 keeps acceleration in hand for whatever moves the arm a little off the ideal.

    From outside (started beyond a position limit, or faster than allowed) the acceleration limit
    comes first: the joint brakes, and then returns, as fast as it may. A joint beyond its position
    limit returns at the speed that the same formula gives for its distance.
    """

    def __init__(self, limits: JointLimits, braking_share: float) -> None:
        """
        Take the limits.

        Args:
            limits: of the joints.
            braking_share: β, above 0 and at most 1.

        Raises:
            ValueError: β is out of range; the box would not be recursively feasible.

        """
        if not 0.0 < braking_share <= 1.0:
            raise ValueError(f'braking share {braking_share} is not in (0, 1]')
        self._limits = limits
        self._braking = braking_share * np.array([limits.acceleration] * 2)
        self._fastest = np.array([limits.velocity] * 2)
        self._period = 0.0

    def bounds(
        self, joint_positions: Array, previous_velocity: Array, dt: float
    ) -> tuple[Array, Array]:
        """
        Compute the box.

        Args:
            joint_positions: (n,), rad.
            previous_velocity: (n,), rad/s, of the period that ends now.
            dt: length of the next period, s.

        Returns:
            Lower and upper bounds, (n,) each, rad/s; the lower never above the upper.

        """
        if dt != self._period:
            self._prepare(dt)
        distance, towards = np.empty_like(self._step), np.empty_like(self._step)
        np.subtract(self._limits.upper, joint_positions, out=distance[0])
        np.subtract(joint_positions, self._limits.lower, out=distance[1])
        np.abs(distance, out=towards)
        towards *= self._twice
        towards += self._square
        np.sqrt(towards, out=towards)
        towards -= self._step
        np.minimum(towards, self._fastest, out=towards)
        np.copysign(towards, distance, out=towards)
        upper, lower = towards
        np.negative(lower, out=lower)
        np.maximum(towards, previous_velocity - self._change, out=towards)
        np.minimum(towards, previous_velocity + self._change, out=towards)
        return lower, upper

    def brake(self, joint_positions: Array, previous_velocity: Array, dt: float) -> Array:
        """
        Compute the velocities of the box that are nearest to standstill.

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
        """Compute what depends on the period alone."""
        self._period = dt
        self._step = self._braking * dt
        self._square = self._step * self._step
        self._twice = 2.0 * self._braking
        self._change = self._limits.acceleration * dt
