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

"""The hand in every type of message, in other frames, among others; over DDS where it can be."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import nan
import os
from pathlib import Path
import time
from types import SimpleNamespace
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import (
    PointStamped,
    Pose,
    PoseArray,
    PoseStamped,
    PoseWithCovarianceStamped,
    TransformStamped,
)
from handover_dmp.common.errors import UsageError
from handover_dmp.mocap.message_bodies import bodies, Body
from handover_dmp.nodes.hand_input import HandInput
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.nodes.qos import message_class
from handover_dmp.nodes.tracker_parameters import HAND, ONE_TRACKER
from handover_dmp.topics import HAND_POSE, TF, TF_STATIC, Topic
from handover_dmp.tracking.frames import FixedTransform
from handover_dmp.tracking.pose_messages import BodyChooser
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import qos_profile_sensor_data
from scipy.spatial.transform import Rotation
from std_msgs.msg import String

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

WAIT_S = 30.0
# Other tests of this process publish the hand too, and its type is looked up among all of them.
DOMAIN = int(os.environ.get('ROS_DOMAIN_ID', '0')) % 100 + 1
PLACE = (0.3, -0.2, 1.1)
numbers = st.floats(-10.0, 10.0)


class Listener(HandoverNode):
    """A node that does nothing but hear the hand."""

    NAME = 'dmp'
    PARAMETERS = HAND
    OF_EACH_TRACKER = ONE_TRACKER

    def __init__(self) -> None:
        super().__init__()
        self.taken: list[tuple[Time, Body]] = []
        self.refused: list[tuple[str, str]] = []
        self.inputs = HandInput(
            self,
            self.values['trackers'][-1],
            lambda stamp, pose: self.taken.append((stamp, pose)),
            lambda reason, text: self.refused.append((reason, text)),
        )


@pytest.fixture
def listener() -> Iterator[Callable[..., Any]]:
    """Make a listener with parameters, which hears a message until it has dealt with it."""
    opened: list[Callable[[], object]] = []

    def make(topic: str = HAND_POSE.name, **parameters: str) -> Callable[[Any], Listener]:
        words = [] if topic == HAND_POSE.name else ['-r', f'hand/pose:={topic}']
        words += [word for item in parameters.items() for word in ('-p', '{}:={}'.format(*item))]
        words = [word.replace('tracker_', 'tracker.') for word in words]
        rclpy.init(args=['--ros-args', *words], domain_id=DOMAIN)
        opened.append(rclpy.try_shutdown)
        # a participant of its own, since one has one type a topic
        other = rclpy.Context()
        other.init(domain_id=DOMAIN)
        opened.append(other.try_shutdown)
        node, speaker = Listener(), rclpy.create_node('speaker', context=other)
        executor = SingleThreadedExecutor()
        opened.extend((speaker.destroy_node, node.destroy_node, executor.shutdown))
        executor.add_node(node)
        publishers: dict[type, Any] = {}

        def hear(message: Any) -> Listener:
            kind = type(message)
            if kind not in publishers:
                for publisher in publishers.values():
                    speaker.destroy_publisher(publisher)
                publishers.clear()
                publishers[kind] = speaker.create_publisher(kind, topic, qos_profile_sensor_data)
            # what is still on its way from the last time
            for _ in range(5):
                executor.spin_once(timeout_sec=0.02)
            node.taken.clear()
            node.refused.clear()
            end_s = time.monotonic() + WAIT_S
            while not (node.taken or node.refused) and time.monotonic() < end_s:
                publishers[kind].publish(message)
                executor.spin_once(timeout_sec=0.02)
            return node

        return hear

    yield make
    for close in reversed(opened):
        close()


def filled(kind: type, body: str = '', frame: str = 'world', place: Any = PLACE) -> Any:
    """Make a message of a type that shows the hand, beside others where it can."""
    message = kind()
    message.header.frame_id = frame
    message.header.stamp.sec = 7
    spot: Any
    if kind is PoseArray:
        message.poses = [Pose(), Pose()]
        spot = message.poses[1].position
    elif kind is TransformStamped:
        message.child_frame_id = body
        spot = message.transform.translation
    elif kind is PointStamped:
        spot = message.point
    else:
        spot = message.pose.pose.position if hasattr(message.pose, 'pose') else None
        spot = message.pose.position if spot is None else spot
    spot.x, spot.y, spot.z = place
    return message


@pytest.mark.parametrize(
    ('kind', 'body'),
    [
        (PoseStamped, ''),
        (PoseWithCovarianceStamped, ''),
        (PointStamped, ''),
        (TransformStamped, 'wrist'),
        (PoseArray, '1'),
    ],
)
def test_every_type_is_heard_when_it_is_told(listener: Any, kind: type, body: str) -> None:
    name = f'geometry_msgs/msg/{kind.__name__}'
    # a number alone would be an integer to ROS
    hear = listener(tracker_type=name, **({'tracker_body': f'"{body}"'} if body else {}))
    heard = hear(filled(kind, body))
    assert heard.refused == []
    stamp, pose = heard.taken[0]
    assert (stamp.sec, pose.position) == (7, PLACE)


def test_vrpn_mocap_needs_one_remap(listener: Any) -> None:
    """It publishes the poses of each body, `/vrpn_mocap/BODY/pose`, as `PoseStamped`."""
    hear = listener('/vrpn_mocap/wrist/pose')
    stamp, pose = hear(filled(PoseStamped)).taken[0]
    assert (stamp.sec, pose.position) == (7, PLACE)
    for page in ('README.md', 'docs/trackers.md'):
        text = (Path(__file__).parents[2] / page).read_text(encoding='utf-8')
        assert '-r hand/pose:=/vrpn_mocap/wrist/pose' in text


def test_a_tracker_of_several_is_heard_by_its_own_parameters(listener: Any) -> None:
    hear = listener(
        '/body/wrist',
        trackers='[mocap, camera]',
        **{
            'camera.topic': '/body/wrist',
            'camera.frame': 'camera',
            'camera.position': '[0.0, 0.0, 1.0]',
            'mocap.frame': 'camera',
        },
    )
    seen = hear(filled(PoseStamped, frame='camera')).taken[0][1]
    np.testing.assert_allclose(seen.position, np.add(PLACE, (0.0, 0.0, 1.0)))


def test_the_type_is_looked_up_where_it_is_not_told(listener: Any) -> None:
    hear = listener()
    assert hear(filled(PointStamped)).taken[0][1].position == PLACE
    assert hear(filled(TransformStamped, 'wrist')).taken[0][1].name == 'wrist'
    reason, text = hear(String()).refused[0]
    assert reason == 'other_type'
    assert 'std_msgs/msg/String' in text


def test_a_frame_is_transformed_or_named_with_its_remedies(listener: Any) -> None:
    turn = Rotation.from_euler('xyz', [0.3, -0.5, 2.0])
    quaternion = str(turn.as_quat().tolist())
    hear = listener(
        frame='room',
        tracker_frame='camera',
        tracker_position='[1.0, 2.0, 3.0]',
        tracker_quaternion=quaternion,
    )
    assert hear(filled(PoseStamped, frame='room')).taken[0][1].position == PLACE
    seen = hear(filled(PoseStamped, frame='camera')).taken[0][1]
    np.testing.assert_allclose(seen.position, turn.apply(PLACE) + [1.0, 2.0, 3.0], atol=1e-12)
    reason, text = hear(filled(PoseStamped, frame='world')).refused[0]
    assert reason == 'other_frame'
    assert all(word in text for word in ("'world'", "'room'", 'tracker.frame', 'tf2'))
    # what is none stays none
    for lost in ((0.0, 0.0, 0.0), (nan, 0.0, 1.0)):
        seen = hear(filled(PoseStamped, frame='camera', place=lost)).taken[0][1]
        np.testing.assert_array_equal(seen.position, lost)


@pytest.mark.parametrize(
    ('topic', 'at_s', 'stamps', 'is_known'),
    [
        pytest.param(TF_STATIC, 0.0, 'header', True, id='fixed'),
        # the hand is stamped 7 s; who tells where a moving frame is does so now and then
        pytest.param(TF, 6.95, 'header', True, id='a bit older'),
        pytest.param(TF, 6.0, 'header', False, id='much older'),
        pytest.param(TF, 7.05, 'header', False, id='only newer'),
        pytest.param(TF, 99.0, 'arrival', True, id='another clock'),
    ],
)
def test_a_frame_is_looked_up_in_tf2(
    listener: Any, topic: Topic, at_s: float, stamps: str, is_known: bool
) -> None:
    pytest.importorskip('tf2_ros', reason='tf2_ros is not installed')
    hear = listener(hand_stamps=stamps)
    # it begins to listen to tf2
    node = hear(filled(PoseStamped, frame='camera'))
    assert 'does not know it' in node.refused[0][1]
    told = TransformStamped(child_frame_id='camera')
    told.header.frame_id = 'world'
    told.header.stamp = Time(sec=int(at_s), nanosec=round(at_s % 1.0 * 1e9))
    told.transform.translation.z, told.transform.rotation.w = 1.0, 1.0
    node.advertise(topic).publish(message_class(topic.type_name)(transforms=[told]))
    end_s = time.monotonic() + WAIT_S
    while not node.inputs._buffer._frameExists('camera'):
        hear(filled(PoseStamped, frame='camera'))
        assert time.monotonic() < end_s
    node = hear(filled(PoseStamped, frame='camera'))
    assert bool(node.taken) is is_known
    for _, pose in node.taken:
        np.testing.assert_allclose(pose.position, np.add(PLACE, (0.0, 0.0, 1.0)))


def test_of_several_bodies_none_is_guessed(listener: Any) -> None:
    hear = listener()
    assert hear(filled(TransformStamped, 'wrist')).taken
    reason, text = hear(filled(TransformStamped, 'object')).refused[0]
    assert reason == 'ambiguous'
    assert 'object, wrist' in text
    assert hear(filled(TransformStamped, 'wrist')).refused


def named(name: str, x: float) -> SimpleNamespace:
    """Make a body as the lists of motion capture have them."""
    place, turn = SimpleNamespace(x=x, y=0.0, z=1.0), SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
    pose = SimpleNamespace(position=place, orientation=turn)
    return SimpleNamespace(name=name, rigid_body_name=name, pose=pose)


@pytest.mark.parametrize(
    'field',
    [
        # mocap4r2_msgs/msg/RigidBodies, motion_capture_tracking_interfaces/msg/NamedPoseArray
        'rigidbodies',
        'poses',
    ],
)
def test_lists_of_named_bodies(field: str) -> None:
    """By the fields that their packages define, since these are not installed here."""
    header = SimpleNamespace(stamp=Time(), frame_id='mocap')
    message = SimpleNamespace(
        header=header, **{field: [named('object', 1.0), named('wrist', 2.0)]}
    )
    found = BodyChooser('wrist').choose(bodies(message))
    assert isinstance(found, Body)
    assert found.position == (2.0, 0.0, 1.0)
    assert BodyChooser('hand').choose(bodies(message)) == 'other_body'
    assert BodyChooser('').choose(bodies(message)) == 'ambiguous'
    assert BodyChooser('wrist').choose([]) == 'absent'


@given(st.tuples(*[numbers] * 3), st.tuples(*[numbers] * 4), st.tuples(*[numbers] * 3))
def test_a_fixed_transform_is_that_of_scipy(place: Any, quaternion: Any, point: Any) -> None:
    if np.linalg.norm(quaternion) < 1e-3:
        return
    expected = Rotation.from_quat(quaternion).apply(point) + place
    np.testing.assert_allclose(FixedTransform(place, quaternion)(point), expected, atol=1e-9)


@pytest.mark.parametrize(
    ('place', 'quaternion', 'fault'),
    [
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), 'norm 1, not 0'),
        ((0.0, nan, 0.0), (0.0, 0.0, 0.0, 1.0), 'finite'),
        ((0.0, 0.0), (0.0, 0.0, 0.0, 1.0), 'x, y, z'),
    ],
)
def test_what_is_no_transform(place: Any, quaternion: Any, fault: str) -> None:
    with pytest.raises(UsageError, match=fault):
        FixedTransform(place, quaternion)
