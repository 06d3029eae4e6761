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

from dataclasses import dataclass, fields
import math

from handover_dmp.common.errors import UsageError
from handover_dmp.common.settings import setting


@dataclass(frozen=True)
class HandFilter:
    """
    Parameters of the goal estimator; the defaults stand in `config/handover.yaml`.

    Attributes:
        acceleration_noise: root of the spectral density of the hand's acceleration, m/s²/√Hz.
            Larger: less lag, more noise. Its ratio to a tracker's `noise_m` sets the smoothing.
        outlier_distance_m: a pose further than this from where the hand is expected, m, is not
            believed; of a tracker with more noise, six standard deviations.
        hand_acceleration: what a hand may do between two poses, m/s²; widens the gate by half of
            it times the square of the time between them, to three times its width at most.
        hand_speed: a hand that is seen again no further off than this speed allows, m/s, is
            believed at once.
        reacquire_poses: one that is further off is believed after so many poses that agree with
            each other.
        frozen_s: a pose that stays the same to the last bit for longer than this, s, is frozen.
        refuse_frozen: whether such a pose is none; a live tracker always has noise, a replay at
            rest may have none.
        max_deviation_m: a pose whose covariance tells more than this standard deviation, m, is
            none.
        lost_s: without a pose for this long, s, the old ones no longer tell where the hand is.
        late_limit_s: poses up to this much older than the newest, s, are still worked in.
        prediction_limit_s: how far ahead of the newest pose the hand is taken to move on at its
            speed, s; the speed then falls to zero within the same time again.

    Raises:
        UsageError: a value is out of range.

    """

    acceleration_noise: float = setting('dmp', 'hand_filter.acceleration_noise')
    outlier_distance_m: float = setting('dmp', 'hand_filter.outlier_distance_m')
    hand_acceleration: float = setting('dmp', 'hand_filter.hand_acceleration')
    hand_speed: float = setting('dmp', 'hand_filter.hand_speed')
    reacquire_poses: int = setting('dmp', 'hand_filter.reacquire_poses')
    frozen_s: float = setting('dmp', 'hand_filter.frozen_s')
    refuse_frozen: bool = setting('dmp', 'hand_filter.refuse_frozen')
    max_deviation_m: float = setting('dmp', 'hand_filter.max_deviation_m')
    lost_s: float = setting('dmp', 'hand_filter.lost_s')
    late_limit_s: float = setting('dmp', 'hand_filter.late_limit_s')
    prediction_limit_s: float = setting('dmp', 'hand_filter.prediction_limit_s')

    def __post_init__(self) -> None:
        may_be_zero = {'hand_acceleration', 'refuse_frozen', 'late_limit_s', 'prediction_limit_s'}
        for item in fields(self):
            value = getattr(self, item.name)
            if not (math.isfinite(value) and value >= 0.0):
                raise UsageError(f'hand_filter.{item.name}: {value} is not 0 or more')
            if value == 0.0 and item.name not in may_be_zero:
                raise UsageError(f'hand_filter.{item.name}: must be more than 0')
