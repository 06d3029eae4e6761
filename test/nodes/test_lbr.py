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

"""The README's KUKA example, word by word, with the description in the form its stack gives it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
import os
from pathlib import Path
import shlex
import subprocess
import sys
import time
from typing import Any

from handover_dmp.bench.odd_arms import lbr
from handover_dmp.bench.zoo import file_limits
from handover_dmp.nodes.conversions import pose_message, quaternion_of
from handover_dmp.nodes.graph import isolate
from handover_dmp.nodes.qos import message_class, qos_profile
from handover_dmp.nodes.shutdown import shut_down
from handover_dmp.robot.model import BasePlacement, RobotModel
from handover_dmp.topics import JOINT_STATES, POSE_COMMAND, ROBOT_DESCRIPTION
import numpy as np
from numpy.typing import NDArray
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

pytestmark = [pytest.mark.ros, pytest.mark.timeout(400)]

README = Path(__file__).resolve().parents[2] / 'README.md'
NAMES = [f'lbr_A{i}' for i in range(1, 8)]
STATES, COMMANDS = '/lbr/joint_states', '/lbr/forward_position_controller/commands'
BASE = BasePlacement((0.0, -0.9, 0.6))
WAIT_S = 120.0
PATIENT = {
    'velocity_to_position': ['-p', 'command_timeout_s:=2.0', '-p', 'joint_state_timeout_s:=10.0'],
    'priority_ik': ['-p', 'command_timeout_s:=2.0', '-p', 'joint_state_timeout_s:=2.0'],
}
"""What a machine that does much else needs beyond the README's words."""


class Stack:
    """What lbr_fri_ros2_stack is to the graph: an arm that follows positions at 100 Hz."""

    def __init__(self) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=int(os.environ['ROS_DOMAIN_ID']))
        self.node = rclpy.create_node('lbr_stack', context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.place: NDArray[np.float64] = np.array([0.0, 0.5, 0.0, -1.4, 0.0, 0.5, 0.0])
        self.told: list[NDArray[np.float64]] = []
        self.target: Any = None
        self.heard: JointState | None = None
        self.node.create_subscription(Float64MultiArray, COMMANDS, self._follow, 100)
        self.node.create_subscription(
            JointState, JOINT_STATES.name, self._hear, qos_profile(JOINT_STATES.quality)
        )
        self.states = self.node.create_publisher(JointState, STATES, 10)
        self.poses = self.node.create_publisher(
            message_class(POSE_COMMAND.type_name),
            POSE_COMMAND.name,
            qos_profile(POSE_COMMAND.quality),
        )
        self.descriptions = self.node.create_publisher(
            String, '/lbr/robot_description', qos_profile(ROBOT_DESCRIPTION.quality)
        )
        self.node.create_timer(0.01, self._measure)

    def _follow(self, message: Float64MultiArray) -> None:
        self.told.append(np.array(message.data))
        self.place = self.told[-1]

    def _hear(self, message: JointState) -> None:
        self.heard = message

    def _measure(self) -> None:
        now = self.node.get_clock().now().to_msg()
        state = JointState(name=NAMES, position=self.place.tolist(), velocity=[float('nan')] * 7)
        state.header.stamp = now
        self.states.publish(state)
        if self.target is not None:
            self.poses.publish(pose_message(now, *self.target))

    def until(self, done: Callable[[], bool], processes: list[subprocess.Popen[str]]) -> None:
        """Be the arm until something is so."""
        end_s = time.monotonic() + WAIT_S
        while not done():
            assert all(process.poll() is None for process in processes)
            assert time.monotonic() < end_s, 'it does not come to that'
            self.executor.spin_once(timeout_sec=0.02)


@pytest.fixture
def stack() -> Iterator[Stack]:
    isolate()
    stack = Stack()
    yield stack
    stack.executor.shutdown()
    shut_down(stack.node)


def command(node: str) -> list[str]:
    """Return the README's words for a node of the example, after `ros2 run handover_dmp`."""
    (line,) = [
        line
        for line in README.read_text(encoding='utf-8').splitlines()
        if line.startswith(f'ros2 run handover_dmp {node} ') and 'iiwa14.urdf' in line
    ]
    return shlex.split(line)[3:]


@pytest.mark.parametrize(
    ('model', 'robot'), [('iiwa14', 'iiwa14.urdf'), ('med7', '/lbr/robot_description')]
)
def test_the_example_moves_the_arm_within_the_limits_of_its_file(
    stack: Stack, tmp_path: Path, model: str, robot: str
) -> None:
    text = lbr(model)
    (tmp_path / 'iiwa14.urdf').write_text(text, encoding='utf-8')
    with ExitStack() as ended:
        processes = []
        for node in ('velocity_to_position', 'priority_ik'):
            words = [word.replace('iiwa14.urdf', robot) for word in command(node)]
            process = subprocess.Popen(
                [sys.executable, '-m', f'handover_dmp.nodes.{node}', *words[1:], *PATIENT[node]],
                cwd=tmp_path,
                text=True,
                stderr=subprocess.PIPE,
            )
            ended.callback(process.communicate)
            ended.callback(process.kill)
            processes.append(process)
        if robot.startswith('/'):
            _wait_for_the_description(stack, processes, text)
        _reach(stack, tmp_path, processes)
    limits = file_limits(text, NAMES)
    told = np.array(stack.told)
    assert told.shape[1] == 7
    assert np.all(told >= limits.lower) and np.all(told <= limits.upper)


def _wait_for_the_description(
    stack: Stack, processes: list[subprocess.Popen[str]], text: str
) -> None:
    """Tell what the nodes wait for, and not before they say that they do."""
    for process in processes:
        assert process.stderr is not None
        line = ''
        while 'waiting for the robot description on /lbr/robot_description' not in line:
            line = process.stderr.readline()
            assert line, 'the node has ended'
    begin_s = time.monotonic()
    stack.until(lambda: time.monotonic() > begin_s + 0.5, processes)
    assert not stack.told and stack.node.count_publishers(COMMANDS) == 0
    stack.descriptions.publish(String(data=text))


def _reach(stack: Stack, folder: Path, processes: list[subprocess.Popen[str]]) -> None:
    """Ask for a wrist pose a little way off until the arm is there."""
    arm = RobotModel.load(folder / 'iiwa14.urdf', base=BASE)
    wrist, rotation = arm.wrist_pose(stack.place)
    goal = wrist + [0.06, 0.05, -0.04]
    stack.target = goal, quaternion_of(rotation)
    resume = stack.node.create_client(Trigger, '/velocity_to_position/resume')
    asked: list[Any] = []

    def there() -> bool:
        # a node that starts late finds commands that have come too late, and stands
        if resume.service_is_ready() and (not asked or asked[-1].done()):
            asked.append(resume.call_async(Trigger.Request()))
        return bool(np.linalg.norm(arm.wrist_pose(stack.place)[0] - goal) < 0.005)

    stack.until(there, processes)
    assert len(stack.told) > 20


def test_robot_sim_stands_in_for_the_arm(stack: Stack, tmp_path: Path) -> None:
    (tmp_path / 'iiwa14.urdf').write_text(lbr('iiwa14'), encoding='utf-8')
    words = ['-m', 'handover_dmp.nodes.robot_sim', '--ros-args', '-p', 'robot:=iiwa14.urdf']
    with subprocess.Popen([sys.executable, *words], cwd=tmp_path) as process:
        try:
            stack.until(lambda: stack.heard is not None, [process])
        finally:
            process.kill()
    assert stack.heard is not None and stack.heard.name == NAMES
