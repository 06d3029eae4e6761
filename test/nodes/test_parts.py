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

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
import fcntl
from pathlib import Path
import random
import signal
from subprocess import Popen, TimeoutExpired
from threading import Thread
import time
from typing import Any

from builtin_interfaces.msg import Time as RosTime
from geometry_msgs.msg import PoseStamped
from handover_dmp.common.errors import DataError
from handover_dmp.handover.recordings import example_model, example_trials
from handover_dmp.nodes.conversions import NANOSECONDS, nanoseconds
from handover_dmp.nodes.dmp import MAX_STALL_S
from handover_dmp.nodes.graph import Graph
from handover_dmp.nodes.lockstep import ASK_AGAIN_S
from handover_dmp.nodes.qos import message_class, qos_profile
from handover_dmp.nodes.recorder import QUEUE
from handover_dmp.nodes.shutdown import MAX_WAIT_S, turn_file
from handover_dmp.recording import (
    bag_files,
    bag_information,
    BagMessage,
    LATCHED,
    Qos,
    read_bag,
)
from handover_dmp.robot.collision import CollisionModel
from handover_dmp.robot.model import RobotModel
from handover_dmp.topics import (
    CLOCK,
    DIAGNOSTICS,
    ELBOW_POSE,
    HAND_POSE,
    JOINT_COMMAND,
    JOINT_STATES,
    POSE_COMMAND,
    SIGNAL,
    STATE,
    Topic,
    WRIST_POSE,
)
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
import pinocchio as pin
import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray, Header, String
import yaml

pytestmark = [pytest.mark.ros, pytest.mark.timeout(300)]

# A machine that keeps one of the nodes waiting stops the arm only for that long. To let the arm
# wait for longer instead would let it run on: it may then never come back.
ON_A_BUSY_MACHINE = {'resume_within_s': 60.0}


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


@pytest.mark.sample(2)
@pytest.mark.parametrize('robot', ['iiwa14', 'ur5'])
def test_priority_ik_follows_poses_alone_on_any_robot(tmp_path: Path, robot: str) -> None:
    arm = {'robot': robot}
    parameters = {'robot_sim': arm | ON_A_BUSY_MACHINE, 'priority_ik': arm}
    with nodes(tmp_path, parameters, 'robot_sim', 'priority_ik') as graph:
        hearing = Hearing(graph, WRIST_POSE, DIAGNOSTICS)
        command = hearing.publisher(POSE_COMMAND)
        assert hearing.until(lambda: WRIST_POSE in hearing.newest, lambda: None, 50.0)
        model = RobotModel.load(robot)
        start = place_of(hearing.newest[WRIST_POSE])
        assert np.linalg.norm(start - model.wrist_pose(model.home)[0]) < 1e-3
        goal = start + [-0.05, 0.1, -0.05]
        elsewhere = pose(graph, goal)
        elsewhere.header.frame_id = 'base_link'
        assert hearing.until(
            lambda: "refused: wrist command in frame 'base_link'" in str(hearing.newest),
            lambda: command.publish(elsewhere),
            40.0,
        )
        reached = hearing.until(
            lambda: np.linalg.norm(place_of(hearing.newest[WRIST_POSE]) - goal) < 1e-3,
            lambda: command.publish(pose(graph, goal)),
            40.0,
        )
        assert reached


