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

"""`--low-pass` of the verbs that smooth recordings: a trembling at 30 Hz stays, or it goes."""

from __future__ import annotations

import json
from pathlib import Path

from handover_dmp.cli.main import main
from handover_dmp.mocap import HandoverTrial, read_data_set, write_data_set
import numpy as np
import pytest

TREMBLING_M = 0.005
TIMES = np.linspace(0.0, 1.2, 241)


def reach(extra_m: float = 0.0) -> np.ndarray:
    u = TIMES[:, None] / TIMES[-1]
    way = np.array([0.5 + extra_m, 0.2, 0.1])
    return (10 * u**3 - 15 * u**4 + 6 * u**5) * way + [0.0, 0.1, 0.9]


def trembling() -> np.ndarray:
    return TREMBLING_M * np.sin(2.0 * np.pi * 30.0 * TIMES)[:, None] * [0.0, 1.0, 0.0]


@pytest.fixture(scope='module')
def data_set(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp('data') / 'set'
    write_data_set(
        [
            HandoverTrial(
                TIMES, reach()[::-1] + [0.6, 0.0, 0.0], reach(0.02 * k) + trembling(), 'a',
                number=k + 1,
            )
            for k in range(4)
        ],
        folder,
    )  # fmt: skip
    return folder


def test_evaluate(data_set: Path, tmp_path: Path) -> None:
    """What minimum jerk is apart from the persons is their trembling, where it is left in."""
    rms_m = {}
    for cutoff in ('none', '6'):
        out = tmp_path / cutoff
        words = ['evaluate', str(data_set), '-o', str(out), '--low-pass', cutoff]
        assert main([*words, '--no-figures']) == 0
        rows = json.loads((out / 'table.json').read_text())['rows']
        (rms_m[cutoff],) = {row['rms_m'] for row in rows if row['method'] == 'minimum_jerk'}
    assert 0.8 * TREMBLING_M / np.sqrt(2.0) < rms_m['none'] < 1.2 * TREMBLING_M / np.sqrt(2.0)
    assert rms_m['6'] < 0.5 * rms_m['none']


def test_tune(data_set: Path, tmp_path: Path) -> None:
    """The mean of the persons, learnt with their trembling, ends up elsewhere."""
    rms_m = {}
    for cutoff in ('none', '6'):
        out, found = (tmp_path / f'{cutoff}.{ending}' for ending in ('yaml', 'json'))
        words = ['tune', str(data_set), '-o', str(out), '--low-pass', cutoff]
        assert main([*words, '--candidates', '1', '--json', str(found)]) == 0
        compared = json.loads(found.read_text())['comparisons']
        (rms_m[cutoff],) = (c['default']['rms_m'] for c in compared if c['learn'] == 'mean')
    assert rms_m['none'] > 1.2 * rms_m['6']


@pytest.mark.parametrize(('words', 'left'), [([], 1.0), (['--low-pass', 'none'], 1.0),
                                             (['--low-pass', '6'], 0.02)])  # fmt: skip
def test_import(tmp_path: Path, words: list[str], left: float) -> None:
    """By default, what is written is what was recorded."""
    rows = 1e3 * np.hstack([reach()[::-1] + [0.6, 0.0, 0.0], reach() + trembling()])
    source = tmp_path / 'bay_give_1.tsv'
    head = ['FREQUENCY\t200', 'DATA_INCLUDED\t3D', 'MARKER_NAMES\ta\tb']
    lines = ['\t'.join(f'{value:.5f}' for value in row) for row in rows]
    source.write_text('\n'.join([*head, *lines]) + '\n')
    out = tmp_path / 'set'
    command = ['import', 'qualisys', str(source), '--p1', 'a', '--p2', 'b', '-o', str(out)]
    assert main([*command, '--up', 'z', *words]) == 0
    (trial,) = read_data_set(out)
    inner = slice(40, -40)
    shaken = (trial.demonstrator - reach())[inner, 1]
    spectrum = 2.0 * np.abs(np.exp(-60j * np.pi * trial.times[inner]) @ shaken) / len(shaken)
    assert spectrum == pytest.approx(left * TREMBLING_M, abs=0.02 * TREMBLING_M)
    assert np.abs(trial.demonstrator - reach())[inner, [[0], [2]]].max() < 2e-3
