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

"""The sensor model: each of its faults has the size that was asked for."""

from __future__ import annotations

from handover_dmp.common.errors import UsageError
from handover_dmp.mocap import condition, synthesize
from handover_dmp.mocap.filtering import interpolate
from handover_dmp.tracking import SensorModel
import numpy as np
import pytest


@pytest.fixture(scope='module')
def trial():
    return condition(synthesize(trials=1)[1])


def long_motion():
    times = np.arange(0.0, 40.0, 0.01)
    return times, np.column_stack([np.sin(times), np.cos(times), times / 40.0])


def test_a_perfect_tracker(trial):
    truth = interpolate(trial.times, trial.partner)
    seen = SensorModel(rate_hz=60.0).observe_motion(trial.times, trial.partner)
    assert len(seen) == int(trial.duration_s * 60.0 + 1e-6) + 1
    for arrival, stamp, position in seen:
        assert arrival == stamp
        np.testing.assert_allclose(position, truth(stamp), atol=1e-12)


def test_noise_delay_and_share_of_faults():
    times, path = long_motion()
    truth = interpolate(times, path)
    model = SensorModel(100.0, 2e-3, 0.05, dropout=0.2, outliers=0.1, seed=3, duplicates=0.3)
    seen = model.observe_motion(times, path)
    stamps = np.array([observation.stamp_s for observation in seen])
    errors = np.array([observation.position - truth(observation.stamp_s) for observation in seen])
    distances = np.linalg.norm(errors, axis=1)
    delays = [observation.arrival_s - observation.stamp_s for observation in seen]
    np.testing.assert_allclose(delays, 0.05, atol=1e-9)
    far = distances > 0.5
    assert far.mean() == pytest.approx(0.1, abs=0.02)
    np.testing.assert_allclose(distances[far], 1.0, atol=0.01)
    assert np.std(errors[~far]) == pytest.approx(2e-3, rel=0.05)
    kept, copies = np.unique(stamps, return_counts=True)
    assert len(kept) / 4000 == pytest.approx(0.8, abs=0.02)
    assert (copies == 2).mean() == pytest.approx(0.3, abs=0.03)


def test_jitter_brings_poses_out_of_order():
    seen = SensorModel(200.0, jitter_s=0.03, seed=1).observe_motion(*long_motion())
    arrivals = np.array([observation.arrival_s for observation in seen])
    stamps = np.array([observation.stamp_s for observation in seen])
    assert (np.diff(arrivals) >= 0.0).all()
    assert (np.diff(stamps) < 0.0).mean() > 0.2
    assert (arrivals - stamps).min() >= 0.0
    assert (arrivals - stamps).max() <= 0.03 + 1e-9


AT_S = 20.0


def seen_with(**fault):
    """Watch the long motion with a fault and without it; return stamps and both paths."""
    times, path = long_motion()
    whole, seen = (
        SensorModel(50.0, 1e-3, seed=2, **changes).observe_motion(times, path)
        for changes in ({}, fault)
    )
    positions = [np.array([pose.position for pose in poses]) for poses in (whole, seen)]
    return np.array([pose.stamp_s for pose in seen]), *positions


def test_a_tracker_dies_freezes_jumps_and_drifts():
    stamps, whole, seen = seen_with(fault='dies', fault_at_s=AT_S)
    assert stamps.max() < AT_S
    np.testing.assert_array_equal(seen, whole[: len(seen)])
    stamps, whole, seen = seen_with(fault='freezes', fault_at_s=AT_S)
    after = stamps >= AT_S
    np.testing.assert_array_equal(seen[~after], whole[~after])
    assert (seen[after] == seen[after][0]).all(), 'to the last bit, its noise and all'
    stamps, whole, seen = seen_with(fault='jumps', fault_at_s=AT_S, fault_m=(0.0, 0.5, 0.0))
    off = np.outer(stamps >= AT_S, [0.0, 0.5, 0.0])
    np.testing.assert_allclose(seen - whole, off, atol=1e-12)
    stamps, whole, seen = seen_with(fault='drifts', fault_at_s=AT_S, fault_m=(0.05, 0.0, 0.0))
    share = np.clip(stamps - AT_S, 0.0, 1.0)
    np.testing.assert_allclose(seen - whole, np.outer(share, [0.05, 0.0, 0.0]), atol=1e-12)


def test_an_offset_and_a_wrong_clock():
    stamps, whole, seen = seen_with(offset_m=(0.01, -0.02, 0.03), clock_s=-0.3)
    offset = np.tile([0.01, -0.02, 0.03], (len(seen), 1))
    np.testing.assert_allclose(seen - whole, offset, atol=1e-12)
    np.testing.assert_allclose(stamps, np.arange(len(stamps)) / 50.0 - 0.3, atol=1e-9)


def test_a_seed_sees_the_same(trial):
    def positions(seed):
        seen = SensorModel(noise_m=1e-3, seed=seed).observe_motion(trial.times, trial.partner)
        return np.array([observation.position for observation in seen])

    np.testing.assert_array_equal(positions(4), positions(4))
    assert (positions(4) != positions(5)).all()


def test_everything_lost(trial):
    assert SensorModel(dropout=1.0).observe_motion(trial.times, trial.partner) == []


@pytest.mark.parametrize(
    'wrong',
    [
        {'rate_hz': 0.0},
        {'rate_hz': float('nan')},
        {'noise_m': -1.0},
        {'delay_s': float('inf')},
        {'dropout': 1.5},
        {'outliers': -0.1},
        {'seed': -1},
        {'fault': 'sleeps'},
        {'offset_m': (0.0, 1.0)},
        {'clock_s': float('nan')},
    ],
)
def test_parameters_out_of_range(wrong):
    with pytest.raises(UsageError, match=f'sensor {next(iter(wrong))[:4]}'):
        SensorModel(**wrong)
