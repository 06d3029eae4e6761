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

"""Bags for the tests of this room."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

from handover_dmp.recording import BagWriter, LATCHED, SENSOR
from handover_dmp.recording.messages import (
    float_array,
    joint_state,
    pose_stamped,
    string,
    twist_stamped,
)
import pytest

JOINTS = [f'joint_{number}' for number in range(1, 8)]


def _write_bag(folder: Path, count: int = 400, start_ns: int = 0, **options: Any) -> Path:
    """Write 4 topics of `count` messages each at 200 Hz, and one with one message."""
    with BagWriter(folder, **options) as bag:
        bag.add_topic('/handover/info', 'std_msgs/msg/String', LATCHED)
        bag.add_topic('/hand/pose', 'geometry_msgs/msg/PoseStamped', SENSOR)
        bag.add_topic('/wrist/twist_command', 'geometry_msgs/msg/TwistStamped')
        bag.add_topic('/joint_states', 'sensor_msgs/msg/JointState', SENSOR)
        bag.add_topic('/handover/phase', 'std_msgs/msg/Float64MultiArray')
        bag.write_message('/handover/info', string('{"seed": 7}'), start_ns)
        for index in range(count):
            time_ns = start_ns + index * 5_000_000
            value = index * 1e-3
            bag.write_message('/hand/pose', pose_stamped(time_ns, (value, 0.2, 1.1)), time_ns)
            bag.write_message(
                '/wrist/twist_command', twist_stamped(time_ns, (0.0, value, 0.0)), time_ns
            )
            bag.write_message(
                '/joint_states', joint_state(time_ns, JOINTS, [value] * 7, [0.1] * 7), time_ns
            )
            bag.write_message(
                '/handover/phase', float_array([value, 0.5], ['phase', 'goal_weight']), time_ns
            )
    return folder


class WriteBag(Protocol):
    def __call__(
        self, folder: Path, count: int = 400, start_ns: int = 0, **options: Any
    ) -> Path: ...


@pytest.fixture(scope='session')
def write_bag() -> WriteBag:
    """Give the function that writes a bag of so many messages a topic, at 200 Hz."""
    return _write_bag
