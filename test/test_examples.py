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

"""The examples are short, run, and say what is true."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
import os
from pathlib import Path
import re
import subprocess
import sys
from time import monotonic

from handover_dmp.mocap import synthesize, write_data_set
import pytest

pytestmark = pytest.mark.timeout(1800)  # on a machine that does much else
EXAMPLES = Path(__file__).resolve().parents[1] / 'examples'
MAX_LINES = 40
FAR_RAD = 0.1
GAP_S = 0.3
ATTEMPTS = 20
HEADER_LINES = 14  # of the licence, and the line below


def run(name: str, *words: str | Path) -> str:
    """Run an example as a user does; return what it printed."""
    result = subprocess.run(
        [sys.executable, str(EXAMPLES / f'{name}.py'), *map(str, words)],
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def numbers(text: str, pattern: str) -> list[float]:
    """Return every number that a pattern finds."""
    found = [float(match) for match in re.findall(pattern, text)]
    assert found, text
    return found


def test_every_example_is_short_and_tested_here() -> None:
    tests = Path(__file__).read_text(encoding='utf-8')
    files = sorted(EXAMPLES.glob('*.py'))
    assert len(files) >= 5
    for file in files:
        lines = file.read_text(encoding='utf-8').splitlines()
        own = len(lines) - (HEADER_LINES if lines[0].startswith('# Copyright') else 0)
        assert own <= MAX_LINES, f'{file.name} has {own} lines'
        assert re.search(rf"'{file.stem}(\.py)?'", tests), f'{file.name} is not run here'


def test_learn_and_roll_out() -> None:
    text = run('learn_and_roll_out')
    distances = numbers(text, r'([\d.]+) mm from the person')
    assert len(distances) == 11
    assert distances[0] < 1.0  # it begins where the person did
    assert max(distances) < 150.0
    weights = numbers(text, r'w_g = ([\d.]+)')
    assert weights == sorted(weights)
    assert (weights[0], weights[-1]) == (0.0, 1.0)


def test_moving_goal() -> None:
    decoupled, classical = numbers(run('moving_goal'), r'lags +([\d.]+) mm')
    assert decoupled < 0.5
    assert classical > 20.0


def test_arm_without_ros() -> None:
    text = run('arm_without_ros')
    assert numbers(text, r'at most ([\d.]+) mm')[0] < 1.0
    shares = numbers(text.partition('limits:')[2], r'([\d.]+)')
    assert len(shares) == 7
    assert 0.05 < max(shares) <= 1.0


def test_read_a_bag(tmp_path: Path) -> None:
    # Loaded here, not imported: conftest files are no modules.
    program = (
        'import runpy, sys, pathlib;'
        f'runs = runpy.run_path({str(Path(__file__).parent / "view" / "conftest.py")!r});'
        'runs["write_run"](pathlib.Path(sys.argv[1]))'
    )
    subprocess.run([sys.executable, '-c', program, str(tmp_path)], check=True)
    text = run('read_a_bag', tmp_path)
    states = re.findall(r'^ +[\d.]+ s  (\w+)$', text, re.MULTILINE)
    assert states == ['idle', 'reaching', 'exchange', 'done']
    assert '75 wrist poses' in text
    speeds = dict(re.findall(r'^(\w+) .* at most ([\d.]+) m/s$', text, re.MULTILINE))
    assert float(speeds['reaching']) > 0.1 > float(speeds['idle'])


def test_tune_parameters(tmp_path: Path) -> None:
    trials = synthesize(trials=4, configurations=['engine_bay'])
    write_data_set([trial for trial in trials if trial.direction == 'give'], tmp_path / 'trials')
    text = run('tune_parameters', tmp_path / 'trials', '3')
    assert 'on 4 trials' in text
    assert numbers(text, r'stiffness +([\d.]+)')[0] == 200.0
    assert len(re.findall(r'on unseen trials', text)) == 2


@pytest.mark.ros
def test_velocity_to_position(monkeypatch: pytest.MonkeyPatch) -> None:
    """
    Its positions are the integral of the velocities, from where the arm was measured.

    They never go far from there, and begin anew where the arm is when the commands had a gap.
    """
    rclpy = pytest.importorskip('rclpy')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    from handover_dmp.nodes.qos import qos_profile
    from handover_dmp.nodes.shutdown import shut_down
    from handover_dmp.topics import JOINT_COMMAND, JOINT_STATES
    from rclpy.executors import SingleThreadedExecutor
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64MultiArray

    domain = int(os.environ['ROS_DOMAIN_ID'])
    process = subprocess.Popen(
        [sys.executable, str(EXAMPLES / 'velocity_to_position.py')],
        env={**os.environ, 'ROS_DOMAIN_ID': str(domain)},
    )
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node('velocities', context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    received: list[list[float]] = []
    start = [0.1 * i for i in range(7)]
    elsewhere = [1.0 + place for place in start]
    joints = [f'lbr_A{i}' for i in range(1, 8)]
    try:
        node.create_subscription(
            Float64MultiArray,
            '/velocity_to_position/positions',
            lambda message: received.append(list(message.data)),
            1,
        )
        states = node.create_publisher(
            JointState, JOINT_STATES.name, qos_profile(JOINT_STATES.quality)
        )
        commands = node.create_publisher(
            Float64MultiArray, JOINT_COMMAND.name, qos_profile(JOINT_COMMAND.quality)
        )
        # Its joints in another order, and one that is not of the arm.

        def measure_at(place: list[float]) -> None:
            names = ['gripper', *joints[::-1]]
            states.publish(JointState(name=names, position=[9.0, *place[::-1]]))
            executor.spin_once(timeout_sec=0.005)

        def move_until(done: Callable[[], bool]) -> None:
            for _ in range(20_000):
                commands.publish(Float64MultiArray(data=[0.5, 0.0, 0.0, 0.0, 0.0, 0.0, -0.5]))
                executor.spin_once(timeout_sec=0.005)
                if done():
                    return
                assert process.poll() is None
            pytest.fail('nothing comes')

        def moved_from_start() -> bool:
            measure_at(start)
            return len(received) >= 20 and received[-1] == received[-2]

        move_until(moved_from_start)
        # again where the gap has been none for a process that did not run meanwhile
        for _ in range(ATTEMPTS):
            end_s = monotonic() + GAP_S
            while monotonic() < end_s:
                measure_at(elsewhere)
            followed = len(received)
            move_until(lambda heard=followed: len(received) > heard)
            if elsewhere in received:
                break
    finally:
        process.terminate()
        process.wait()
        executor.shutdown()
        shut_down(node)
    assert elsewhere in received
    from_start = [positions for positions in received if positions[1] == start[1]]
    assert len(from_start) >= 20
    for positions in from_start:
        moved = positions[0] - start[0]
        assert moved >= 0.0
        assert positions[6] - start[6] == pytest.approx(-moved)
        assert positions[1:6] == pytest.approx(start[1:6])
    assert max(from_start)[0] == pytest.approx(start[0] + FAR_RAD)
    for before, after in pairwise(from_start):
        assert after[0] >= before[0] or after == start, 'only a gap begins anew'
