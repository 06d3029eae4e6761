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

"""Messages without ROS: from plain values to the bytes on the wire and in bags."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from typing import Any

from handover_dmp.recording.message_definitions import message_definition
from handover_dmp.topics import label_of, position_covariance

# The library that decodes can also encode, but its public interface only writes whole files. Our
# files also need quality of service and type hashes, so we use its internal encoder.
from mcap_ros2._dynamic import serialize_dynamic

Message = Mapping[str, Any]


@cache
def encoder(type_name: str) -> Callable[[Message], bytes]:
    """
    Make the function that encodes messages of one type.

    Args:
        type_name: e.g. `geometry_msgs/msg/PoseStamped`.

    Returns:
        Function from the message, as nested dictionaries of its fields, to CDR bytes, little
        endian, with the header of four bytes. Missing fields are zero or empty.

    Raises:
        DataError: no package on this machine defines the type.

    """
    definition = message_definition(type_name)
    return serialize_dynamic(type_name, definition.text)[type_name]  # type: ignore[no-any-return]


def time_message(time_ns: int) -> dict[str, int]:
    """Return a `builtin_interfaces/Time` or `Duration` from nanoseconds."""
    seconds, nanoseconds = divmod(int(time_ns), 10**9)
    return {'sec': seconds, 'nanosec': nanoseconds}


def header(time_ns: int, frame: str = 'world') -> dict[str, Any]:
    """Return a `std_msgs/Header`."""
    return {'stamp': time_message(time_ns), 'frame_id': frame}


def clock(time_ns: int) -> dict[str, Any]:
    """Return a `rosgraph_msgs/Clock`."""
    return {'clock': time_message(time_ns)}


def pose_stamped(
    time_ns: int,
    position: Sequence[float],
    orientation: Sequence[float] = (0.0, 0.0, 0.0, 1.0),
    frame: str = 'world',
) -> dict[str, Any]:
    """
    Return a `geometry_msgs/PoseStamped`.

    Args:
        time_ns: stamp in nanoseconds.
        position: (3,), m.
        orientation: quaternion x, y, z, w.
        frame: frame of the pose.

    """
    return {
        'header': header(time_ns, frame),
        'pose': {
            'position': _named(position, 'xyz'),
            'orientation': _named(orientation, 'xyzw'),
        },
    }


def pose_with_covariance_stamped(
    time_ns: int, position: Sequence[float], deviation_m: float
) -> dict[str, Any]:
    """
    Return a `geometry_msgs/PoseWithCovarianceStamped` with unknown orientation.

    Args:
        time_ns: stamp in nanoseconds.
        position: (3,), m.
        deviation_m: standard deviation of the position on each axis, m.

    Returns:
        The message.

    """
    pose = pose_stamped(time_ns, position)
    covariance = position_covariance(deviation_m)
    return {'header': pose['header'], 'pose': {'pose': pose['pose'], 'covariance': covariance}}


def twist_stamped(
    time_ns: int, linear: Sequence[float], angular: Sequence[float] = (0.0, 0.0, 0.0)
) -> dict[str, Any]:
    """
    Return a `geometry_msgs/TwistStamped`.

    Args:
        time_ns: stamp in nanoseconds.
        linear: (3,), m/s.
        angular: (3,), rad/s.

    """
    return {
        'header': header(time_ns),
        'twist': {'linear': _named(linear, 'xyz'), 'angular': _named(angular, 'xyz')},
    }


def wrench_stamped(
    time_ns: int, force: Sequence[float], torque: Sequence[float]
) -> dict[str, Any]:
    """
    Return a `geometry_msgs/WrenchStamped`.

    Args:
        time_ns: stamp in nanoseconds.
        force: (3,), N.
        torque: (3,), Nm.

    """
    return {
        'header': header(time_ns),
        'wrench': {'force': _named(force, 'xyz'), 'torque': _named(torque, 'xyz')},
    }


def joint_state(
    time_ns: int,
    names: Sequence[str],
    positions: Sequence[float],
    velocities: Sequence[float],
) -> dict[str, Any]:
    """
    Return a `sensor_msgs/JointState`.

    Args:
        time_ns: stamp in nanoseconds.
        names: names of the joints.
        positions: joint positions, rad.
        velocities: joint velocities, rad/s.

    """
    return {
        'header': header(time_ns, ''),
        'name': list(names),
        'position': _floats(positions),
        'velocity': _floats(velocities),
    }


def transforms(time_ns: int, frames: Iterable[Sequence[Any]]) -> dict[str, Any]:
    """
    Return a `tf2_msgs/TFMessage`.

    Args:
        time_ns: stamp in nanoseconds.
        frames: for each transform, the names of parent and child, the position of the child in
            the parent, (3,) m, and the quaternion x, y, z, w from child to parent axes.

    """
    return {
        'transforms': [
            {
                'header': header(time_ns, parent),
                'child_frame_id': child,
                'transform': {
                    'translation': _named(position, 'xyz'),
                    'rotation': _named(quaternion, 'xyzw'),
                },
            }
            for parent, child, position, quaternion in frames
        ]
    }


def float_array(values: Sequence[float], labels: Sequence[str] = ()) -> dict[str, Any]:
    """
    Return a `std_msgs/Float64MultiArray`.

    Args:
        values: the data.
        labels: name of each value, or one for all; stored as the label of the single dimension.

    """
    size = len(values)
    dimensions = [{'label': label_of(labels), 'size': size, 'stride': size}] if labels else []
    return {'layout': {'dim': dimensions, 'data_offset': 0}, 'data': _floats(values)}


def string(text: str) -> dict[str, Any]:
    """Return a `std_msgs/String`."""
    return {'data': text}


def boolean(value: bool) -> dict[str, Any]:
    """Return a `std_msgs/Bool`."""
    return {'data': bool(value)}


def _named(values: Sequence[float], names: str) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def _floats(values: Sequence[float]) -> list[float]:
    return [float(value) for value in values]
