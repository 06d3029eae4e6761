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

"""The state of a movement primitive, and the result of a rollout."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import NamedTuple

from handover_dmp.common.arrays import Array, Vector
from handover_dmp.common.vectors import plus, scaled_by

SMALLEST_PHASE = 1e-300


class DmpState(NamedTuple):
    """
    State of a movement primitive of d dimensions.

    The velocity is ẋ, not v = τẋ, so it does not jump when τ changes. To set a state to a
    measurement: `state._replace(position=…, velocity=…)`.

    Attributes:
        position: x, m, d floats.
        velocity: ẋ, m/s, d floats.
        phase: s of (4), 1 at the start.
        start: x0, m, d floats.

    """

    position: Vector
    velocity: Vector
    phase: float
    start: Vector

    def braked(self, dt: float, deceleration: float) -> DmpState:
        """
        Decelerate along the path; the phase stands still.

        Args:
            dt: length of the step, s.
            deceleration: m/s².

        Returns:
            The state at the end of the step.

        """
        speed = hypot(*self.velocity)
        if speed == 0.0:
            return self
        slower = max(0.0, speed - deceleration * dt) / speed
        return self._moved(scaled_by(self.velocity, slower), dt)

    def accelerated(self, change: Sequence[float], dt: float, acceleration: float) -> DmpState:
        """
        Change the velocity as far as the acceleration permits; the phase stands still.

        Args:
            change: wanted change of the velocity, m/s, d floats.
            dt: length of the step, s.
            acceleration: its limit, m/s².

        Returns:
            The state at the end of the step.

        """
        size = hypot(*change)
        share = min(1.0, acceleration * dt / size) if size > 0.0 else 1.0
        return self._moved(plus(self.velocity, scaled_by(change, share)), dt)

    def _moved(self, velocity: Vector, dt: float) -> DmpState:
        position = tuple(
            x + 0.5 * (before + after) * dt
            for x, before, after in zip(self.position, self.velocity, velocity, strict=True)
        )
        return self._replace(position=position, velocity=velocity)


@dataclass(frozen=True, eq=False)
class Rollout:
    """
    A motion from its start to its end.

    Attributes:
        times: s, (n,).
        positions: x, m, (n, d).
        velocities: ẋ, m/s, (n, d).
        goal_weight: w_g of (7), (n,).
        phase: s of (4), (n,).
        deviation: standard deviation of the positions from the posterior of the weights, m,
            (n, d); None unless requested.

    """

    times: Array
    positions: Array
    velocities: Array
    goal_weight: Array
    phase: Array
    deviation: Array | None = None
