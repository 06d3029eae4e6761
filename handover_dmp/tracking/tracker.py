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

"""Parameters of a tracker: accuracy, delay and rate of its poses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
import math

from handover_dmp.common.errors import UsageError
from handover_dmp.common.settings import check_settings, dmp_setting

PATIENCE_PERIODS = 2.2
"""Time-out of a tracker in periods: one lost pose does not stop the arm."""

_setting = partial(dmp_setting, read_only=True)


@dataclass(frozen=True)
class Tracker:
    """
    A tracker of the hand; the defaults are in `config/handover.yaml`.

    Attributes:
        name: its name, for messages.

    Raises:
        UsageError: a value is out of its range.

    """

    name: str = 'tracker'
    noise_m: float = _setting(
        'tracker.noise_m',
        'Standard deviation of a pose on each axis, m',
        1e-09,
        1.0,
    )
    weight: float = _setting(
        'tracker.weight',
        'Weight of a pose in addition to its noise; 2: as much as two poses',
        1e-06,
        1000000.0,
    )
    use_covariance: bool = _setting(
        'tracker.use_covariance',
        'Whether the covariance of a message, if it has one, replaces noise_m',
    )
    delay_s: float = _setting(
        'tracker.delay_s',
        'Delay of the stamps of the poses, s; negative: the stamps are early',
        -10.0,
        10.0,
    )
    bias: str = _setting(
        'tracker.bias',
        'Constant offset of the poses: none, fixed (bias_m) or learnt (estimated from bias_m on, '
        'while another tracker sees the hand)',
        choices=('none', 'fixed', 'learnt'),
    )
    bias_m: tuple[float, ...] = _setting(
        'tracker.bias_m', 'Offset of the poses from the truth, (3,), m'
    )
    bias_deviation_m: float = _setting(
        'tracker.bias_deviation_m',
        'Standard deviation of a learnt bias about bias_m, m',
        1e-06,
        10.0,
    )
    bias_drift: float = _setting(
        'tracker.bias_drift',
        'Rate at which a learnt bias may change, m/√s',
        0.0,
        1.0,
    )
    rate_hz: float = _setting(
        'tracker.rate_hz',
        'Rate of the poses, Hz, from which a missing pose is noticed',
        0.1,
        10000.0,
    )

    def __post_init__(self) -> None:
        check_settings(self, UsageError, f'{self.name}.')
        if len(self.bias_m) != 3 or not all(map(math.isfinite, self.bias_m)):
            raise UsageError(f'{self.name}.bias_m: {list(self.bias_m)} is not three numbers')

    @property
    def variance(self) -> float:
        """Effective variance of a pose on each axis, m²."""
        return self.noise_m**2 / self.weight

    @property
    def timeout_s(self) -> float:
        """Time without a pose after which it has lost the hand, s."""
        return PATIENCE_PERIODS / self.rate_hz
