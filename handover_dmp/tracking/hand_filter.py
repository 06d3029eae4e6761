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

"""The parameters by which the hand is followed, whatever trackers see it."""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.common.errors import UsageError
from handover_dmp.common.settings import check_settings, setting


@dataclass(frozen=True)
class HandFilter:
    """
    Parameters of the goal estimator; the defaults stand in `config/handover.yaml`.

    Raises:
        UsageError: a value is out of range.

    """

    acceleration_noise: float = setting(
        'dmp',
        'hand_filter.acceleration_noise',
        "root of the spectral density of the hand's acceleration, m/s²/√Hz. Larger: less lag, "
        "more noise. Its ratio to a tracker's noise_m sets the smoothing",
        1e-06,
        1000.0,
        read_only=True,
    )
    outlier_distance_m: float = setting(
        'dmp',
        'hand_filter.outlier_distance_m',
        'a pose further than this from where the hand is expected, m, is not believed; of a '
        'tracker with more noise, six standard deviations',
        1e-06,
        100.0,
        read_only=True,
    )
    hand_acceleration: float = setting(
        'dmp',
        'hand_filter.hand_acceleration',
        'what a hand may do between two poses, m/s²; widens the gate by half of it times the '
        'square of the time between them, to three times its width at most',
        0.0,
        1000.0,
        read_only=True,
    )
    hand_speed: float = setting(
        'dmp',
        'hand_filter.hand_speed',
        'a hand that is seen again no further off than this speed allows, m/s, is believed at '
        'once',
        0.001,
        1000.0,
        read_only=True,
    )
    reacquire_poses: int = setting(
        'dmp',
        'hand_filter.reacquire_poses',
        'one that is further off is believed after so many poses that agree with each other',
        1,
        1000000,
        read_only=True,
    )
    frozen_s: float = setting(
        'dmp',
        'hand_filter.frozen_s',
        'a pose that stays the same to the last bit for longer than this, s, is frozen',
        0.001,
        1000000.0,
        read_only=True,
    )
    refuse_frozen: bool = setting(
        'dmp',
        'hand_filter.refuse_frozen',
        'whether such a pose is none; a live tracker always has noise, a replay at rest may have '
        'none',
        read_only=True,
    )
    max_deviation_m: float = setting(
        'dmp',
        'hand_filter.max_deviation_m',
        'a pose whose covariance tells more than this standard deviation, m, is none',
        1e-06,
        1000.0,
        read_only=True,
    )
    lost_s: float = setting(
        'dmp',
        'hand_filter.lost_s',
        'without a pose for this long, s, the old ones no longer tell where the hand is',
        0.001,
        60.0,
        read_only=True,
    )
    late_limit_s: float = setting(
        'dmp',
        'hand_filter.late_limit_s',
        'poses up to this much older than the newest, s, are still worked in',
        0.0,
        10.0,
        read_only=True,
    )
    prediction_limit_s: float = setting(
        'dmp',
        'hand_filter.prediction_limit_s',
        'how far ahead of the newest pose the hand is taken to move on at its speed, s; the speed '
        'then falls to zero within the same time again',
        0.0,
        10.0,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self, UsageError, 'hand_filter.')
