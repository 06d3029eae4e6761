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

from dataclasses import dataclass
from functools import cached_property
from math import erf, exp, log, sqrt

from handover_dmp.common.arrays import Array, Vector
from handover_dmp.common.vectors import minus, plus
from handover_dmp.dmp.fast_step import fast_step, FastStep
from handover_dmp.dmp.primitive import Primitive
from handover_dmp.dmp.state import DmpState

# (7) is exactly 1 in floating point this many σ beyond μ
SETTLED_DEVIATIONS = 8.3


@dataclass(frozen=True, eq=False, repr=False)
class DecoupledDmp(Primitive):
    """
    The decoupled primitive (8), weighted by (7): w_g(u) = ½[1 + erf((u − μ)/(σ√2))].

    While w_g is 0, the motion follows the learnt shape from its start and ignores the goal. As
    w_g grows to 1, the motion is attracted to the goal and to its velocity. The final goal need
    not be known in advance. Fields: see `Primitive`.
    """

    def goal_weight_at_time(self, u: Array) -> Array:
        """
        Return the goal weight (7).

        Args:
            u: −ln(s)/α, any shape.

        Returns:
            w_g, from 0 to 1, of the same shape.

        """
        from scipy.special import erf as erf_of_array

        mu, slope = self.parameters.mu, 1.0 / (self.parameters.sigma * sqrt(2.0))
        weight: Array = 0.5 + 0.5 * erf_of_array((u - mu) * slope)
        return weight

    def goal_weight_at(self, u: float) -> float:
        """
        Return the goal weight (7) at one time.

        Args:
            u: −ln(s)/α.

        Returns:
            w_g, from 0 to 1.

        """
        return 0.5 + 0.5 * erf((u - self.parameters.mu) / (self.parameters.sigma * sqrt(2.0)))

    def step_as_late(
        self,
        state: DmpState,
        goal: Vector,
        goal_velocity: Vector,
        dt: float,
        phase_rate: float,
        later: float,
    ) -> DmpState:
        """
        Step (8) with the goal weight of a later time and the present shape.

        The primitive is stepped at the later time, with its start shifted by what the shape would
        have moved until then. This is exact for any step length.

        Args:
            state: state at the start of the step.
            goal: g, m.
            goal_velocity: ġ, m/s.
            dt: length of the step, s.
            phase_rate: speed of the phase, 1 as learnt.
            later: time whose goal weight is used, −ln(s)/α.

        Returns:
            The state at the end of the step.

        """
        alpha = self.parameters.alpha
        half = 0.5 * phase_rate * dt / self.duration_s
        now, then = self.shape(-log(state.phase) / alpha + half), self.shape(later + half)
        moved = plus(state.start, minus(now, then))
        asked = state._replace(phase=exp(-alpha * later), start=moved)
        after = self.step(asked, goal, goal_velocity, dt, phase_rate)
        phase = state.phase * exp(-2.0 * alpha * half)
        return after._replace(phase=phase, start=state.start)

    @property
    def _settled(self) -> float:
        return self.parameters.mu + SETTLED_DEVIATIONS * self.parameters.sigma

    @property
    def _sharpest(self) -> float:
        return self.parameters.sigma / 4.0

    @cached_property
    def goal_velocity_gain(self) -> float:
        """K_v, s."""
        return self.parameters.effective_goal_velocity_gain(self.duration_s)

    def _fast_step(self, h: float) -> FastStep | None:
        if self.dimensions != 3 or self.varies:
            return None
        rows = self.shape_rows
        return fast_step(self.parameters, self.duration_s, self.goal_velocity_gain, rows, h)
