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

"""Nodes that replace a subscription, since a publisher came later and offers something else."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
import os
from pathlib import Path
import time

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped, PoseStamped
from handover_dmp.common.errors import DataError
from handover_dmp.nodes.hand_input import HandInput
from handover_dmp.nodes.node import HandoverNode, NO_EVENTS
from handover_dmp.nodes.recorder import Recorder
from handover_dmp.nodes.spin import events_executor
from handover_dmp.nodes.tracker_parameters import HAND, ONE_TRACKER
from handover_dmp.recording import read_bag
from handover_dmp.topics import HAND_POSE, POSE_COMMAND, Topic, WRIST_POSE
import pytest
import rclpy
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.task import Future

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

WAIT_S = 30.0
DOMAIN = int(os.environ.get('ROS_DOMAIN_ID', '0')) % 100 + 1
"""Apart from other tests of this process, since the type of the hand is looked up there."""


class Listener(HandoverNode):
    """A node with the parameters of the hand, which does nothing by itself."""

    NAME = 'dmp'
    PARAMETERS = HAND
    OF_EACH_TRACKER = ONE_TRACKER


@pytest.fixture
def speaker(tmp_path: Path) -> Iterator[Node]:
    """Start ROS for the node to be tested; give a node of another participant."""
    rclpy.init(args=['--ros-args', '-p', f'folder:={tmp_path / "bag"}'], domain_id=DOMAIN)
    # DDS permits one type per topic in a participant
    other = rclpy.Context()
    other.init(domain_id=DOMAIN)
    node = rclpy.create_node('speaker', context=other)
    yield node
    node.destroy_node()
    other.try_shutdown()
    rclpy.try_shutdown()


def spin_until(executor: Executor, done: Callable[[], bool], act: Callable[[], object]) -> None:
    end_s = time.monotonic() + WAIT_S
    while not done() and time.monotonic() < end_s:
        act()
        executor.spin_until_future_complete(Future(), 0.1)
    assert done()


@pytest.fixture(params=['events', 'default'])
def executor(request: pytest.FixtureRequest) -> Iterator[Executor]:
    """Make the executor that nodes have, or the one that users may set instead."""
    made = events_executor() if request.param == 'events' else SingleThreadedExecutor()
    assert made is not None
    yield made
    made.shutdown()


@pytest.mark.parametrize(
    ('topic', 'message'),
    [
        pytest.param(POSE_COMMAND, PoseStamped(), id='less reliable'),
        pytest.param(HAND_POSE, PointStamped(), id='another type'),
    ],
)
def test_recorder_records_who_comes_later_and_offers_something_else(
    speaker: Node, executor: Executor, tmp_path: Path, topic: Topic, message: object
) -> None:
    bag = tmp_path / 'bag'
    recorder = Recorder()
    executor.add_node(recorder)
    executor.spin_until_future_complete(Future(), 0.5)
    publisher = speaker.create_publisher(type(message), topic.name, qos_profile_sensor_data)

    def recorded() -> bool:
        with suppress(DataError):
            return any(name == topic.name for name, *_ in read_bag(bag))
        return False

    spin_until(executor, recorded, lambda: publisher.publish(message))
    recorder.finish()


def test_hand_is_heard_from_a_tracker_that_comes_later_and_has_another_type(
    speaker: Node, executor: Executor
) -> None:
    stamps: list[Time] = []
    listener = Listener()
    HandInput(
        listener,
        listener.values['trackers'][-1],
        lambda stamp, _pose: stamps.append(stamp),
        lambda *_refused: None,
    )
    executor.add_node(listener)
    listener.once_per_second.start()
    executor.spin_until_future_complete(Future(), 0.5)
    publisher = speaker.create_publisher(PointStamped, HAND_POSE.name, qos_profile_sensor_data)
    spin_until(executor, lambda: bool(stamps), lambda: publisher.publish(PointStamped()))


def test_replaced_subscription_whose_event_is_still_in_store(
    speaker: Node, executor: Executor
) -> None:
    """Whether the event comes before or after the node looks is chance."""
    node = Listener()
    executor.add_node(node)
    heard: list[object] = []
    strict = node.subscribe(POSE_COMMAND, heard.append, events=NO_EVENTS)
    executor.spin_until_future_complete(Future(), 0.2)
    publisher = speaker.create_publisher(PoseStamped, POSE_COMMAND.name, qos_profile_sensor_data)
    while not node.count_publishers(POSE_COMMAND.name):
        time.sleep(0.05)
    # the event of the middleware comes with the discovery, or soon after
    time.sleep(0.5)
    node.replace(strict, lambda: node.subscribe(WRIST_POSE, heard.append, POSE_COMMAND.name))
    spin_until(executor, lambda: bool(heard), lambda: publisher.publish(PoseStamped()))
