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

"""`handover_dmp import`, as a user calls it."""

from __future__ import annotations

import json

from handover_dmp.cli.main import main
from handover_dmp.mocap import read_data_set, synthesize
import numpy as np
import pytest

REST_S = 0.6


@pytest.fixture(scope='module')
def trials():
    return synthesize(seed=3, trials=2, configurations=['engine_bay'])


def tsv(path, trials, rate_hz=100.0):
    """Write trials as one Qualisys session: reach, hold, back again, rest."""
    pieces = []
    for trial in trials:
        both = np.hstack([trial.partner, trial.demonstrator])
        times = np.arange(0.0, trial.duration_s, 1.0 / rate_hz)
        reach = np.column_stack([np.interp(times, trial.times, column) for column in both.T])
        rest = np.tile(reach[0], (round(REST_S * rate_hz), 1))
        hold = np.tile(reach[-1], (round(REST_S * rate_hz), 1))
        pieces += [rest, reach, hold, reach[::-1]]
        if len(trials) == 1:
            pieces = [reach]
    for k in range(3, len(pieces) - 1, 4):
        # To where the next one starts.
        share = np.linspace(0.0, 1.0, 50)[:, None]
        way = pieces[k][-1] + share * (pieces[k + 1][0] - pieces[k][-1])
        pieces[k] = np.vstack([pieces[k], way])
    table = 1000.0 * np.vstack(pieces)
    lines = [
        f'NO_OF_FRAMES\t{len(table)}',
        f'FREQUENCY\t{rate_hz:g}',
        'DATA_INCLUDED\t3D',
        'MARKER_NAMES\tmechanic\tassistant',
        *('\t'.join(f'{value:.3f}' for value in row) for row in table),
    ]
    path.write_text('\n'.join(lines) + '\n')
    return path


MARKERS = ['--p1', 'mechanic', '--p2', 'assistant']


def test_whole_files_by_their_names(tmp_path, trials, capsys):
    sources = [
        str(tsv(tmp_path / f'bay_{trial.direction}_{trial.number}.tsv', [trial]))
        for trial in trials
    ]
    output = tmp_path / 'set'
    assert main(['import', 'qualisys', *sources, '-o', str(output), *MARKERS]) == 0
    assert '4 trials written' in capsys.readouterr().out
    made = read_data_set(output)
    assert [trial.label for trial in made] == [
        'bay give 1',
        'bay give 2',
        'bay take 1',
        'bay take 2',
    ]
    for new, old in zip(made, trials, strict=True):
        assert new.rate_hz == pytest.approx(100.0)
        np.testing.assert_allclose(new.demonstrator[0], old.demonstrator[0], atol=1e-6)
        np.testing.assert_allclose(new.partner[-1], old.partner[-1], atol=1e-3)


def test_a_long_recording_is_cut_and_shown(tmp_path, trials, capsys):
    source = tsv(tmp_path / 'session.tsv', trials)
    output, report, figure = (tmp_path / name for name in ('set', 'cut.json', 'cut.png'))
    words = ['import', 'qualisys', str(source), '-o', str(output), *MARKERS, '--segment']
    words += ['--configuration', 'engine_bay', '--giver', 'p2', '--json', str(report)]
    assert main([*words, '--figure', str(figure)]) == 0
    assert 'engine_bay_give_4.csv' in capsys.readouterr().out
    assert figure.read_bytes().startswith(b'\x89PNG')
    found = json.loads(report.read_text())
    assert [row['trial'] for row in found['trials']] == [1, 2, 3, 4]
    assert found['left_out'] == []
    for new, old in zip(read_data_set(output), trials, strict=True):
        np.testing.assert_allclose(new.demonstrator[-1], old.demonstrator[-1], atol=0.01)


