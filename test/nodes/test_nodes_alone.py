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

"""Each node by itself: started as a user would, ended as a user would."""

from __future__ import annotations

from contextlib import suppress
import fcntl
from importlib.util import find_spec
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from handover_dmp.nodes.conversions import pose_message, quaternion_of
from handover_dmp.nodes.graph import isolate, NODES
from handover_dmp.nodes.priority_ik import MAX_STEP
from handover_dmp.nodes.qos import qos_profile
from handover_dmp.nodes.shutdown import MAX_WAIT_S, shut_down, turn_file
from handover_dmp.robot.model import RobotModel
from handover_dmp.topics import (
    CLOCK,
    HAND_POSE,
    JOINT_COMMAND,
    JOINT_STATES,
    POSE_COMMAND,
    SIGNAL,
    STATE,
    WRIST_POSE,
)
import numpy as np
from numpy.typing import NDArray
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from shared_memory import shared_memory_of
from std_msgs.msg import Float64MultiArray, Header, String

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]


def start(node: str, folder: Path, *arguments: str) -> subprocess.Popen[str]:
    isolate()
    words = [sys.executable, '-m', f'handover_dmp.nodes.{node}', '--ros-args', *arguments]
    if node == 'recorder':
        words += ['-p', f'folder:={folder / "bag"}']
    return subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def is_up(node: str) -> bool:
    """Whether a node can be seen in the graph, by a process that looks once."""
    look = (
        'import rclpy, time\n'
        'rclpy.init()\n'
        'node = rclpy.create_node("look")\n'
        'end = time.monotonic() + 60\n'
        f'while {node!r} not in node.get_node_names() and time.monotonic() < end:\n'
        '    rclpy.spin_once(node, timeout_sec=0.05)\n'
        f'print({node!r} in node.get_node_names())\n'
    )
    done = subprocess.run([sys.executable, '-c', look], capture_output=True, text=True)
    return 'True' in done.stdout


def test_a_topic_goes_where_it_is_remapped_to(tmp_path: Path) -> None:
    process = start('dmp', tmp_path, '-r', '/hand/pose:=/tracker/pose')
    assert is_up('dmp'), process.communicate()
    look = (
        'import rclpy, time\n'
        'rclpy.init()\n'
        'node = rclpy.create_node("look")\n'
        'end = time.monotonic() + 60\n'
        'while not node.count_subscribers("/tracker/pose") and time.monotonic() < end:\n'
        '    rclpy.spin_once(node, timeout_sec=0.05)\n'
        'print([node.count_subscribers(f"/{who}/pose") for who in ("tracker", "hand")])\n'
    )
    seen = subprocess.run([sys.executable, '-c', look], capture_output=True, text=True)
    process.send_signal(signal.SIGINT)
    assert seen.stdout.strip() == '[1, 0]', seen.stderr
    assert process.wait(30) == 0


@pytest.mark.parametrize('node', [*NODES, 'velocity_to_position'])
def test_starts_alone_and_ends_cleanly(node: str, tmp_path: Path) -> None:
    """By Ctrl-C; the graphs of other tests end by SIGTERM, and tell which node did not obey."""
    process = start(node, tmp_path)
    assert is_up(node), process.communicate()
    process.send_signal(signal.SIGINT)
    # as `ros2 launch` does
    time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=30)
    assert process.returncode == 0, said
    assert 'Traceback' not in said[1]
    assert 'leaked' not in said[1]


def test_is_not_ended_by_force_once_it_has_left_dds() -> None:
    """What is left then takes long only on a busy machine, and must not cost the exit code."""
    program = (
        'import faulthandler, sys\n'
        'from handover_dmp.nodes import spin\n'
        'from rclpy.node import Node\n'
        'cancel = faulthandler.cancel_dump_traceback_later\n'
        'faulthandler.cancel_dump_traceback_later = lambda: (print("safe"), cancel())\n'
        'class Rest:\n'
        '    def __init__(self):\n'
        '        self.cycle = self\n'
        '    def __del__(self):\n'
        '        print("collected")\n'
        'def make_node():\n'
        '    node = Node("rest")\n'
        '    node.ended, node.rest = True, Rest()\n'
        '    return node\n'
        'sys.exit(spin.run(make_node))\n'
    )
    isolate()
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True)
    assert done.returncode == 0, done
    assert done.stdout.split() == ['safe', 'collected'], done


