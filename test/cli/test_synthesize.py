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
