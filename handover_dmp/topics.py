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

"""
Name, type and quality of service of every topic of the graph.

Nodes use relative names, so that a namespace or a remap moves them; all graphs share `/clock`,
`/diagnostics`, `/tf` and `/tf_static`, as usual in ROS.

Sensor data is best effort with depth 1, since only the newest counts. Commands are reliable with
depth 1, since an old one must never be followed. Messages that a late subscriber must still get
are transient local. Positions are in metres in the frame `world` (REP 103, REP 105).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from math import pi
from typing import Any

FRAME = 'world'
TF_PERIOD_S = 0.02
"""Period of the transforms of a moving arm, s; viewers draw no faster."""
SEPARATOR = ','
HARDWARE_ID = 'handover_dmp'
"""Marks reports on `/diagnostics` that come from a node of this package."""


class Quality(Enum):
    """Quality of service: reliability, durability, depth."""

    SENSOR = ('best_effort', 'volatile', 1)
    COMMAND = ('reliable', 'volatile', 1)
    LATCHED = ('reliable', 'transient_local', 1)
    REPORT = ('reliable', 'volatile', 10)
    # as tf2 requires
    TRANSFORMS = ('reliable', 'volatile', 100)
    # for late subscribers that need the first message as well as the last
    LATCHED_REPORT = ('reliable', 'transient_local', 10)


@dataclass(frozen=True)
class Topic:
    """
    One topic.

    Attributes:
        name: absolute, of a graph in the root namespace.
        type_name: of its messages, e.g. `geometry_msgs/msg/PoseStamped`.
        quality: of service, for publisher and subscription alike.
        meaning: content of its messages, with units.
        is_global: whether the graphs of all namespaces share it.

    """

    name: str
    type_name: str
    quality: Quality
    meaning: str
    is_global: bool = False

    @property
    def relative(self) -> str:
        """Return the name that a node asks for."""
        return self.name if self.is_global else self.name.lstrip('/')

    def within(self, namespace: str) -> str:
        """
        Name the topic in a namespace.

        Args:
            namespace: namespace of the graph, e.g. `/left`; `/` or empty for the root.

        Returns:
            Its absolute name.

        """
        return self.name if self.is_global else namespace.rstrip('/') + self.name


CLOCK = Topic(
    '/clock', 'rosgraph_msgs/msg/Clock', Quality.COMMAND, 'simulated time', is_global=True
)
HAND_POSE = Topic(
    '/hand/pose',
    'geometry_msgs/msg/PoseStamped',
    Quality.SENSOR,
    'tracked wrist of the partner, m',
)
HAND_FUSED = Topic(
    '/hand/fused',
    'geometry_msgs/msg/PoseWithCovarianceStamped',
    Quality.REPORT,
    'position of the hand, fused from all trackers, m; its orientation is unknown',
)
HAND_TRUTH = Topic(
    '/hand/truth',
    'geometry_msgs/msg/PoseStamped',
    Quality.REPORT,
    'true position of the hand of a trial, without tracker errors, m',
)
ELBOW_POSE = Topic(
    '/partner/elbow',
    'geometry_msgs/msg/PoseStamped',
    Quality.SENSOR,
    "elbow of the partner's tracked arm, m, if a tracker sees it",
)
DEMONSTRATOR_POSE = Topic(
    '/human/pose',
    'geometry_msgs/msg/PoseStamped',
    Quality.SENSOR,
    'wrist of the demonstrator, whose role the robot takes, m',
)
SIGNAL = Topic(
    '/handover/signal',
    'std_msgs/msg/Header',
    Quality.LATCHED,
    "the partner's signal: the handover starts at the stamp",
)
WRIST_POSE = Topic(
    '/wrist/pose',
    'geometry_msgs/msg/PoseStamped',
    Quality.SENSOR,
    "measured pose of the robot's wrist, m",
)
POSE_COMMAND = Topic(
    '/wrist/pose_command',
    'geometry_msgs/msg/PoseStamped',
    Quality.COMMAND,
    'commanded pose of the wrist, m',
)
TWIST_COMMAND = Topic(
    '/wrist/twist_command',
    'geometry_msgs/msg/TwistStamped',
    Quality.COMMAND,
    'commanded velocity of the wrist, m/s; with the stamp of its pose',
)
IK_STATUS = Topic(
    '/wrist/ik_status',
    'std_msgs/msg/Float64MultiArray',
    Quality.COMMAND,
    'how well the arm follows; the label of the layout names the values',
)
JOINT_STATES = Topic(
    '/joint_states', 'sensor_msgs/msg/JointState', Quality.SENSOR, 'of the arm, rad and rad/s'
)
JOINT_COMMAND = Topic(
    '/joint_velocity_controller/commands',
    'std_msgs/msg/Float64MultiArray',
    Quality.COMMAND,
    'joint velocities, rad/s, in the order of the URDF',
)
JOINT_POSITIONS = Topic(
    '/velocity_to_position/positions',
    'std_msgs/msg/Float64MultiArray',
    Quality.COMMAND,
    'joint positions, rad, in the order of the URDF, for an arm that takes no velocities',
)
STATE = Topic(
    '/handover/state',
    'std_msgs/msg/String',
    Quality.LATCHED,
    'idle, reaching, exchange, done or aborted; in a session also picking_up, released, '
    'withdrawing, waiting',
)
PHASE = Topic(
    '/handover/phase',
    'std_msgs/msg/Float64MultiArray',
    Quality.COMMAND,
    'phase of the movement primitive; the label of the layout names the values',
)
GRIPPER_COMMAND = Topic(
    '/gripper/command',
    'std_msgs/msg/Bool',
    Quality.LATCHED,
    'true: close the gripper; false: open it',
)
WRIST_WRENCH = Topic(
    '/wrist/wrench',
    'geometry_msgs/msg/WrenchStamped',
    Quality.SENSOR,
    'force and torque of the object on the wrist, N and Nm; in the room or in '
    'session.wrench_frame',
)
OBJECT_POSE = Topic(
    '/object/pose',
    'geometry_msgs/msg/PoseStamped',
    Quality.REPORT,
    'pose of the object, m',
)
OBJECT_HOLDER = Topic(
    '/object/holder',
    'std_msgs/msg/String',
    Quality.LATCHED,
    'holder of the object: robot, partner, both, table or nobody',
)
MARKERS = Topic(
    '/handover/markers',
    'visualization_msgs/msg/MarkerArray',
    Quality.REPORT,
    'hand, wrist, trails, learnt path, expected goal, exchange position',
)
INFO = Topic(
    '/handover/info',
    'std_msgs/msg/String',
    Quality.LATCHED,
    'JSON: the scenario and the versions of the software',
)
ROBOT_DESCRIPTION = Topic(
    '/robot_description', 'std_msgs/msg/String', Quality.LATCHED, 'URDF of the arm'
)
TF = Topic(
    '/tf',
    'tf2_msgs/msg/TFMessage',
    Quality.TRANSFORMS,
    'pose of each moving link of the arm, relative to its parent',
    is_global=True,
)
TF_STATIC = Topic(
    '/tf_static',
    'tf2_msgs/msg/TFMessage',
    Quality.LATCHED,
    'pose of the arm in the room, and of each fixed link relative to its parent',
    is_global=True,
)
DIAGNOSTICS = Topic(
    '/diagnostics',
    'diagnostic_msgs/msg/DiagnosticArray',
    Quality.LATCHED_REPORT,
    'rate, jitter, overruns, age of inputs, faults; at the start, once a second, at the end',
    is_global=True,
)

TOPICS = (
    CLOCK, HAND_POSE, HAND_FUSED, HAND_TRUTH, ELBOW_POSE, DEMONSTRATOR_POSE, SIGNAL, WRIST_POSE,
    POSE_COMMAND, TWIST_COMMAND, IK_STATUS, JOINT_STATES, JOINT_COMMAND, STATE, PHASE,
    GRIPPER_COMMAND, WRIST_WRENCH, OBJECT_POSE, OBJECT_HOLDER, MARKERS, INFO, ROBOT_DESCRIPTION,
    TF, TF_STATIC, DIAGNOSTICS,
)  # fmt: skip
OPTIONAL = (GRIPPER_COMMAND, WRIST_WRENCH, OBJECT_POSE, OBJECT_HOLDER, ELBOW_POSE)
"""Topics that exist only if a gripper holds an object, or a tracker sees the elbow."""


def position_covariance(deviation_m: float) -> list[float]:
    """
    Make the covariance of a pose whose orientation is not known.

    Args:
        deviation_m: standard deviation of the position on each axis, m.

    Returns:
        (36,), row by row, m² and rad².

    """
    # variance of an angle that is uniform from -pi to pi
    anyhow = pi**2 / 3.0
    diagonal = [deviation_m**2] * 3 + [anyhow] * 3
    return [diagonal[k // 6] if k % 7 == 0 else 0.0 for k in range(36)]


def label_of(names: Iterable[str]) -> str:
    """
    Join the names of values into one label, since an array of numbers has one dimension.

    Args:
        names: names of the values, in order.

    Returns:
        The label of the dimension.

    """
    return SEPARATOR.join(names)


def names_of_values(message: Any) -> tuple[str, ...]:
    """
    Read the names of the values from the layout of an array.

    Args:
        message: a `std_msgs/Float64MultiArray`.

    Returns:
        Name of each value, also if each has its own dimension.

    """
    labels = (dimension.label for dimension in message.layout.dim)
    return tuple(name for label in labels for name in label.split(SEPARATOR))
