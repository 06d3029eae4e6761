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

"""Tuning: finds what is there to be found, and is honest about what is not."""

from __future__ import annotations

from dataclasses import replace

from handover_dmp.common.errors import DataError
from handover_dmp.dmp import DmpParameters
from handover_dmp.evaluation.rollouts import Learning
from handover_dmp.evaluation.tuning import tune
from handover_dmp.mocap import HandoverTrial, synthesize
import pytest

BAD = Learning(parameters=DmpParameters(mu=1.05, sigma=0.02, stiffness=40.0), duration_scale=1.25)


def give(trials: int = 5) -> list[HandoverTrial]:
    everything = synthesize(seed=5, trials=trials)
    return [t for t in everything if (t.configuration, t.direction) == ('engine_bay', 'give')]


def test_bad_parameters_are_improved_on_unseen_trials():
    tuning = tune(give(), BAD, candidates=32)
    assert tuning.candidates >= 32 and tuning.trials == 5
    for compared in tuning.comparisons:
        assert compared.gain_m > 0.005
        assert compared.gain_interval_m[0] < compared.gain_m < compared.gain_interval_m[1]
        assert compared.gain_m == pytest.approx(compared.default.rms_m - compared.tuned.rms_m)
    assert 0.85 < tuning.best.duration_scale < 1.15
    assert len(tuning.folds) == 5
    assert tuning.attempts[0].what == 'the defaults'


def test_same_seed_same_answer_whatever_the_jobs():
    trials = give(4)
    alone = tune(trials, candidates=16, seed=3)
    assert tune(trials, candidates=16, seed=3, jobs=2) == alone
    assert tune(trials, candidates=16, seed=4).best != alone.best


def test_the_default_stands_where_nothing_is_better(monkeypatch):
    """Where every candidate loses curves within 3σ, none is taken."""
    monkeypatch.setattr('handover_dmp.evaluation.tuning.SPACE', _hopeless())
    tuning = tune(give(4), candidates=16)
    assert tuning.best == tuning.default
    for compared in tuning.comparisons:
        assert compared.gain_m == 0.0
        assert compared.gain_interval_m == (0.0, 0.0)


def _hopeless():
    from handover_dmp.evaluation.tuning import SPACE

    slow = {'duration_scale': (2.5, 3.0), 'mu': (1.5, 1.6)}
    return tuple(
        replace(each, low=slow[each.name][0], high=slow[each.name][1])
        if each.name in slow
        else each
        for each in SPACE
    )


def test_too_few_trials_are_named():
    with pytest.raises(DataError, match='at least 4 are needed'):
        tune(give(3))