def test_priority_ik_keeps_off_the_forearm_whose_elbow_a_tracker_sees(tmp_path: Path) -> None:
    """Without it, the arm goes 20 mm into the forearm; nothing else keeps it off."""
    ik = {'robot': 'lwr4', 'hand_timeout_s': 2.0, 'self_collision': False}
    model = RobotModel.load('lwr4')
    goal = model.wrist_pose(model.home)[0] + [0.1, 0.0, -0.1]
    elbow = model.shoulder + [0.2, -0.1, 0.2]
    parameters = {'robot_sim': {'robot': 'lwr4'} | ON_A_BUSY_MACHINE, 'priority_ik': ik}
    with nodes(tmp_path, parameters, 'robot_sim', 'priority_ik') as graph:
        hearing = Hearing(graph, WRIST_POSE, JOINT_STATES)
        told = {ELBOW_POSE: elbow, HAND_POSE: goal, POSE_COMMAND: goal}
        senders = {topic: hearing.publisher(topic) for topic in told}
        # an arm that hears of the goal first is there before it hears of the forearm
        assert hearing.until(
            lambda: (
                WRIST_POSE in hearing.newest
                and all(sender.get_subscription_count() for sender in senders.values())
            ),
            lambda: None,
            50.0,
        )

        def tell() -> None:
            for topic, place in told.items():
                senders[topic].publish(pose(graph, place))

        assert hearing.until(
            lambda: np.linalg.norm(place_of(hearing.newest[WRIST_POSE]) - goal) < 1e-3, tell, 40.0
        )
        joints = np.array(hearing.newest[JOINT_STATES].position)
    bodies = CollisionModel.of(model)
    jacobian = pin.computeJointJacobians(model.pinocchio_model, model.pinocchio_data, joints)
    near = bodies.near_forearm(jacobian, goal, elbow, np.zeros(3), 2.0)
    assert min(pair.distance for pair in near) > 0.01


def test_robot_sim_takes_velocities_from_anybody(tmp_path: Path) -> None:
    patient = {'robot_sim': ON_A_BUSY_MACHINE}
    with nodes(tmp_path, patient, 'robot_sim') as graph:
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
        assert any(hearing.newest[JOINT_STATES].velocity)
        graph.pause(True)
        assert hearing.until(
            lambda: not any(hearing.newest[JOINT_STATES].velocity), lambda: None, 50.0
        )


def test_robot_sim_follows_the_clock_of_another_simulator(tmp_path: Path) -> None:
    """Which begins late in its day, and then runs at a quarter of the speed of the wall's."""
    parameters = {'robot_sim': {'use_sim_time': True}}
    with nodes(tmp_path, parameters, 'robot_sim') as graph:
        hearing = Hearing(graph, JOINT_STATES)
        command, clock = hearing.publisher(JOINT_COMMAND), hearing.publisher(CLOCK)
        simulated_ns = 1000 * NANOSECONDS

        def act() -> None:
            nonlocal simulated_ns
            simulated_ns += 5_000_000
            clock.publish(Clock(clock=Time(nanoseconds=simulated_ns).to_msg()))
            command.publish(Float64MultiArray(data=[0.2] + [0.0] * 6))

        def state() -> tuple[float, float]:
            message = hearing.newest[JOINT_STATES]
            return nanoseconds(message.header.stamp) * 1e-9, message.position[0]

        def moving() -> bool:
            return (
                JOINT_STATES in hearing.newest and hearing.newest[JOINT_STATES].velocity[0] > 0.19
            )

        assert hearing.until(moving, act, 50.0)
        began_s, began_rad = state()
        assert began_s > 1000.0
        assert hearing.until(lambda: state()[0] > began_s + 0.5, act, 50.0)
        now_s, now_rad = state()
        assert now_rad - began_rad == pytest.approx(0.2 * (now_s - began_s), rel=0.15)


def test_dmp_follows_any_hand(tmp_path: Path) -> None:
    """A hand at 30 Hz from another tracker, and a wrist that is where it is told to be."""
    with nodes(tmp_path, {'dmp': {'start': 'service'}}, 'dmp') as graph:
        hearing = Hearing(graph, POSE_COMMAND, STATE)
        hand, wrist = hearing.publisher(HAND_POSE), hearing.publisher(WRIST_POSE)
        model = example_model()
        target = example_trials()[0].partner[-1] + [0.05, -0.05, 0.1]
        goal = target + model.goal_offset

        def act() -> None:
            at = hearing.newest.get(POSE_COMMAND)
            wrist.publish(pose(graph, model.start if at is None else place_of(at)))
            hand.publish(pose(graph, target))

        assert hearing.until(lambda: POSE_COMMAND in hearing.newest, act, 30.0)
        for _ in range(5):  # a machine that stands still ends a motion
            graph.call('/dmp/start')
            assert hearing.until(lambda: graph.state in ('done', 'aborted'), act, 30.0)
            if graph.state == 'done':
                break
            graph.call('/dmp/reset')
            assert hearing.until(lambda: graph.state == 'idle', act, 30.0)
        assert graph.state == 'done'
        assert np.linalg.norm(place_of(hearing.newest[POSE_COMMAND]) - goal) < 0.02


