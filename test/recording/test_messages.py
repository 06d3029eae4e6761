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

from __future__ import annotations

from handover_dmp.recording.messages import (
    boolean,
    clock,
    encoder,
    float_array,
    joint_state,
    pose_stamped,
    string,
    twist_stamped,
    wrench_stamped,
)
from handover_dmp.topics import names_of_values
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

typesys = pytest.importorskip('rosbags.typesys')
STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)

numbers = st.floats(allow_nan=False, width=64)
times = st.integers(0, 2**31 * 10**9 - 1)
texts = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=40)


def decode(type_name: str, message: dict) -> object:
    """Encode with ours, decode with an independent library, which refuses surplus bytes."""
    return STORE.deserialize_cdr(encoder(type_name)(message), type_name)


@given(times, st.tuples(numbers, numbers, numbers), texts)
@settings(max_examples=50, deadline=None)
def test_pose_stamped(time_ns: int, position: tuple[float, float, float], frame: str) -> None:
    pose = decode(
        'geometry_msgs/msg/PoseStamped', pose_stamped(time_ns, position, (0, 0.6, 0, 0.8), frame)
    )
    assert pose.header.stamp.sec * 10**9 + pose.header.stamp.nanosec == time_ns
    assert pose.header.frame_id == frame
    assert (pose.pose.position.x, pose.pose.position.y, pose.pose.position.z) == position
    assert (pose.pose.orientation.y, pose.pose.orientation.w) == (0.6, 0.8)


@given(times, st.lists(st.tuples(texts, numbers, numbers), max_size=9))
@settings(max_examples=50, deadline=None)
def test_joint_state(time_ns: int, joints: list[tuple[str, float, float]]) -> None:
    names = [name for name, _, _ in joints]
    positions = [position for _, position, _ in joints]
    velocities = [velocity for _, _, velocity in joints]
    state = decode(
        'sensor_msgs/msg/JointState', joint_state(time_ns, names, positions, velocities)
    )
    assert state.name == names
    np.testing.assert_array_equal(state.position, positions)
    np.testing.assert_array_equal(state.velocity, velocities)
    assert state.effort.size == 0


@given(st.lists(numbers, max_size=20))
@settings(max_examples=50, deadline=None)
def test_float_array_names_its_values(values: list[float]) -> None:
    labels = [f'value_{index}' for index in range(len(values))]
    array = decode('std_msgs/msg/Float64MultiArray', float_array(np.array(values), labels))
    np.testing.assert_array_equal(array.data, values)
    assert names_of_values(array) == tuple(labels)
    assert [dimension.size for dimension in array.layout.dim] == [len(values)] * bool(values)


def test_the_others() -> None:
    twist = decode('geometry_msgs/msg/TwistStamped', twist_stamped(5, (1, 2, 3), (4, 5, 6)))
    assert (twist.twist.linear.z, twist.twist.angular.x) == (3.0, 4.0)
    wrench = decode('geometry_msgs/msg/WrenchStamped', wrench_stamped(5, (1, 2, 3), (4, 5, 6)))
    assert (wrench.wrench.force.z, wrench.wrench.torque.x) == (3.0, 4.0)
    assert wrench.header.frame_id == 'world'
    assert [decode('std_msgs/msg/Bool', boolean(value)).data for value in (1, 0)] == [True, False]
    assert decode('std_msgs/msg/String', string('Übergabe')).data == 'Übergabe'
    assert decode('rosgraph_msgs/msg/Clock', clock(1_500_000_000)).clock.nanosec == 500_000_000
    empty = decode('diagnostic_msgs/msg/DiagnosticArray', {})
    assert empty.status == []


def test_a_vector_of_the_wrong_length_is_refused() -> None:
    with pytest.raises(ValueError, match='zip'):
        pose_stamped(0, (1.0, 2.0))
