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
The orientation primitive: shape first, goal later, with the phase of the position primitive.

Unit quaternions are not a vector space, but the logarithm of the rotation since the start is:
r = Log(q ⊗ q₀⁻¹). On r, (8) has the same form as for a position, and the orientation is
q = Exp(r) ⊗ q₀. It is exact at the ends: r = 0 is the start, and r = Log(g ⊗ q₀⁻¹) the goal.

- A. Ude, B. Nemec, T. Petrič, J. Morimoto, "Orientation in Cartesian Space Dynamic Movement
  Primitives", ICRA 2014: quaternions and their logarithm in a primitive.
- L. Koutras, Z. Doulgeri, "A correct formulation for the Orientation Dynamic Movement Primitives
  for robot control in the Cartesian space", CoRL 2019 (PMLR 100, 2020): the second-order system on
  the logarithm itself, which is linear. With the angular velocity instead, it is not linear, and
  the learnt path is not reproduced.

They take the logarithm relative to the goal. The goal moves here, so the start is the reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import hypot, log, sqrt
from statistics import NormalDist
from typing import NamedTuple

from handover_dmp.common.arrays import Array, read_only, ReadOnly
from handover_dmp.common.errors import DataError
from handover_dmp.common.quaternions import (
    angular_velocity,
    conjugate,
    exponential,
    logarithm,
    multiply,
    nearest_turn,
    normalized,
    Quaternion,
    Turn,
    turn_rate,
)
from handover_dmp.common.vectors import minus
from handover_dmp.dmp.decoupled import DecoupledDmp
from handover_dmp.dmp.state import DmpState
import numpy as np
from numpy.typing import ArrayLike

NO_TURN: Turn = (0.0, 0.0, 0.0)
EQUAL_WEIGHTS = 1e-9
"""Goal weights that differ by less than this from (7) count as equal."""


@dataclass(frozen=True, eq=False)
class LearntTurn(ReadOnly):
    """
    The rotation of the wrist in a learnt movement.

    It is expressed in the axes of `world`, so the choice of the wrist's axes does not matter.

    Attributes:
        start: orientation at the start of the demonstration, quaternion x, y, z, w, (4,).
        goal: rotation vector from there to its end, rad, (3,).
        weights: w of (6), rad, (m, 3), on the basis of the movement.
        start_velocity: ṙ at the start, rad/s, (3,).

    Raises:
        DataError: the shapes do not fit, a number is not finite, or the norm of the quaternion
            is not 1.

    """

    start: Array
    goal: Array
    weights: Array
    start_velocity: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        """Check the shapes and make the arrays read-only."""
        count = len(self.weights)
        for name, shape in (
            ('start', (4,)),
            ('goal', (3,)),
            ('weights', (count, 3)),
            ('start_velocity', (3,)),
        ):
            array = read_only(getattr(self, name))
            if array.shape != shape or not np.isfinite(array).all():
                raise DataError(f'turn: {name} is not of {shape} finite numbers')
            object.__setattr__(self, name, array)
        if abs(float(np.linalg.norm(self.start)) - 1.0) > 1e-6:
            raise DataError('turn: start is not a unit quaternion')

    @classmethod
    def of(cls, turning: DecoupledDmp, start: ArrayLike) -> LearntTurn:
        """
        Take the fields from a primitive of the logarithm.

        Args:
            turning: primitive learnt from the rotation vectors since the start, rad.
            start: orientation at the start, quaternion x, y, z, w.

        Returns:
            The turn.

        """
        return cls(
            np.array(normalized(np.asarray(start, dtype=float).tolist())),
            turning.goal,
            turning.weights,
            turning.start_velocity,
        )


class OrientationState(NamedTuple):
    """
    State of an orientation primitive.

    Attributes:
        turned: r (as position), rad, ṙ, rad/s, and the phase.
        origin: q₀, orientation at the start, quaternion x, y, z, w.
        goal: Log(g ⊗ q₀⁻¹) of the last step, rad; it keeps the next one from jumping by a whole
            revolution.

    """

    turned: DmpState
    origin: Quaternion
    goal: Turn

    @property
    def orientation(self) -> Quaternion:
        """q, a unit quaternion x, y, z, w."""
        return normalized(multiply(exponential(self.turned.position), self.origin))

    @property
    def angular_velocity(self) -> Turn:
        """ω, rad/s, in the axes of `world`."""
        return angular_velocity(self.turned.position, self.turned.velocity)

    def braked(self, dt: float, deceleration: float) -> OrientationState:
        """
        Decelerate along the path of the rotation; the phase stands still.

        Args:
            dt: length of the step, s.
            deceleration: rad/s².

        Returns:
            The state at the end of the step.

        """
        return self._replace(turned=self.turned.braked(dt, deceleration))

    def turned_back(self, dt: float, speed: float, acceleration: float) -> OrientationState:
        """
        Turn back to the start, and stop there.

        Args:
            dt: length of the step, s.
            speed: rad/s.
            acceleration: rad/s².

        Returns:
            The state at the end of the step.

        """
        turned = self.turned
        left = minus(NO_TURN, turned.position)
        distance = hypot(*left)
        # proportional at the end, which avoids chattering
        wanted_speed = min(speed, sqrt(acceleration * distance), 0.2 * distance / dt)
        wanted = [wanted_speed * part / max(distance, 1e-12) for part in left]
        change = minus(wanted, turned.velocity)
        return self._replace(turned=turned.accelerated(change, dt, acceleration))


