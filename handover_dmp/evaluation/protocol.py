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

"""The protocol of Section III: every method replaces P2 and is compared with people."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from operator import add

from handover_dmp.common.arrays import Array
from handover_dmp.evaluation import LEARN
from handover_dmp.evaluation.bootstrap import draw_samples, ROUNDS
from handover_dmp.evaluation.cases import Case, make_cases
from handover_dmp.evaluation.envelope import Envelope
from handover_dmp.evaluation.minimum_jerk import minimum_jerk
from handover_dmp.evaluation.motions import measure_trials, TrialMeasures
from handover_dmp.evaluation.rejections import (
    band_widths,
    bottlenecks,
    excess,
    find_rejections,
    MIN_WIDTH_M,
    Rejection,
    Rejections,
)
from handover_dmp.evaluation.rollouts import curves_of, Learning, moved_from, plan, RolloutTask
from handover_dmp.evaluation.scores import judge, Scores, Summary, Totals
from handover_dmp.evaluation.table import Row
from handover_dmp.mocap import HandoverTrial
from joblib import delayed, Parallel
import numpy as np
from numpy.typing import NDArray

MIN_TRIALS = 2
MIN_TRIALS_LEFT_OUT = 3

KEPT_ROLLOUTS = 400
"""Largest number of rollouts of a case kept for the figures."""

_CHUNK = 20
"""Number of models that one worker learns at a time; the result does not depend on it."""

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Protocol:
    """
    What to evaluate, and how.

    Attributes:
        learning: parameters of the primitive, and how it is learnt.
        learn: sources of learning, of `LEARN`.
        leave_one_out: test each trial against band, mean and model of all other trials.
        seed: seed of the bootstrap.
        rounds: rounds of the bootstrap.
        min_width_m: a band narrower than this, from −3σ to 3σ, is a bottleneck, m.

    """

    learning: Learning = field(default_factory=Learning)
    learn: tuple[str, ...] = LEARN
    leave_one_out: bool = False
    seed: int = 0
    rounds: int = ROUNDS
    min_width_m: float = MIN_WIDTH_M


@dataclass(frozen=True)
class CaseScores:
    """
    All scores of one case.

    Attributes:
        case: the trials.
        scores: scores by source of learning and method.
        curves: by source, some curves of the decoupled primitive for the figures, (k, 101, 3) m.
        kept: by source, (k, 2), row and column of these in `scores`.
        rejections: by source, the curves of the decoupled primitive that leave the band.

    """

    case: Case
    scores: dict[tuple[str, str], Scores]
    curves: dict[str, Array]
    kept: dict[str, NDArray[np.int_]]
    rejections: dict[str, Rejections]


@dataclass(frozen=True)
class Evaluation:
    """
    Table I and the data of its figures.

    Attributes:
        protocol: the protocol.
        rows: one row per case, source of learning and method.
        summary: one row per source of learning and method, over all cases.
        cases: all scores of each case.
        measures: measures of the motions, trial by trial.

    """

    protocol: Protocol
    rows: list[Row]
    summary: list[Row]
    cases: list[CaseScores]
    measures: list[TrialMeasures]


def evaluate(
    trials: Sequence[HandoverTrial],
    protocol: Protocol | None = None,
    *,
    jobs: int = 1,
    progress: Progress | None = None,
) -> Evaluation:
    """
    Evaluate a data set.

    Args:
        trials: recorded handovers, several of each configuration and exchange.
        protocol: what to evaluate; default: the paper's Section III.
        jobs: number of processes; −1 for one per processor. The result does not depend on it.
        progress: called with the number of finished models and of all models.

    Returns:
        The table and the scores behind it.

    Raises:
        DataError: too few trials in a case.

    """
    protocol = protocol or Protocol()
    min_trials = MIN_TRIALS_LEFT_OUT if protocol.leave_one_out else MIN_TRIALS
    cases = make_cases(trials, min_trials=min_trials, cutoff_hz=protocol.learning.cutoff_hz)
    units = [unit for case in cases for unit in _units(case, protocol)]
    total, done = sum(len(unit.tasks) for unit in units), 0
    blocks: defaultdict[tuple[str, ...], list[_Block]] = defaultdict(list)
    run = Parallel(n_jobs=jobs, return_as='generator')
    results = run(delayed(_carry_out)(unit, protocol) for unit in units)
    for unit, result in zip(units, results, strict=True):
        done += len(result)
        blocks[unit.key] += result
        if progress is not None:
            progress(done, total)
    judged = [_collect(case, protocol, blocks) for case in cases]
    measures = measure_trials(
        cases,
        protocol.learning,
        moved_from(protocol.learn),
        leave_one_out=protocol.leave_one_out,
    )
    return Evaluation(protocol, *_tabulate(judged, protocol), judged, measures)


@dataclass(frozen=True)
class _Unit:
    """Tasks of one case, source of learning and method: the work unit of one worker."""

    case: Case
    band: Envelope
    learn: str
    method: str
    tasks: Sequence[RolloutTask]

    @property
    def key(self) -> tuple[str, ...]:
        return *self.case.key, self.learn, self.method


@dataclass(frozen=True)
class _Block:
    """The scored rollouts of one task."""

    task: RolloutTask
    scores: Scores
    curves: Array
    rejected: list[Rejection]
    outside: Array


def _units(case: Case, protocol: Protocol) -> Iterator[_Unit]:
    band = band_of(case, leave_one_out=protocol.leave_one_out)
    for learn in protocol.learn:
        tasks = plan(case, learn, leave_one_out=protocol.leave_one_out)
        for method in protocol.learning.methods:
            for first in range(0, len(tasks), _CHUNK):
                yield _Unit(case, band, learn, method, tasks[first: first + _CHUNK])  # fmt: skip


def band_of(case: Case, *, leave_one_out: bool) -> Envelope:
    """
    Make the band against which the rollouts of a case are tested.

    Args:
        case: the trials.
        leave_one_out: whether each trial has its own band, made of all other trials.

    Returns:
        The band.

    """
    if leave_one_out:
        return Envelope.of_the_others(case.curves)
    return Envelope.of(case.curves)


def _carry_out(unit: _Unit, protocol: Protocol) -> list[_Block]:
    blocks = []
    for task in unit.tasks:
        curves = curves_of(unit.case, task, unit.method, protocol.learning)
        tested = list(task.tested)
        band = unit.band.at(tested)
        durations = unit.case.durations_s[tested]
        scores = judge(curves[None], unit.case.curves[tested], band, durations_s=durations)
        rejected: list[Rejection] = []
        if unit.method == 'decoupled':
            rejected = find_rejections(curves, task.sources, tested, band, protocol.min_width_m)
        outside = (excess(curves, band) > 0.0).sum(axis=0)
        drawn = curves if _drawn(unit) else curves[:0]
        blocks.append(_Block(task, scores, drawn, rejected, outside))
    return blocks


def _drawn(unit: _Unit) -> bool:
    return unit.method == 'decoupled' and unit.tasks[0].row * len(unit.case) < KEPT_ROLLOUTS


def _collect(
    case: Case, protocol: Protocol, blocks: Mapping[tuple[str, ...], list[_Block]]
) -> CaseScores:
    scores: dict[tuple[str, str], Scores] = {}
    curves: dict[str, Array] = {}
    kept: dict[str, NDArray[np.int_]] = {}
    rejections: dict[str, Rejections] = {}
    for learn in protocol.learn:
        for method in protocol.learning.methods:
            key = *case.key, learn, method
            own = blocks[key]
            scores[learn, method] = _table_of(own, len(case))
            if method == 'decoupled':
                drawn = [block for block in own if len(block.curves)]
                curves[learn] = np.concatenate([block.curves for block in drawn])
                kept[learn] = np.array(
                    [(block.task.row, j) for block in drawn for j in block.task.tested]
                )
                rejections[learn] = _why(case, learn, own, scores[learn, method], protocol)
        scores[learn, 'minimum_jerk'] = _judge_minimum_jerk(case, protocol)
        scores[learn, 'human'] = _judge_people(case)
    return CaseScores(case, scores, curves, kept, rejections)


def _why(
    case: Case, learn: str, blocks: Sequence[_Block], scores: Scores, protocol: Protocol
) -> Rejections:
    widths_m = band_widths(Envelope.of(case.curves))
    return Rejections(
        case=case,
        learn=learn,
        curves=scores.curves,
        rejected=tuple(rejection for block in blocks for rejection in block.rejected),
        outside=np.sum([block.outside for block in blocks], axis=0),
        widths_m=widths_m,
        bottlenecks=bottlenecks(widths_m, protocol.min_width_m),
        min_width_m=protocol.min_width_m,
    )


def _table_of(blocks: Sequence[_Block], trials: int) -> Scores:
    table = Scores.blank(1 + max(block.task.row for block in blocks), trials)
    for block in blocks:
        table.enter(block.task.row, block.task.tested, block.scores)
    return table


def _judge_minimum_jerk(case: Case, protocol: Protocol) -> Scores:
    reaches = [
        minimum_jerk(trial.demonstrator[0], trial.demonstrator[-1]) for trial in case.trials
    ]
    band = band_of(case, leave_one_out=protocol.leave_one_out)
    return judge(np.stack(reaches)[None], case.curves, band, durations_s=case.durations_s)


def _judge_people(case: Case) -> Scores:
    """Score each person's motion against the others': the upper bound for any imitation."""
    if len(case) < MIN_TRIALS_LEFT_OUT:
        return Scores.blank(1, len(case))
    others = Envelope.of_the_others(case.curves)
    return judge(case.curves[None], others.mean, others, durations_s=case.durations_s)


def _tabulate(cases: Sequence[CaseScores], protocol: Protocol) -> tuple[list[Row], list[Row]]:
    seeds = np.random.SeedSequence(protocol.seed).spawn(len(cases))
    draws = [
        draw_samples(len(judged.case), seed, protocol.rounds)
        for judged, seed in zip(cases, seeds, strict=True)
    ]
    rows: list[Row] = []
    sums: dict[tuple[str, str], list[tuple[Totals, Totals]]] = {}
    for judged, counts in zip(cases, draws, strict=True):
        case, once = judged.case, np.ones((1, len(judged.case)))
        for (learn, method), scores in judged.scores.items():
            totals = scores.totals(once), scores.totals(counts)
            sums.setdefault((learn, method), []).append(totals)
            figures = Summary.of(*totals)
            rows.append(Row(*case.key, learn, method, len(case), scores.curves, figures))
    trials = sum(len(judged.case) for judged in cases)
    summary = []
    for (learn, method), parts in sums.items():
        curves = sum(judged.scores[learn, method].curves for judged in cases)
        totals = reduce(add, (part for part, _ in parts)), reduce(add, (part for _, part in parts))
        summary.append(Row('', '', learn, method, trials, curves, Summary.of(*totals)))
    return rows, summary
