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

"""The numbers that make a movement primitive, apart from what it has learnt."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, log, sqrt

from handover_dmp.common.errors import DataError
from handover_dmp.common.settings import setting

FORMULATIONS = ('stiff', 'printed')


@dataclass(frozen=True)
class DmpParameters:
    """
    Parameters of the canonical system (4), the goal weight (7) and the transformation system (8).

    Attributes:
        stiffness: K of (8), above 0.
        damping: D of (8); 0 stands for critical damping, 2√K.
        goal_velocity_gain: K_v of (8), s; negative stands for Dτ, with which the motion does not
            lag behind a goal of constant velocity.
        phase_at_end: s(τ), between 0 and 1; it sets α of (4).
        mu: centre of the goal weight (7), in units of τ.
        sigma: width of the goal weight (7), in units of τ.
        formulation: `stiff` puts K_s = K in front of the learnt shape, the only form that becomes
            (1a) when w_g = 1 − s; `printed` puts K_s = 1, as (5a), (8) and (9) are printed.

    Raises:
        DataError: a parameter is outside of its range.

    """

    stiffness: float = setting('dmp', 'stiffness')
    damping: float = setting('dmp', 'damping')
    goal_velocity_gain: float = setting('dmp', 'goal_velocity_gain')
    phase_at_end: float = setting('dmp', 'phase_at_end')
    mu: float = setting('dmp', 'mu')
    sigma: float = setting('dmp', 'sigma')
    formulation: str = setting('dmp', 'formulation')

    def __post_init__(self) -> None:
        """Turn the numbers into plain floats and check their ranges."""
        for name, (low, high) in RANGES.items():
            try:
                value = float(getattr(self, name))
            except (TypeError, ValueError, OverflowError) as error:
                given = _shown(getattr(self, name))
                raise DataError(f'{name} is not a number: {given}') from error
            if not (isfinite(value) and low <= value <= high):
                raise DataError(f'{name} is {value:g}; it must be from {low:g} to {high:g}')
            object.__setattr__(self, name, value)
        if self.formulation not in FORMULATIONS:
            raise DataError(
                f'formulation is {_shown(self.formulation)}; known: {", ".join(FORMULATIONS)}'
            )

    @property
    def alpha(self) -> float:
        """Decay rate α of the phase (4)."""
        return -log(self.phase_at_end)

    @property
    def effective_damping(self) -> float:
        """D of (8), with 0 replaced by 2√K."""
        return self.damping if self.damping > 0.0 else 2.0 * sqrt(self.stiffness)

    @property
    def shape_stiffness(self) -> float:
        """K_s of (8): what pulls towards the learnt shape."""
        return self.stiffness if self.formulation == 'stiff' else 1.0

    def effective_goal_velocity_gain(self, duration_s: float) -> float:
        """
        K_v of (8), with a negative value replaced by Dτ.

        Args:
            duration_s: τ, s.

        Returns:
            K_v, s.

        """
        if self.goal_velocity_gain >= 0.0:
            return self.goal_velocity_gain
        return self.effective_damping * duration_s


RANGES = {
    'stiffness': (1e-3, 1e6),
    'damping': (0.0, 1e5),
    'goal_velocity_gain': (-1e6, 1e6),
    'phase_at_end': (1e-9, 0.99),
    'mu': (-10.0, 10.0),
    'sigma': (1e-4, 10.0),
}
"""Least and greatest value of each number."""


def _shown(value: object) -> str:
    """Quote a text; whatever else a file holds may be too large to be shown."""
    return repr(value)[:40] if isinstance(value, str) else f'of type {type(value).__name__}'
