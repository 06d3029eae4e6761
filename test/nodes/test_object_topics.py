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

"""The node `robot_sim` alone with an object: it tells of it, and hears of gripper and hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

from geometry_msgs.msg import PoseStamped, WrenchStamped
from handover_dmp.nodes.conversions import pose_message, position_of
from handover_dmp.nodes.graph import isolate
from handover_dmp.nodes.qos import message_class, qos_profile
from handover_dmp.robot.model import RobotModel
from handover_dmp.topics import (
    GRIPPER_COMMAND,
    HAND_TRUTH,
    OBJECT_HOLDER,
    OBJECT_POSE,
    Topic,
    WRIST_WRENCH,
)
import numpy as np
import pytest
import rclpy
from std_msgs.msg import Bool

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

MASS_KG = 0.8
WEIGHT_N = MASS_KG * 9.81
OBJECT = [0.1, 0.0, 0.0]


class Listener:
    """Hears the topics of the object, and stands in for `dmp` and `hand_tracker`."""

    def __init__(self) -> None:
        self.node = rclpy.create_node('listener')
        self.holders: list[str] = []
        self.wrench: WrenchStamped | None = None
        self.pose: PoseStamped | None = None
        self._hear(OBJECT_HOLDER, lambda m: self.holders.append(m.data))
        self._hear(WRIST_WRENCH, lambda m: setattr(self, 'wrench', m))
        self._hear(OBJECT_POSE, lambda m: setattr(self, 'pose', m))
        self.hand = self._tell(HAND_TRUTH)
        self.gripper = self._tell(GRIPPER_COMMAND)

    def _hear(self, topic: Topic, callback: Callable[[Any], None]) -> None:
        kind, profile = message_class(topic.type_name), qos_profile(topic.quality)
        self.node.create_subscription(kind, topic.name, callback, profile)

    def _tell(self, topic: Topic) -> Any:
        kind, profile = message_class(topic.type_name), qos_profile(topic.quality)
        return self.node.create_publisher(kind, topic.name, profile)

    def until(self, done: Callable[[], bool], hand: Any = None) -> None:
        end = time.monotonic() + 40.0
        while not done():
            assert time.monotonic() < end, (self.holders, self.wrench)
            if hand is not None:
                self.hand.publish(pose_message(self.node.get_clock().now().to_msg(), hand))
            rclpy.spin_once(self.node, timeout_sec=0.01)

    @property
    def lifted_n(self) -> float:
        return np.nan if self.wrench is None else -self.wrench.wrench.force.z


def test_the_object_is_told_of_and_changes_hands(tmp_path: Path) -> None:
    isolate()
    words = [sys.executable, '-m', 'handover_dmp.nodes.robot_sim', '--ros-args']
    for name, value in (('mass_kg', MASS_KG), ('position', OBJECT), ('noise_n', 0.0)):
        words += ['-p', f'object.{name}:={value}']
    process = subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    rclpy.init()
    try:
        listener = Listener()
        listener.until(
            lambda: bool(listener.pose and listener.lifted_n > 0.0 and listener.holders)
        )
        model = RobotModel.load('lwr4')
        wrist = model.wrist_pose(model.home)[0]
        assert listener.holders == ['robot']
        assert listener.wrench is not None
        assert listener.wrench.header.frame_id == 'world'
        assert listener.lifted_n == pytest.approx(WEIGHT_N, abs=1e-3)
        assert listener.wrench.wrench.torque.y == pytest.approx(0.1 * WEIGHT_N, abs=2e-3)
        assert position_of(listener.pose) == pytest.approx(wrist + OBJECT, abs=1e-5)

        hand = wrist + [0.3, 0.0, 0.0]
        listener.until(lambda: abs(listener.lifted_n) < 1e-2, hand)
        assert listener.holders == ['robot', 'both']
        listener.gripper.publish(Bool(data=False))
        listener.until(lambda: listener.holders[-1] == 'partner', hand)
        listener.gripper.publish(Bool(data=True))
        listener.until(lambda: listener.holders[-1] == 'robot', hand)
        assert listener.holders == ['robot', 'both', 'partner', 'both', 'robot']
        # the partner's hand gives way before the wrench says so
        listener.until(lambda: abs(listener.lifted_n - WEIGHT_N) < 0.01, hand)
        listener.gripper.publish(Bool(data=False))
        listener.until(lambda: listener.holders[-1] == 'nobody', hand + [0.5, 0.0, 0.0])
    finally:
        rclpy.shutdown()
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=30)
    assert process.returncode == 0, said


def test_an_object_that_cannot_be_is_refused_in_one_line(tmp_path: Path) -> None:
    isolate()
    words = [sys.executable, '-m', 'handover_dmp.nodes.robot_sim', '--ros-args']
    words += ['-p', 'object.mass_kg:=0.001']
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert 'object.mass_kg is 0.001: it must be 0, or at least 0.01' in done.stdout + done.stderr
    assert 'Traceback' not in done.stderr
