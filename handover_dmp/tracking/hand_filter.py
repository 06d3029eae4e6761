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

"""Parameters of the filter of the hand, common to all trackers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from handover_dmp.common.errors import UsageError
from handover_dmp.common.settings import check_settings, dmp_setting

_setting = partial(dmp_setting, read_only=True)


@dataclass(frozen=True)
class HandFilter:
    """
    Parameters of the goal estimator; the defaults are in `config/handover.yaml`.

    Raises:
        UsageError: a value is out of its range.

    """

    acceleration_noise: float = _setting(
        'hand_filter.acceleration_noise',
        "Square root of the spectral density of the hand's acceleration, m/s²/√Hz. Larger: less "
        "lag, more noise. Its ratio to a tracker's noise_m sets the smoothing",
        1e-06,
        1000.0,
    )
    outlier_distance_m: float = _setting(
        'hand_filter.outlier_distance_m',
        'Distance to the expected hand beyond which a pose is rejected as an outlier, m; at '
        'least six standard deviations of the tracker',
        1e-06,
        100.0,
    )
    hand_acceleration: float = _setting(
        'hand_filter.hand_acceleration',
        'Acceleration a of the hand that widens the outlier gate by a·t²/2 after a time t '
        'without a pose, to three times its width at most, m/s²',
        0.0,
        1000.0,
    )
    hand_speed: float = _setting(
        'hand_filter.hand_speed',
        'Speed that bounds how far a lost hand may have moved, m/s; a pose within that distance '
        'is accepted at once',
        0.001,
        1000.0,
    )
    reacquire_poses: int = _setting(
        'hand_filter.reacquire_poses',
        'Number of consistent poses after which a hand beyond that distance is accepted',
        1,
        1000000,
    )
    frozen_s: float = _setting(
        'hand_filter.frozen_s',
        'Time after which a pose that does not change by a single bit counts as frozen, s',
        0.001,
        1000000.0,
    )
    refuse_frozen: bool = _setting(
        'hand_filter.refuse_frozen',
        'Whether frozen poses are rejected; a live tracker always has noise, a replay at rest '
        'may have none',
    )
    max_deviation_m: float = _setting(
        'hand_filter.max_deviation_m',
        'Standard deviation, by the covariance of the message, beyond which a pose is rejected, m',
        1e-06,
        1000.0,
    )
    lost_s: float = _setting(
        'hand_filter.lost_s',
        'Time without a pose after which the hand counts as lost, s',
        0.001,
        60.0,
    )
    late_limit_s: float = _setting(
        'hand_filter.late_limit_s',
        'Maximum age of a late pose relative to the newest one at which it is still used, s',
        0.0,
        10.0,
    )
    prediction_limit_s: float = _setting(
        'hand_filter.prediction_limit_s',
        'Maximum time for which the hand is predicted at its last speed, s; the speed then falls '
        'to zero within the same time',
        0.0,
        10.0,
    )

    def __post_init__(self) -> None:
        check_settings(self, UsageError, 'hand_filter.')
