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

"""Messages say what they were made of, whether they are new or filled anew."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import PoseStamped
from handover_dmp.nodes.conversions import (
    nanoseconds,
    period_of,
    pose_message,
    position_of,
    quaternion_of,
    rotation_of,
    stamp,
    to_float_array,
    to_joint_command,
    twist_message,
    values_of,
    velocities_of,
)
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from scipy.spatial.transform import Rotation

numbers = st.floats(allow_nan=False)
vectors = st.tuples(numbers, numbers, numbers)
turns = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(
    lambda vector: Rotation.from_rotvec(vector).as_matrix()
)
times = st.integers(0, 2**31 * 10**9 - 1)
named = st.dictionaries(st.text('ab_', min_size=1), numbers, max_size=12)
OLD_POSE = (stamp(7), (7.0, 8.0, 9.0), (1.0, 0.0, 0.0, 0.0))


def sent(message: Any) -> Any:
    """Give a message as it arrives."""
    return deserialize_message(serialize_message(message), type(message))


@given(times, vectors, turns)
def test_a_pose_comes_back(time_ns: int, position: Any, rotation: Any) -> None:
    for old in (None, pose_message(*OLD_POSE)):
        message = pose_message(stamp(time_ns), position, quaternion_of(rotation), into=old)
        pose = sent(message)
        assert nanoseconds(pose.header.stamp) == time_ns
        assert position_of(pose) == position
        np.testing.assert_allclose(rotation_of(pose), rotation, atol=1e-12)


def test_a_pose_without_orientation_is_upright_whatever_it_was() -> None:
    assert rotation_of(PoseStamped()) is not None
    for old in (None, pose_message(*OLD_POSE)):
        np.testing.assert_array_equal(
            rotation_of(pose_message(stamp(0), (0.0, 0.0, 0.0), into=old)), np.eye(3)
        )


@given(times, vectors, vectors)
def test_a_twist_comes_back(time_ns: int, velocity: Any, earlier: Any) -> None:
    for old in (None, twist_message(stamp(7), earlier)):
        twist = sent(twist_message(stamp(time_ns), velocity, into=old))
        assert nanoseconds(twist.header.stamp) == time_ns
        assert velocities_of(twist) == (velocity, (0.0, 0.0, 0.0))


@given(named, named)
def test_named_values_come_back(values: dict[str, float], earlier: dict[str, float]) -> None:
    for old in (None, to_float_array(earlier)):
        message = sent(to_float_array(values, into=old))
        assert values_of(message) == values
        assert [part.size for part in message.layout.dim] == [len(message.data)]


@given(times, st.lists(numbers, max_size=9), st.lists(numbers, max_size=9))
def test_a_joint_command_names_its_period(
    time_ns: int, velocities: list[float], earlier: list[float]
) -> None:
    for old in (None, to_joint_command(7, earlier)):
        message = sent(to_joint_command(time_ns, velocities, into=old))
        assert period_of(message) == time_ns
        assert list(message.data) == velocities
