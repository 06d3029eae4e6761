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

"""Limits that keep the links of the arm apart, and away from the partner's forearm."""

from __future__ import annotations

from dataclasses import dataclass
import math

from handover_dmp.robot.collision import ClosingSpeed, CollisionModel, NearPair
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.tasks import HalfSpace, ik_setting, IkInput
import numpy as np


@dataclass(eq=False)
class _Clearance:
    """Common part: bodies close in no faster than they can brake."""

    model: RobotModel
    collision_distance: float = ik_setting(
        'collision_distance', 'Minimum distance between links, and to the forearm, m', 0.0, 1.0
    )
    collision_deceleration: float = ik_setting(
        'collision_deceleration',
        'Deceleration of a link on its way to another link or to the forearm, m/s²',
        0.01,
        100.0,
    )

    def __post_init__(self) -> None:
        self._closing_speed = closing_speed(self.collision_distance, self.collision_deceleration)


@dataclass(eq=False)
class SelfCollisionLimit(_Clearance):
    """
    Keep the links apart from each other.

    Attributes:
        model: the arm.

    """

    def __post_init__(self) -> None:
        super().__post_init__()
        self._bodies = CollisionModel.of(self.model)

    def half_spaces(self, period: IkInput) -> list[HalfSpace]:
        """Bound every pair of links that could close in too fast, see `tasks.Limit`."""
        sides = zip(period.lower, period.upper, strict=True)
        fastest = np.array([high if high > -low else -low for low, high in sides])
        near = self._bodies.near_pairs(period.joint_jacobian, self._closing_speed, fastest)
        return [_half_space(pair, self._closing_speed(pair.distance)) for pair in near]


@dataclass(eq=False)
class ForearmLimit(_Clearance):
    """
    Keep the links away from the partner's forearm, if its elbow is known.

    Attributes:
        model: the arm.

    """

    collision_activation: float = ik_setting(
        'collision_activation',
        'Distance to the forearm below which the motion of a link is limited, m',
        0.0,
        5.0,
    )

    def half_spaces(self, period: IkInput) -> list[HalfSpace]:
        """Bound every link near the forearm, see `tasks.Limit`."""
        partner = period.partner
        if partner is None or partner.elbow is None:
            return []
        near = CollisionModel.of(self.model).near_forearm(
            period.joint_jacobian,
            partner.position,
            partner.elbow,
            partner.velocity,
            self.collision_activation,
        )
        return [_half_space(pair, self._closing_speed(pair.distance)) for pair in near]


def closing_speed(kept: float, deceleration: float) -> ClosingSpeed:
    """
    Return the maximum closing speed from which braking keeps bodies apart.

    Args:
        kept: minimum distance, m.
        deceleration: deceleration towards each other, m/s².

    Returns:
        The speed, m/s, as a function of their distance, m.

    """
    twice = 2.0 * deceleration

    def allowed(distance: float) -> float:
        room = distance - kept
        return math.sqrt(twice * room) if room > 0.0 else 0.0

    return allowed


def _half_space(pair: NearPair, closing_speed: float) -> HalfSpace:
    return HalfSpace(pair.name, pair.row, min(-closing_speed - pair.drift, 0.0))
