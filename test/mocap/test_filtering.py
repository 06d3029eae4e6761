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

"""Resampling and low-pass: frequency response, ends, uneven stamps, against independent ways."""

from __future__ import annotations

from dataclasses import replace

from handover_dmp.common.errors import DataError
from handover_dmp.mocap import condition, HandoverTrial, read_data_set, smooth, velocities
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt, sosfreqz


def gain(frequency_hz, rate_hz, cutoff_hz=6.0, target_hz=200.0):
    times = np.arange(0.0, 10.0, 1.0 / rate_hz)
    wave = np.column_stack(
        [np.sin(2 * np.pi * frequency_hz * times), np.cos(2 * np.pi * frequency_hz * times)]
    )
    new, values, _ = smooth(times, wave, target_hz, cutoff_hz)
    inside = (new > 2.0) & (new < 8.0)
    expected = np.exp(2j * np.pi * frequency_hz * new[inside])
    got = values[inside, 1] + 1j * values[inside, 0]
    return np.mean(got / expected)


@pytest.mark.parametrize('rate_hz', [24.0, 60.0, 120.0, 200.0, 1000.0])
@pytest.mark.parametrize('frequency_hz', [0.5, 2.0, 4.0, 6.0, 8.0])
def test_it_is_a_third_order_butterworth_forwards_and_backwards(rate_hz, frequency_hz):
    response = gain(frequency_hz, rate_hz)
    assert response.imag == pytest.approx(0.0, abs=2e-3), 'phase'
    half_power_hz = 6.0 / (np.sqrt(2.0) - 1.0) ** (1 / 6)
    sos = butter(3, half_power_hz, fs=20000.0, output='sos')
    _, once = sosfreqz(sos, worN=[frequency_hz], fs=20000.0)
    assert response.real == pytest.approx(abs(once[0]) ** 2, abs=5e-3)


def test_the_cut_off_is_where_the_power_is_halved():
    for cutoff_hz in (3.0, 6.0, 12.0):
        response = gain(cutoff_hz, 200.0, cutoff_hz)
        assert abs(response) == pytest.approx(np.sqrt(0.5), abs=0.01)


def test_inside_it_equals_filtfilt():
    random = np.random.default_rng(3)
    times = np.arange(2000) / 200.0
    walk = np.cumsum(1e-3 * random.standard_normal((2000, 2)), axis=0)
    half_power_hz = 6.0 / (np.sqrt(2.0) - 1.0) ** (1 / 6)
    expected = sosfiltfilt(butter(3, half_power_hz, fs=200.0, output='sos'), walk, axis=0)
    _, values, _ = smooth(times, walk)
    np.testing.assert_allclose(values[300:-300], expected[300:-300], atol=5e-5)


@pytest.mark.parametrize('rate_hz', [24.0, 120.0, 333.0])
def test_constant_acceleration_passes_unchanged_to_the_last_sample(rate_hz):
    times = np.arange(0.0, 1.0, 1.0 / rate_hz)
    path = np.column_stack([0.3 + 0.5 * times, 2.0 * times**2 - times, 0.0 * times])
    new, values, speeds = smooth(times, path)
    expected = np.column_stack([0.3 + 0.5 * new, 2.0 * new**2 - new, 0.0 * new])
    np.testing.assert_allclose(values, expected, atol=1e-9)
    slope = np.column_stack([0.5 + 0.0 * new, 4.0 * new - 1.0, 0.0 * new])
    np.testing.assert_allclose(speeds, slope, atol=1e-7)


def cut_reach(times):
    """Half a metre in 1.2 s, cut where the hand moves already, and again before it rests."""
    u = np.clip((times + 0.25) / 1.2, 0.0, 1.0)
    return 0.5 * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def test_the_ends_are_better_than_those_of_filtfilt():
    random = np.random.default_rng(0)
    times = np.arange(0.0, 0.9, 1.0 / 120.0)
    truth = cut_reach(times)
    sos = butter(2, 6.0 / 0.802, fs=120.0, output='sos')
    ours, theirs = [], []
    for _ in range(300):
        seen = truth + 1e-3 * random.standard_normal(len(times))
        ours.append(smooth(times, seen[:, None], 120.0)[1][:, 0] - truth)
        theirs.append(sosfiltfilt(sos, seen) - truth)
    ours_rms, theirs_rms = (np.sqrt(np.mean(np.square(e), axis=0)) for e in (ours, theirs))
    middle = slice(30, -30)
    assert ours_rms[middle].mean() == pytest.approx(theirs_rms[middle].mean(), rel=0.1)
    assert ours_rms[-1] < 0.75 * theirs_rms[-1] < 0.8e-3
    assert ours_rms[0] < 0.75 * theirs_rms[0]
    assert abs(np.mean(ours, axis=0)[[0, -1]]).max() < 0.25e-3, 'bias'


