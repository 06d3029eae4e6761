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

"""The protocol, recomputed independently with plain loops and with single rollouts."""

from __future__ import annotations

import math

from handover_dmp.common.errors import DataError
from handover_dmp.dmp import DmpParameters
from handover_dmp.evaluation.envelope import Envelope
from handover_dmp.evaluation.protocol import evaluate, Evaluation, Protocol
from handover_dmp.evaluation.rollouts import Learning, plan
from handover_dmp.evaluation.table import Row
from handover_dmp.handover.teaching import hand_goal, learn_from_trials
from handover_dmp.mocap import condition, HandoverTrial, synthesize
import numpy as np
import pytest


def one_case(trials: int = 5, direction: str = 'give') -> list[HandoverTrial]:
    everything = synthesize(seed=3, trials=trials)
    return [t for t in everything if (t.configuration, t.direction) == ('under_car', direction)]


@pytest.fixture(scope='module')
def evaluation() -> Evaluation:
    return evaluate(synthesize(seed=1))


def find(rows: list[Row], learn: str, method: str, configuration: str = '') -> Row:
    return next(
        row
        for row in rows
        if (row.learn, row.method) == (learn, method) and configuration in row.configuration
    )


def normalise(times, positions) -> list[list[float]]:
    """Time-normalise with a plain loop."""
    curve = []
    for sample in range(101):
        at = times[0] + (times[-1] - times[0]) * sample / 100
        after = 1
        while after < len(times) - 1 and times[after] < at:
            after += 1
        share = (at - times[after - 1]) / (times[after] - times[after - 1])
        curve.append(
            [
                p + share * (q - p)
                for p, q in zip(positions[after - 1], positions[after], strict=True)
            ]
        )
    return curve


def count_within(rollouts: list, people: list, k: int) -> float:
    inside = 0
    for rollout in rollouts:
        for axis in range(3):
            fits = True
            for sample in range(101):
                column = [person[sample][axis] for person in people]
                mean = sum(column) / len(column)
                variance = sum((value - mean) ** 2 for value in column) / (len(column) - 1)
                fits &= abs(rollout[sample][axis] - mean) <= k * math.sqrt(variance)
            inside += fits
    return 100.0 * inside / (3 * len(rollouts))


@pytest.mark.parametrize('formulation', ['stiff', 'printed'])
def test_table_is_that_of_an_independent_computation(formulation):
    trials = one_case()
    parameters = DmpParameters(formulation=formulation)
    learning = Learning(parameters=parameters)
    rows = evaluate(trials, Protocol(learning=learning, learn=('single', 'mean'))).rows
    smooth = [condition(trial) for trial in trials]
    people = [normalise(trial.times, trial.demonstrator) for trial in smooth]
    for learn, groups in (('single', [[trial] for trial in trials]), ('mean', [trials])):
        rollouts, squares, gaps = [], [], []
        for group in groups:
            model = learn_from_trials(group, parameters, regression='ridge', basis=50)
            for tested, person in zip(smooth, people, strict=True):
                goals, velocities = hand_goal(tested, model)
                offset = goals - tested.partner
                # The hand of the low-passed trial itself, not low-passed twice.
                motion = model.rollout(
                    tested.times,
                    tested.partner + model.goal_offset,
                    velocities,
                    start=tested.demonstrator[0],
                )
                assert np.abs(offset - model.goal_offset).max() < 2e-3
                rollouts.append(normalise(tested.times, motion.positions.tolist()))
                for mine, theirs in zip(rollouts[-1], person, strict=True):
                    squares.append(math.dist(mine, theirs) ** 2)
                gaps.append(math.dist(rollouts[-1][-1], person[-1]))
        row = find(rows, learn, 'decoupled')
        assert row.curves == 3 * len(rollouts)
        for k in (1, 2, 3):
            expected = count_within(rollouts, people, k)
            # A curve that touches the edge of the band may fall on either side.
            assert row.figures.within[k] == pytest.approx(expected, abs=100 / row.curves + 1e-9)
        assert row.figures.rms_m == pytest.approx(math.sqrt(np.mean(squares)), abs=2e-4)
        assert row.figures.final_gap_m == pytest.approx(np.mean(gaps), abs=2e-4)


def test_people_and_the_oracle_are_those_of_an_independent_computation():
    trials = one_case()
    rows = evaluate(trials).rows
    smooth = [condition(trial) for trial in trials]
    people = [normalise(trial.times, trial.demonstrator) for trial in smooth]
    reaches = []
    for trial in smooth:
        u = np.linspace(0.0, 1.0, 101)[:, None]
        reaches.append(
            trial.demonstrator[0]
            + (trial.demonstrator[-1] - trial.demonstrator[0]) * u**3 * (10 - 15 * u + 6 * u**2)
        )
    for k in (1, 2, 3):
        figures = find(rows, 'single', 'minimum_jerk').figures
        assert figures.within[k] == pytest.approx(count_within(reaches, people, k))
        others = [
            count_within([person], [p for p in people if p is not person], k) for person in people
        ]
        figures = find(rows, 'mean', 'human').figures
        assert figures.within[k] == pytest.approx(sum(others) / 5)
    assert find(rows, 'single', 'minimum_jerk').figures.final_gap_m < 1e-12


