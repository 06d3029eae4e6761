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

"""What the arm is asked for beside the wrist's position: orientation, and a good posture."""

from __future__ import annotations

from handover_dmp.robot.limits import JointLimits
import numpy as np
from numpy.typing import NDArray
import pinocchio as pin

Array = NDArray[np.float64]

UP = np.array([0.0, 0.0, 1.0])


def full_orientation(
    rotation: Array, target: Array, angular_velocity: Array, gain: float, fastest: float
) -> Array:
    """
    Turn the wrist to a rotation.

    Args:
        rotation: (3, 3), of the wrist in `world`.
        target: (3, 3), the one wanted.
        angular_velocity: (3,), of the target, rad/s, in `world`.
        gain: rad/s per rad.
        fastest: what the gain may ask for, rad/s.

    Returns:
        The wrist's angular velocity, (3,), rad/s, in `world`.

    """
    turn = rotation @ pin.log3(rotation.T @ target)
    return angular_velocity + _at_most(gain * turn, fastest)


def axis_alignment(axis: Array, target: Array, gain: float, fastest: float) -> tuple[Array, Array]:
    """
    Turn one axis of the wrist to a direction, free about that axis.

    Args:
        axis: (3,), the axis in `world`, of unit length.
        target: (3,), the direction wanted in `world`, of unit length.
        gain: rad/s per rad.
        fastest: what the gain may ask for, rad/s.

    Returns:
        Two directions square to the axis, (2, 3), and the wrist's angular velocity about each,
        (2,), rad/s.

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
    Find two directions square to an axis and to each other.

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


class PostureTask:
    """Move the joints towards the home posture, and harder away from a limit that is near."""

    def __init__(
        self, home: Array, limits: JointLimits, fastest: Array, gain: float, margin: float
    ) -> None:
        """
        Say where to.

        Args:
            home: (n,), rad.
            limits: of the joints.
            fastest: (n,), what may be asked for, rad/s.
            gain: rad/s per rad.
            margin: rad before a limit from where the joint is pushed away, 20 times as hard.

        """
        self._gain = gain
        self._push = 20.0 * gain
        columns = (home, limits.lower + margin, limits.upper - margin, fastest)
        self._joints = [tuple(map(float, joint)) for joint in zip(*columns, strict=True)]

    def velocity(self, joint_positions: Array) -> Array:
        """
        Compute the joint velocities to ask for.

        Args:
            joint_positions: (n,), rad.

        Returns:
            (n,), rad/s.

        """
        gain, push = self._gain, self._push
        wanted = []
        # plain floats and no min(), max(): for a handful of joints twice as fast as arrays
        for position, (home, low, high, fastest) in zip(
            joint_positions.tolist(), self._joints, strict=True
        ):
            speed = gain * (home - position)
            if position < low:
                speed += push * (low - position)
            elif position > high:
                speed += push * (high - position)
            speed = speed if speed < fastest else fastest
            wanted.append(speed if speed > -fastest else -fastest)
        return np.array(wanted)


def _at_most(vector: Array, length: float) -> Array:
    size = float(np.sqrt(vector @ vector))
    return vector if size <= length else vector * (length / size)


def _cross(a: Array, b: Array) -> Array:
    """Do what `numpy.cross` does for two vectors, ten times as fast."""
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
