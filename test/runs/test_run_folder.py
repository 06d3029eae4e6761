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

"""What a run leaves behind, also where the arm or the outcome is not the usual one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import json
from pathlib import Path
import re

from handover_dmp.cli.main import main
from handover_dmp.common.resources import share_path
from handover_dmp.handover.lockstep import Handover, simulate
from handover_dmp.handover.scenario import make_scenario
from handover_dmp.recording import read_bag
from handover_dmp.report import load_run, measure
from handover_dmp.robot.descriptions import ArmChoice
from handover_dmp.robot.model import RobotModel
from handover_dmp.runs.bag import write_run_bag
from handover_dmp.runs.folder import run_info
import numpy as np
import pytest

Write = Callable[[str, str], Path]


@pytest.fixture
def changed_arm(tmp_path: Path) -> Write:
    """Give the function that writes the URDF of the LWR 4+ with something replaced."""

    def write(pattern: str, replacement: str) -> Path:
        text = share_path('urdf/lwr4.urdf').read_text(encoding='utf-8')
        changed, count = re.subn(pattern, replacement, text, flags=re.DOTALL)
        assert count > 0
        path = tmp_path / 'arm.urdf'
        path.write_text(changed, encoding='utf-8')
        return path

    return write


def test_an_arm_with_a_joint_that_turns_for_ever(changed_arm: Write, tmp_path: Path) -> None:
    arm = changed_arm(r'("joint_7" type=)"revolute"(.*?)lower=\S+ upper=\S+', r'\1"continuous"\2')
    run = tmp_path / 'run'
    scenario = make_scenario(arm=ArmChoice(str(arm)))
    write_run_bag(run / 'bag', scenario, simulate(scenario), run_info(scenario, 1.0))
    limits = measure(load_run(run))['limits']
    assert limits['met'] is True
    assert 0.0 < limits['position']['share'] <= 1.0
    assert limits['position']['joint'] != 'joint_7'
    ((_, told, _),) = read_bag(run / 'bag', ['/handover/info'])
    assert 'Infinity' not in told.data
    assert json.loads(told.data)['joint_limits']['upper'][-1] is None


def test_a_handover_that_never_happens_has_no_picture_of_it(
    changed_arm: Write, tmp_path: Path
) -> None:
    sluggish = changed_arm(r'velocity="\S+"', 'velocity="0.02"')
    sluggish.write_text(sluggish.read_text().replace('robot name="lwr4"', 'robot name="slow"'))
    run = tmp_path / 'run'
    assert main(['simulate', '--robot', str(sluggish), '-o', str(run)]) == 1
    assert {path.name for path in (run / 'figures').glob('scene_*')} == {
        'scene_start.png', 'scene_middle.png', 'scene_end.png',
    }  # fmt: skip
    page = (run / 'report.md').read_text()
    assert 'The object did not change hands.' in page
    assert 'half way, and at the end.' in page


@pytest.mark.parametrize('knows_its_file', [True, False])
def test_the_report_finds_an_arm_that_was_moved_beyond_its_own_description(
    changed_arm: Write, tmp_path: Path, knows_its_file: bool
) -> None:
    usual = make_scenario()
    slow = RobotModel.load(changed_arm(r'velocity="\S+"', 'velocity="0.4"'), base=usual.robot.base)
    np.testing.assert_array_equal(slow.limits.velocity, 0.4)
    robot = slow if knows_its_file else replace(slow, limits=usual.robot.limits)
    scenario = replace(usual, robot=robot)
    handover = Handover(scenario)
    periods = handover.run()
    handover.close()
    write_run_bag(tmp_path / 'bag', scenario, periods, run_info(scenario, 1.0))
    limits = measure(load_run(tmp_path / 'bag'))['limits']
    fastest = max(np.abs(period.joint_velocities).max() for period in periods)
    assert limits['judged_by'] == '/robot_description'
    assert limits['velocity']['share'] == pytest.approx(fastest / 0.4)
    assert limits['sources']['velocity'] == 'description'
    assert limits['met'] is knows_its_file
    if knows_its_file:
        assert 0.39 < fastest < 0.4 * (1 + 1e-6)
        assert limits['believed_beyond'] == []
    else:
        assert len(limits['believed_beyond']) == robot.dof
        assert limits['believed_beyond'][0].startswith(
            'velocity of joint_1: assumed 1.745 rad/s, actual 0.4'
        )
