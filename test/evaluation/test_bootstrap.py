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

"""Resampling: seeded, of the right size, with intervals of the right width."""

from __future__ import annotations

from handover_dmp.evaluation.bootstrap import draw_samples, interval
import numpy as np
import pytest


def test_each_round_draws_as_many_trials_as_there_are():
    counts = draw_samples(7, np.random.SeedSequence(1), rounds=300)
    assert counts.shape == (300, 7)
    assert (counts.sum(axis=1) == 7).all()
    assert counts.min() == 0 and counts.max() > 1


def test_the_seed_decides():
    first = draw_samples(5, np.random.SeedSequence(1))
    assert (first == draw_samples(5, np.random.SeedSequence(1))).all()
    assert not (first == draw_samples(5, np.random.SeedSequence(2))).all()


def test_interval_of_a_mean_agrees_with_the_theory():
    values = np.random.default_rng(8).normal(size=400)
    counts = draw_samples(400, np.random.SeedSequence(3), rounds=4000)
    low, high = interval(counts @ values / 400)
    half_width = 1.96 * values.std() / 20
    assert low == pytest.approx(values.mean() - half_width, abs=0.08 * half_width)
    assert high == pytest.approx(values.mean() + half_width, abs=0.08 * half_width)


def test_rounds_where_the_statistic_does_not_exist_are_left_out():
    assert interval(np.array([np.nan, 2.0, np.nan])) == (2.0, 2.0)
    assert all(np.isnan(interval(np.array([np.nan, np.nan]))))
