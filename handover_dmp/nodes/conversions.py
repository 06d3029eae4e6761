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

"""Between messages and the plain numbers of the other rooms."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, TwistStamped
from handover_dmp.topics import FRAME
import numpy as np
from numpy.typing import NDArray
import pinocchio
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

NANOSECONDS = 1_000_000_000


def nanoseconds(stamp: Time) -> int:
    """Return a stamp as one whole number, ns."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def stamp(time_ns: int) -> Time:
    """Return a whole number of ns as a stamp."""
    seconds, rest = divmod(time_ns, NANOSECONDS)
    return Time(sec=seconds, nanosec=rest)


def pose_message(
    time: Time, position: Iterable[float], rotation: NDArray[np.float64] | None = None
) -> PoseStamped:
    """
    Make a pose in `world`.

    Args:
        time: its stamp.
        position: (3,), m.
        rotation: (3, 3); none gives the unit quaternion.

    Returns:
        The message.

    """
    message = PoseStamped()
    message.header.stamp = time
    message.header.frame_id = FRAME
    place, turn = message.pose.position, message.pose.orientation
    place.x, place.y, place.z = map(float, position)
    if rotation is not None:
        turn.x, turn.y, turn.z, turn.w = map(float, pinocchio.Quaternion(rotation).coeffs())
    return message


def twist_message(time: Time, velocity: Iterable[float]) -> TwistStamped:
    """
    Make a twist in `world` without rotation.

    Args:
        time: its stamp.
        velocity: (3,), m/s.

    Returns:
        The message.

    """
    message = TwistStamped()
    message.header.stamp = time
    message.header.frame_id = FRAME
    linear = message.twist.linear
    linear.x, linear.y, linear.z = map(float, velocity)
    return message


def position_of(message: PoseStamped) -> tuple[float, float, float]:
    """Return the position of a pose, m."""
    place = message.pose.position
    return place.x, place.y, place.z


def rotation_of(message: PoseStamped) -> NDArray[np.float64] | None:
    """Return the rotation of a pose, (3, 3); None where its quaternion is none."""
    turn = message.pose.orientation
    quaternion = pinocchio.Quaternion(turn.w, turn.x, turn.y, turn.z)
    if not abs(quaternion.norm() - 1.0) < 1e-3:
        return None
    matrix: NDArray[np.float64] = quaternion.normalized().toRotationMatrix()
    return matrix


def labelled(values: Mapping[str, float]) -> Float64MultiArray:
    """
    Make an array whose layout names each value.

    Args:
        values: name to value.

    Returns:
        The message.

    """
    message = Float64MultiArray(data=[float(value) for value in values.values()])
    message.layout.dim = [MultiArrayDimension(label=name, size=1, stride=1) for name in values]
    return message


def values_of(message: Float64MultiArray) -> dict[str, float]:
    """Return what `labelled` put into an array."""
    names = (dimension.label for dimension in message.layout.dim)
    return dict(zip(names, message.data, strict=False))


def velocities_of(
    message: TwistStamped,
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return the linear velocity of a twist, m/s, and the angular one, rad/s."""
    linear, angular = message.twist.linear, message.twist.angular
    return (linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z)


def answering(time_ns: int, velocities: Iterable[float]) -> Float64MultiArray:
    """
    Make a joint command that names the period which it answers.

    Controllers of ros2_control read the data alone; in lockstep the label of the layout tells
    `robot_sim` a late answer from the one that it waits for.

    Args:
        time_ns: time of the period, ns.
        velocities: rad/s.

    Returns:
        The message.

    """
    data = [float(velocity) for velocity in velocities]
    message = Float64MultiArray(data=data)
    size = len(data)
    message.layout.dim = [MultiArrayDimension(label=str(time_ns), size=size, stride=size)]
    return message


def period_of(message: Float64MultiArray) -> int | None:
    """Return the time of the period that a joint command answers, ns; None if it names none."""
    label = message.layout.dim[0].label if message.layout.dim else ''
    return int(label) if label.isdecimal() and len(label) < 20 else None
