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

"""The decoupled movement primitive of the paper, (6) to (8): shape first, goal later."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import erf, log, sqrt
from typing import Any

from handover_dmp.common.arrays import Vector
from handover_dmp.dmp.basis import LAST_NODE, TABLE_RATE
from handover_dmp.dmp.primitive import Primitive, SMALLEST_PHASE, Step
from handover_dmp.dmp.state import DmpState
import numpy as np
from numpy.typing import NDArray
from scipy.special import erf as erf_of_array

# (7) is 1 to the last bit of a float this many σ beyond μ
SETTLED_DEVIATIONS = 8.3
_new = tuple.__new__  # a named tuple without the detour over its own __new__


@dataclass(frozen=True, eq=False, repr=False)
class DecoupledDmp(Primitive):
    """
    The decoupled primitive (8), weighted by (7): w_g(u) = ½[1 + erf((u − μ)/(σ√2))].

    While w_g is 0 the motion follows the learnt shape from where it started and takes no notice
    of the goal; as w_g grows to 1 it is drawn to the goal and to its velocity, without ever
    having needed to know where the goal would be. Fields: see `Primitive`.
    """

    def goal_weight_at_time(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """
        Give (7).

        Args:
            u: −ln(s)/α, any shape.

        Returns:
            w_g, from 0 to 1, of the same shape.

        """
        mu, slope = self.parameters.mu, 1.0 / (self.parameters.sigma * sqrt(2.0))
        weight: NDArray[np.float64] = 0.5 + 0.5 * erf_of_array((u - mu) * slope)
        return weight

    def shape(self, u: float) -> Vector:
        """
        Give the forcing term f of (6) at one time.

        Args:
            u: −ln(s)/α, from 0.

        Returns:
            m, d floats; beyond the end of the basis its last value.

        """
        node = min(u * TABLE_RATE, LAST_NODE)
        index = int(node)
        value, slope = self._rows[index]
        return tuple([f + (node - index) * df for f, df in zip(value, slope, strict=True)])

    @cached_property
    def _erf(self) -> tuple[float, float]:
        return (
            self.parameters.mu * TABLE_RATE,
            1.0 / (self.parameters.sigma * sqrt(2.0) * TABLE_RATE),
        )

    def _weight_pair(self, first: float, second: float) -> tuple[float, float]:
        mu, slope = self._erf
        return 0.5 + 0.5 * erf((first - mu) * slope), 0.5 + 0.5 * erf((second - mu) * slope)

    @property
    def _settled(self) -> float:
        return self.parameters.mu + SETTLED_DEVIATIONS * self.parameters.sigma

    @property
    def _sharpest(self) -> float:
        return self.parameters.sigma / 4.0

    @cached_property
    def _goal_velocity_gain(self) -> float:
        return self.parameters.effective_goal_velocity_gain(self.duration_s)

    @property
    def _advance(self) -> Callable[[Any, DmpState, Vector, Vector, Step], DmpState]:
        if self.dimensions == 3 and not self._varies:
            return type(self)._advance_three
        return type(self)._advance_any

    def _advance_three(
        self, state: DmpState, goal: Vector, goal_velocity: Vector, step: Step
    ) -> DmpState:
        """Do the same for three dimensions and constant stiffness, unrolled: a third faster."""
        (x, y, z), (vx, vy, vz), phase, start = state
        (_, _, _, _, decay, later_a, later_b, push_a, push_b, numbers, rows, scale, k_s, k) = step
        carry, keep, xa, xb, va, vb = numbers
        mu, slope = self._erf
        node = log(phase) * scale
        node_a = node + later_a
        node_b = node + later_b
        weight_a = 0.5 + 0.5 * erf((node_a - mu) * slope)
        weight_b = 0.5 + 0.5 * erf((node_b - mu) * slope)
        free_a = (1.0 - weight_a) * k_s
        free_b = (1.0 - weight_b) * k_s
        pull_a = weight_a * k
        pull_b = weight_b * k
        push_a *= weight_a
        push_b *= weight_b
        index = int(node_a) if node_a < LAST_NODE else LAST_NODE
        (fx, fy, fz), (dx, dy, dz) = rows[index]
        rest = node_a - index
        x0, y0, z0 = start
        gx, gy, gz = goal
        hx, hy, hz = goal_velocity
        x0 -= x
        y0 -= y
        z0 -= z
        gx -= x
        gy -= y
        gz -= z
        ax = free_a * (x0 + fx + rest * dx) + pull_a * gx + push_a * hx
        ay = free_a * (y0 + fy + rest * dy) + pull_a * gy + push_a * hy
        az = free_a * (z0 + fz + rest * dz) + pull_a * gz + push_a * hz
        index = int(node_b) if node_b < LAST_NODE else LAST_NODE
        (fx, fy, fz), (dx, dy, dz) = rows[index]
        rest = node_b - index
        bx = free_b * (x0 + fx + rest * dx) + pull_b * gx + push_b * hx
        by = free_b * (y0 + fy + rest * dy) + pull_b * gy + push_b * hy
        bz = free_b * (z0 + fz + rest * dz) + pull_b * gz + push_b * hz
        return _new(
            DmpState,
            (
                (
                    x + carry * vx + xa * ax + xb * bx,
                    y + carry * vy + xa * ay + xb * by,
                    z + carry * vz + xa * az + xb * bz,
                ),
                (
                    keep * vx + va * ax + vb * bx,
                    keep * vy + va * ay + vb * by,
                    keep * vz + va * az + vb * bz,
                ),
                phase * decay or SMALLEST_PHASE,
                start,
            ),
        )
