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

"""The first task: the direction of the wrist's motion."""

from __future__ import annotations

from dataclasses import dataclass
import math

from handover_dmp.common.arrays import Array
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.singularity import (
    limit_outward_speed,
    singular_slope,
    smallest_singular_direction,
)
from handover_dmp.robot.tasks import ik_setting, IkInput
import numpy as np


@dataclass(eq=False)
class DirectionTask:
    """
    Move the wrist in the desired direction, at s times the desired speed: J q̇ = s·v.

    v is the velocity of the target plus feedback of the position error. Near the end of the arm's
    reach its outward part is limited, see `singularity.limit_outward_speed`.

    Attributes:
        model: the arm.

    """

    model: RobotModel
    position_gain: float = ik_setting(
        'position_gain', 'Proportional gain of the wrist position error, 1/s', 0.0, 200.0
    )
    feedback_deceleration: float = ik_setting(
        'feedback_deceleration',
        'Deceleration that bounds the correction of the position error, m/s²: the correction is '
        'never faster than this can stop',
        0.01,
        100.0,
    )
    singularity_activation: float = ik_setting(
        'singularity_activation',
        'Smallest singular value below which the outward speed is limited, m',
        0.0,
        2.0,
    )
    singularity_min: float = ik_setting(
        'singularity_min',
        'Smallest singular value with which the arm rests at the end of its reach, m',
        0.0,
        2.0,
    )
    singularity_rate: float = ik_setting(
        'singularity_rate',
        'Rate at which the smallest singular value approaches singularity_min, 1/s',
        0.0,
        50.0,
    )
    name = 'position'

    def __post_init__(self) -> None:
        self._rows = np.zeros((3, self.model.dof + 1))
        self._joint_columns, self._scale_column = self._rows[:, :-1], self._rows[:, -1]

    def rows(self, period: IkInput) -> tuple[Array, None]:
        """Return (J, −v), see `tasks.Task`; v is stored as `period.wrist_velocity`."""
        velocity = self._towards(period)
        if period.singular_value < self.singularity_activation:
            direction = smallest_singular_direction(period.linear)
            slope = singular_slope(self.model, period.joint_positions, period.linear, direction)
            velocity, stretched = limit_outward_speed(
                velocity,
                direction,
                period.singular_value,
                slope,
                self.singularity_min,
                self.singularity_rate,
            )
            if stretched:
                period.held_back.append('stretch')
        period.wrist_velocity = velocity
        self._joint_columns[:] = period.linear
        np.negative(velocity, out=self._scale_column)
        return self._rows, None

    def _towards(self, period: IkInput) -> Array:
        """Return v: the target's velocity plus the correction, which is bounded far away."""
        target = period.target
        error = target.position - period.position
        distance = math.hypot(*error.tolist())
        if distance < 1e-12:
            return target.velocity
        gain = math.sqrt(2.0 * self.feedback_deceleration / distance)
        error *= gain if gain < self.position_gain else self.position_gain
        error += target.velocity
        return error
