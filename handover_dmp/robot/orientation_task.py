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

"""The third task: the orientation of the wrist, in full or of one axis."""

from __future__ import annotations

from dataclasses import dataclass
import math

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import UsageError
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.tasks import ik_setting, IkInput
import numpy as np
import pinocchio as pin

UP = np.array([0.0, 0.0, 1.0])
ORIENTATIONS = ('none', 'full', 'level', 'upright', 'point')
NEAR_HAND_M = 0.1
"""Closer to the hand, its direction changes fast; the angular speed is limited there."""


@dataclass(eq=False)
class OrientationTask:
    """
    Turn the wrist.

    Attributes:
        model: the arm.

    Raises:
        UsageError: there is no such orientation.

    """

    model: RobotModel
    orientation: str = ik_setting(
        'orientation',
        "Orientation task: none, full (the target's rotation), level (what is up in the home "
        "configuration stays up), upright (what is up in the target's rotation stays up) or "
        "point (the wrist's z axis points at the partner's hand)",
        choices=ORIENTATIONS,
    )
    orientation_gain: float = ik_setting(
        'orientation_gain', 'Proportional gain of the orientation error, 1/s', 0.0, 200.0
    )
    orientation_speed: float = ik_setting(
        'orientation_speed',
        'Maximum angular speed for the correction of the orientation, rad/s',
        0.0,
        20.0,
    )
    name = 'orientation'

    def __post_init__(self) -> None:
        if self.orientation not in ORIENTATIONS:
            raise UsageError(
                f'orientation is {self.orientation!r}, not one of {", ".join(ORIENTATIONS)}'
            )
        _, home = self.model.wrist_pose(self.model.home)
        self._level_axis = home.T @ UP

    def rows(self, period: IkInput) -> tuple[Array, Array] | None:
        """Return the rows of the wrist's rotation, see `tasks.Task`."""
        if self.orientation == 'none':
            return None
        gain, fastest, target = self.orientation_gain, self.orientation_speed, period.target
        if self.orientation == 'full':
            if target.rotation is None:
                return None
            turn = np.zeros(3) if target.angular_velocity is None else target.angular_velocity
            speed = full_orientation(period.rotation, target.rotation, turn, gain, fastest)
            return period.jacobian[3:], speed
        if self.orientation == 'level':
            axis, wanted = period.rotation @ self._level_axis, UP
        elif self.orientation == 'upright':
            if target.rotation is None:
                return None
            axis, wanted = period.rotation @ (target.rotation.T @ UP), UP
        else:
            if period.partner is None:
                return None
            apart = period.partner.position - period.position
            distance = math.hypot(*apart.tolist())
            if distance < 1e-3:
                return None
            axis, wanted = period.rotation[:, 2], apart / distance
            gain *= min(1.0, distance / NEAR_HAND_M)
        directions, speed = axis_alignment(axis, wanted, gain, fastest)
        return directions @ period.jacobian[3:], speed

    def off(self, rotation: Array, target: Array | None) -> float:
        """
        Return the orientation error of a wrist, as far as the task controls it.

        Args:
            rotation: (3, 3), rotation of the wrist in `world`.
            target: (3, 3), rotation of the target; None if any will do.

        Returns:
            Norm of the difference of the matrices, or of their upright axes; about the angle, rad.

        """
        if target is None or self.orientation not in ('full', 'upright'):
            return 0.0
        difference = rotation - target
        if self.orientation == 'upright':
            difference = difference.T @ UP
        return float(np.linalg.norm(difference))


def full_orientation(
    rotation: Array, target: Array, angular_velocity: Array, gain: float, fastest: float
) -> Array:
    """
    Turn the wrist to a rotation.

    Args:
        rotation: (3, 3), rotation of the wrist in `world`.
        target: (3, 3), the desired rotation.
        angular_velocity: (3,), angular velocity of the target, rad/s, in `world`.
        gain: rad/s per rad.
        fastest: maximum angular speed of the correction, rad/s.

    Returns:
        The wrist's angular velocity, (3,), rad/s, in `world`.

    """
    turn = rotation @ pin.log3(rotation.T @ target)
    return angular_velocity + _at_most(gain * turn, fastest)


def axis_alignment(axis: Array, target: Array, gain: float, fastest: float) -> tuple[Array, Array]:
    """
    Turn one axis of the wrist to a direction, with free rotation about that axis.

    Args:
        axis: (3,), the axis in `world`, of unit length.
        target: (3,), the desired direction in `world`, of unit length.
        gain: rad/s per rad.
        fastest: maximum angular speed of the correction, rad/s.

    Returns:
        Two directions perpendicular to the axis, (2, 3), and the wrist's angular velocity about
        each, (2,), rad/s.

    """
    crossed = _cross(axis, target)
    sine, cosine = float(np.sqrt(crossed @ crossed)), float(axis @ target)
    first, second = orthogonal_directions(axis)
    if sine > 1e-9:
        turn = crossed * (np.arctan2(sine, cosine) / sine)
    else:
        turn = first * (0.0 if cosine > 0.0 else np.pi)
    directions = np.array([first, second])
    return directions, directions @ _at_most(gain * turn, fastest)


def orthogonal_directions(axis: Array) -> tuple[Array, Array]:
    """
    Find two directions perpendicular to an axis and to each other.

    Args:
        axis: (3,), of unit length.

    Returns:
        The two, (3,) each, of unit length.

    """
    helper = np.zeros(3)
    helper[int(np.argmin(np.abs(axis)))] = 1.0
    first = _cross(axis, helper)
    first /= np.sqrt(first @ first)
    return first, _cross(axis, first)


def _at_most(vector: Array, length: float) -> Array:
    size = float(np.sqrt(vector @ vector))
    return vector if size <= length else vector * (length / size)


def _cross(a: Array, b: Array) -> Array:
    """Compute `numpy.cross` of two vectors, ten times as fast."""
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
