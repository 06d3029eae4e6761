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

"""Single nodes in somebody else's graph: with other publishers than ours, on other robots."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
import time
from typing import Any

from geometry_msgs.msg import PoseStamped
from handover_dmp.nodes.graph import Graph
from handover_dmp.nodes.qos import message_class, qos_profile
from handover_dmp.recording import bag_information
from handover_dmp.robot.model import RobotModel
from handover_dmp.scenario import example_model, example_trials
from handover_dmp.topics import (
    HAND_POSE,
    JOINT_COMMAND,
    JOINT_STATES,
    POSE_COMMAND,
    STATE,
    Topic,
    WRIST_POSE,
)
import numpy as np
import pytest
from std_msgs.msg import Float64MultiArray

pytestmark = [pytest.mark.ros, pytest.mark.timeout(300)]


class Hearing:
    """The newest message of each topic, and publishers of others."""

    def __init__(self, graph: Graph, *topics: Topic) -> None:
        self.graph = graph
        self.newest: dict[Topic, Any] = {}
        for topic in topics:
            graph.node.create_subscription(
                message_class(topic.type_name),
                topic.name,
                lambda message, topic=topic: self.newest.__setitem__(topic, message),
                qos_profile(topic.quality),
            )

    def publisher(self, topic: Topic) -> Any:
        return self.graph.node.create_publisher(
            message_class(topic.type_name), topic.name, qos_profile(topic.quality)
        )

    def until(self, condition: Callable[[], bool], act: Callable[[], None], hz: float) -> bool:
        """Act at a rate until something holds; whether it did within a minute."""
        end = time.monotonic() + 60.0
        due = time.monotonic()
        while not condition():
            self.graph.spin(max(0.0, due - time.monotonic()))
            if time.monotonic() >= due:
                act()
                due = max(due + 1.0 / hz, time.monotonic())
            if time.monotonic() > end:
                return False
        return True


@contextmanager
def nodes(folder: Path, parameters: dict[str, Any], *names: str) -> Iterator[Graph]:
    with Graph(folder, parameters, lockstep=False, nodes=names) as graph:
        yield graph


def pose(graph: Graph, position: Any) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id = 'world'
    message.header.stamp = graph.node.get_clock().now().to_msg()
    place = message.pose.position
    place.x, place.y, place.z = map(float, position)
    message.pose.orientation.w = 1.0
    return message


def place_of(message: PoseStamped) -> np.ndarray:
    place = message.pose.position
    return np.array([place.x, place.y, place.z])


@pytest.mark.parametrize('robot', ['iiwa14', 'ur5'])
def test_priority_ik_follows_poses_alone_on_any_robot(tmp_path: Path, robot: str) -> None:
    arm = {'robot': robot}
    with nodes(
        tmp_path, {'robot_sim': arm, 'priority_ik': arm}, 'robot_sim', 'priority_ik'
    ) as graph:
        hearing = Hearing(graph, WRIST_POSE)
        command = hearing.publisher(POSE_COMMAND)
        assert hearing.until(lambda: WRIST_POSE in hearing.newest, lambda: None, 50.0)
        model = RobotModel.load(robot)
        start = place_of(hearing.newest[WRIST_POSE])
        assert np.linalg.norm(start - model.wrist_pose(model.home)[0]) < 1e-3
        goal = start + [-0.05, 0.1, -0.05]
        reached = hearing.until(
            lambda: np.linalg.norm(place_of(hearing.newest[WRIST_POSE]) - goal) < 1e-3,
            lambda: command.publish(pose(graph, goal)),
            40.0,
        )
        assert reached


def test_robot_sim_takes_velocities_from_anybody(tmp_path: Path) -> None:
    with nodes(tmp_path, {}, 'robot_sim') as graph:
        hearing = Hearing(graph, JOINT_STATES)
        command = hearing.publisher(JOINT_COMMAND)
        velocities = [0.1, -0.1, 0.0, 0.05, 0.0, 0.1, -0.2]
        message = Float64MultiArray(data=velocities)
        assert hearing.until(lambda: JOINT_STATES in hearing.newest, lambda: None, 50.0)
        start = np.array(hearing.newest[JOINT_STATES].position)

        def moved() -> np.ndarray:
            return np.array(hearing.newest[JOINT_STATES].position) - start

        assert hearing.until(
            lambda: np.abs(moved()).max() > 0.1, lambda: command.publish(message), 100.0
        )
        ratio = moved() / np.abs(moved()).max()
        assert np.allclose(ratio, np.array(velocities) / 0.2, atol=0.02)


def test_dmp_follows_any_hand(tmp_path: Path) -> None:
    """A hand at 30 Hz from another tracker, and a wrist that is where it is told to be."""
    with nodes(tmp_path, {'dmp': {'start': 'service'}}, 'dmp') as graph:
        hearing = Hearing(graph, POSE_COMMAND, STATE)
        hand, wrist = hearing.publisher(HAND_POSE), hearing.publisher(WRIST_POSE)
        model = example_model()
        target = example_trials()[0].p1[-1] + [0.05, -0.05, 0.1]
        goal = target + model.goal_offset

        def act() -> None:
            at = hearing.newest.get(POSE_COMMAND)
            wrist.publish(pose(graph, model.start if at is None else place_of(at)))
            hand.publish(pose(graph, target))

        assert hearing.until(lambda: POSE_COMMAND in hearing.newest, act, 30.0)
        graph.call('/dmp/start')
        assert hearing.until(lambda: graph.state == 'done', act, 30.0)
        assert np.linalg.norm(place_of(hearing.newest[POSE_COMMAND]) - goal) < 0.02


def test_recorder_keeps_up_with_a_flood(tmp_path: Path) -> None:
    """5,000 messages in about a second, none lost."""
    parameters = {'recorder': {'folder': str(tmp_path / 'bag')}}
    count = 5000
    with nodes(tmp_path, parameters, 'recorder') as graph:
        publishers = [
            graph.node.create_publisher(Float64MultiArray, f'/flood_{k}', 2000) for k in range(5)
        ]
        message = Float64MultiArray(data=[1.0] * 7)

        def heard() -> bool:
            return all(publisher.get_subscription_count() >= 1 for publisher in publishers)

        assert Hearing(graph).until(heard, lambda: None, 20.0)
        begun = time.monotonic()
        for k in range(count):
            publishers[k % 5].publish(message)
            ahead = begun + k / 5000.0 - time.monotonic()
            if ahead > 0.002:
                time.sleep(ahead)
        end = time.monotonic() + 5.0
        while time.monotonic() < end:
            graph.spin(0.05)
    topics = bag_information(tmp_path / 'bag').topics
    assert [topics[f'/flood_{k}'].count for k in range(5)] == [count // 5] * 5
