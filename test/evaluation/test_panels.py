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

"""Figures: one of each for a configuration, safely named, with everything in its place."""

from __future__ import annotations

from dataclasses import replace

from handover_dmp.evaluation.panels import write_panels
from handover_dmp.evaluation.protocol import evaluate, Protocol
from handover_dmp.mocap import synthesize
import numpy as np
from PIL import Image
import pytest


@pytest.fixture(scope='module')
def pictures(tmp_path_factory):
    trials = [
        replace(trial, configuration='odd/../na me')
        for trial in synthesize(seed=0, trials=3)
        if (trial.configuration, trial.direction) == ('under_car', 'take')
    ]
    folder = tmp_path_factory.mktemp('pictures')
    told = []
    evaluation = evaluate(trials, Protocol(learn=('single', 'mean')))
    figures = write_panels(evaluation, folder, lambda done, total: told.append((done, total)))
    return folder, figures, told, evaluation


def test_names_stay_within_the_folder(pictures):
    folder, figures, told, _ = pictures
    assert [name for name, _ in figures] == [
        'fig03_traces_odd-na-me',
        'fig04-06_rollouts_odd-na-me',
        'fig07-09_learn_single_odd-na-me',
        'fig10-12_learn_mean_odd-na-me',
        'why_odd-na-me',
        'measures',
    ]
    assert {path.name for path in folder.iterdir()} == {'figures'}
    assert len(list((folder / 'figures').iterdir())) == 12
    assert told == [(done, 6) for done in range(1, 7)]


@pytest.mark.parametrize(
    ('name', 'colours'),
    [
        ('fig03_traces_odd-na-me', ['#c8372d', '#2f8f4e', '#f3d9a4']),
        ('fig04-06_rollouts_odd-na-me', ['#c8372d', '#1f5fb4']),
        ('fig07-09_learn_single_odd-na-me', ['#111827', '#aab6c4', '#e1e6ec']),
    ],
)
def test_what_is_drawn_has_its_colour(pictures, name, colours):
    with Image.open(pictures[0] / 'figures' / f'{name}.png') as image:
        pixels = np.asarray(image.convert('RGB')).reshape(-1, 3).astype(int)
    for colour in colours:
        wanted = [int(colour[at: at + 2], 16) for at in (1, 3, 5)]  # fmt: skip
        near = (np.abs(pixels - wanted).max(axis=1) <= 3).sum()
        assert near > 300, colour


def test_the_same_data_give_the_same_file(pictures, tmp_path):
    folder, _, _, evaluation = pictures
    write_panels(evaluation, tmp_path)
    for path in (folder / 'figures').iterdir():
        assert path.read_bytes() == (tmp_path / 'figures' / path.name).read_bytes()
