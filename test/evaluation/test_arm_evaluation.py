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

"""The evaluation with an arm: near the primitive where it may, honest where it may not."""

from __future__ import annotations

from dataclasses import replace
import json
from pathlib import Path

from handover_dmp.cli.main import main
from handover_dmp.evaluation.arm import ArmEvaluation, evaluate_arm, figures
from handover_dmp.evaluation.arm_limits import possible_acceleration
from handover_dmp.evaluation.arm_table import arm_remarks
from handover_dmp.evaluation.protocol import evaluate, Evaluation, Protocol
from handover_dmp.mocap import HandoverTrial, read_data_set, write_data_set
from handover_dmp.robot.descriptions import ArmChoice
from handover_dmp.robot.model import RobotModel
import joblib
import numpy as np
import pytest

LWR = ArmChoice('lwr4')


@pytest.fixture(scope='module')
def trials(kth_folder: Path) -> list[HandoverTrial]:
    return [
        trial
        for trial in read_data_set(kth_folder)
        if (trial.configuration, trial.direction) == ('raw', 'give')
    ]


@pytest.fixture(scope='module')
def alone(trials: list[HandoverTrial]) -> Evaluation:
    return evaluate(trials, Protocol(learn=('mean',)))


@pytest.fixture(scope='module')
def with_arm(alone: Evaluation, tmp_path_factory: pytest.TempPathFactory) -> ArmEvaluation:
    return evaluate_arm(alone, LWR, tmp_path_factory.mktemp('cache'))


def test_an_arm_that_is_hardly_limited_does_what_the_primitive_does(
    with_arm: ArmEvaluation,
) -> None:
    (case,) = with_arm.cases
    assert case.limits is not None and case.limits.any_joint < 0.05
    assert case.apart_m < 5e-3
    assert case.unreached == ()
    assert case.arm.counted.all()
    distances = np.sqrt(case.arm.squared_m2), np.sqrt(case.primitive.squared_m2)
    # by the triangle inequality of the root mean square
    assert np.abs(distances[0] - distances[1]).max() < 3 * case.apart_m


def test_the_measures_of_an_arm_stand_beside_those_of_the_same_movement(
    alone: Evaluation, with_arm: ArmEvaluation
) -> None:
    for trial in alone.measures:
        primitive, arm = trial.primitive.motion, with_arm.motions[trial.label].motion
        assert primitive is not None and arm is not None
        assert arm.path_m == pytest.approx(primitive.path_m, rel=0.02)
        assert arm.peak_speed == pytest.approx(primitive.peak_speed, rel=0.03)


def test_all_cases_together_are_every_trial_once(with_arm: ArmEvaluation) -> None:
    (case,) = with_arm.cases
    counted = case.arm.counted & [True, False, True, False]
    fewer = replace(case, arm=replace(case.arm, counted=counted))
    total = ArmEvaluation('lwr4', 'mean', [case, fewer], []).total()
    squared = [*case.arm.squared_m2[0], *fewer.arm.squared_m2[0][[0, 2]]]
    assert total['trials'] == len(squared) == 6
    assert total['arm']['rms_m'] == pytest.approx(np.sqrt(np.mean(squared)))
    assert total['apart_m'] == pytest.approx(case.apart_m)


def test_a_slower_arm_is_limited_and_loses(
    alone: Evaluation, with_arm: ArmEvaluation, tmp_path: Path
) -> None:
    from handover_dmp.robot.descriptions import read_description

    text = read_description('lwr4').text
    slow = tmp_path / 'slow.urdf'
    slow.write_text(re_limited(text, velocity=0.3))
    (case,) = evaluate_arm(alone, ArmChoice(str(slow)), tmp_path / 'cache').cases
    (fast,) = with_arm.cases
    assert case.limits is not None and case.limits.any_joint > 0.2
    assert case.limits.kinds['velocity'] > max(
        case.limits.kinds['acceleration'], case.limits.kinds['position']
    )
    assert case.apart_m > 5 * fast.apart_m
    # it comes late, and the phase has waited for it
    late, early = (figures(one.arm)['lateness_s'] for one in (case, fast))
    assert late > early + 0.1
    assert case.limits.slowed_s > 0.1
    (remark,) = arm_remarks(ArmEvaluation('slow', 'mean', [case], []))
    assert 'at its velocity limit' in remark


