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

"""Time normalisation and the band, recomputed with plain loops."""

from __future__ import annotations

import math
import statistics

from handover_dmp.evaluation.envelope import Envelope
from handover_dmp.mocap.typical import SAMPLES, time_normalise
from hypothesis import given, strategies
import numpy as np
import pytest


def random_curves(seed: int, trials: int, samples: int = 12) -> np.ndarray:
    generator = np.random.default_rng(seed)
    return generator.normal(size=(trials, samples, 3)) * 0.05 + 1.3


def test_a_straight_line_stays_straight_whatever_its_stamps():
    times = np.array([2.0, 2.1, 2.15, 2.9, 3.0, 4.0])
    positions = np.outer(times - 2.0, [1.0, -2.0, 0.5])
    curve = time_normalise(times, positions)
    assert curve.shape == (SAMPLES, 3)
    for sample in range(SAMPLES):
        expected = [2.0 * sample / 100 * factor for factor in (1.0, -2.0, 0.5)]
        assert curve[sample] == pytest.approx(expected, abs=1e-12)


def test_time_normalisation_is_linear_between_samples():
    generator = np.random.default_rng(3)
    times = np.cumsum(generator.uniform(0.01, 0.2, size=40))
    positions = generator.normal(size=(40, 3))
    curve = time_normalise(times, positions, samples=17)
    for sample in range(17):
        at = times[0] + (times[-1] - times[0]) * sample / 16
        after = min(39, max(1, sum(1 for time in times if time < at)))
        share = (at - times[after - 1]) / (times[after] - times[after - 1])
        for axis in range(3):
            left, right = positions[after - 1, axis], positions[after, axis]
            assert curve[sample, axis] == pytest.approx(left + share * (right - left), abs=1e-12)


def test_envelope_is_the_sample_mean_and_the_sample_deviation():
    curves = random_curves(1, trials=5)
    envelope = Envelope.of(curves)
    assert envelope.trials == 5
    for sample in range(curves.shape[1]):
        for axis in range(3):
            column = [float(curve[sample][axis]) for curve in curves]
            assert envelope.mean[sample, axis] == pytest.approx(statistics.mean(column))
            assert envelope.deviation[sample, axis] == pytest.approx(statistics.stdev(column))


@pytest.mark.parametrize('trials', [3, 5, 40])
def test_envelope_of_the_others_is_made_without_the_one(trials):
    curves = random_curves(2, trials)
    together = Envelope.of_the_others(curves)
    assert together.trials == trials - 1
    for left_out in range(trials):
        alone = Envelope.of(np.array([c for i, c in enumerate(curves) if i != left_out]))
        np.testing.assert_allclose(together.mean[left_out], alone.mean, atol=1e-12)
        np.testing.assert_allclose(together.deviation[left_out], alone.deviation, atol=1e-12)


@given(
    seed=strategies.integers(0, 10_000),
    k=strategies.floats(0.1, 5.0),
    trials=strategies.integers(2, 7),
)
def test_within_is_what_a_plain_loop_says(seed, k, trials):
    curves = random_curves(seed, trials)
    candidate = random_curves(seed + 1, 1)[0]
    envelope = Envelope.of(curves)
    sigmas = envelope.sigmas(candidate)
    for axis in range(3):
        inside = True
        for sample in range(curves.shape[1]):
            column = [float(curve[sample][axis]) for curve in curves]
            middle = sum(column) / trials
            spread = math.sqrt(sum((value - middle) ** 2 for value in column) / (trials - 1))
            if abs(candidate[sample][axis] - middle) > k * spread:
                inside = False
        assert (sigmas[axis] <= k) == inside


def test_one_sample_outside_puts_the_whole_curve_outside():
    curves = random_curves(4, trials=5)
    envelope = Envelope.of(curves)
    candidate = envelope.mean.copy()
    assert (envelope.sigmas(candidate) <= 1).all()
    candidate[7, 1] += 3.01 * envelope.deviation[7, 1]
    assert list(envelope.sigmas(candidate) <= 3) == [True, False, True]


def test_a_band_without_width_holds_its_own_curve_and_no_other():
    curve = random_curves(5, trials=1)[0]
    envelope = Envelope.of(np.array([curve, curve, curve]))
    assert (envelope.sigmas(curve) == 0).all()
    assert np.isinf(envelope.sigmas(curve + 1e-6)).all()