def test_numbers_of_rollouts_are_those_of_the_protocol(evaluation):
    assert len(evaluation.cases) == 6
    assert len(evaluation.rows) == 6 * 3 * 4
    assert {row.trials for row in evaluation.rows} == {5}
    for method in ('decoupled', 'classical'):
        assert find(evaluation.rows, 'single', method).curves == 75
        assert find(evaluation.rows, 'mean', method).curves == 15
        assert find(evaluation.summary, 'single', method).curves == 450
        assert find(evaluation.summary, 'mean', method).curves == 90
    assert find(evaluation.summary, 'single', 'human').curves == 90


def test_summary_is_the_share_of_all_curves(evaluation):
    for summary in evaluation.summary:
        rows = [
            row
            for row in evaluation.rows
            if (row.learn, row.method) == (summary.learn, summary.method)
        ]
        curves = sum(row.curves for row in rows)
        for k in (1, 2, 3):
            inside = sum(row.curves * row.figures.within[k] for row in rows)
            assert summary.figures.within[k] == pytest.approx(inside / curves)
            low, high = summary.figures.within_interval[k]
            assert low <= summary.figures.within[k] <= high


def test_decoupling_is_worth_it(evaluation):
    for learn in ('single', 'mean'):
        decoupled = find(evaluation.summary, learn, 'decoupled').figures
        classical = find(evaluation.summary, learn, 'classical').figures
        assert decoupled.within[3] > classical.within[3] + 20
        assert decoupled.rms_m < 0.7 * classical.rms_m


def test_nothing_is_tested_against_itself_when_it_is_left_out():
    trials = one_case(trials=6)
    evaluated = evaluate(trials, Protocol(leave_one_out=True))
    case = evaluated.cases[0].case
    for learn in ('single', 'mean', 'representative'):
        for task in plan(case, learn, leave_one_out=True):
            assert not set(task.sources) & set(task.tested)
    assert find(evaluated.rows, 'single', 'decoupled').curves == 6 * 5 * 3
    assert find(evaluated.rows, 'mean', 'decoupled').curves == 6 * 3
    assert find(evaluated.rows, 'representative', 'decoupled').curves == 6 * 3


def test_a_trial_left_out_changes_nothing_of_what_it_is_held_against():
    trials = one_case()
    moved = HandoverTrial(
        trials[0].times,
        trials[0].partner,
        trials[0].demonstrator + 0.3,
        'under_car',
        'give',
        trials[0].number,
    )
    before, after = (
        evaluate([first, *trials[1:]], Protocol(leave_one_out=True, learn=('mean',))).cases[0]
        for first in (trials[0], moved)
    )
    people, primitive = ('mean', 'human'), ('mean', 'decoupled')
    assert (after.scores[people].sigmas[0, 0] > before.scores[people].sigmas[0, 0] + 3).all()
    # The model and the band that its own hand is held against have not seen it move away.
    np.testing.assert_allclose(
        after.scores[primitive].sigmas[0, 0],
        Envelope.of(before.case.curves[1:]).sigmas(after.curves['mean'][0]),
    )


@pytest.mark.parametrize('trials', [2, 3, 8])
def test_any_number_of_trials_will_do(trials):
    rows = evaluate(one_case(trials)).rows
    assert {row.trials for row in rows} == {trials}
    assert find(rows, 'single', 'decoupled').curves == 3 * trials**2
    people = find(rows, 'single', 'human')
    if trials == 2:
        assert people.curves == 0 and math.isnan(people.figures.within[3])
        assert people.as_json()['within'] == {'1': None, '2': None, '3': None}
    else:
        assert people.curves == 3 * trials


def test_one_trial_alone_has_no_spread():
    with pytest.raises(DataError, match='under_car give has 1 trial, at least 2'):
        evaluate(one_case()[:1])
    with pytest.raises(DataError, match='at least 3'):
        evaluate(one_case()[:2], Protocol(leave_one_out=True))


def test_jobs_and_order_of_trials_change_nothing():
    trials = [*one_case(), *one_case(direction='take')]
    alone = [row.as_json() for row in evaluate(trials).rows]
    assert [row.as_json() for row in evaluate(trials, jobs=2).rows] == alone
    shuffled = [trials[i] for i in (4, 2, 0, 1, 3, 9, 8, 5, 6, 7)]
    assert [row.as_json() for row in evaluate(shuffled).rows] == alone


def test_seed_changes_the_intervals_alone():
    first, second = (evaluate(one_case(), Protocol(seed=seed)).summary[0] for seed in (0, 1))
    assert first.figures.within == second.figures.within
    assert first.figures.rms_interval_m != second.figures.rms_interval_m


def test_sparse_regression_gives_the_same_table():
    trials = one_case()
    ridge, sparse = (
        evaluate(trials, Protocol(learning=Learning(regression=regression, basis=25))).summary[0]
        for regression in ('ridge', 'rvm')
    )
    assert sparse.figures.rms_m == pytest.approx(ridge.figures.rms_m, abs=1e-3)
    for k in (1, 2, 3):
        assert sparse.figures.within[k] == pytest.approx(ridge.figures.within[k], abs=4.0)


def test_real_people(kth_folder):
    from handover_dmp.mocap import read_data_set

    evaluated = evaluate(read_data_set(kth_folder))
    assert len(evaluated.cases) == 10
    for learn in ('single', 'mean'):
        decoupled = find(evaluated.summary, learn, 'decoupled').figures
        classical = find(evaluated.summary, learn, 'classical').figures
        assert decoupled.within[3] > classical.within[3]
        assert decoupled.rms_m < classical.rms_m
