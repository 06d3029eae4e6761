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

"""Preferences of free joints: towards home, away from limits, away from the partner."""

from __future__ import annotations

from dataclasses import dataclass
import math

from handover_dmp.common.arrays import Array
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.partner import Partner
from handover_dmp.robot.tasks import ik_setting, IkInput
import numpy as np

MAX_SPEED_SHARE = 0.5
"""Maximum preferred velocity, as a share of a joint's velocity limit."""
LIMIT_GAIN = 20.0
"""Gain away from a near limit, relative to that towards home."""


@dataclass(eq=False)
class Posture:
    """
    Move the joints towards the home configuration, and with more gain away from a near limit.

    Attributes:
        model: the arm.

    """

    model: RobotModel
    posture_gain: float = ik_setting(
        'posture_gain', 'Proportional gain towards the home configuration, 1/s', 0.0, 50.0
    )
    limit_margin: float = ik_setting(
        'limit_margin',
        'Distance to a position limit below which the joint is pushed away from it, rad',
        0.0,
        3.0,
    )

    def __post_init__(self) -> None:
        limits = self.model.limits
        columns = (
            self.model.home,
            limits.lower + self.limit_margin,
            limits.upper - self.limit_margin,
            MAX_SPEED_SHARE * limits.velocity,
        )
        self._joints = [tuple(map(float, joint)) for joint in zip(*columns, strict=True)]

    def velocity(self, period: IkInput) -> list[float]:
        """Return the joint velocities, see `tasks.Preference`."""
        gain, push = self.posture_gain, LIMIT_GAIN * self.posture_gain
        wanted = []
        # plain floats without min() and max(): twice as fast as arrays for a few joints
        for position, (home, low, high, fastest) in zip(period.joints, self._joints, strict=True):
            speed = gain * (home - position)
            if position < low:
                speed += push * (low - position)
            elif position > high:
                speed += push * (high - position)
            speed = speed if speed < fastest else fastest
            wanted.append(speed if speed > -fastest else -fastest)
        return wanted


@dataclass(eq=False)
class ElbowClearance:
    """
    Move the elbow away from the partner, if the partner is near.

    Attributes:
        model: the arm.

    """

    model: RobotModel
    elbow_distance: float = ik_setting(
        'elbow_distance',
        'Distance between elbow and partner below which the elbow is moved away, m',
        0.0,
        2.0,
    )
    elbow_gain: float = ik_setting(
        'elbow_gain', 'Proportional gain of the missing distance of the elbow, 1/s', 0.0, 50.0
    )

    def __post_init__(self) -> None:
        self._elbow = _elbow(self.model)
        self._fastest = MAX_SPEED_SHARE * self.model.limits.velocity

    def velocity(self, period: IkInput) -> list[float] | None:
        """Return the joint velocities, see `tasks.Preference`."""
        if period.partner is None:
            return None
        elbow = self.model.pinocchio_data.oMi[self._elbow].translation
        apart = elbow - _nearest_on_forearm(elbow, period.partner)
        distance = math.hypot(*apart.tolist())
        missing = self.elbow_distance - distance
        if missing <= 0.0 or distance < 1e-6:
            return None
        x, y, z = elbow
        a, b, c = apart / distance
        turning = np.array([a, b, c, y * c - z * b, z * a - x * c, x * b - y * a])
        row = turning @ period.joint_jacobian
        row[self._elbow:] = 0.0  # fmt: skip
        square = float(row @ row)
        if square < 1e-4:
            return None
        away: Array = row * (self.elbow_gain * missing / square)
        kept: list[float] = np.minimum(np.maximum(away, -self._fastest), self._fastest).tolist()
        return kept


def _elbow(model: RobotModel) -> int:
    """Find the joint farthest from the line from shoulder to wrist, at home."""
    wrist, _ = model.wrist_pose(model.home)
    line = wrist - model.shoulder
    line /= max(float(np.linalg.norm(line)), 1e-9)
    joints = range(1, model.dof + 1)
    apart = [model.pinocchio_data.oMi[joint].translation - model.shoulder for joint in joints]
    return 1 + int(np.argmax([np.linalg.norm(a - (a @ line) * line) for a in apart]))


def _nearest_on_forearm(point: Array, partner: Partner) -> Array:
    if partner.elbow is None:
        return partner.position
    axis = partner.elbow - partner.position
    share = float((point - partner.position) @ axis) / max(float(axis @ axis), 1e-12)
    nearest: Array = partner.position + min(max(share, 0.0), 1.0) * axis
    return nearest