class OrientationPrimitive:
    """
    The orientation primitive of a learnt movement.

    With r = Log(q ⊗ q₀⁻¹) and ρ = Log(g ⊗ q₀⁻¹),

        (O1) τv̇ = (1 − w_g)K_s(f_w − r) + w_g[K(ρ − r) + K_v ρ̇] − Dv,   τṙ = v
        (O2) q = Exp(r) ⊗ q₀,   ω = J(r)ṙ,   ρ̇ = J(ρ)⁻¹ω_g

    J the left Jacobian; K, D, K_v, τ, basis, phase and goal weight are those of the position.

    Attributes:
        turning: (O1) as a primitive of three dimensions, in rad instead of m.

    """

    def __init__(self, movement: DecoupledDmp) -> None:
        """
        Take a movement that has learnt the rotation of the wrist.

        Args:
            movement: the learnt movement.

        Raises:
            DataError: the movement has none.

        """
        if movement.turn is None:
            raise DataError('the movement was learnt without orientations')
        self.turning = DecoupledDmp(
            movement.parameters,
            movement.duration_s,
            np.zeros(3),
            movement.turn.goal,
            movement.turn.weights,
            movement.basis,
            start_velocity=movement.turn.start_velocity,
        )
        self._goal: Turn = tuple(movement.turn.goal.tolist())
        self._start = normalized(movement.turn.start.tolist())

    def initial_state(
        self, orientation: Sequence[float] | None = None, velocity: Sequence[float] = NO_TURN
    ) -> OrientationState:
        """
        Return the state at the start.

        Args:
            orientation: q₀, quaternion x, y, z, w; that of the demonstration if left out.
            velocity: ω, rad/s; zero if left out.

        Returns:
            The state, with phase 1.

        """
        origin = self._start if orientation is None else normalized(orientation)
        # at r = 0, ṙ is the angular velocity
        return OrientationState(self.turning.initial_state(NO_TURN, velocity), origin, self._goal)

    def step(
        self,
        state: OrientationState,
        dt: float,
        phase_rate: float = 1.0,
        *,
        goal: Quaternion | None = None,
        goal_velocity: Sequence[float] = NO_TURN,
        goal_weight: float = 0.0,
    ) -> OrientationState:
        """
        Make one step.

        Args:
            state: state at the start of the step.
            dt: length of the step, s.
            phase_rate: speed of the phase, 1 as learnt.
            goal: g at the start of the step; turned from the start as in the demonstration if left
                out.
            goal_velocity: its angular velocity, rad/s.
            goal_weight: lower bound of w_g, for a position whose weight exceeds (7).

        Returns:
            The state at the end of the step.

        """
        turning, aim, rate = self.turning, self._goal, NO_TURN
        if goal is not None:
            turn = logarithm(multiply(normalized(goal), conjugate(state.origin)))
            aim = nearest_turn(turn, state.goal)
            rate = turn_rate(aim, goal_velocity)
        parameters, phase = turning.parameters, state.turned.phase
        u = -log(phase) / parameters.alpha
        by_time = turning.goal_weight_at(u + phase_rate * dt / turning.duration_s)
        if goal_weight > by_time + EQUAL_WEIGHTS:
            gaussian = NormalDist(parameters.mu, parameters.sigma)
            later = gaussian.inv_cdf(min(goal_weight, 1.0 - 1e-15))
            after = turning.step_as_late(state.turned, aim, rate, dt, phase_rate, later)
        else:
            after = turning.step(state.turned, aim, rate, dt, phase_rate)
        return OrientationState(after, state.origin, aim)

    def rollout(
        self, times: ArrayLike, start: Sequence[float] | None = None
    ) -> tuple[Array, Array]:
        """
        Run from the start to the end of the demonstration.

        Args:
            times: s, (n,), rising.
            start: q₀, quaternion x, y, z, w; that of the demonstration if left out.

        Returns:
            Unit quaternions, (n, 4), and angular velocities, rad/s, (n, 3).

        """
        origin = self._start if start is None else normalized(start)
        motion = self.turning.rollout(times, self.turning.goal)
        states = [
            OrientationState(DmpState(tuple(r), tuple(v), 1.0, NO_TURN), origin, self._goal)
            for r, v in zip(motion.positions.tolist(), motion.velocities.tolist(), strict=True)
        ]
        return (
            np.array([state.orientation for state in states]),
            np.array([state.angular_velocity for state in states]),
        )
