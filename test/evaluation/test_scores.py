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

"""Scores and their sums, recomputed with plain loops over every pair."""

from __future__ import annotations

import math

from handover_dmp.evaluation.bootstrap import draw_samples
from handover_dmp.evaluation.envelope import Envelope
from handover_dmp.evaluation.scores import judge, Scores, Summary
import numpy as np
import pytest


def random_case(models: int, trials: int = 4) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(models)
    references = generator.normal(size=(trials, 20, 3))
    return generator.normal(size=(models, trials, 20, 3)), references


@pytest.mark.parametrize('models', [1, 4])
def test_figures_are_those_of_a_plain_loop(models):
    curves, references = random_case(models)
    envelope = Envelope.of(references)
    counted = np.ones((models, 4), dtype=bool)
    if models == 4:
        counted[np.diag_indices(4)] = False
    scores = judge(curves, references, envelope, counted)
    summary = Summary.of(scores.totals(np.ones((1, 4))), scores.totals(np.ones((1, 4))))
    inside = {1: 0, 2: 0, 3: 0}
    total, squares, gaps = 0, [], []
    for model in range(models):
        for trial in range(4):
            if models == 4 and model == trial:
                continue
            rollout = curves[model][trial]
            for axis in range(3):
                total += 1
                for k in inside:
                    fits = True
                    for sample in range(20):
                        away = abs(rollout[sample][axis] - envelope.mean[sample][axis])
                        fits = fits and away <= k * envelope.deviation[sample][axis]
                    inside[k] += fits
            for sample in range(20):
                squares.append(math.dist(rollout[sample], references[trial][sample]) ** 2)
            gaps.append(math.dist(rollout[-1], references[trial][-1]))
    assert scores.curves == total
    for k, count in inside.items():
        assert summary.within[k] == pytest.approx(100 * count / total)
    assert summary.rms_m == pytest.approx(math.sqrt(sum(squares) / len(squares)))
    assert summary.final_gap_m == pytest.approx(sum(gaps) / len(gaps))


@pytest.mark.parametrize('models', [1, 4])
def test_a_resampled_total_is_the_total_of_the_resampled_trials(models):
    curves, references = random_case(models)
    scores = judge(curves, references, Envelope.of(references))
    counts = draw_samples(4, np.random.SeedSequence(5), rounds=40)
    totals = scores.totals(counts)
    for draw, sums in zip(counts, totals.sums, strict=True):
        drawn = [trial for trial in range(4) for _ in range(int(draw[trial]))]
        if models == 1:
            assert sums[3] == pytest.approx(sum(scores.squared_m2[0, trial] for trial in drawn))
            assert sums[5] == 4
            continue
        own = [scores.squared_m2[trial, trial] for trial in drawn]
        pairs = [scores.squared_m2[i, j] for i in drawn for j in drawn if i != j]
        if pairs:
            assert sums[3] == pytest.approx(sum(own) + 12 * sum(pairs) / len(pairs))
            assert sums[5] == pytest.approx(16)
        else:
            assert np.isnan(sums).all()


def test_rounds_that_drew_one_trial_alone_have_no_pairs():
    curves, references = random_case(30, trials=30)
    scores = judge(curves, references, Envelope.of(references))
    assert np.isnan(scores.totals(30.0 * np.eye(30)).sums).all()


def test_the_interval_lies_around_the_figure():
    generator = np.random.default_rng(0)
    own = 3.0 * generator.normal(size=(30, 1)) + generator.normal(size=(30, 30))
    squares = np.exp(own) * (1.0 - np.eye(30))
    scores = Scores(
        sigmas=np.zeros((30, 30, 3)),
        squared_m2=squares,
        gap_m=squares,
        counted=np.ones((30, 30), dtype=bool),
    )
    once = scores.totals(np.ones((1, 30)))
    draws = scores.totals(draw_samples(30, np.random.SeedSequence(1)))
    middle = float(np.mean(draws.gap_m))
    assert middle == pytest.approx(float(once.gap_m[0]), rel=0.05)


def test_without_rollouts_there_are_no_figures():
    scores = Scores(
        sigmas=np.zeros((1, 2, 3)),
        squared_m2=np.zeros((1, 2)),
        gap_m=np.zeros((1, 2)),
        counted=np.zeros((1, 2), dtype=bool),
    )
    summary = Summary.of(scores.totals(np.ones((1, 2))), scores.totals(np.ones((3, 2))))
    assert scores.curves == 0
    assert math.isnan(summary.within[3]) and math.isnan(summary.rms_interval_m[0])
