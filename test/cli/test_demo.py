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

"""The main job, as a user runs it: the graph, the bag, the report, the pictures."""

from __future__ import annotations

from collections import Counter
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from handover_dmp.cli.main import main
from handover_dmp.handover.lockstep import simulate
from handover_dmp.handover.scenario import make_scenario
from handover_dmp.nodes.graph import NODES
from handover_dmp.runs.bag import write_run_bag
from handover_dmp.runs.folder import run_info
from handover_dmp.topics import INFO
from mcap.reader import make_reader
import pytest

pytestmark = [pytest.mark.ros, pytest.mark.timeout(300)]

LEFT_BEHIND = {
    'bag', 'figures', 'index.html', 'logs', 'model.json', 'parameters.yaml', 'report.json',
    'report.md', 'trial.csv',
}  # fmt: skip


SIMULATE = """
from pathlib import Path
from handover_dmp.handover.lockstep import simulate
from handover_dmp.handover.scenario import make_scenario
from handover_dmp.runs.bag import write_run_bag
from handover_dmp.runs.folder import run_info
scenario = make_scenario()
write_run_bag(Path('one'), scenario, simulate(scenario), run_info(scenario, 1.0))
"""


def command(*words: str) -> list[str]:
    return [sys.executable, '-m', 'handover_dmp', *words]


def run(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command(*words), cwd=folder, capture_output=True, text=True)


def test_leaves_a_run_that_others_can_read(tmp_path: Path) -> None:
    done = run('demo', '--json', 'told.json', folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert 'handed over' in done.stdout
    (folder,) = (tmp_path / 'runs').iterdir()
    assert folder.name.endswith('_give_engine_bay')
    assert {entry.name for entry in folder.iterdir()} == LEFT_BEHIND
    report = json.loads((folder / 'report.json').read_text())
    assert json.loads((tmp_path / 'told.json').read_text()) == report
    assert report['handed_over'] is True
    assert report['exchange_gap_m'] < 0.02
    assert report['limits']['met'] is True
    assert set(report['nodes']) == set(NODES)
    for name in ('positions', 'scene_start', 'scene_middle', 'scene_exchange'):
        assert (folder / 'figures' / f'{name}.png').read_bytes()[:4] == b'\x89PNG'
        assert f'figures/{name}.png' in (folder / 'report.md').read_text()
    for name in NODES:
        log = (folder / 'logs' / f'{name}.log').read_text()
        # on a busy machine one node may come up long before another
        assert all(
            line.startswith('[INFO] ') or line.endswith(' running?') for line in log.splitlines()
        ), log

    from rosbags.highlevel import AnyReader
    from rosbags.typesys import get_typestore, Stores

    counts: Counter[str] = Counter()
    with AnyReader([folder / 'bag'], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as bag:
        for connection, _, data in bag.messages():
            bag.deserialize(data, connection.msgtype)
            counts[connection.topic] += 1
    assert counts['/wrist/pose'] > 300
    assert counts['/handover/info'] == 1
    # the place of the arm and its links, though no tf2 is installed
    assert counts['/tf_static'] == 1
    assert counts['/tf'] > 50


@pytest.mark.slow
@pytest.mark.parametrize('direction', ['give', 'take'])
@pytest.mark.parametrize('number', [1, 2, 3, 4])
def test_hands_over_to_every_recorded_person(
    kth_folder: Path, tmp_path: Path, direction: str, number: int
) -> None:
    trial = kth_folder / f'raw_{direction}_{number}.csv'
    done = run('demo', '--trial', str(trial), '-o', 'run', folder=tmp_path)
    assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / 'run' / 'report.json').read_text())
    assert report['handed_over'] is True
    assert report['limits']['met'] is True
    assert 'base position, m' in (tmp_path / 'run' / 'report.md').read_text()