def test_append_takes_the_next_numbers(tmp_path, trials, capsys):
    source = str(tsv(tmp_path / 'bay_give_1.tsv', trials[:1]))
    output = tmp_path / 'set'
    for more in ([], ['--append'], ['--append']):
        assert main(['import', 'qualisys', source, '-o', str(output), *MARKERS, *more]) == 0
    assert [trial.number for trial in read_data_set(output)] == [1, 2, 3]
    index = (output / 'trials.csv').read_text()
    # Before the sources are read.
    words = ['import', 'qualisys', str(tmp_path / 'none'), '-o', str(output), *MARKERS]
    assert main(words) == 1
    assert 'trials.csv: exists already' in capsys.readouterr().err
    assert (output / 'trials.csv').read_text() == index
    twice = str(tmp_path / 'twice')
    assert main(['import', 'qualisys', source, source, '-o', twice, *MARKERS]) == 0
    assert [trial.number for trial in read_data_set(twice)] == [1, 2]


def test_append_keeps_what_the_index_tells(tmp_path, trials):
    source = str(tsv(tmp_path / 'bay_give_1.tsv', trials[:1]))
    words = ['import', 'qualisys', source, '-o', str(tmp_path / 'set'), *MARKERS]
    assert main(words) == 0
    (tmp_path / 'set' / 'bay_give_1.csv').rename(tmp_path / 'set' / 'monday.csv')
    index = tmp_path / 'set' / 'trials.csv'
    index.write_text(
        'file,configuration,exchange,trial,source,giver_id\n'
        'monday.csv,bay,give,1,vicon session 7,g12\n'
    )
    before = index.read_text()
    assert main([*words, '--append']) == 0
    assert index.read_text() == before + 'bay_give_2.csv,bay,give,2,bay_give_1.tsv,\n'
    names = {path.name for path in index.parent.iterdir()}
    assert names == {'trials.csv', 'monday.csv', 'bay_give_2.csv', 'import.html'}


def test_c3d_with_y_up(tmp_path, trials):
    ezc3d = pytest.importorskip('ezc3d')
    trial = trials[2]
    points = np.ones((4, 2, len(trial.times)))
    for k, path in enumerate((trial.partner, trial.demonstrator)):
        points[:3, k] = 1000.0 * np.array([path[:, 0], path[:, 2], -path[:, 1]])
    file = ezc3d.c3d()
    file['parameters']['POINT']['RATE']['value'] = [200.0]
    file['parameters']['POINT']['LABELS']['value'] = ['mechanic', 'assistant']
    file['parameters']['POINT']['UNITS']['value'] = ['mm']
    file['data']['points'] = points
    file.write(str(tmp_path / 'lift_take_7.c3d'))
    words = ['import', 'c3d', str(tmp_path / 'lift_take_7.c3d'), '-o', str(tmp_path / 'set')]
    assert main([*words, *MARKERS, '--up', 'y']) == 0
    made = read_data_set(tmp_path / 'set')[0]
    assert made.label == 'lift take 7'
    np.testing.assert_allclose(made.partner, trial.partner, atol=1e-6)
    np.testing.assert_allclose(made.demonstrator, trial.demonstrator, atol=1e-6)


@pytest.mark.parametrize(
    'name',
    ['Take 2023-05-01 10.12.13 AM', 'givers', 'lab_TAKE', 'P2 receives 3', 'take_4', 'giving_01'],
)
def test_a_name_that_may_tell_the_direction_is_asked_for(name, tmp_path, trials, capsys):
    source = str(tsv(tmp_path / f'{name}.tsv', trials[:1]))
    words = ['import', 'qualisys', source, '-o', str(tmp_path / 'set'), *MARKERS]
    assert main(words) == 2
    assert 'Say --exchange give or take' in capsys.readouterr().err
    assert main([*words, '--exchange', 'give']) == 0
    assert 'taken for give' not in capsys.readouterr().out


def test_a_name_that_tells_nothing_is_taken_for_give_and_said(tmp_path, trials, capsys):
    source = str(tsv(tmp_path / 'session.tsv', trials[:1]))
    assert main(['import', 'qualisys', source, '-o', str(tmp_path / 'set'), *MARKERS]) == 0
    assert 'give is assumed' in capsys.readouterr().out
    (trial,) = read_data_set(tmp_path / 'set')
    assert trial.direction == 'give'


