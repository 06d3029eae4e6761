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

"""What is said in a sentence, and trial by trial, is what the curves have."""

from __future__ import annotations

from typing import Any

from handover_dmp.evaluation.envelope import Envelope
from handover_dmp.evaluation.protocol import evaluate, Evaluation, Protocol
from handover_dmp.evaluation.report import as_json
from handover_dmp.evaluation.rollouts import plan, sources_of
from handover_dmp.mocap import synthesize
import numpy as np
import pytest


@pytest.fixture(scope='module')
def evaluation() -> Evaluation:
    trials = [t for t in synthesize(seed=0, trials=4) if t.configuration == 'under_car']
    return evaluate(trials, Protocol(learn=('mean',)))


@pytest.fixture(scope='module')
def table(evaluation: Evaluation) -> dict[str, Any]:
    return as_json(evaluation, 'data')


def test_the_distance_of_each_trial_is_that_of_its_curves(
    evaluation: Evaluation, table: dict[str, Any]
) -> None:
    found = {(one['exchange'], one['trial'], one['method']): one for one in table['distances']}
    assert len(found) == len(table['distances']) == 16
    for judged in evaluation.cases:
        case = judged.case
        mean, deviation = case.curves.mean(axis=0), case.curves.std(axis=0, ddof=1)
        for index, trial in enumerate(case.trials):
            curve = judged.curves['mean'][index]
            own = found[case.direction, trial.number, 'decoupled']
            away = np.linalg.norm(curve - case.curves[index], axis=1)
            assert own['rms_m'] == pytest.approx(np.sqrt(np.mean(away**2)))
            assert own['final_gap_m'] == pytest.approx(away[-1])
            fits = (np.abs(curve - mean) <= 3 * deviation + 1e-9).all(axis=0)
            assert own['within']['3'] == pytest.approx(100 * fits.mean())
            others = Envelope.of(np.delete(case.curves, index, axis=0)).mean
            away = np.linalg.norm(case.curves[index] - others, axis=1)
            people = found[case.direction, trial.number, 'human']
            assert people['rms_m'] == pytest.approx(np.sqrt(np.mean(away**2)))


def test_the_answers_are_the_figures_of_the_table(table: dict[str, Any]) -> None:
    answers = table['in_short']
    (own,) = [one for one in table['summary'] if one['method'] == 'decoupled']
    assert f'{own["within"]["3"]:.1f} %' in answers['How near?']
    assert f'{1e3 * own["shifted_rms_m"]:.0f} mm after the best shift' in answers['How near?']
    everything = table['why'][-1]
    assert f'{everything["rejected"]} of {everything["curves"]}' in answers['Why not nearer?']
    distances = [one for one in table['distances'] if one['method'] == 'decoupled']
    far = max(distances, key=lambda one: one['rms_m'])
    assert answers['Which trials?'].startswith(
        f'Farthest from P2 are under_car {far["exchange"]} #{far["trial"]} '
        f'({1e3 * far["rms_m"]:.0f} mm, '
    )
    early = 'early' if far['lateness_s'] < 0.0 else 'late'
    assert f'{1e3 * abs(far["lateness_s"]):.0f} ms {early}' in answers['Which trials?']
    assert answers['With which arm?'] == 'No arm was evaluated (--arm selects one).'
    assert '(DMP)' in answers['How smooth?'] and '(P2)' in answers['How fluent?']


@pytest.mark.parametrize('learn', ['single', 'mean', 'representative'])
@pytest.mark.parametrize('leave_one_out', [False, True])
def test_one_model_moves_against_each_trial(
    evaluation: Evaluation, learn: str, leave_one_out: bool
) -> None:
    for judged in evaluation.cases:
        case = judged.case
        chosen = sources_of(case, learn, leave_one_out=leave_one_out)
        assert sorted(chosen) == list(range(len(case)))
        tasks = plan(case, learn, leave_one_out=leave_one_out)
        for index, sources in chosen.items():
            assert not (leave_one_out and index in sources)
            # it is one of those that the table has, too
            assert any(task.sources == sources and index in task.tested for task in tasks)