@pytest.mark.parametrize('rate_hz', [24.0, 120.0, 200.0])
def test_a_reach_comes_through(rate_hz):
    times = np.arange(0.0, 0.9, 1.0 / rate_hz)
    new, values, speeds = smooth(times, cut_reach(times)[:, None])
    assert np.abs(values[:, 0] - cut_reach(new)).max() < 1.0e-3
    fine = 1e-6
    slope = (cut_reach(new + fine) - cut_reach(new - fine)) / (2 * fine)
    assert np.abs(speeds[:, 0] - slope).max() < 0.05
    assert np.sqrt(np.mean((speeds[:, 0] - slope) ** 2)) < 0.01


@given(st.integers(0, 2**32 - 1), st.sampled_from([24.0, 60.0, 120.0, 200.0, 500.0]))
@settings(max_examples=40, deadline=None)
def test_uneven_stamps(seed, rate_hz):
    random = np.random.default_rng(seed)
    even = np.arange(0.0, 1.3, 1.0 / rate_hz)
    times = even + 0.8 / rate_hz * random.uniform(size=len(even))
    keep = random.uniform(size=len(even)) > 0.1
    keep[:3] = keep[-3:] = True
    times = times[keep]
    new, values, _ = smooth(times, cut_reach(times)[:, None])
    assert np.abs(values[:, 0] - cut_reach(new)).max() < 5e-3
    np.testing.assert_allclose(np.diff(new), 0.005, atol=1e-9)
    assert times[-1] - 0.005 - 1e-9 < new[-1] <= times[-1] + 1e-8


def test_velocities_of_a_smooth_path():
    times = np.cumsum(np.random.default_rng(0).uniform(0.003, 0.007, 300))
    path = np.column_stack([np.sin(3 * times), np.cos(2 * times), times**2])
    expected = np.column_stack([3 * np.cos(3 * times), -2 * np.sin(2 * times), 2 * times])
    np.testing.assert_allclose(velocities(times, path), expected, atol=1e-5)


def trial(times):
    path = np.column_stack([cut_reach(times)] * 3)
    return HandoverTrial(times, path, path + 1.0, 'bay', 'take', 4, 'here')


def test_condition_keeps_what_the_trial_is():
    conditioned = condition(trial(5.0 + np.arange(60) / 60.0))
    assert conditioned.label == 'bay take 4'
    assert conditioned.source == 'here'
    assert conditioned.times[0] == 5.0
    assert conditioned.rate_hz == pytest.approx(200.0)
    assert len(conditioned.times) == 197
    np.testing.assert_allclose(conditioned.demonstrator - conditioned.partner, 1.0, atol=1e-9)


def test_stamps_that_were_rounded_lose_no_sample():
    times = np.round(np.arange(121) / 120.0, 5)
    assert len(condition(trial(times)).times) == 201


def test_conditioning_twice_changes_little():
    once = condition(trial(np.arange(120) / 120.0))
    np.testing.assert_allclose(condition(once).partner, once.partner, atol=1.5e-3)


@pytest.mark.parametrize(
    ('rate_hz', 'cutoff_hz'),
    [(200.0, 100.0), (200.0, 0.0), (0.0, 6.0), (float('nan'), 6.0), (200.0, float('nan'))],
)
def test_rates_that_make_no_sense(rate_hz, cutoff_hz):
    with pytest.raises(DataError, match=r'cannot (low-pass|sample)'):
        condition(trial(np.arange(60) / 60.0), rate_hz, cutoff_hz)


def test_absurd_lengths_are_refused():
    with pytest.raises(DataError, match='more than can be held'):
        condition(trial(np.arange(60) / 60.0), 1e9)


def test_noise_of_real_people_goes_and_their_motion_stays(kth_folder):
    for recorded in read_data_set(kth_folder):
        conditioned = condition(recorded)
        both = np.hstack([recorded.partner, recorded.demonstrator])
        again = np.column_stack(
            [
                np.interp(recorded.times, conditioned.times, column)
                for column in np.hstack([conditioned.partner, conditioned.demonstrator]).T
            ]
        )
        inside = recorded.times <= conditioned.times[-1]
        difference = (again - both)[inside]
        limit = 0.015 if recorded.configuration == 'raw' else 0.006
        assert np.abs(difference).max() < limit, recorded.label
        assert np.abs(difference.mean(axis=0)).max() < 0.5e-3, recorded.label
        # What is left is as smooth as a hand.
        jerk = np.diff(conditioned.demonstrator, n=3, axis=0) * 200.0**3
        assert np.sqrt(np.mean(jerk**2)) < 300.0, recorded.label


def test_shifted_frames_shift_the_result():
    here = trial(np.arange(60) / 60.0)
    there = replace(here, partner=here.partner + 50.0)
    np.testing.assert_allclose(condition(there).partner, condition(here).partner + 50.0, atol=1e-9)
