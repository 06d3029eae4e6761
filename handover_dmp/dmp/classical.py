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

"""The classical movement primitive, (1) to (4): the baseline of every comparison."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log

from handover_dmp.common.arrays import Array
from handover_dmp.dmp.primitive import Primitive
import numpy as np


@dataclass(frozen=True, eq=False, repr=False)
class ClassicalDmp(Primitive):
    """
    The classical primitive (1a): τv̇ = K(g − x) − Dv − K(g − x0)s + K f(s).

    With f(s) = s·Σψ_i w_i/Σψ_i, (3), this is (8) with w_g = 1 − s, K_s = K and K_v = 0, and is
    computed as such. The goal may move; its velocity is used only to extrapolate it within a
    step. Fields: see `Primitive`; the parameters `mu`, `sigma`, `goal_velocity_gain` and
    `formulation` are unused.
    """

    def goal_weight_at_time(self, u: Array) -> Array:
        """
        Return the goal weight, 1 − s.

        Args:
            u: −ln(s)/α, any shape.

        Returns:
            The weight of the goal, from 0 to 1, of the same shape.

        """
        weight: Array = 1.0 - np.exp(-self.parameters.alpha * u)
        return weight

    def goal_weight_at(self, u: float) -> float:
        """
        Return the goal weight, 1 − s, at one time.

        Args:
            u: −ln(s)/α.

        Returns:
            The weight of the goal, from 0 to 1.

        """
        return 1.0 - exp(-self.parameters.alpha * u)

    @property
    def _settled(self) -> float:
        return -log(1e-17) / self.parameters.alpha

    @property
    def _sharpest(self) -> float:
        return 0.1 / self.parameters.alpha

    @property
    def goal_velocity_gain(self) -> float:
        """K_v; 0 in (1a)."""
        return 0.0

    @property
    def shape_stiffness(self) -> float:
        """K_s; equal to K in (1a)."""
        return self.parameters.stiffness
