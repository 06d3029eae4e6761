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

"""Splits, and verdicts recomputed with plain loops."""

from __future__ import annotations

import math

from handover_dmp.dmp import DmpParameters
from handover_dmp.evaluation.cases import Case, make_cases
from handover_dmp.evaluation.envelope import Envelope
from handover_dmp.evaluation.folds import (
    Candidate,
    FOLDS,
    judge_splits,
    learn_mean_unseen,
    split,
    thinned,
    try_out,
)
from handover_dmp.evaluation.hand_views import smooth_goal
from handover_dmp.evaluation.protocol import evaluate, Protocol
from handover_dmp.evaluation.rollouts import Learning
from handover_dmp.evaluation.scores import Totals
from handover_dmp.mocap import synthesize
import numpy as np
import pytest


@pytest.fixture(scope='module')
def case() -> Case:
    trials = [t for t in synthesize(seed=2, trials=7) if t.configuration == 'engine_bay']
    return make_cases(trials)[0]


@pytest.mark.parametrize('trials', [4, 5, 7])
def test_each_trial_is_unseen_once_and_never_trained_on_then(case, trials):
    splits = split(thinned(case, trials), np.random.SeedSequence(1))
    assert len(splits) == FOLDS + 1
    unseen = [trial for part in splits for trial in part.unseen]
    assert sorted(unseen) == list(range(trials))
    for part in splits:
        assert not set(part.training) & set(part.unseen)
        assert set(part.training) | set(part.unseen) == set(range(trials))
        assert len(part.training) >= 3
    assert splits[-1].unseen == ()


def test_verdict_is_that_of_a_plain_loop(case):
    splits = split(case, np.random.SeedSequence(2))
    generator = np.random.default_rng(3)
    curves = case.curves[None] + 0.02 * generator.normal(size=(7, 7, 1, 3))
    verdict = judge_splits(case, splits, curves)
    part = splits[1]
    inside = squares = rollouts = 0.0
    for tested in part.training:
        others = [i for i in part.training if i != tested]
        band = Envelope.of(case.curves[others])
        for learnt in others:
            rollouts += 1
            squares += np.mean(np.sum((curves[learnt, tested] - case.curves[tested]) ** 2, axis=1))
            inside += np.mean(band.sigmas(curves[learnt, tested]) <= 3)
    sums = verdict.training[1].sums[0]
    assert sums[5] == rollouts
    assert sums[3] == pytest.approx(squares)
    assert sums[2] == pytest.approx(inside)
    for tested in part.unseen:
        band = Envelope.of(case.curves[list(part.training)])
        inside = sum(np.mean(band.sigmas(curves[learnt, tested]) <= 2) for learnt in part.training)
        assert verdict.unseen[tested, 1] == pytest.approx(inside)
        assert verdict.unseen[tested, 5] == len(part.training)


def test_verdict_on_all_trials_is_the_table_with_each_left_out(case):
    learning = Learning(parameters=DmpParameters(mu=0.6))
    splits = split(case, np.random.SeedSequence(0))
    sums = try_out(case, splits, Candidate(learning)).training[-1]
    protocol = Protocol(learning=learning, learn=('single',), leave_one_out=True)
    row = next(row for row in evaluate(case.trials, protocol).summary if row.method == 'decoupled')
    assert row.curves == 3 * sums.sums[0, 5]
    # The trials are conditioned already, and once more within `evaluate`.
    assert sums.rms_m[0] == pytest.approx(row.figures.rms_m, rel=0.02)
    assert sums.within_percent[0, 2] == pytest.approx(row.figures.within[3], abs=4)


def test_learn_mean_is_tested_on_unseen_trials_alone(case):
    part = split(case, np.random.SeedSequence(2))[0]
    table = learn_mean_unseen(case, part, Candidate())
    assert table.shape == (len(part.unseen), 6)
    assert (table[:, 5] == 1).all()
    assert math.sqrt(table[:, 3].max()) < 0.2


def test_what_the_primitive_is_told_matters(case):
    splits = split(case, np.random.SeedSequence(2))
    told_late = Candidate(view=lambda hands: smooth_goal(hands, 1.0))
    truth, late = (
        Totals(try_out(case, splits, candidate).unseen).gap_m.mean()
        for candidate in (Candidate(), told_late)
    )
    assert late > 1.5 * truth


def test_thinning_keeps_the_ends(case):
    few = thinned(case, 3)
    assert [t.number for t in few.trials] == [1, 4, 7]
    assert thinned(case, 20).trials == case.trials
