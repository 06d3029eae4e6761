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

"""The graph under the real tools of ROS 2, where these are on the PATH: `make test-ros2`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys
from time import monotonic, sleep

from handover_dmp.recording import bag_information, read_bag
import pytest

ROOT = Path(__file__).resolve().parents[1]
ROS2 = shutil.which('ros2')
pytestmark = [
    pytest.mark.ros,
    pytest.mark.ros2,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(ROS2 is None, reason='ros2 is not on the PATH'),
]
SHARED = {'/clock', '/diagnostics', '/rosout', '/parameter_events', '/tf', '/tf_static'}
NODES = ('robot_sim', 'hand_tracker', 'priority_ik', 'dmp', 'recorder')
MAX_S = 300.0
"""Within which all but a broken machine has done anything, s."""
SIDES = ('left', 'right')
SIDE_BY_SIDE = """
from launch import LaunchDescription
from launch.actions import GroupAction, IncludeLaunchDescription
from launch_ros.actions import PushRosNamespace
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    handover = [FindPackageShare('handover_dmp'), '/launch/handover.launch.py']
    return LaunchDescription([
        GroupAction([
            PushRosNamespace(side),
            IncludeLaunchDescription(handover, launch_arguments={
                'exchange': exchange, 'output': 'OUTPUT/' + side,
            }.items()),
        ])
        for side, exchange in (('left', 'give'), ('right', 'take'))
    ])
"""


def ros2(*words: str, timeout_s: float = MAX_S) -> subprocess.CompletedProcess[str]:
    """Run a command of ros2 to its end."""
    assert ROS2 is not None
    return subprocess.run(
        [ROS2, *words], capture_output=True, text=True, timeout=timeout_s, check=False
    )


@contextmanager
def running(*words: str) -> Iterator[subprocess.Popen[str]]:
    """Run a command of ros2, and end it as Ctrl-C does: the whole group of processes."""
    assert ROS2 is not None
    process = subprocess.Popen([ROS2, *words], text=True, start_new_session=True)
    try:
        yield process
    finally:
        os.killpg(process.pid, signal.SIGINT)
        process.wait(MAX_S)


def states(bag: Path, topic: str) -> list[str]:
    try:
        return [message.data for _, message, _ in read_bag(bag, [topic])]
    except Exception:  # not there yet, or just being written
        return []


def wait_until_done(process: subprocess.Popen[str], *bags: tuple[Path, str]) -> None:
    end_s = monotonic() + MAX_S
    while not all('done' in states(bag, topic) for bag, topic in bags):
        assert monotonic() < end_s, [states(bag, topic) for bag, topic in bags]
        assert process.poll() is None
        sleep(0.5)


def test_launch_ends_with_the_handover(tmp_path: Path) -> None:
    done = ros2(
        'launch', 'handover_dmp', 'handover.launch.py',
        f'output:={tmp_path / "run"}', 'exit_when_done:=true',
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert states(tmp_path / 'run' / 'bag', '/handover/state') == [
        'idle', 'reaching', 'exchange', 'done',
    ]  # fmt: skip
    for node, words in (
        ('dmp', 'reaching for the hand'), ('priority_ik', 'moves wrist of lwr4'),
        ('robot_sim', 'simulates lwr4'), ('recorder', 'records every topic'),
        ('hand_tracker', 'replays'),
    ):  # fmt: skip
        assert re.search(rf'\[{node}\]: .*{words}', done.stdout + done.stderr), node


def test_two_includes_do_not_hear_each_other(tmp_path: Path) -> None:
    file = tmp_path / 'side_by_side.launch.py'
    file.write_text(SIDE_BY_SIDE.replace('OUTPUT', str(tmp_path)), encoding='utf-8')
    bags = [(tmp_path / side / 'bag', f'/{side}/handover/state') for side in SIDES]
    with running('launch', str(file)) as launch:
        wait_until_done(launch, *bags)
    for side, (bag, topic) in zip(SIDES, bags, strict=True):
        recorded = set(bag_information(bag).topics)
        assert {name for name in recorded - SHARED if not name.startswith(f'/{side}/')} == set()
        assert states(bag, topic) == ['idle', 'reaching', 'exchange', 'done']


def test_every_dump_loads_again_and_changes_nothing(tmp_path: Path) -> None:
    with running('launch', 'handover_dmp', 'handover.launch.py', f'output:={tmp_path / "run"}'):
        for node in NODES:
            file = tmp_path / f'{node}.yaml'
            end_s = monotonic() + MAX_S
            while not (dump := ros2('param', 'dump', f'/{node}')).stdout.strip():
                assert monotonic() < end_s, dump.stderr
            file.write_text(dump.stdout, encoding='utf-8')
            loaded = ros2('param', 'load', f'/{node}', str(file))
            assert loaded.returncode == 0, loaded.stderr
            assert 'failed' not in loaded.stdout + loaded.stderr
            assert ros2('param', 'dump', f'/{node}').stdout == dump.stdout


def collected(*words: str) -> int:
    """Count the tests that pytest finds."""
    told = subprocess.run(
        [sys.executable, '-m', 'pytest', '--collect-only', '-q', *words],
        cwd=ROOT, capture_output=True, text=True, check=False,
    ).stdout  # fmt: skip
    counts = re.findall(r'^(\d+)(?:/\d+)? tests? collected', told, re.MULTILINE)
    assert counts, told[-500:]
    return int(counts[-1])


def test_the_plugins_of_launch_hide_no_test() -> None:
    pytest.importorskip('launch_testing')
    # Without any plugin, save those whose options pyproject.toml names.
    alone = collected('-p', 'no:launch_testing', '-p', 'no:launch_ros')
    assert collected() == alone > 1000