def test_an_arm_at_rest_accelerates_as_its_joints_can() -> None:
    robot = RobotModel.load('lwr4')
    direction = np.array([0.3, -0.5, 0.2])
    possible = possible_acceleration(robot, robot.home, direction)
    limits = robot.limits.acceleration
    jacobian = robot.wrist_jacobian(robot.home)[:3]
    towards = direction / np.linalg.norm(direction)
    # not less than the least squares solution, scaled to the first limit; not more than ‖J‖
    joints = np.linalg.pinv(jacobian) @ towards
    assert possible >= 1.0 / np.abs(joints / limits).max() - 1e-9
    assert possible <= np.linalg.norm(jacobian, 2) * np.linalg.norm(limits)
    # the limits twice as wide, twice the acceleration
    wide = replace(robot.limits, acceleration=2.0 * limits)
    stronger = replace(robot, limits=wide)
    assert possible_acceleration(stronger, robot.home, direction) == pytest.approx(2.0 * possible)


def test_recordings_that_begin_in_motion_ask_more_than_an_arm_can(
    kth_folder: Path, tmp_path: Path
) -> None:
    """Where an arm loses most of the primitive: at the start, to the accelerations of joints."""
    fastest = [
        trial
        for trial in read_data_set(kth_folder)
        if (trial.configuration, trial.direction) == ('p03', 'give') and trial.number <= 2
    ]
    (case,) = evaluate_arm(evaluate(fastest, Protocol(learn=('mean',))), LWR, tmp_path).cases
    assert case.limits is not None
    assert case.start_speed > 0.5
    assert case.limits.asked > 1.3 * case.limits.possible
    assert case.limits.kinds['acceleration'] > 0.9 * case.limits.any_joint
    assert case.limits.half_by < 0.35
    alone, arm = figures(case.primitive), figures(case.arm)
    # what it loses is time
    assert arm['lateness_s'] > alone['lateness_s'] + 0.02
    assert arm['rms_m'] - arm['shifted_rms_m'] > alone['rms_m'] - alone['shifted_rms_m']


def re_limited(urdf: str, velocity: float) -> str:
    from xml.etree import ElementTree

    root = ElementTree.fromstring(urdf)
    for limit in root.iter('limit'):
        limit.set('velocity', str(velocity))
    return ElementTree.tostring(root, encoding='unicode')


def test_what_is_broken_off_goes_on_where_it_was(
    alone: Evaluation, with_arm: ArmEvaluation, tmp_path: Path
) -> None:
    def break_off(done: int, _total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evaluate_arm(alone, LWR, tmp_path, progress=break_off)
    kept = {file: file.stat().st_mtime_ns for file in tmp_path.rglob('output.pkl')}
    assert len(kept) >= 2
    again = evaluate_arm(alone, LWR, tmp_path)
    assert again.as_json() == with_arm.as_json()
    assert all(file.stat().st_mtime_ns == stamp for file, stamp in kept.items())
    # the trials, and the placement
    assert len(list(tmp_path.rglob('output.pkl'))) == 5


def test_another_backend_gives_the_same(
    alone: Evaluation, with_arm: ArmEvaluation, tmp_path: Path
) -> None:
    with joblib.parallel_config(backend='threading', n_jobs=2):
        assert evaluate_arm(alone, LWR, tmp_path, jobs=2).as_json() == with_arm.as_json()


def test_a_way_that_is_too_long_is_refused_by_case_and_the_rest_is_told(
    trials: list[HandoverTrial], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    large = [
        replace(
            trial,
            configuration='giant',
            partner=6.0 * trial.partner,
            demonstrator=6.0 * trial.demonstrator,
        )
        for trial in trials
    ]
    write_data_set([*trials, *large], tmp_path / 'data')
    words = ['evaluate', str(tmp_path / 'data'), '-o', str(tmp_path / 'out'), '--learn', 'mean']
    assert main([*words, '--no-figures', '--arm', 'lwr4']) == 0
    assert 'With the arm: lwr4, learn mean' in capsys.readouterr().out
    table = json.loads((tmp_path / 'out' / 'table.json').read_text())['arm']
    assert [case['configuration'] for case in table['cases']] == ['raw']
    (refused,) = table['refused']
    assert refused['configuration'] == 'giant'
    assert 'cannot follow this path' in refused['reason']
    assert 'With the arm' in (tmp_path / 'out' / 'index.html').read_text()
