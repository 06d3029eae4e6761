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

"""The node between joint velocities and an arm that takes positions, as a process over DDS."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from handover_dmp.nodes.graph import isolate
from handover_dmp.nodes.qos import qos_profile
from handover_dmp.nodes.shutdown import shut_down
from handover_dmp.robot.model import RobotModel
from handover_dmp.topics import JOINT_COMMAND, JOINT_POSITIONS, JOINT_STATES
import numpy as np
from numpy.typing import NDArray
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

pytestmark = [pytest.mark.ros, pytest.mark.timeout(300)]

MODEL = RobotModel.load('lwr4')
WANTED = [0.2, 0.0, 0.0, 0.0, 0.0, 0.0, -0.2]


class Driver:
    """An arm that follows positions, with names and other joints as a real driver has them."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=int(os.environ['ROS_DOMAIN_ID']))
        self.node = rclpy.create_node('driver', context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.place = MODEL.home.copy()
        self.told: list[NDArray[np.float64]] = []
        self.told_s = 0.0
        self.node.create_subscription(
            Float64MultiArray,
            JOINT_POSITIONS.name,
            self._follow,
            qos_profile(JOINT_POSITIONS.quality),
        )
        self.states = self.node.create_publisher(
            JointState, JOINT_STATES.name, qos_profile(JOINT_STATES.quality)
        )
        self.commands = self.node.create_publisher(
            Float64MultiArray, JOINT_COMMAND.name, qos_profile(JOINT_COMMAND.quality)
        )

    def _follow(self, message: Float64MultiArray) -> None:
        self.told.append(np.array(message.data))
        self.place = self.told[-1]
        self.told_s = time.monotonic()

    def is_left_alone(self) -> bool:
        """Tell whether no position has come for longer than commands may stay away."""
        return time.monotonic() > self.told_s + 2.0

    def until(self, done: Callable[[], bool], velocities: list[float] | None = None) -> None:
        """Measure, command and follow until something is so."""
        names = ['gripper', *(f'lbr_{name}' for name in MODEL.joint_names[::-1])]
        end_s = time.monotonic() + 120.0
        while not done():
            assert self.process.poll() is None
            assert time.monotonic() < end_s, 'nothing comes'
            position = [9.0, *self.place[::-1].tolist()]
            nothing = [float('nan')] * len(names)
            self.states.publish(JointState(name=names, position=position, velocity=nothing))
            if velocities is not None:
                self.commands.publish(Float64MultiArray(data=velocities))
            self.executor.spin_once(timeout_sec=0.002)

    def resume(self) -> None:
        client = self.node.create_client(Trigger, '/velocity_to_position/resume')
        assert client.wait_for_service(60.0)
        answer = client.call_async(Trigger.Request())
        self.until(answer.done)
        assert answer.result().success


@pytest.fixture
def driver(tmp_path: Path) -> Iterator[Driver]:
    isolate()
    words = [
        sys.executable, '-m', 'handover_dmp.nodes.velocity_to_position', '--ros-args',
        '-p', 'joint_prefix:=lbr_', '-p', 'command_timeout_s:=1.0',
        '-p', 'joint_state_timeout_s:=10.0',
    ]  # fmt: skip
    process = subprocess.Popen(words, text=True, stderr=subprocess.PIPE)
    driver = Driver(process)
    try:
        yield driver
    finally:
        process.kill()
        process.communicate()
        driver.executor.shutdown()
        shut_down(driver.node)


def test_moves_the_arm_from_where_it_is_and_stops_when_commands_do(driver: Driver) -> None:
    """A stop lasts until it is told to resume."""
    driver.until(lambda: len(driver.told) > 100, WANTED)
    told = np.array(driver.told)
    assert np.abs(told[0] - MODEL.home).max() < 0.02
    moved = told - MODEL.home
    assert moved[:, 1:6] == pytest.approx(0.0, abs=1e-9)
    assert np.all(np.diff(moved[:, 0]) >= 0.0)
    assert np.all(np.diff(moved[:, 6]) <= 0.0)
    assert moved[-1, 0] > 0.01

    driver.until(driver.is_left_alone)
    place, count = driver.place, len(driver.told)
    begin_s = time.monotonic()
    driver.until(lambda: time.monotonic() > begin_s + 0.3, WANTED)
    assert len(driver.told) - count < 5
    assert driver.place == pytest.approx(place, abs=1e-3)

    driver.resume()
    count = len(driver.told)
    driver.until(lambda: len(driver.told) > count + 50, WANTED)
    assert driver.place[0] > place[0]

    driver.process.send_signal(signal.SIGINT)
    end_s = time.monotonic() + 60.0
    while driver.process.poll() is None and time.monotonic() < end_s:
        driver.executor.spin_once(timeout_sec=0.002)
    assert driver.process.returncode == 0
