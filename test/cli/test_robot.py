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

"""What a user does first with an arm of their own."""

from __future__ import annotations

import json
from pathlib import Path
import subprocess
import sys

from handover_dmp.bench.odd_arms import odd_arm
from handover_dmp.cli.main import main
from handover_dmp.common.resources import share_path
from handover_dmp.handover.lockstep import simulate
from handover_dmp.handover.scenario import make_scenario
from handover_dmp.runs.bag import write_run_bag
from handover_dmp.runs.folder import run_info
import numpy as np
from PIL import Image
import pytest


def test_an_arm_is_looked_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm = tmp_path / 'mine.urdf'
    text = share_path('urdf/lwr4.urdf').read_text(encoding='utf-8')
    arm.write_text(text.replace('robot name="lwr4"', 'robot name="mine"'), encoding='utf-8')
    picture, numbers = tmp_path / 'mine.png', tmp_path / 'mine.json'
    assert main(['robot', str(arm), '-o', str(picture), '--json', str(numbers)]) == 0
    shown = capsys.readouterr().out
    assert 'joint_7' in shown and 'acceleration: default' in ' '.join(shown.split())
    told = json.loads(numbers.read_text())
    assert [joint['name'] for joint in told['joints']] == [f'joint_{i}' for i in range(1, 8)]
    assert told['joints'][0]['velocity'] == pytest.approx(np.radians(100.0), rel=1e-6)
    assert told['limit_sources']['velocity'] == 'description'
    assert told['wrist_frame'] == 'wrist' and told['engines_apart_m'] < 1e-6
    assert 0.7 < told['reach_m'] < 1.0
    pixels = np.asarray(Image.open(picture).convert('L'))
    seen = pixels != pixels[0, 0]
    # the arm is in the picture, and none of it beyond its edge
    assert 0.03 < seen.mean() < 0.6
    assert not (seen[0].any() or seen[-1].any() or seen[:, 0].any() or seen[:, -1].any())


def test_an_arm_that_cannot_be_used(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm = tmp_path / 'mine.urdf'
    arm.write_text('<robot name="mine"><link name="base"/></robot>', encoding='utf-8')
    assert main(['robot', str(arm)]) == 1
    assert capsys.readouterr().err == (
        f'handover_dmp robot: {arm}: no joint moves any link; is it an arm?\n'
    )


@pytest.fixture(scope='module')
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a run, to draw another arm into."""
    folder = tmp_path_factory.mktemp('run')
    scenario = make_scenario()
    write_run_bag(folder / 'bag', scenario, simulate(scenario), run_info(scenario, 1.0))
    return folder


WRONG = {
    'the only jaw of a gripper': 'say which link is the wrist',
    'two arms': 'say which link is the wrist',
    'an axis of no direction': "joint 'j2' has an axis of zero length",
    'a ball joint': "joint 'j1' is of type ball",
    'a loop in place of a tree': 'must form a tree',
    'macros of xacro that are not expanded': 'an unexpanded xacro',
}


@pytest.mark.parametrize('name', WRONG)
def test_an_odd_arm_is_refused_in_one_line(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = str(odd_arm(name, tmp_path).path)
    assert main(['robot', file]) == 1
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith(f'handover_dmp robot: {file}: ') and WRONG[name] in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ['odd.urdf']


@pytest.mark.parametrize('name', ['two arms', 'a ball joint'])
def test_every_command_says_the_same_line_before_anything_starts(
    name: str, recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, run = str(odd_arm(name, tmp_path).path), str(tmp_path / 'run')
    said = set()
    for words in (
        ['robot', file],
        ['simulate', '--robot', file, '-o', run],
        ['demo', '--robot', file, '-o', run],
        ['render', str(recorded), '--robot', file, '-o', str(tmp_path / 'film.mp4')],
        ['view', str(recorded), '--robot', file, '--no-browser'],
    ):
        assert main(words) == 1
        line = capsys.readouterr().err.splitlines()[-1]
        start = f'handover_dmp {words[0]}: '
        assert line.startswith(start)
        said.add(line.removeprefix(start))
    assert len(said) == 1
    assert said.pop().startswith(f'{file}: ') and WRONG[name] in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ['odd.urdf']


@pytest.mark.ros
@pytest.mark.parametrize('node', ['robot_sim', 'priority_ik', 'velocity_to_position'])
def test_every_node_says_it_in_the_words_of_the_commands(
    node: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = str(odd_arm('two arms', tmp_path).path)
    assert main(['robot', file]) == 1
    expected = capsys.readouterr().err.removeprefix('handover_dmp robot: ')
    words = ['-m', f'handover_dmp.nodes.{node}', '--ros-args', '-p', f'robot:={file}']
    ended = subprocess.run([sys.executable, *words], capture_output=True, text=True, timeout=100)
    assert (ended.returncode, ended.stderr.partition(f'{file}: ')[2]) == (
        1,
        expected.removeprefix(f'{file}: '),
    )
    assert ended.stderr.count('\n') == 1


def test_one_arm_of_two_by_the_two_options(tmp_path: Path) -> None:
    file = str(odd_arm('two arms', tmp_path).path)
    numbers = tmp_path / 'numbers.json'
    frames = ['--wrist-frame', 'right_l7', '--base-frame', 'right_l1']
    assert main(['robot', file, *frames, '--json', str(numbers)]) == 0
    told = json.loads(numbers.read_text())
    assert [joint['name'] for joint in told['joints']] == [f'right_j{i}' for i in range(2, 8)]
    assert (told['wrist_frame'], told['base_frame']) == ('right_l7', 'right_l1')