def test_says_so_when_a_node_dies(tmp_path: Path) -> None:
    demo = subprocess.Popen(
        command('demo', '-o', 'run'), cwd=tmp_path, stderr=subprocess.PIPE, text=True
    )
    victim = None
    end = time.monotonic() + 120.0
    while victim is None and time.monotonic() < end:
        time.sleep(0.1)
        for child in Path(f'/proc/{demo.pid}/task/{demo.pid}/children').read_text().split():
            words = Path(f'/proc/{child}/cmdline').read_bytes().split(b'\0')
            if b'handover_dmp.nodes.dmp' in words:
                victim = int(child)
    assert victim is not None
    os.kill(victim, signal.SIGKILL)
    said = demo.communicate(timeout=120)[1].strip().splitlines()
    assert demo.returncode == 1
    assert said == ['handover_dmp demo: dmp ended with code -9']


@pytest.mark.parametrize('verb', ['demo', 'simulate'])
@pytest.mark.parametrize(
    ('content', 'fault'),
    [
        (None, 'no such file'),
        ('', 'is empty'),
        ('t,p1_x,p1_y,p1_z,p2_x,p2_y,p2_z\n0,0,0,0,0,0,0\n', 'at least 10'),
    ],
)
def test_bad_trials_give_one_line_and_leave_nothing(
    tmp_path: Path, verb: str, content: str | None, fault: str, capsys: pytest.CaptureFixture[str]
) -> None:
    trial = tmp_path / 'trial.csv'
    if content is not None:
        trial.write_text(content)
    assert main([verb, '--trial', str(trial), '-o', str(tmp_path / 'run')]) == 1
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert str(trial) in line
    assert fault in line
    assert not (tmp_path / 'run').exists()


WITHOUT = """
import sys
for name in sys.argv.pop(1).split(','):
    sys.modules[name] = None
if 'rosbags' in sys.modules:
    sys.prefix = '/nowhere'
from handover_dmp.cli.main import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.parametrize(
    ('absent', 'words', 'fault'),
    [
        ('rclpy', ['demo', '-o', 'run'], 'rclpy'),
        ('std_srvs.srv', ['demo', '-o', 'run'], 'std_srvs.srv is not installed'),
        ('rclpy', ['bench', 'ros', '--json', 'run'], 'ros: rclpy'),
        ('rosbags', ['simulate', '-o', 'run'], 'no package on this machine defines it'),
    ],
)
def test_what_is_not_installed_is_said_before_anything_is_written(
    tmp_path: Path, absent: str, words: list[str], fault: str
) -> None:
    done = subprocess.run(
        [sys.executable, '-c', WITHOUT, absent, *words],
        cwd=tmp_path,
        env=os.environ | {'AMENT_PREFIX_PATH': ''},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    (line,) = done.stderr.strip().splitlines()
    assert fault in line
    assert "pip install 'handover_dmp[ros]'" in line
    assert list(tmp_path.iterdir()) == []


def test_an_unreachable_way_names_the_distance(tmp_path: Path) -> None:
    done = run('simulate', '--scale', '6', folder=tmp_path)
    assert done.returncode == 1
    assert 'm out of reach' in done.stderr
    assert not (tmp_path / 'runs').exists()


def test_simulates_the_same_every_time(tmp_path: Path) -> None:
    """In another process, too, to the last bit; the report as well, as test_report.py has it."""
    assert subprocess.run([sys.executable, '-c', SIMULATE], cwd=tmp_path).returncode == 0
    scenario = make_scenario()
    write_run_bag(tmp_path / 'two', scenario, simulate(scenario), run_info(scenario, 1.0))
    recorded = []
    for bag in (tmp_path / 'one', tmp_path / 'two'):
        (file,) = bag.glob('*.mcap')
        with file.open('rb') as stream:
            # In the order of the file: where its chunks end depends on the time that writing took,
            # and rosbags up to 0.11.4 mixes the messages of one time about such an end.
            messages = make_reader(stream).iter_messages(log_time_order=False)
            recorded.append(
                [
                    (channel.topic, message.log_time, message.publish_time, message.data)
                    for _, channel, message in messages
                    # tells how it was made
                    if channel.topic != INFO.name
                ]
            )
    assert len(recorded[0]) > 5000
    assert recorded[0] == recorded[1]


def test_a_run_is_never_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'mine.txt').touch()
    assert main(['simulate', '-o', str(tmp_path)]) == 1
    assert 'never overwritten' in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ['mine.txt']
