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

"""Speed and separation: a bound on the wrist's speed near the partner's hand."""

from __future__ import annotations

from dataclasses import dataclass
import math

from handover_dmp.common.arrays import Array
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.partner import Partner
from handover_dmp.robot.tasks import HalfSpace, ik_setting, IkInput
import numpy as np

NAMES = ('approach', 'speed near hand')


@dataclass(eq=False)
class SeparationLimit:
    """
    Bound on the wrist's speed relative to the hand, by their distance (ISO/TS 15066).

    V(d) = speed, for d ≤ distance;  V(d) = √(speed² + 2·deceleration·(d − distance)), beyond: a
    wrist that moves at V(d) and brakes with `deceleration` arrives at `distance` with `speed`. The
    arm never has to retreat: standing still is always permitted, however fast the hand approaches.

    Attributes:
        model: the arm.

    """

    model: RobotModel
    separation_distance: float = ik_setting(
        'separation_distance',
        'Distance to the hand within which separation_speed holds, m',
        0.0,
        5.0,
    )
    separation_speed: float = ik_setting(
        'separation_speed', 'Maximum speed of the wrist relative to the hand, m/s', 0.0, 5.0
    )
    separation_deceleration: float = ik_setting(
        'separation_deceleration',
        'Deceleration of the wrist on its way to that distance, m/s²',
        0.01,
        100.0,
    )

    def half_spaces(self, period: IkInput) -> list[HalfSpace]:
        """Bound the wrist's speed, see `tasks.Limit`."""
        # an unknown hand may be at the wrist
        partner = period.partner or Partner(period.position, np.zeros(3))
        directions, bounds = self.rows(period.position, period.wrist_velocity, partner, period.dt)
        rows = -directions @ period.linear
        return [HalfSpace(*named) for named in zip(NAMES, rows, (-bounds).tolist(), strict=False)]

    def allowed(self, distance: float, dt: float) -> float:
        """
        Compute V(d).

        Args:
            distance: distance between wrist and hand, m.
            dt: time for which the result must hold, s.

        Returns:
            The speed, m/s; that of braking at the end of `dt`, so that V is not exceeded.

        """
        beyond = distance - self.separation_distance
        if beyond <= 0.0:
            return self.separation_speed
        fall = self.separation_deceleration * dt
        square = self.separation_speed**2 + 2.0 * self.separation_deceleration * beyond
        return max(self.separation_speed, math.sqrt(fall * fall + square) - fall)

    def rows(
        self, wrist: Array, velocity: Array, partner: Partner, dt: float
    ) -> tuple[Array, Array]:
        """
        Bound the wrist's velocity by half-spaces.

        One bounds the speed of approach. The other is tangent to the ball of permitted velocities,
        ‖ẋ − ẋ_hand‖ ≤ V, at the point where the commanded direction s·v leaves it, so it is exact
        along that direction.

        Args:
            wrist: (3,), m.
            velocity: (3,), v, desired velocity of the wrist, m/s.
            partner: the hand.
            dt: length of the next period, s.

        Returns:
            Directions d, (k, 3), and bounds b, (k,), m/s, for d·ẋ ≤ b; every b ≥ 0.

        """
        apart = partner.position - wrist
        distance = float(np.sqrt(apart @ apart))
        allowed = self.allowed(distance, dt)
        hand = partner.velocity
        directions = []
        if distance > 1e-6:
            directions.append(apart / distance)
        touching = _ball_exit(velocity, hand, allowed)
        if touching is not None:
            directions.append(touching)
        if not directions:
            return np.empty((0, 3)), np.empty(0)
        stacked = np.array(directions)
        return stacked, np.maximum(allowed + stacked @ hand, 0.0)


def _ball_exit(velocity: Array, hand: Array, allowed: float) -> Array | None:
    """Find where s·velocity − hand, 0 ≤ s ≤ 1, leaves the ball of radius `allowed`."""
    relative = velocity - hand
    if float(relative @ relative) <= allowed * allowed:
        return None
    a = float(velocity @ velocity)
    b = float(velocity @ hand)
    c = float(hand @ hand) - allowed * allowed
    inside = b * b - a * c
    if a < 1e-18 or inside <= 0.0:
        return None
    share = (b + np.sqrt(inside)) / a
    if share < 0.0:
        return None
    edge: Array = (share * velocity - hand) / allowed
    return edge
