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

"""Conversions between messages and the plain numbers of the other rooms."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Mapping
from math import hypot

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TwistStamped
from handover_dmp.common.arrays import Array, Point
from handover_dmp.common.quaternions import IDENTITY, normalized, Quaternion, to_matrix
from handover_dmp.topics import FRAME, label_of, names_of_values, position_covariance
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension

NANOSECONDS = 1_000_000_000


def nanoseconds(stamp: Time) -> int:
    """Return a stamp as one whole number, ns."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def stamp(time_ns: int) -> Time:
    """Return a whole number of ns as a stamp."""
    seconds, rest = divmod(time_ns, NANOSECONDS)
    return Time(sec=seconds, nanosec=rest)


def pose_message(
    time: Time,
    position: Iterable[float],
    orientation: Quaternion | None = None,
    *,
    frame: str = FRAME,
    into: PoseStamped | None = None,
) -> PoseStamped:
    """
    Make a pose.

    Args:
        time: its stamp.
        position: (3,), m.
        orientation: x, y, z, w; None: the unit quaternion.
        frame: frame of the pose.
        into: message to reuse, which takes a fifth of the time.

    Returns:
        The message.

    """
    message = PoseStamped(header=Header(frame_id=frame)) if into is None else into
    message.header.stamp = time
    place, turn = message.pose.position, message.pose.orientation
    place.x, place.y, place.z = map(float, position)
    turn.x, turn.y, turn.z, turn.w = IDENTITY if orientation is None else orientation
    return message


def pose_with_covariance(
    time: Time,
    position: Iterable[float],
    deviation_m: float,
    *,
    frame: str = FRAME,
    into: PoseWithCovarianceStamped | None = None,
) -> PoseWithCovarianceStamped:
    """
    Make a position with its covariance.

    Args:
        time: its stamp.
        position: (3,), m.
        deviation_m: standard deviation on each axis, m.
        frame: frame of the position.
        into: message to reuse.

    Returns:
        The message; its orientation is unknown.

    """
    message = PoseWithCovarianceStamped(header=Header(frame_id=frame)) if into is None else into
    message.header.stamp = time
    place = message.pose.pose.position
    place.x, place.y, place.z = map(float, position)
    message.pose.covariance = position_covariance(deviation_m)
    return message


def twist_message(
    time: Time,
    velocity: Iterable[float],
    angular_velocity: Iterable[float] = (0.0, 0.0, 0.0),
    *,
    frame: str = FRAME,
    into: TwistStamped | None = None,
) -> TwistStamped:
    """
    Make a twist.

    Args:
        time: its stamp.
        velocity: (3,), m/s.
        angular_velocity: (3,), rad/s.
        frame: frame of the twist.
        into: message to reuse.

    Returns:
        The message.

    """
    message = TwistStamped(header=Header(frame_id=frame)) if into is None else into
    message.header.stamp = time
    linear = message.twist.linear
    linear.x, linear.y, linear.z = map(float, velocity)
    angular = message.twist.angular
    angular.x, angular.y, angular.z = map(float, angular_velocity)
    return message


def position_of(message: PoseStamped) -> Point:
    """Return the position of a pose, m."""
    place = message.pose.position
    return place.x, place.y, place.z


def quaternion_of(rotation: Array) -> Quaternion:
    """Return a rotation, (3, 3), as a quaternion."""
    # imported here: the nodes that know the arm have it already, the others need not load it
    import pinocchio

    x, y, z, w = pinocchio.Quaternion(rotation).coeffs().tolist()
    return x, y, z, w


def orientation_of(message: PoseStamped) -> Quaternion | None:
    """Return the orientation of a pose, of norm 1; None if its quaternion is invalid."""
    turn = message.pose.orientation
    found = turn.x, turn.y, turn.z, turn.w
    return normalized(found) if abs(hypot(*found) - 1.0) < 1e-3 else None


def rotation_of(message: PoseStamped) -> Array | None:
    """Return the rotation of a pose, (3, 3); None if its quaternion is invalid."""
    found = orientation_of(message)
    return None if found is None else to_matrix(found)


def to_float_array(
    values: Mapping[str, float], *, into: Float64MultiArray | None = None
) -> Float64MultiArray:
    """
    Make an array whose layout names each value.

    Args:
        values: name to value.
        into: message to reuse.

    Returns:
        The message.

    """
    return _array(label_of(values), values.values(), into)


def values_of(message: Float64MultiArray) -> dict[str, float]:
    """Return what `to_float_array` put into an array."""
    return dict(zip(names_of_values(message), message.data, strict=False))


def velocities_of(message: TwistStamped) -> tuple[Point, Point]:
    """Return the linear velocity of a twist, m/s, and the angular one, rad/s."""
    linear, angular = message.twist.linear, message.twist.angular
    return (linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z)


def to_joint_command(
    time_ns: int, velocities: Iterable[float], *, into: Float64MultiArray | None = None
) -> Float64MultiArray:
    """
    Make a joint command that names the period that it answers.

    Controllers of ros2_control read only the data. In lockstep the label of the layout lets
    `robot_sim` distinguish a late answer from the one that it waits for.

    Args:
        time_ns: time of the period, ns.
        velocities: rad/s.
        into: message to reuse.

    Returns:
        The message.

    """
    return _array(str(time_ns), velocities, into)


def _array(
    label: str, values: Iterable[float], into: Float64MultiArray | None
) -> Float64MultiArray:
    if into is None:
        into = Float64MultiArray()
        into.layout.dim = [MultiArrayDimension()]
    into.data = array('d', values)
    dimension = into.layout.dim[0]
    dimension.label, dimension.size, dimension.stride = label, len(into.data), len(into.data)
    return into


def period_of(message: Float64MultiArray) -> int | None:
    """Return the time of the period that a joint command answers, ns; None if it names none."""
    label = message.layout.dim[0].label if message.layout.dim else ''
    return int(label) if label.isdecimal() and len(label) < 20 else None
