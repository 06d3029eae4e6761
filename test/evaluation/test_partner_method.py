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

"""The partner model as a method of the evaluation, and what it is worth on recorded people."""

from __future__ import annotations

from pathlib import Path

from handover_dmp.evaluation.cases import make_cases
from handover_dmp.evaluation.few_demonstrations import few_demonstrations
from handover_dmp.evaluation.protocol import evaluate, Evaluation, Protocol
from handover_dmp.evaluation.rollouts import Learning
from handover_dmp.evaluation.scores import Summary
from handover_dmp.mocap import read_data_set, synthesize
from handover_dmp.tracking.partner_model import PartnerOptions
import numpy as np
import pytest

WITH = Learning(partner=PartnerOptions())
NOTHING_EXPECTED = PartnerOptions(mu=0.75, sigma=0.05, following=0.0, trust_within_m=0.0)


def figures(evaluation: Evaluation, method: str) -> Summary:
    (row,) = [row for row in evaluation.summary if row.method == method]
    return row.figures


def test_it_is_a_method_of_its_own_and_changes_no_other() -> None:
    trials = synthesize(seed=0, trials=3)[:6]
    plain = evaluate(trials, Protocol(learn=('mean',)))
    both = evaluate(trials, Protocol(learning=WITH, learn=('mean',)))
    assert 'partner_model' not in {row.method for row in plain.rows}
    without = [row for row in both.rows if row.method != 'partner_model']
    assert without == plain.rows
    assert figures(both, 'partner_model') != figures(both, 'decoupled')


def test_without_trust_it_gives_the_figures_of_the_primitive() -> None:
    """Though rolled out step by step, where the primitive is rolled out at once."""
    trials = synthesize(seed=0, trials=3)[:3]
    learning = Learning(partner=NOTHING_EXPECTED)
    both = evaluate(trials, Protocol(learning=learning, learn=('single',)))
    ours, plain = figures(both, 'partner_model'), figures(both, 'decoupled')
    assert ours.within == plain.within
    assert ours.rms_m == pytest.approx(plain.rms_m, abs=2e-5)
    assert ours.lateness_s == pytest.approx(plain.lateness_s, abs=1e-3)


def test_every_method_has_its_timing() -> None:
    evaluated = evaluate(synthesize(seed=0, trials=4)[:8], Protocol(learning=WITH, rounds=10))
    for row in evaluated.rows + evaluated.summary:
        assert row.figures.shifted_rms_m <= row.figures.rms_m + 1e-9
        assert np.isfinite([row.figures.lateness_s, row.figures.lateness_deviation_s]).all()
        if row.method == 'minimum_jerk':
            assert row.figures.shifted_rms_m > 0.0
        assert {'shifted_rms_m', 'lateness_s', 'lateness_deviation_s'} <= set(row.as_json())


@pytest.mark.slow
def test_on_people_it_is_nearer_and_leaves_the_band_no_more(kth_folder: Path) -> None:
    protocol = Protocol(learning=WITH, learn=('mean',), leave_one_out=True, rounds=10)
    evaluated = evaluate(read_data_set(kth_folder), protocol)
    ours, plain = figures(evaluated, 'partner_model'), figures(evaluated, 'decoupled')
    assert plain.rms_m == pytest.approx(0.0524, abs=2e-4)
    assert ours.rms_m <= 0.0503
    assert ours.within[3] >= plain.within[3]
    assert ours.shifted_rms_m < plain.shifted_rms_m - 0.003


@pytest.mark.slow
def test_with_few_demonstrations_it_is_no_worse(kth_folder: Path) -> None:
    curve = few_demonstrations(make_cases(read_data_set(kth_folder)), draws=1)
    assert curve.counts == (1, 2, 3, 4, 6)
    assert np.all(curve.rms_m['partner_model'] <= curve.rms_m['decoupled'])
