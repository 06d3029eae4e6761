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

"""Cross-validation by trial: the score of parameters on unseen trials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from handover_dmp.common.arrays import Array
from handover_dmp.evaluation.cases import Case, Hands
from handover_dmp.evaluation.envelope import Envelope
from handover_dmp.evaluation.rollouts import learn_from_case, Learning, roll_out
from handover_dmp.evaluation.scores import judge, Totals
import numpy as np

FOLDS = 5
MAX_TRIALS = 20
"""Largest number of trials of a case; the cost grows with its square."""


@dataclass(frozen=True)
class Candidate:
    """
    A set of parameters to try.

    Attributes:
        learning: parameters of the primitive, factor on its duration, regression.
        view: maps the true hands to those that the primitive sees; None: the truth.
        common_offset: take the mean goal offset of the training trials instead of that of the
            learnt trial.

    """

    learning: Learning = field(default_factory=Learning)
    view: Callable[[Hands], Hands] | None = None
    common_offset: bool = False


@dataclass(frozen=True)
class Split:
    """
    A case divided into trials to learn from and trials to test on.

    Attributes:
        training: indices of trials, at least three.
        unseen: indices of trials; empty if all are for training.

    """

    training: tuple[int, ...]
    unseen: tuple[int, ...]


@dataclass(frozen=True)
class Verdict:
    """
    One candidate in one case.

    Attributes:
        training: sums over the training trials of each split; each trial is tested against the
            band of the others and never with a model of its own. The last split has all trials.
        unseen: (trials, 6) the sums of `Totals` over the rollouts of models of the training
            trials against each unseen trial, tested against the band of the training trials.

    """

    training: list[Totals]
    unseen: Array


def split(case: Case, seed: np.random.SeedSequence, folds: int = FOLDS) -> list[Split]:
    """
    Divide the trials of a case so that each is unseen once.

    Args:
        case: at least four trials.
        seed: seed of the random division.
        folds: number of parts; with fewer trials, some are empty.

    Returns:
        The splits, and finally one with all trials for training.

    """
    order = np.random.default_rng(seed).permutation(len(case)).tolist()
    everyone = tuple(range(len(case)))
    parts = [tuple(sorted(order[part::folds])) for part in range(folds)]
    splits = [Split(tuple(i for i in everyone if i not in part), part) for part in parts]
    return [*splits, Split(everyone, ())]


def try_out(case: Case, splits: Sequence[Split], candidate: Candidate) -> Verdict:
    """
    Learn from every trial, roll out against every other, and judge by each split.

    Args:
        case: the trials.
        splits: from `split`.
        candidate: the parameters to try.

    Returns:
        Its scores.

    """
    return judge_splits(case, splits, _rollouts(case, candidate))


def judge_splits(case: Case, splits: Sequence[Split], curves: Array) -> Verdict:
    """
    Score the rollouts of the model of each trial against each trial.

    Args:
        case: the trials.
        splits: from `split`.
        curves: (n, n, 101, 3) m; learnt trial first, tested trial second.

    Returns:
        Their scores.

    """
    training, unseen = [], np.zeros((len(case), 6))
    for part in splits:
        seen = list(part.training)
        scores = judge(
            curves[np.ix_(seen, seen)],
            case.curves[seen],
            Envelope.of_the_others(case.curves[seen]),
            ~np.eye(len(seen), dtype=np.bool_),
        )
        training.append(scores.totals(np.ones((1, len(seen)))))
        if part.unseen:
            tested = list(part.unseen)
            judged = judge(
                curves[np.ix_(seen, tested)],
                case.curves[tested],
                Envelope.of(case.curves[seen]),
            )
            unseen[tested] = judged.measures.sum(axis=1).T
    return Verdict(training, unseen)


def learn_mean_unseen(case: Case, part: Split, candidate: Candidate) -> Array:
    """
    Learn from the mean of the training trials, and judge against the unseen ones.

    Args:
        case: the trials.
        part: the split.
        candidate: the parameters to try.

    Returns:
        (len(part.unseen), 6) the sums of `Totals`, one rollout each.

    """
    model, offset = learn_from_case(case, part.training, 'decoupled', candidate.learning)
    hands = case.hands if candidate.view is None else candidate.view(case.hands)
    rollouts = roll_out(model, offset, case, part.unseen, hands)
    curves = case.hands.time_normalise(rollouts, part.unseen)
    band = Envelope.of(case.curves[list(part.training)])
    judged = judge(curves[None], case.curves[list(part.unseen)], band)
    return np.asarray(judged.measures[:, 0].T)


def thinned(case: Case, maximum: int = MAX_TRIALS) -> Case:
    """
    Thin out the trials of a large case evenly.

    Args:
        case: any case.
        maximum: largest number of trials to keep.

    Returns:
        The case with at most that many.

    """
    kept = np.unique(np.linspace(0, len(case) - 1, maximum).round().astype(int))
    return Case(case.configuration, case.direction, tuple(case.trials[i] for i in kept))


def _rollouts(case: Case, candidate: Candidate) -> Array:
    everyone = range(len(case))
    hands = case.hands if candidate.view is None else candidate.view(case.hands)
    # A tested trial must stay unknown, so its own offset is not in its mean.
    means = (case.goal_offsets.sum(axis=0) - case.goal_offsets) / (len(case) - 1)
    rows = []
    for index in everyone:
        model, offset = learn_from_case(case, [index], 'decoupled', candidate.learning)
        offsets = means if candidate.common_offset else offset
        rollouts = roll_out(model, offsets, case, everyone, hands)
        rows.append(case.hands.time_normalise(rollouts, everyone))
    return np.stack(rows)
