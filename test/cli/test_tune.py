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

"""`handover_dmp tune` from the outside, and the verbs that read what it writes."""

from __future__ import annotations

from dataclasses import replace
import json
from pathlib import Path

from handover_dmp.cli.main import main
from handover_dmp.mocap import read_data_set, synthesize, write_data_set
import numpy as np
import pytest
import yaml


@pytest.fixture(scope='module')
def data_set(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp('data') / 'garage'
    trials = [t for t in synthesize(seed=0, trials=4) if t.configuration == 'under_car']
    write_data_set([t for t in trials if t.direction == 'give'], folder)
    return folder


@pytest.fixture(scope='module')
def tuned(data_set, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp('tuned')
    words = ['tune', str(data_set), '-o', str(folder / 'tuned.yaml'), '--candidates', '16']
    assert main([*words, '--json', str(folder / 'tuned.json')]) == 0
    return folder


def test_the_file_names_what_it_was_tuned_on_and_what_that_gave(tuned):
    text = (tuned / 'tuned.yaml').read_text()
    assert 'Tuned on 4 trials of garage' in text
    assert 'learn single: distance to P2' in text
    assert 'All trials start at rest' in text
    found = json.loads((tuned / 'tuned.json').read_text())
    section = yaml.safe_load(text)['/**/dmp']['ros__parameters']
    assert section['mu'] == found['best']['parameters']['mu']
    assert section['duration_scale'] == found['best']['duration_scale']
    assert {compared['learn'] for compared in found['comparisons']} == {'single', 'mean'}


def test_learn_reads_it(tuned, data_set):
    model, section = (
        tuned / 'model.json',
        yaml.safe_load((tuned / 'tuned.yaml').read_text())['/**/dmp']['ros__parameters'],
    )
    trial = str(data_set / 'under_car_give_1.csv')
    words = ['learn', trial, '-o', str(model), '--parameters', str(tuned / 'tuned.yaml')]
    assert main([*words, '--sigma', '0.11']) == 0
    from handover_dmp.dmp import load_model

    learnt = load_model(model)
    assert learnt.parameters.mu == section['mu']
    assert learnt.parameters.sigma == 0.11
    plain = tuned / 'plain.json'
    assert main(['learn', trial, '-o', str(plain)]) == 0
    scale = learnt.duration_s / load_model(plain).duration_s
    assert scale == pytest.approx(section['duration_scale'])


def test_evaluate_reads_it(tuned, data_set):
    words = ['evaluate', str(data_set), '-o', str(tuned / 'out'), '--no-figures']
    assert main([*words, '--parameters', str(tuned / 'tuned.yaml')]) == 0
    protocol = json.loads((tuned / 'out' / 'table.json').read_text())['protocol']
    section = yaml.safe_load((tuned / 'tuned.yaml').read_text())['/**/dmp']['ros__parameters']
    assert protocol['parameters']['mu'] == section['mu']
    assert protocol['duration_scale'] == section['duration_scale']


def test_faults_are_named_in_one_line(data_set, tmp_path, capsys):
    output = str(tmp_path / 'tuned.yaml')
    for words, code, word in (
        ([str(tmp_path / 'nowhere'), '-o', output], 1, 'nowhere'),
        ([str(data_set), '-o', output, '--candidates', '0'], 2, '--candidates'),
        ([str(data_set), '-o', output, '--stiffness', '-5'], 1, 'stiffness'),
    ):
        assert main(['tune', *words]) == code
        lines = capsys.readouterr().err.strip().splitlines()
        assert len(lines) == 1 and word in lines[0]
    assert not Path(output).exists()


def test_trials_that_are_cut_in_motion_are_counted(data_set, tmp_path, capsys):
    trials = read_data_set(data_set)
    cut = [
        replace(
            trial,
            times=trial.times[when:],
            partner=trial.partner[when:],
            demonstrator=trial.demonstrator[when:],
        )
        for trial in trials
        # where the first of the two is fastest
        for when in [int(np.linalg.norm(np.gradient(trial.partner, axis=0), axis=1).argmax())]
    ]
    write_data_set([*cut[:3], trials[3]], tmp_path / 'cut')
    out = str(tmp_path / 'p.yaml')
    assert main(['tune', str(tmp_path / 'cut'), '-o', out, '--candidates', '1']) == 0
    assert '3 of 4 trials start in motion' in capsys.readouterr().out
