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

"""The parameters of a movement primitive, other than what it has learnt."""

from __future__ import annotations

from dataclasses import dataclass
from math import log, sqrt

from handover_dmp.common.errors import DataError
from handover_dmp.common.settings import check_settings, dmp_setting, settings_of


@dataclass(frozen=True)
class DmpParameters:
    """
    Parameters of the canonical system (4), the goal weight (7) and the transformation system (8).

    Raises:
        DataError: a parameter is out of its range.

    """

    stiffness: float = dmp_setting('stiffness', 'Stiffness K of (8), above 0', 0.001, 1000000.0)
    damping: float = dmp_setting(
        'damping', 'Damping D of (8); 0: critical damping, 2√K', 0.0, 100000.0
    )
    goal_velocity_gain: float = dmp_setting(
        'goal_velocity_gain',
        'Goal velocity gain K_v of (8), s; negative: Dτ, with which the motion does not lag '
        'behind a goal of constant velocity',
        -1000000.0,
        1000000.0,
    )
    phase_at_end: float = dmp_setting(
        'phase_at_end',
        'Phase s(τ) at the end, between 0 and 1; it sets α of (4)',
        1e-09,
        0.99,
    )
    mu: float = dmp_setting('mu', 'Centre of the goal weight (7), in units of τ', -10.0, 10.0)
    sigma: float = dmp_setting(
        'sigma', 'Width of the goal weight (7), in units of τ', 0.0001, 10.0
    )
    formulation: str = dmp_setting(
        'formulation',
        'Factor K_s of the learnt shape. stiff: K_s = K, the only form that becomes (1a) when '
        'w_g = 1 − s; printed: K_s = 1, as (5a), (8) and (9) are printed',
        choices=('stiff', 'printed'),
    )

    def __post_init__(self) -> None:
        """Convert the numbers to plain floats and check their ranges."""
        check_settings(self, DataError)
        for name, what in settings_of(type(self)).items():
            if what.low is not None:
                object.__setattr__(self, name, float(getattr(self, name)))

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
        """K_s of (8), the stiffness towards the learnt shape."""
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
