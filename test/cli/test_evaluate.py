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

"""`handover_dmp evaluate` from the outside: files, options, faults."""

from __future__ import annotations

import csv
from html.parser import HTMLParser
import json
from pathlib import Path
import shutil
from xml.etree import ElementTree

from handover_dmp.cli.main import main
from handover_dmp.mocap import synthesize, write_data_set
from PIL import Image
import pytest


@pytest.fixture(scope='module')
def data_set(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp('data') / 'garage'
    trials = [t for t in synthesize(seed=0, trials=4) if t.configuration == 'engine_bay']
    write_data_set(trials, folder)
    return folder


@pytest.fixture(scope='module')
def results(data_set, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp('results')
    words = ['evaluate', str(data_set), '-o', str(folder), '--json', str(folder / 'own.json')]
    assert main(words) == 0
    return folder


def test_json_has_the_agreed_keys(results):
    table = json.loads((results / 'own.json').read_text())
    assert table == json.loads((results / 'table.json').read_text())
    keys = {'configuration', 'exchange', 'learn', 'method', 'curves', 'within', 'rms_m'}
    for row in table['rows']:
        assert keys | {'final_gap_m'} <= set(row)
        assert set(row['within']) == {'1', '2', '3'}
        assert 0 <= row['within']['1'] <= row['within']['2'] <= row['within']['3'] <= 100
        assert row['trials'] == 4
    for row in table['summary']:
        assert keys - {'configuration', 'exchange'} <= set(row)
    combinations = {(r['exchange'], r['learn'], r['method']) for r in table['rows']}
    assert len(combinations) == len(table['rows']) == 2 * 3 * 4
    assert len(table['summary']) == 12


def test_csv_says_the_same(results):
    table = json.loads((results / 'table.json').read_text())
    with (results / 'table.csv').open() as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == len(table['rows']) + len(table['summary'])
    for line, row in zip(lines, [*table['rows'], *table['summary']], strict=True):
        assert line['configuration'] == row.get('configuration', 'all')
        assert float(line['within_3_percent']) == pytest.approx(row['within']['3'], abs=0.01)
        assert float(line['rms_m']) == pytest.approx(row['rms_m'], abs=1e-5)


def test_text_fits_a_terminal_and_names_the_paper(results):
    text = (results / 'table.txt').read_text()
    assert max(map(len, text.splitlines())) <= 98
    for word in ('engine_bay', '79.1', '90.0', 'minimum jerk', 'P2 itself', 'classical'):
        assert word in text
    assert '…' not in text


def test_every_figure_is_there_twice_and_on_the_page(results):
    expected = {
        'fig03_traces_engine_bay',
        'fig04-06_rollouts_engine_bay',
        'fig07-09_learn_single_engine_bay',
        'fig10-12_learn_mean_engine_bay',
        'fig13_learn_representative_engine_bay',
        'why_engine_bay',
        'measures',
    }
    assert {path.stem for path in (results / 'figures').iterdir()} == expected
    for name in expected:
        with Image.open(results / 'figures' / f'{name}.png') as image:
            assert image.width >= 1200
            assert len(image.convert('RGB').getcolors(1 << 24)) > 50
        assert ElementTree.parse(results / 'figures' / f'{name}.svg').getroot().tag.endswith('svg')
    links = Links()
    links.feed((results / 'index.html').read_text())
    assert {f'figures/{name}.svg' for name in expected} <= links.found
    for link in links.found:
        assert link.startswith('#') or (results / link).is_file(), link


class Links(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: set[str] = set()

    def handle_starttag(self, tag, attrs):
        self.found |= {value for name, value in attrs if name in {'href', 'src'}}


def test_parameters_come_from_file_and_from_options(data_set, tmp_path):
    file = tmp_path / 'dmp.yaml'
    file.write_text(
        'dmp:\n  ros__parameters:\n    mu: 0.6\n    stiffness: 150\n    rate_hz: 9.0\n'
    )
    words = ['evaluate', str(data_set), '-o', str(tmp_path / 'out'), '--no-figures']
    words += ['--parameters', str(file), '--stiffness', '300', '--learn', 'mean']
    assert main([*words, '--leave-one-out', '--seed', '4', '--regression', 'ridge']) == 0
    protocol = json.loads((tmp_path / 'out' / 'table.json').read_text())['protocol']
    assert protocol['parameters']['mu'] == 0.6
    assert protocol['parameters']['stiffness'] == 300
    assert protocol['parameters']['sigma'] == 0.05
    assert (protocol['leave_one_out'], protocol['seed'], protocol['learn']) == (True, 4, ['mean'])
    assert not (tmp_path / 'out' / 'figures').exists()


def fault(capsys, *words: str) -> tuple[int, str]:
    code = main(['evaluate', *words])
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1, lines
    return code, lines[0]


def test_faults_are_named_in_one_line(data_set, tmp_path, capsys):
    out = ['-o', str(tmp_path / 'out'), '--no-figures']
    code, line = fault(capsys, str(tmp_path / 'nowhere'), *out)
    assert code == 1 and 'nowhere' in line
    (tmp_path / 'empty').mkdir()
    code, line = fault(capsys, str(tmp_path / 'empty'), *out)
    assert code == 1 and 'trials.csv' in line
    code, line = fault(capsys, str(data_set), *out, '--learn', 'everything')
    assert code == 2 and 'everything' in line
    code, line = fault(capsys, str(data_set), *out, '--sigma', '-1')
    assert code == 1 and 'sigma' in line
    code, line = fault(capsys, str(data_set), *out, '--parameters', str(tmp_path / 'no.yaml'))
    assert code == 1 and 'no.yaml' in line
    code, line = fault(capsys, str(data_set), *out, '--jobs', '0')
    assert code == 2 and '--jobs' in line
    code, line = fault(capsys, str(data_set), *out, '--seed', '-1')
    assert code == 2 and '--seed' in line
    (tmp_path / 'file').write_text('not a folder')
    code, line = fault(capsys, str(data_set), '-o', str(tmp_path / 'file'), '--no-figures')
    assert code == 1 and 'file' in line
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (lambda rows: [[*row[:4], 'nan', *row[5:]] for row in rows], ['engine_bay_give_2.csv']),
        (
            lambda rows: [[row[0], *(str(float(x) + 7.0) for x in row[1:])] for row in rows],
            ['engine_bay_give_2.csv', 'm '],
        ),
        (
            lambda rows: (
                rows[:90] + [[r[0], *(str(float(x) + 3) for x in r[1:])] for r in rows[90:]]
            ),
            ['engine_bay_give_2.csv', 'jump'],
        ),
    ],
    ids=['not a number', 'another frame', 'frame changes on the way'],
)
def test_a_faulty_trial_is_named(data_set, tmp_path, capsys, change, words):
    folder = tmp_path / 'faulty'
    shutil.copytree(data_set, folder)
    path = folder / 'engine_bay_give_2.csv'
    header, *lines = path.read_text().splitlines()
    rows = change([line.split(',') for line in lines])
    path.write_text('\n'.join([header, *(','.join(row) for row in rows)]) + '\n')
    code, line = fault(capsys, str(folder), '-o', str(tmp_path / 'out'), '--no-figures')
    assert code == 1
    for word in words:
        assert word in line


def test_one_trial_alone_is_named(data_set, tmp_path, capsys):
    folder = tmp_path / 'lonely'
    shutil.copytree(data_set, folder)
    index = (folder / 'trials.csv').read_text().splitlines()
    kept = [line for line in index if '_give_' not in line or '_give_1' in line]
    (folder / 'trials.csv').write_text('\n'.join(kept) + '\n')
    code, line = fault(capsys, str(folder), '-o', str(tmp_path / 'out'), '--no-figures')
    assert code == 1 and 'engine_bay give has 1 trial' in line


def test_as_the_paper_prints_it_unless_told_otherwise(data_set, tmp_path):
    words = [
        'evaluate',
        str(data_set),
        '--no-figures',
        '--paper',
        '--sigma',
        '0.1',
        '--basis',
        '20',
    ]
    assert main([*words, '-o', str(tmp_path)]) == 0
    protocol = json.loads((tmp_path / 'table.json').read_text())['protocol']
    assert protocol['learn'] == ['single', 'mean']
    assert protocol['regression'] == 'rvm'
    parameters = protocol['parameters']
    assert parameters['formulation'] == 'printed'
    assert (parameters['mu'], parameters['sigma']) == (0.75, 0.1)


def test_the_rollouts_that_are_drawn_can_be_chosen(data_set, tmp_path):
    words = ['evaluate', str(data_set), '--learn', 'mean', '--learnt', '1', '--tested', '3']
    assert main([*words, '-o', str(tmp_path)]) == 0
    drawn = (tmp_path / 'figures' / 'fig04-06_rollouts_engine_bay.svg').read_text()
    for tested in (1, 3):
        assert drawn.count(f'learnt from 1, tested against {tested}') == 2


def test_a_trial_that_is_not_there_is_said_before_anything_is_written(data_set, tmp_path, capsys):
    out = tmp_path / 'out'
    code, line = fault(capsys, str(data_set), '-o', str(out), '--tested', '9')
    assert code == 1
    assert 'engine_bay give has no trial 9; it has 1, 2, 3, 4' in line
    assert not out.exists()
