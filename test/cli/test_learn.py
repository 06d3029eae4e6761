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

from __future__ import annotations

import json
from pathlib import Path

from handover_dmp.cli.main import main
from handover_dmp.dmp import ClassicalDmp, load_model
from handover_dmp.mocap import read_trial, synthesize, write_trial
from handover_dmp.mocap.typical import demonstrator_curves
import pytest


@pytest.fixture(scope='module')
def trials(tmp_path_factory):
    folder = tmp_path_factory.mktemp('trials')
    paths = []
    for trial in synthesize(trials=2)[:2]:
        paths.append(folder / f'{trial.configuration}_{trial.direction}_{trial.number}.csv')
        write_trial(trial, paths[-1])
    return [str(path) for path in paths]


def test_it_learns_and_says_what(trials, tmp_path, capsys):
    model = tmp_path / 'sub' / 'model.json'
    assert main(['learn', trials[0], '-o', str(model), '--json', str(tmp_path / 'o.json')]) == 0
    assert 'τ = ' in capsys.readouterr().out
    outcome = json.loads((tmp_path / 'o.json').read_text())
    assert outcome['trials'] == 1
    assert outcome['duration_s'] == load_model(model).duration_s
    assert max(outcome['reproduction_error_mm']) < 5.0


def test_every_option_reaches_the_model(trials, tmp_path):
    path = tmp_path / 'model.json'
    words = '--stiffness 150 --damping 20 --goal-velocity-gain 3 --alpha 5 --mu 0.6 --sigma 0.1'
    words += ' --formulation printed --regression ridge --basis 33'
    assert main(['learn', *trials, '-o', str(path), *words.split()]) == 0
    model = load_model(path)
    parameters = model.parameters
    assert (parameters.stiffness, parameters.damping) == (150.0, 20.0)
    assert parameters.goal_velocity_gain == 3.0
    assert parameters.alpha == pytest.approx(5.0, rel=1e-12)
    assert (parameters.mu, parameters.sigma) == (0.6, 0.1)
    assert parameters.formulation == 'printed'
    assert model.basis.size == 33
    assert model.covariance is None
    assert model.source.startswith('mean of 2')


def test_joint_and_classical(trials, tmp_path):
    path = tmp_path / 'model.json'
    assert main(['learn', *trials, '-o', str(path), '--joint', '--classical']) == 0
    assert isinstance(load_model(path), ClassicalDmp)
    assert load_model(path).source.startswith('all of 2')


@pytest.mark.parametrize(
    ('words', 'code', 'fault'),
    [
        (['--stiffness', '-3'], 1, 'stiffness'),
        (['--mu', 'nan'], 1, 'mu'),
        (['--alpha', '0'], 2, '--alpha'),
        (['--basis', '1'], 2, 'basis'),
    ],
)
def test_wrong_numbers_are_one_line(trials, tmp_path, capsys, words, code, fault):
    path = tmp_path / 'model.json'
    assert main(['learn', trials[0], '-o', str(path), *words]) == code
    error = capsys.readouterr().err
    assert fault in error
    assert error.count('\n') == 1
    assert not path.exists()


def test_a_missing_trial_is_one_line(tmp_path, capsys):
    assert main(['learn', str(tmp_path / 'no.csv'), '-o', str(tmp_path / 'm.json')]) == 1
    assert 'no.csv' in capsys.readouterr().err


@pytest.mark.parametrize('words', [['--regression', 'lasso'], ['--formulation', 'soft']])
def test_unknown_choices_are_wrong_usage(trials, tmp_path, words):
    with pytest.raises(SystemExit) as exit_:
        main(['learn', trials[0], '-o', str(tmp_path / 'm.json'), *words])
    assert exit_.value.code == 2


@pytest.mark.parametrize('still', [[1], [0, 1, 2], [2]])
@pytest.mark.parametrize('regression', ['rvm', 'ridge'])
def test_a_motion_in_a_plane_or_along_a_line(tmp_path, still, regression):
    """A table-top study has a coordinate that never moves; it stays where it is."""
    from dataclasses import replace

    trial = synthesize(trials=1)[0]
    place = trial.demonstrator.copy()
    place[:, still] = 0.25
    write_trial(replace(trial, demonstrator=place), tmp_path / 'flat_give_1.csv')
    out = tmp_path / 'model.json'
    words = ['learn', str(tmp_path / 'flat_give_1.csv'), '-o', str(out)]
    assert main([*words, '--regression', regression]) == 0
    model = load_model(out)
    motion = model.rollout(trial.times, place[-1], start=place[0]).positions
    assert abs(motion[:, still] - 0.25).max() < 1e-9
    assert abs(motion[-1] - place[-1]).max() < 5e-3


def test_smooth_data_are_not_smoothed_again(tmp_path):
    """A noiseless minimum jerk is met better when it is not low-passed before."""
    from handover_dmp.mocap import HandoverTrial
    import numpy as np

    u = np.linspace(0.0, 1.0, 201)[:, None]
    path = (10 * u**3 - 15 * u**4 + 6 * u**5) * [0.5, 0.2, 0.1] + [0.0, 0.1, 0.9]
    trial = HandoverTrial(np.linspace(0.0, 1.0, 201), path[::-1], path)
    write_trial(trial, tmp_path / 'a_give_1.csv')
    errors = {}
    for cutoff in ('none', '6', '12'):
        out = tmp_path / f'{cutoff}.json'
        words = ['learn', str(tmp_path / 'a_give_1.csv'), '-o', str(out), '--low-pass', cutoff]
        assert main(words) == 0
        model = load_model(out)
        motion = model.rollout(trial.times, path[-1], start=path[0]).positions
        errors[cutoff] = np.abs(motion - path).max()
    assert errors['none'] < 0.5 * errors['6']
    assert errors['none'] <= errors['12'] <= errors['6']
    for wrong in ('0', 'nan', 'much'):
        with pytest.raises(SystemExit):
            main(['learn', 'x.csv', '-o', 'm.json', '--low-pass', wrong])


def test_the_most_typical_of_several_is_learnt_alone(kth_folder, tmp_path):
    files = [str(kth_folder / f'p01_take_{number}.csv') for number in range(1, 9)]
    out = tmp_path / 'model.json'
    words = ['--regression', 'ridge', '--basis', '20', '-o', str(out)]
    assert main(['learn', '--representative', *files, *words]) == 0
    by_distance = {}
    curves = [demonstrator_curves([read_trial(file)])[0] for file in files]
    mean = sum(curves) / len(curves)
    for file, curve in zip(files, curves, strict=True):
        by_distance[((curve - mean) ** 2).sum()] = file
    assert load_model(out).source == Path(by_distance[min(by_distance)]).name


def test_a_demonstration_far_from_those_beside_it_is_warned_of(kth_folder, tmp_path, capsys):
    said = {}
    for number in range(1, 9):
        words = ['-o', str(tmp_path / 'm.json'), '--regression', 'ridge', '--basis', '20']
        assert main(['learn', str(kth_folder / f'p01_take_{number}.csv'), *words]) == 0
        said[number] = capsys.readouterr().err
    assert 'p01_take_6.csv is unusual: 165 mm from the mean of the 7 others' in said[6]
    assert '--representative' in said[6]
    assert said[7] == ''
    assert all(text.count('\n') <= 1 for text in said.values())