def test_robot_sim_does_not_say_that_it_follows_nobody(tmp_path: Path) -> None:
    with start('robot_sim', tmp_path) as process:
        assert process.stderr is not None
        said = []
        for line in process.stderr:
            said.append(line)
            if 'is priority_ik running?' in line:
                break
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=30)
    assert any('no command yet' in line for line in said), said
    assert not any('following commands' in line for line in said), said


class Partner:
    """Somebody whom `dmp` has not discovered yet; latches one signal at once."""

    def __init__(self, stamp_s: int = 0) -> None:
        self._context = rclpy.Context()
        self._context.init(args=[], domain_id=int(os.environ['ROS_DOMAIN_ID']))
        self._node = rclpy.create_node(
            f'partner_{stamp_s}', context=self._context, use_global_arguments=False
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        signals = self._node.create_publisher(Header, SIGNAL.name, qos_profile(SIGNAL.quality))
        signals.publish(Header(stamp=Time(sec=stamp_s), frame_id='world'))
        self._poses = [
            self._node.create_publisher(PoseStamped, topic.name, qos_profile(topic.quality))
            for topic in (WRIST_POSE, HAND_POSE)
        ]
        self._state = ''
        self._node.create_subscription(String, STATE.name, self._hear, qos_profile(STATE.quality))

    def _hear(self, message: String) -> None:
        self._state = message.data

    def waits_for(self, *wanted: str, timeout_s: float) -> str:
        """Show wrist and hand until a state is reached or the time is over; return the state."""
        end_s = time.monotonic() + timeout_s
        while self._state not in wanted and time.monotonic() < end_s:
            pose = pose_message(Time(), (0.5, 0.0, 0.5), (0.0, 0.0, 0.0, 1.0), frame='world')
            for publisher in self._poses:
                publisher.publish(pose)
            self._executor.spin_once(timeout_sec=0.02)
        return self._state

    def hears(self, process: subprocess.Popen[str], words: str) -> bool:
        """Tell whether a node logs something within a while."""
        assert process.stderr is not None
        os.set_blocking(process.stderr.fileno(), False)
        said = ''
        end_s = time.monotonic() + 60.0
        while words not in said and time.monotonic() < end_s:
            self._executor.spin_once(timeout_sec=0.02)
            with suppress(BlockingIOError):
                said += os.read(process.stderr.fileno(), 10000).decode()
        return words in said

    def tells_time(self, step_s: float) -> None:
        """Publish a clock that keeps up with that on the wall, in steps."""
        clock = self._node.create_publisher(Clock, CLOCK.name, qos_profile(CLOCK.quality))

        def tell() -> None:
            now = self._node.get_clock().now().to_msg()
            clock.publish(Clock(clock=now))

        self._node.create_timer(step_s, tell)

    def close(self) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()


def test_a_signal_is_followed_however_late_its_sender_is_discovered(tmp_path: Path) -> None:
    """A latched one without a time; one from before the node was there is told of."""
    isolate()
    early = Partner()
    time.sleep(0.5)
    partners = [early]
    process = start('dmp', tmp_path, '-p', 'hand_stamps:=arrival')
    try:
        assert early.hears(process, 'before this node started; send it again')
        assert early.waits_for('reaching', timeout_s=0.5) == 'idle'
        partners.append(late := Partner(stamp_s=3))
        assert late.waits_for('reaching', timeout_s=20.0) == 'reaching'
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
    finally:
        process.kill()
        for partner in partners:
            partner.close()


def test_a_signal_of_another_clock_is_told_of(tmp_path: Path) -> None:
    process = start('dmp', tmp_path)
    partner = Partner(stamp_s=3)
    try:
        assert partner.hears(process, 'set hand_stamps:=arrival')
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
    finally:
        process.kill()
        partner.close()


def test_a_clock_in_long_steps_is_told_of(tmp_path: Path) -> None:
    process = start('priority_ik', tmp_path, '-p', 'use_sim_time:=true')
    player = Partner()
    player.tells_time(1.0 / 18.0)
    try:
        assert player.hears(process, 'publish it more often, e.g. ros2 bag play --clock 100')
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
    finally:
        process.kill()
        player.close()


def test_a_topic_of_another_type_is_told_of(tmp_path: Path) -> None:
    """DDS connects nobody then, and says nothing."""
    process = start('dmp', tmp_path, '-p', 'tracker.type:=geometry_msgs/msg/PointStamped')
    partner = Partner()
    try:
        assert partner.hears(
            process,
            '/hand/pose is not heard: it is published as geometry_msgs/msg/PoseStamped, '
            'expected geometry_msgs/msg/PointStamped',
        )
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
    finally:
        process.kill()
        partner.close()


def test_leaves_when_its_turn_comes_and_not_before(tmp_path: Path) -> None:
    """A node that hears of a neighbour's end while it ends itself may hang in Fast DDS."""
    processes = [start(node, tmp_path) for node in ('dmp', 'priority_ik')]
    assert is_up('dmp')
    assert is_up('priority_ik')
    with turn_file(int(os.environ['ROS_DOMAIN_ID'])).open('w') as turn:
        fcntl.flock(turn, fcntl.LOCK_EX)
        for process in processes:
            process.send_signal(signal.SIGINT)
        time.sleep(MAX_WAIT_S / 5)
        assert [process.poll() for process in processes] == [None, None]
        fcntl.flock(turn, fcntl.LOCK_UN)
        assert [process.wait(30) for process in processes] == [0, 0]


def test_leaves_when_its_turn_never_comes(tmp_path: Path) -> None:
    process = start('dmp', tmp_path)
    assert is_up('dmp')
    with turn_file(int(os.environ['ROS_DOMAIN_ID'])).open('w') as turn:
        fcntl.flock(turn, fcntl.LOCK_EX)
        process.send_signal(signal.SIGINT)
        assert process.wait(MAX_WAIT_S + 30) == 0


def test_priority_ik_ends_with_an_arm_at_rest(tmp_path: Path) -> None:
    """Ctrl-C in motion: a velocity controller goes on with the last command that it got."""
    arm = RobotModel.load('lwr4')
    place, rotation = arm.wrist_pose(arm.home)
    turn = quaternion_of(rotation)
    # where a busy machine keeps this test from driving for a moment, the arm is not to brake
    patient = [f'{name}_timeout_s:=0.5' for name in ('joint_state', 'command')]
    process = start('priority_ik', tmp_path, '-p', patient[0], '-p', patient[1])
    rclpy.init(args=[])
    node = rclpy.create_node('arm_and_commander', use_global_arguments=False)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    commands: list[NDArray[np.float64]] = []
    node.create_subscription(
        Float64MultiArray, JOINT_COMMAND.name, lambda m: commands.append(np.array(m.data)), 1000
    )
    states = node.create_publisher(JointState, JOINT_STATES.name, 10)
    poses = node.create_publisher(PoseStamped, POSE_COMMAND.name, 10)

    def drive() -> None:
        time_now = node.get_clock().now().to_msg()
        state = JointState(name=list(arm.joint_names), position=arm.home.tolist())
        gripper = JointState(name=['finger'], position=[0.01])
        state.header.stamp = gripper.header.stamp = time_now
        states.publish(state)
        states.publish(gripper)
        poses.publish(pose_message(time_now, place + [0.0, 0.4, 0.0], turn))

    node.create_timer(0.005, drive)
    try:
        end_s = time.monotonic() + 60.0
        # the gripper is no reason to stop the arm
        while len(commands) < 100 or np.abs(commands[-1]).max() <= 0.1:
            executor.spin_once(timeout_sec=0.1)
            assert time.monotonic() < end_s, process.poll()
        process.send_signal(signal.SIGINT)
        while (process.poll() is None or commands[-1].any()) and time.monotonic() < end_s:
            executor.spin_once(timeout_sec=0.1)
    finally:
        process.kill()
        executor.shutdown()
        shut_down(node)
    assert process.wait() == 0
    assert not commands[-1].any()
    steps = np.abs(np.diff(commands[-20:], axis=0))
    assert np.all(steps <= MAX_STEP * 0.005 * arm.limits.acceleration + 1e-9)


@pytest.mark.parametrize('lockstep', [False, True])
def test_runs_at_the_priority_that_it_is_given(lockstep: bool, tmp_path: Path) -> None:
    """On the wall clock, and where the system permits it."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        permitted = True
    except PermissionError:
        permitted = False
    simulated = str(lockstep).lower()
    words = ['-p', 'thread_priority:=7']
    words += ['-p', f'lockstep:={simulated}', '-p', f'use_sim_time:={simulated}']
    process = start('dmp', tmp_path, *words)
    assert is_up('dmp'), process.communicate()
    end_s = time.monotonic() + 60.0
    # the threads of the middleware go before that of Python, for discovery and services
    wanted = {7, 8} if permitted and not lockstep else {0}
    while priorities(process.pid) != wanted and time.monotonic() < end_s:
        time.sleep(0.05)
    assert priorities(process.pid) == wanted
    process.send_signal(signal.SIGINT)
    assert process.wait(30) == 0


def priorities(pid: int) -> set[int]:
    """Give the real-time priorities of all threads of a process; 0 is ordinary."""
    threads = [int(path.name) for path in Path(f'/proc/{pid}/task').iterdir()]
    return {os.sched_getparam(thread).sched_priority for thread in threads}


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ('node', 'words', 'fault'),
    [
        ('dmp', ['-p', 'model:=nowhere.json'], 'nowhere.json'),
        ('dmp', ['-p', 'rate_hz:=1e9'], 'rate_hz'),
        ('dmp', ['-p', 'start:=magic'], 'magic'),
        ('dmp', ['-p', 'mu:=text'], 'mu'),
        ('dmp', ['-p', 'lockstep:=true'], 'use_sim_time'),
        ('hand_tracker', ['-p', 'trial:=nowhere.csv'], 'nowhere.csv'),
        ('robot_sim', ['-p', 'robot:=nowhere.urdf'], 'nowhere.urdf'),
        ('robot_sim', ['-p', 'initial_positions:=[1.0, 2.0]'], '7'),
        ('robot_sim', ['-p', 'base_position:=[0.0, 0.0]'], 'three'),
        ('robot_sim', ['-p', 'real_time_factor:=0.0001'], '0.01'),
        ('priority_ik', ['-p', 'base_position:=[0.0, .nan, 0.0]'], 'three finite'),
        ('priority_ik', ['-p', 'hand_filter.hand_speed:=0.0'], 'hand_speed'),
        ('priority_ik', ['-p', 'orientation:=upside_down'], 'upside_down'),
        ('dmp', ['-p', 'partner_model:=on'], 'auto, off'),
        ('dmp', ['-p', 'partner.following:=1.0'], 'partner.following'),
        ('recorder', ['-p', 'compression:=rar'], 'rar'),
        ('hand_tracker', ['-p', 'tracker.topic:=9x'], "'9x' is no name of a topic"),
        pytest.param(
            'dmp',
            ['-p', 'session.enabled:=true', '-p', 'session.gripper_action:=/gripper/move'],
            'control_msgs, which is not installed',
            marks=pytest.mark.skipif(find_spec('control_msgs') is not None, reason='it is there'),
        ),
    ],
)
def test_a_wrong_parameter_gives_one_line_and_no_traceback(
    node: str, words: list[str], fault: str, tmp_path: Path
) -> None:
    said = start(node, tmp_path, *words).communicate(timeout=60)[1]
    lines = said.strip().splitlines()
    assert len(lines) == 1, said
    assert fault in lines[0]


@pytest.mark.parametrize(
    ('words', 'fault'),
    [
        (['--params-file', 'nowhere.yaml'], 'nowhere.yaml'),
        (['--no-such-argument'], 'unknown ROS arguments'),
    ],
)
def test_wrong_ros_arguments_are_told_without_a_traceback(
    words: list[str], fault: str, tmp_path: Path
) -> None:
    process = start('hand_tracker', tmp_path, *words)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 2
    assert fault in said.strip().splitlines()[-1]
    assert 'Traceback' not in said


def test_a_bag_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / 'bag').mkdir()
    process = start('recorder', tmp_path)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 1
    assert 'exists' in said


def test_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    """A launcher that is killed outright leaves no node and no shared memory behind."""
    code = (
        'from pathlib import Path\n'
        'from handover_dmp.nodes.graph import Graph\n'
        f'graph = Graph(Path({str(tmp_path)!r}), {{"recorder": '
        f'{{"folder": {str(tmp_path / "bag")!r}}}}}, lockstep=False, '
        'nodes=("recorder", "hand_tracker"))\n'
        'graph.__enter__()\n'
        'print([p.pid for p in graph.processes.values()], flush=True)\n'
        'graph._wait_for(lambda: False, 1000.0, "")\n'
    )
    launcher = subprocess.Popen([sys.executable, '-c', code], stdout=subprocess.PIPE, text=True)
    assert launcher.stdout is not None
    pids = [int(word.strip(' []\n')) for word in launcher.stdout.readline().split(',')]
    assert len(pids) == 2
    shared = {path for pid in (launcher.pid, *pids) for path in shared_memory_of(pid)}
    launcher.kill()
    launcher.wait()
    deadline = time.monotonic() + 30.0
    while any(alive(pid) for pid in pids) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(alive(pid) for pid in pids)
    assert (tmp_path / 'bag' / 'metadata.yaml').is_file(), 'the recorder closed its bag'
    assert [path for path in shared if path.exists()] == []


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state: Any = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0]
    return state != 'Z'
