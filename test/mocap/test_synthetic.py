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

"""The synthetic data set: the same everywhere, plausible, and spread like people."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
import subprocess
import sys

from handover_dmp.common.errors import UsageError
from handover_dmp.mocap import condition, synthesize, velocities, write_data_set
import numpy as np
import pytest

# Of all files of the default data set, in the order of their names.
DIGEST = '49aa6ff4fdba21e1aedf62ab59969909f62db38c2ce4e82e49a37eb04f9f1a86'


def digest(folder: Path) -> str:
    files = sorted(folder.iterdir())
    return hashlib.sha256(b''.join(file.read_bytes() for file in files)).hexdigest()


@pytest.fixture(scope='module')
def trials():
    return synthesize()


@pytest.fixture(scope='module')
def conditioned(trials):
    return [condition(trial) for trial in trials]


def length(vectors):
    return np.linalg.norm(vectors, axis=-1)


def test_the_same_bytes_as_on_the_machine_it_was_made_on(tmp_path, trials):
    write_data_set(trials, tmp_path)
    assert digest(tmp_path) == DIGEST


def test_the_same_bytes_whatever_the_threads_and_vector_units(tmp_path):
    script = (
        'from handover_dmp.mocap import synthesize, write_data_set; import sys;'
        'write_data_set(synthesize(), sys.argv[1])'
    )
    environment = {
        **os.environ,
        'PYTHONPATH': str(Path(__file__).parents[2]),
        'OMP_NUM_THREADS': '1',
        'OPENBLAS_NUM_THREADS': '1',
        'PYTHONHASHSEED': '7',
        'NPY_DISABLE_CPU_FEATURES': 'AVX2 FMA3 AVX512F AVX512_SKX',
    }
    for folder, features in (
        (tmp_path / 'less', environment['NPY_DISABLE_CPU_FEATURES']),
        (tmp_path / 'all', ''),
    ):
        environment['NPY_DISABLE_CPU_FEATURES'] = features
        command = [sys.executable, '-W', 'ignore', '-c', script, str(folder)]
        subprocess.run(command, env=environment, check=True, capture_output=True)
        assert digest(folder) == DIGEST


def test_seeds_and_numbers(trials):
    other = synthesize(seed=1)
    assert all(
        (a.demonstrator[0] != b.demonstrator[0]).any() for a, b in zip(trials, other, strict=True)
    )
    more = {trial.label: trial for trial in synthesize(trials=8)}
    for trial in trials:
        np.testing.assert_array_equal(more[trial.label].partner, trial.partner)
    labels = [trial.label for trial in trials]
    assert len(set(labels)) == 30
    assert labels[0] == 'engine_bay give 1'
    assert labels[-1] == 'hydraulic_lift take 5'
    assert all('synthetic' in trial.source for trial in trials)


def test_geometry(trials):
    for trial in trials:
        assert 0.4 <= length(trial.demonstrator[-1] - trial.demonstrator[0]) <= 0.7, trial.label
        assert 0.2 <= length(trial.demonstrator[-1] - trial.partner[-1]) <= 0.35, trial.label
        assert length(trial.demonstrator[0] - trial.partner[0]) > 0.65, trial.label
        assert trial.partner[:, 2].min() > 0.15, trial.label
        assert trial.demonstrator[:, 2].min() > 0.15, trial.label
    height = {
        configuration: np.mean(
            [trial.partner[-1, 2] for trial in trials if trial.configuration == configuration]
        )
        for configuration in ('under_car', 'engine_bay', 'hydraulic_lift')
    }
    assert height['under_car'] < 0.45 < 0.85 < height['engine_bay'] < 1.1 < 1.25
    assert 1.25 < height['hydraulic_lift'] < 1.5


def test_timing_and_speed_are_those_of_people(conditioned):
    for trial in conditioned:
        assert 0.9 < trial.duration_s < 2.6, trial.label
        for path in (trial.partner, trial.demonstrator):
            speed = length(velocities(trial.times, path))
            assert speed.max() < 1.5, trial.label
            assert speed[0] < 0.12, trial.label
            assert speed[-1] < 0.12, trial.label
        peak = length(velocities(trial.times, trial.demonstrator)).max()
        mean = length(trial.demonstrator[-1] - trial.demonstrator[0]) / trial.duration_s
        # 1.88 for one minimum-jerk reach; more where P2 waits before.
        assert 1.6 < peak / mean < 3.2, trial.label


def test_p1_waits_in_some_gives_and_moves_in_every_take(trials):
    way = {trial.label: length(trial.partner[-1] - trial.partner[0]) for trial in trials}
    gives = [way[trial.label] for trial in trials if trial.direction == 'give']
    takes = [way[trial.label] for trial in trials if trial.direction == 'take']
    assert min(takes) > 0.3
    waiting = sum(distance < 0.03 for distance in gives)
    reaching = sum(distance > 0.3 for distance in gives)
    assert waiting == 6
    assert reaching == 9


def test_spread_from_trial_to_trial():
    for configuration in ('engine_bay', 'under_car', 'hydraulic_lift'):
        many = synthesize(trials=60, configurations=[configuration])
        for direction in ('give', 'take'):
            case = [trial for trial in many if trial.direction == direction]
            starts = np.std([trial.demonstrator[0] for trial in case], axis=0)
            ends = np.std([trial.demonstrator[-1] for trial in case], axis=0)
            assert (starts > 0.008).all() and (starts < 0.03).all()
            assert (ends > 0.01).all() and (ends < 0.04).all()
            durations = [trial.duration_s for trial in case]
            assert 0.05 < np.std(durations) / np.mean(durations) < 0.2


def test_sensor_noise():
    exact = synthesize(noise_m=0.0, trials=2)
    noisy = synthesize(noise_m=1e-4, trials=2)
    differences = np.concatenate(
        [
            np.concatenate([a.partner - b.partner, a.demonstrator - b.demonstrator]).ravel()
            for a, b in zip(noisy, exact, strict=True)
        ]
    )
    assert np.std(differences) == pytest.approx(1e-4, rel=0.02)
    # A sample, not a filtered one: neighbours know nothing of each other.
    assert abs(np.corrcoef(differences[:-6], differences[6:])[0, 1]) < 0.02


def test_rates():
    assert synthesize(rate_hz=24.0, trials=1)[0].rate_hz == pytest.approx(24.0, rel=1e-3)
    assert synthesize(trials=1)[0].rate_hz == pytest.approx(200.0)


@pytest.mark.parametrize(
    'wrong',
    [
        {'seed': -1},
        {'seed': 2**32},
        {'trials': 0},
        {'configurations': ['kitchen']},
        {'rate_hz': 0.0},
        {'rate_hz': float('nan')},
        {'noise_m': -1.0},
        {'noise_m': float('inf')},
    ],
)
def test_wrong_usage(wrong):
    with pytest.raises(UsageError):
        synthesize(**wrong)