class DmpInLockstep:
    """A dmp alone, which is asked for its periods as `priority_ik` would."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self._hearing = Hearing(graph, POSE_COMMAND, STATE)
        self._hand = self._hearing.publisher(HAND_POSE)
        self._wrist = self._hearing.publisher(WRIST_POSE)
        self._target = example_trials()[0].partner[-1]

    def _pose(self, at_s: float, place: np.ndarray) -> PoseStamped:
        message = pose(self.graph, place)
        message.header.stamp = Time(seconds=at_s).to_msg()
        return message

    def ask(self, at_s: float, place: np.ndarray) -> None:
        """Tell where the wrist is, once, and nothing of the hand."""
        self._wrist.publish(self._pose(at_s, place))

    def answered(self, at_s: float) -> bool:
        newest = self._hearing.newest.get(POSE_COMMAND)
        return newest is not None and newest.header.stamp == Time(seconds=at_s).to_msg()

    def answer(self, at_s: float, place: np.ndarray) -> np.ndarray:
        """Ask for a period, with the hand, until it is answered; return the place commanded."""

        def ask() -> None:
            self._hand.publish(self._pose(at_s, self._target))
            self.ask(at_s, place)

        assert self._hearing.until(lambda: self.answered(at_s), ask, 20.0)
        return place_of(self._hearing.newest[POSE_COMMAND])

    def reach(self) -> np.ndarray:
        """Begin a handover; return the place of the wrist, in full motion after 1.2 s."""
        place = self.answer(1.0, np.array(example_model().start))
        self.graph.call('/dmp/start')
        for k in range(1, 41):
            place = self.answer(1.0 + 0.005 * k, place)
        assert self.graph.state == 'reaching'
        return place


@pytest.fixture
def dmp(tmp_path: Path) -> Iterator[DmpInLockstep]:
    with Graph(tmp_path, {'dmp': {'start': 'service'}}, nodes=('dmp',)) as graph:
        yield DmpInLockstep(graph)


def test_a_dmp_that_wakes_holds_the_wrist_where_the_arm_came_to_stand(dmp: DmpInLockstep) -> None:
    """What it is asked for first may be from when the arm still braked."""
    place = dmp.reach()
    time.sleep(MAX_STALL_S + 0.1)
    braking, standing = place + [0.01, 0.0, 0.0], place + [0.03, 0.0, 0.0]
    assert np.allclose(dmp.answer(1.3, braking), braking)
    assert np.allclose(dmp.answer(2.1, standing), standing)
    assert np.allclose(dmp.answer(2.105, standing), standing)
    assert dmp.graph.state == 'aborted'


def test_a_dmp_that_is_given_up_while_it_waits_for_the_hand_goes_on(dmp: DmpInLockstep) -> None:
    """Where its questions are lost, `priority_ik` is out of patience before it is."""
    place = dmp.reach()
    waits_until_s = time.monotonic() + MAX_STALL_S + 0.2
    while time.monotonic() < waits_until_s:
        dmp.ask(1.205, place)
        dmp.graph.spin(ASK_AGAIN_S)
    assert not dmp.answered(1.205)
    for k in range(2, 40):
        at_s = 1.2 + 0.005 * k
        # as often as `priority_ik` asks once it has given up: without an answer it goes on
        for _ in range(2):
            if not dmp.answered(at_s):
                dmp.ask(at_s, place)
                dmp.graph.spin(0.05)
    dmp.answer(1.4, place)
    assert dmp.graph.state == 'reaching'


@pytest.mark.parametrize('hand_stamps', ['header', 'arrival'])
def test_a_dmp_that_starts_anew_does_not_heed_a_signal_without_its_time(
    tmp_path: Path, hand_stamps: str
) -> None:
    """What its publisher has latched may be from any handover before; what is said now counts."""
    parameters = {'dmp': {'hand_stamps': hand_stamps}}
    with nodes(tmp_path, parameters, 'dmp') as graph:
        hearing = Hearing(graph, POSE_COMMAND, STATE)
        hand, wrist = hearing.publisher(HAND_POSE), hearing.publisher(WRIST_POSE)
        signal_publisher = hearing.publisher(SIGNAL)
        start, target = np.array(example_model().start), example_trials()[0].partner[-1]

        def act() -> None:
            wrist.publish(pose(graph, start))
            hand.publish(pose(graph, target))

        def signals() -> None:
            now = graph.node.get_clock().now().to_msg()
            signal_publisher.publish(Header(stamp=now if hand_stamps == 'arrival' else RosTime()))

        def commanded_s() -> float:
            newest = hearing.newest.get(POSE_COMMAND)
            return nanoseconds(newest.header.stamp) * 1e-9 if newest else 0.0

        assert hearing.until(lambda: commanded_s() > 0.0, act, 50.0)
        signals()
        assert hearing.until(lambda: graph.state == 'reaching', act, 50.0)
        dead = graph.processes.pop('dmp')
        dead.kill()
        dead.wait()
        graph.start('dmp')
        assert hearing.until(lambda: graph.state == 'idle', act, 50.0)
        begun_s = graph.node.get_clock().now().nanoseconds * 1e-9
        assert hearing.until(lambda: commanded_s() > begun_s + 2.0, act, 50.0)
        assert graph.state == 'idle'
        signals()
        assert hearing.until(lambda: graph.state == 'reaching', act, 50.0)


def processor_s(process: Popen[bytes]) -> tuple[float, float]:
    """Tell for how long the first thread of a process has run, and has waited for its turn, s."""
    ran_ns, waited_ns, _ = Path(f'/proc/{process.pid}/schedstat').read_text().split()
    return int(ran_ns) * 1e-9, int(waited_ns) * 1e-9


def counts_so_far(bag: Path) -> dict[str, int]:
    """Count the messages of a bag that is still being written."""
    with suppress(DataError):
        return {name: topic.count for name, topic in bag_information(bag).topics.items()}
    return {}


def wait_for_counts(graph: Graph, bag: Path, wanted: dict[str, int]) -> dict[str, int]:
    """Wait until a bag holds so many messages, or for long no more of them than before."""
    last, since_s = {}, time.monotonic()
    while True:
        counts = {name: count for name, count in counts_so_far(bag).items() if name in wanted}
        if counts != last:
            last, since_s = counts, time.monotonic()
        if counts == wanted or time.monotonic() > since_s + 15.0:
            return counts
        graph.spin(0.1)


def wait_until_heard(graph: Graph, publishers: Collection[Any]) -> None:
    def heard() -> bool:
        return all(publisher.get_subscription_count() > 0 for publisher in publishers)

    assert Hearing(graph).until(heard, lambda: None, 20.0)


def test_recorder_keeps_up_with_a_flood(tmp_path: Path) -> None:
    """
    5,000 messages/s for 6 s, none lost; the queues could hide less than a third of them.

    Seconds are those that the recorder was not kept from its work by others on this machine.
    """
    rate_hz, count, depth = 5000.0, 30_000, 1000
    names = [f'/flood_{k}' for k in range(3)]
    assert len(names) * (QUEUE + depth) < count / 3
    with nodes(tmp_path, {'recorder': {'folder': str(tmp_path / 'bag')}}, 'recorder') as graph:
        publishers = [graph.node.create_publisher(Float64MultiArray, n, depth) for n in names]
        message = Float64MultiArray(data=[1.0] * 7)
        wait_until_heard(graph, publishers)
        process = graph.processes['recorder']
        ran_s, waited_s = processor_s(process)
        begun_s = time.monotonic() - waited_s
        for k in range(count):
            publishers[k % len(publishers)].publish(message)
            while (
                k % 50 == 0 and time.monotonic() - processor_s(process)[1] < begun_s + k / rate_hz
            ):
                time.sleep(0.001)
        took_s = time.monotonic() - begun_s - processor_s(process)[1]
        wanted = dict.fromkeys(names, count // len(names))
        assert wait_for_counts(graph, tmp_path / 'bag', wanted) == wanted
        worked_s = processor_s(process)[0] - ran_s
    print(f'sent at {count / took_s:.0f} Hz, would be kept up with at {count / worked_s:.0f} Hz')
    assert count / worked_s > rate_hz


@pytest.mark.parametrize('executor', ['events', 'default'])
def test_recorder_writes_what_was_sent_before_it_was_told_to_end(
    tmp_path: Path, executor: str
) -> None:
    bag, count = tmp_path / 'bag', 1000
    recorder = {'folder': str(bag), 'executor': executor}
    with nodes(tmp_path, {'recorder': recorder}, 'recorder') as graph:
        names = ('/first', '/second')
        publishers = [graph.node.create_publisher(String, name, count) for name in names]
        wait_until_heard(graph, publishers)
        process = graph.processes['recorder']
        process.send_signal(signal.SIGSTOP)
        for k in range(count):
            for publisher in publishers:
                publisher.publish(String(data=str(k)))
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGCONT)
        assert process.wait(60) == 0
        del graph.processes['recorder']
    written: dict[str, list[int]] = {name: [] for name in names}
    for topic, message, _ in read_bag(bag, names):
        written[topic].append(int(message.data))
    assert all(numbers == list(range(count)) for numbers in written.values())


@pytest.mark.parametrize(
    ('compression', 'split'),
    [('zstd', {'split_duration_s': 0.5}), ('lz4', {'split_size': 20_000}), ('none', {})],
)
def test_recorder_records_any_topics_as_it_is_told_to(
    tmp_path: Path, compression: str, split: dict[str, float]
) -> None:
    bag = tmp_path / 'bag'
    options = {'folder': str(bag), 'compression': compression, 'chunk_size': 2048, **split}
    recorder = {**options, 'topics': ['/somebodys', POSE_COMMAND.name]}
    count = 150
    texts = [f'{random.Random(k).getrandbits(4000):x}' for k in range(count)]
    with nodes(tmp_path, {'recorder': recorder}, 'recorder') as graph:
        somebodys = graph.node.create_publisher(String, '/somebodys', count)
        command = graph.node.create_publisher(PoseStamped, POSE_COMMAND.name, count)
        unwanted = graph.node.create_publisher(String, '/unwanted', count)
        wait_until_heard(graph, (somebodys, command))
        for k, text in enumerate(texts):
            for publisher in (somebodys, unwanted):
                publisher.publish(String(data=text))
            command.publish(pose(graph, [k, 0.0, 0.0]))
            graph.spin(0.02)
        wanted = {'/somebodys': count, POSE_COMMAND.name: count}
        assert wait_for_counts(graph, bag, wanted) == wanted
    files = bag_files(bag)
    assert (len(files) > 2) == bool(split)
    with AnyReader([bag]) as reader:
        assert {c.topic: c.msgcount for c in reader.connections} == wanted
        read = [(c, reader.deserialize(data, c.msgtype)) for c, _, data in reader.messages()]
    assert [m.data for c, m in read if c.topic == '/somebodys'] == texts
    assert [m.pose.position.x for c, m in read if c.topic != '/somebodys'] == [*range(count)]
    also_read = []
    for file in files:
        with file.open('rb') as stream:
            mcap = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            decoded = mcap.iter_decoded_messages(topics=['/somebodys'], log_time_order=False)
            also_read += [message.data for *_, message in decoded]
            summary = mcap.get_summary()
        assert summary is not None
        used = {chunk.compression for chunk in summary.chunk_indexes}
        assert used == {'' if compression == 'none' else compression}
        if 'split_size' in split:
            # what is beyond the size is a chunk or two and the indexes
            assert file.stat().st_size < 20_000 + 20_000
        if 'split_duration_s' in split:
            assert bag_information(file).duration_s < 0.5
    assert also_read == texts


def test_recorder_closes_its_bag_before_it_waits_for_its_turn_to_leave(tmp_path: Path) -> None:
    with nodes(tmp_path, {'recorder': {'folder': str(tmp_path / 'bag')}}, 'recorder') as graph:
        process = graph.processes['recorder']
        assert Hearing(graph).until((tmp_path / 'bag').is_dir, lambda: None, 20.0)
        with turn_file(graph.node.context.get_domain_id()).open('w') as turn:
            fcntl.flock(turn, fcntl.LOCK_EX)
            graph.processes.clear()
            process.terminate()
            metadata = tmp_path / 'bag' / 'metadata.yaml'
            assert Hearing(graph).until(metadata.is_file, lambda: None, 20.0)
            with pytest.raises(TimeoutExpired):
                process.wait(MAX_WAIT_S / 2.0)
        assert process.wait(60.0) == 0
    assert bag_information(tmp_path / 'bag').complete


def test_a_recorder_without_a_processor_ends_once_the_others_have(tmp_path: Path) -> None:
    """The tracker stands for what keeps the recorder from its processor; it is told to end too."""
    bag = tmp_path / 'bag'

    def go_on_once_alone(tracker: Popen[bytes], recorder: Popen[bytes]) -> None:
        tracker.wait(60.0)
        recorder.send_signal(signal.SIGCONT)

    with nodes(tmp_path, {'recorder': {'folder': str(bag)}}, 'recorder', 'hand_tracker') as graph:
        tracker, recorder = (graph.processes[name] for name in ('hand_tracker', 'recorder'))
        assert Hearing(graph).until(lambda: bool(counts_so_far(bag)), lambda: None, 20.0)
        recorder.send_signal(signal.SIGSTOP)
        waiting = Thread(target=go_on_once_alone, args=(tracker, recorder))
        waiting.start()
    waiting.join()
    assert recorder.returncode == 0
    assert bag_information(bag).complete


def messages_so_far(bag: Path) -> list[BagMessage]:
    """Read a bag that is still being written, or not even begun."""
    with suppress(DataError):
        return list(read_bag(bag))
    return []


def qos_in(bag: Path) -> dict[str, list[dict[str, Any]]]:
    """Tell what `metadata.yaml` says the publishers of each topic offered."""
    tree = yaml.safe_load((bag / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    topics = [one['topic_metadata'] for one in tree['topics_with_message_count']]
    return {topic['name']: topic['offered_qos_profiles'] for topic in topics}


def test_recorder_hears_who_offers_less_than_our_table_and_keeps_what_was_offered(
    tmp_path: Path,
) -> None:
    """Such as the `/clock` of `ros2 bag play`, and commands of somebody else."""
    bag = tmp_path / 'bag'
    with nodes(tmp_path, {'recorder': {'folder': str(bag)}}, 'recorder') as graph:
        weak = QoSProfile(depth=3, reliability=ReliabilityPolicy.BEST_EFFORT)
        clock = graph.node.create_publisher(Clock, CLOCK.name, weak)
        weak_command = graph.node.create_publisher(PoseStamped, POSE_COMMAND.name, weak)
        command = graph.node.create_publisher(PoseStamped, POSE_COMMAND.name, QoSProfile(depth=7))

        def act() -> None:
            clock.publish(Clock())
            weak_command.publish(pose(graph, [1.0, 0.0, 0.0]))
            command.publish(pose(graph, [2.0, 0.0, 0.0]))

        def recorded() -> bool:
            messages = messages_so_far(bag)
            of_whom = {m.pose.position.x for topic, m, _ in messages if topic == POSE_COMMAND.name}
            topics = {topic for topic, *_ in messages}
            return of_whom == {1.0, 2.0} and {CLOCK.name, DIAGNOSTICS.name, '/rosout'} <= topics

        assert Hearing(graph).until(recorded, act, 20.0)
    offered = qos_in(bag)
    assert offered[CLOCK.name] == [Qos(reliability='best_effort').as_rosbag2()]
    either = sorted(profile['reliability'] for profile in offered[POSE_COMMAND.name])
    assert either == ['best_effort', 'reliable']
    (diagnostics,) = offered[DIAGNOSTICS.name]
    assert diagnostics == LATCHED.as_rosbag2(), 'as rosbag2 finds it, without a depth'
    assert offered['/rosout'][0]['lifespan'] == {'sec': 10, 'nsec': 0}, 'as rclpy offers it'
