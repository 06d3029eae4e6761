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

from handover_dmp.cli.main import main
from handover_dmp.mocap import synthesize, write_trial
import numpy as np
import pytest


@pytest.fixture(scope='module')
def trial():
    return synthesize(trials=1)[0]


@pytest.fixture(scope='module')
def files(trial, tmp_path_factory):
    folder = tmp_path_factory.mktemp('rollout')
    write_trial(trial, folder / 'lab_give_1.csv')
    model = str(folder / 'model.json')
    assert main(['learn', str(folder / 'lab_give_1.csv'), '-o', model]) == 0
    return model, str(folder / 'lab_give_1.csv')


def read(path):
    text = path.read_text()
    return text.splitlines()[0], np.loadtxt(path, delimiter=',', skiprows=1)


def test_the_file_is_what_was_promised(files, trial, tmp_path):
    out = tmp_path / 'out.csv'
    assert main(['rollout', *files, '-o', str(out), '--json', str(tmp_path / 'o.json')]) == 0
    header, rows = read(out)
    assert header == 't,x,y,z,vx,vy,vz,wg,s'
    assert np.diff(rows[:, 0]) == pytest.approx(0.005)
    assert rows[-1, 0] - rows[0, 0] == pytest.approx(trial.duration_s, abs=0.005)
    assert rows[0, 1:4] == pytest.approx(trial.demonstrator[0])
    assert rows[0, 4:7] == pytest.approx(np.zeros(3))
    assert rows[0, 7] < 1e-9
    assert rows[-1, 7] > 0.999
    assert rows[0, 8] == 1.0
    assert np.linalg.norm(rows[-1, 1:4] - trial.demonstrator[-1]) < 0.02
    # velocities are those of the positions
    middle = (rows[2:, 1:4] - rows[:-2, 1:4]) / 0.01
    assert np.abs(middle - rows[1:-1, 4:7]).max() < 5e-3
    outcome = json.loads((tmp_path / 'o.json').read_text())
    assert outcome['samples'] == len(rows)


def test_rate_duration_and_deviation(files, tmp_path):
    out = tmp_path / 'out.csv'
    words = ['--rate', '50', '--duration', '3', '--deviation']
    assert main(['rollout', *files, '-o', str(out), *words]) == 0
    header, rows = read(out)
    assert header.endswith(',sx,sy,sz')
    assert np.diff(rows[:, 0]) == pytest.approx(0.02)
    assert rows[-1, 8] == pytest.approx(0.01 ** ((rows[-1, 0] - rows[0, 0]) / 3.0), rel=1e-6)
    assert (rows[:, 9:] >= 0.0).all()
    assert rows[len(rows) // 2, 9:].max() > 0.0


@pytest.mark.parametrize(
    ('words', 'code'), [(['--rate', '0'], 2), (['--rate', 'nan'], 2), (['--duration', '-1'], 1)]
)
def test_wrong_numbers_are_one_line(files, tmp_path, capsys, words, code):
    assert main(['rollout', *files, '-o', str(tmp_path / 'out.csv'), *words]) == code
    assert capsys.readouterr().err.count('\n') == 1
    assert not (tmp_path / 'out.csv').exists()


def test_a_model_that_is_none_is_one_line(files, tmp_path, capsys):
    assert main(['rollout', files[1], files[1], '-o', str(tmp_path / 'out.csv')]) == 1
    assert 'not JSON' in capsys.readouterr().err