def test_wrong_usage_is_one_line(tmp_path, trials, capsys):
    source = str(tsv(tmp_path / 'session.tsv', trials[:1]))
    cases = [
        (['--p1', 'mechanic'], 2, 'session.tsv has mechanic, assistant'),
        ([*MARKERS, '--giver', 'p1'], 2, '--giver needs --segment'),
        ([*MARKERS, '--figure', 'x.png'], 2, '--figure shows how'),
        ([*MARKERS, '--segment', '--exchange', 'give'], 2, 'use --giver'),
        ([*MARKERS, '--segment', '--near', '9'], 2, 'near_m 9.0 and apart_m'),
        (['--p1', 'mechanic', '--p2', 'robot'], 1, "no marker 'robot'; there are mechanic"),
        ([*MARKERS, '--unit', 'm'], 1, 'are these millimetres?'),
        ([*MARKERS, '--segment', '--near', '0.1'], 1, 'no handover found'),
        (['--p1', 'mechanic', '--p2', 'mechanic'], 2, "both name 'mechanic'"),
        ([*MARKERS, '--append'], 1, 'no such folder'),
        ([*MARKERS, '--part', '2'], 2, 'are for bags'),
        ([*MARKERS, '--unit', 'furlong'], 2, "'furlong' is not one of m, cm"),
    ]
    output = tmp_path / 'set'
    for words, code, message in cases:
        assert main(['import', 'qualisys', source, '-o', str(output), *words]) == code, words
        error = capsys.readouterr().err
        assert error.startswith('handover_dmp import: ')
        assert message in error
        assert error.count('\n') == 1
        assert not output.exists()
    assert main(['import', 'bag', source, '-o', str(output), '--p1', '/a', '--p1', '/b']) == 2
    assert 'bag' in capsys.readouterr().err
    assert main(['import', 'c3d', str(tmp_path / 'none'), '-o', str(output), *MARKERS]) == 1
    assert 'none: no such file' in capsys.readouterr().err


def test_a_bag_of_this_package(tmp_path, trials):
    """What `handover_dmp bag` writes comes back as trials."""
    pytest.importorskip('mcap')
    from handover_dmp.mocap import write_data_set

    write_data_set(trials[2:3], tmp_path / 'old')
    assert main(['bag', str(tmp_path / 'old'), '-o', str(tmp_path / 'bags')]) == 0
    (written,) = (tmp_path / 'bags').iterdir()
    bag = written.rename(tmp_path / 'monday')
    words = ['import', 'bag', str(bag), '-o', str(tmp_path / 'new')]
    assert main(words) == 0
    made = read_data_set(tmp_path / 'new')[0]
    assert made.label == trials[2].label
    np.testing.assert_allclose(made.partner[0], trials[2].partner[0], atol=5e-3)
    np.testing.assert_allclose(made.partner[-1], trials[2].partner[-1], atol=5e-3)


def test_a_dry_run_shows_it_all_and_writes_nothing(tmp_path, trials, capsys):
    source = str(tsv(tmp_path / 'bay_give_1.tsv', trials[:1]))
    words = ['import', 'qualisys', source, '-o', str(tmp_path / 'set'), *MARKERS]
    assert main([*words, '--dry-run', '--json', str(tmp_path / 'x.json')]) == 0
    shown = capsys.readouterr().out
    assert 'bay_give_1.csv' in shown
    assert 'mm (assumed)' in shown
    assert 'nothing written' in shown
    assert not (tmp_path / 'set').exists()
    assert not (tmp_path / 'x.json').exists()
    assert main(words) == 0
    page = (tmp_path / 'set' / 'import.html').read_text()
    assert page.count('<svg') == 1
    assert 'bay give 1' in page


def test_what_is_unusual_is_told(tmp_path, trials, capsys):
    from dataclasses import replace

    trial = trials[0]
    far, way = trial.demonstrator[0] + [1.5, 0.0, 0.0], trial.demonstrator - trial.demonstrator[0]
    away = replace(trial, partner=trial.demonstrator, demonstrator=far + 0.2 * way)
    source = str(tsv(tmp_path / 'bay_give_1.tsv', [away]))
    words = ['import', 'qualisys', source, '-o', str(tmp_path / 'set'), '--up', 'z']
    assert main([*words, *MARKERS, '--unit', 'mm']) == 0
    shown = capsys.readouterr().out
    assert 'the wrists come no nearer than' in shown
    assert 'are they swapped?' in shown
