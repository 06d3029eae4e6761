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

"""`handover_dmp synthesize`, as a user calls it."""

from __future__ import annotations

import json

from handover_dmp.cli.main import main
from handover_dmp.dmp import load_model
from handover_dmp.mocap import read_data_set, synthesize
import numpy as np
import pytest


def files(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_the_data_set_of_the_library(tmp_path, capsys):
    assert main(['synthesize', '-o', str(tmp_path / 'a')]) == 0
    assert '30 synthetic trials' in capsys.readouterr().out
    made = read_data_set(tmp_path / 'a')
    for one, other in zip(made, synthesize(), strict=True):
        assert one.label == other.label
        np.testing.assert_array_equal(one.demonstrator, other.demonstrator)


def test_again_the_same_bytes_but_not_over_the_old_ones(tmp_path, capsys):
    for seed, output, code in ((3, 'a', 0), (3, 'b', 0), (4, 'b', 1)):
        words = ['synthesize', '--seed', str(seed), '--trials', '2', '-o', str(tmp_path / output)]
        assert main(words) == code
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f'handover_dmp synthesize: {tmp_path / "b" / "trials.csv"}: exists')
    assert files(tmp_path / 'a') == files(tmp_path / 'b')
    assert len(files(tmp_path / 'a')) == 13


def test_options_and_json(tmp_path):
    words = ['--configuration', 'under_car', '--trials', '3', '--rate', '50', '--noise', '0']
    report = tmp_path / 'deep' / 'made.json'
    words += ['--json', str(report), '-o', str(tmp_path / 'set')]
    assert main(['synthesize', *words]) == 0
    made = json.loads(report.read_text())
    assert made['rate_hz'] == 50.0
    assert len(made['trials']) == 6
    for row, trial in zip(made['trials'], read_data_set(tmp_path / 'set'), strict=True):
        assert row['file'] == trial.source
        assert (row['exchange'], row['trial']) == (trial.direction, trial.number)
        assert row['duration_s'] == pytest.approx(trial.duration_s)
        assert trial.rate_hz == pytest.approx(50.0)


@pytest.mark.parametrize(
    ('words', 'message'),
    [
        (['--configuration', 'kitchen'], "no configuration 'kitchen'"),
        (['--seed', '-1'], 'seed -1'),
        (['--trials', '0'], '0 trials'),
        (['--rate', 'nan'], 'nan Hz'),
    ],
)
def test_wrong_usage_is_one_line(words, message, tmp_path, capsys):
    assert main(['synthesize', '-o', str(tmp_path / 'set'), *words]) == 2
    error = capsys.readouterr().err
    assert error.startswith('handover_dmp synthesize: ')
    assert message in error
    assert error.count('\n') == 1
    assert not (tmp_path / 'set').exists()


def test_a_folder_that_cannot_be_made(tmp_path, capsys):
    (tmp_path / 'file').write_text('x')
    assert main(['synthesize', '-o', str(tmp_path / 'file')]) == 1
    assert 'cannot be written' in capsys.readouterr().err
    with pytest.raises(SystemExit) as caught:
        main(['synthesize'])
    assert caught.value.code == 2


def test_sessions_are_made_cut_and_are_what_went_in(tmp_path, capsys):
    recorded, cut, made = tmp_path / 'recorded', tmp_path / 'cut', tmp_path / 'made.json'
    words = ['synthesize', '--sessions', '--seed', '5', '--trials', '1']
    words += ['--configuration', 'under_car']
    assert main([*words, '-o', str(recorded), '--json', str(made)]) == 0
    assert '1 synthetic session of' in capsys.readouterr().out
    told = json.loads(made.read_text())['sessions']
    assert [len(row['exchanges']) for row in told] == [2]
    assert main([*words, '-o', str(recorded)]) == 1
    assert 'exists already' in capsys.readouterr().err
    words = ['import', 'csv', str(recorded), '--segment', '--way-back', '-o', str(cut)]
    assert main(words) == 0
    found = {trial.label: trial for trial in read_data_set(cut)}
    put_in = synthesize(5, 1, configurations=['under_car'])
    assert found.keys() == {trial.label for trial in put_in}
    for trial in put_in:
        new = found[trial.label]
        assert new.duration_s == pytest.approx(trial.duration_s, abs=0.4)
        for name in ('partner', 'demonstrator'):
            first, second = getattr(new, name), getattr(trial, name)
            assert np.linalg.norm(first[0] - second[0]) < 0.02, trial.label
            assert np.linalg.norm(first[-1] - second[-1]) < 0.02, trial.label
        assert np.linalg.norm(new.way_back.demonstrator[-1] - new.demonstrator[-1]) > 0.3
    # files by name, the index among them, are the same as the folder
    again = tmp_path / 'again'
    sources = sorted(str(file) for file in recorded.iterdir())
    assert main(['import', 'csv', *sources, '--segment', '--dry-run', '-o', str(again)]) == 0
    assert '2 trials nothing written' in capsys.readouterr().out
    model = tmp_path / 'model.json'
    assert main(['learn', str(cut / 'under_car_give_1.csv'), '-o', str(model)]) == 0
    assert '; way back of 1.' in capsys.readouterr().out.replace('\n', ' ')
    learnt = load_model(model)
    # from where the reach ends to where P2 rests
    assert np.linalg.norm(learnt.way_back.start - learnt.goal) < 0.02
    assert np.linalg.norm(learnt.way_back.goal - learnt.start) < 0.15


@pytest.mark.parametrize(
    ('words', 'message'),
    [
        (['import', 'csv', 'x.csv', '--way-back'], '--way-back needs --segment'),
        (['import', 'csv', 'x.csv', '--p1', 'hand'], '--p1 and --p2'),
        (['import', 'csv', 'x.csv', '--up', 'y'], 'is in metres, z up'),
    ],
)
def test_wrong_usage_of_sessions_is_one_line(words, message, tmp_path, capsys):
    assert main([*words, '-o', str(tmp_path / 'set')]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count('\n') == 1
    assert not (tmp_path / 'set').exists()
