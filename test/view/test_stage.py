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

"""The scene is set up as it was recorded, whoever recorded it."""

from __future__ import annotations

import importlib.util
from pathlib import Path
import sys

from handover_dmp.common.errors import DataError
from handover_dmp.robot.descriptions import ArmChoice
from handover_dmp.view.stage import BEFORE_S, set_up
import numpy as np
import pytest

# The maker of runs; conftest files are no modules that can be imported by name.
_spec = importlib.util.spec_from_file_location('runs', Path(__file__).with_name('conftest.py'))
runs = sys.modules.setdefault('runs', importlib.util.module_from_spec(_spec))
_spec.loader.exec_module(runs)


def test_the_arm_stands_where_the_run_says(run_folder: Path) -> None:
    with set_up(run_folder) as stage:
        assert stage.robot.base == runs.BASE
        assert stage.robot.name == 'lwr4'
        for index in (0, 30, 70):
            assert stage.scene.wrist_path[index] == pytest.approx(
                stage.record.wrist_positions[index], abs=1e-9
            )


def test_without_a_word_about_it_the_base_is_found_from_the_wrist(tmp_path: Path) -> None:
    runs.write_run(tmp_path, info={'robot': 'lwr4'})
    with set_up(tmp_path) as stage:
        assert stage.robot.base.position == pytest.approx(runs.BASE.position, abs=1e-6)
        assert stage.robot.base.yaw == pytest.approx(runs.BASE.yaw, abs=1e-6)


def test_an_arm_that_has_no_name_here_is_taken_from_its_description(tmp_path: Path) -> None:
    from handover_dmp.common.resources import share_path

    own = tmp_path / 'own.urdf'
    text = share_path('urdf/lwr4.urdf').read_text(encoding='utf-8')
    own.write_text(text.replace('<robot name="lwr4"', '<robot name="own_arm"'), encoding='utf-8')
    runs.write_run(tmp_path / 'run', str(own))
    own.unlink()
    with set_up(tmp_path / 'run') as stage:
        assert stage.robot.name == 'own_arm'
        assert stage.scene.image(1.0, 64, 48).std() > 5


def test_joints_of_another_arm_are_refused_by_name(run_folder: Path) -> None:
    with (
        pytest.raises(DataError, match=r'shoulder_pan_joint.*--robot'),
        set_up(run_folder, ArmChoice('ur5')),
    ):
        pass


def test_what_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match='no such bag'), set_up(tmp_path / 'absent'):
        pass


def test_moments_and_states(run_folder: Path) -> None:
    with set_up(run_folder) as stage:
        begin, end = stage.span_s
        assert begin == pytest.approx(runs.REACHING_S - BEFORE_S)
        assert end == pytest.approx(runs.END_S - runs.PERIOD_S)
        times = stage.frame_times(50.0)
        assert times[-1] == end
        assert times[0] >= begin - 0.5 / 50.0
        assert np.diff(times) == pytest.approx(0.02)
        states = [stage.state_at(time_s) for time_s in (0.1, 0.5, 1.25, 1.45)]
        assert states == ['idle', 'reaching', 'exchange', 'done']


@pytest.mark.parametrize('direction', ['give', 'take'])
def test_who_has_the_object_first_is_what_the_run_says(tmp_path: Path, direction: str) -> None:
    runs.write_run(tmp_path, direction=direction)
    with set_up(tmp_path) as stage:
        stage.scene.show(0.0)
        to_wrist = np.linalg.norm(stage.scene.object_pose[0] - stage.scene.wrist_path[0])
        to_hand = np.linalg.norm(stage.scene.object_pose[0] - stage.scene.hand_path[0])
        assert (to_wrist < to_hand) == (direction == 'give')


def test_an_exchange_that_was_broken_off_is_none(tmp_path: Path) -> None:
    runs.write_run(tmp_path, last_state='aborted')
    with set_up(tmp_path) as stage:
        assert stage.record.exchange_time_s is not None
        assert stage.scene.exchange_time_s == np.inf
        last = stage.scene.three_images(40, 30)[-1]
        assert np.array_equal(last, stage.scene.image(stage.span_s[1], 40, 30))
