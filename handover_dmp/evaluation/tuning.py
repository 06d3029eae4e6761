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

"""Search for better parameters, and their score on unseen trials."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.evaluation.bootstrap import draw_samples, interval
from handover_dmp.evaluation.cases import Case, make_cases
from handover_dmp.evaluation.folds import (
    Candidate,
    FOLDS,
    learn_mean_unseen,
    Split,
    split,
    thinned,
    try_out,
    Verdict,
)
from handover_dmp.evaluation.hand_views import (
    estimated,
    looking_ahead,
    smooth_goal,
    smooth_velocity,
)
from handover_dmp.evaluation.rollouts import Learning
from handover_dmp.evaluation.scores import BANDS, Totals
from handover_dmp.mocap import HandoverTrial, velocities
from joblib import delayed, Parallel
import numpy as np

MIN_TRIALS = 4
CANDIDATES = 192
REFINEMENTS = 3
WITHIN = len(BANDS) - 1

REST_SPEED = 0.1
"""A slower hand is at rest, m/s."""


@dataclass(frozen=True)
class Range:
    """
    The search range of a parameter.

    Attributes:
        name: name of the parameter.
        low: least value.
        high: largest value.
        logarithmic: whether the scale is logarithmic.

    """

    name: str
    low: float
    high: float
    logarithmic: bool = False

    def value(self, share: float) -> float:
        """Return the value at a share from 0 to 1 of the range."""
        if self.logarithmic:
            return float(self.low * (self.high / self.low) ** share)
        return float(self.low + (self.high - self.low) * share)


SPACE = (
    Range('stiffness', 30.0, 1000.0, logarithmic=True),
    Range('mu', 0.3, 1.1),
    Range('sigma', 0.02, 0.4, logarithmic=True),
    # K_v as a share of Dτ, which follows without lag; above 1, the rule Dτ itself.
    Range('goal_velocity_gain', 0.0, 2.0),
    Range('duration_scale', 0.8, 1.25, logarithmic=True),
)


@dataclass(frozen=True)
class Worth:
    """
    Scores of parameters on trials that they were not chosen on.

    Attributes:
        rms_m: root-mean-square distance to P2, m.
        within: by k, percentage of curves within kσ.
        final_gap_m: mean distance at the end, m.

    """

    rms_m: float
    within: dict[int, float]
    final_gap_m: float


@dataclass(frozen=True)
class Comparison:
    """
    The tuned parameters compared with the defaults, on unseen trials.

    Attributes:
        learn: `single` or `mean`.
        default: scores of the defaults.
        tuned: scores of the parameters chosen on the other trials.
        gain_m: reduction of the distance, m.
        gain_interval_m: its 95 % interval, trials resampled, m.
        within_change: change of the percentage within 3σ, points.
        within_change_interval: its 95 % interval, points.

    """

    learn: str
    default: Worth
    tuned: Worth
    gain_m: float
    gain_interval_m: tuple[float, float]
    within_change: float
    within_change_interval: tuple[float, float]


@dataclass(frozen=True)
class Attempt:
    """
    One change to the defaults, and its effect on unseen trials.

    Attributes:
        what: the change.
        worth: its scores, learn single.
        gain_m: reduction of the distance, m.
        gain_interval_m: its 95 % interval, trials resampled, m.

    """

    what: str
    worth: Worth
    gain_m: float
    gain_interval_m: tuple[float, float]


@dataclass(frozen=True)
class Tuning:
    """
    The result of the search.

    Attributes:
        default: start of the search.
        best: parameters chosen on all trials.
        folds: parameters chosen without the unseen trials of each fold.
        comparisons: gain on unseen trials, learn single and learn mean.
        attempts: single changes to the defaults, the defaults first.
        candidates: number of sets of parameters that were tried.
        trials: number of trials.
        start_at_rest: number of trials that begin with both hands slower than 0.1 m/s.

    """

    default: Learning
    best: Learning
    folds: list[Learning]
    comparisons: list[Comparison]
    attempts: list[Attempt]
    candidates: int
    trials: int
    start_at_rest: int


def tune(
    trials: Sequence[HandoverTrial],
    default: Learning | None = None,
    *,
    candidates: int = CANDIDATES,
    seed: int = 0,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Tuning:
    """
    Search K, μ, σ, K_v and the scale of τ by cross-validation.

    The candidate with the least distance to P2 wins, among those with no fewer curves within 3σ
    than the defaults. Candidates are first spread evenly, then placed ever closer around the best
    of each fold. Each fold chooses by its training trials alone and is scored on unseen trials;
    the final choice uses all trials.

    Args:
        trials: recorded handovers, at least four of each configuration and exchange.
        default: start of the search, and the parameters to beat.
        candidates: least number of sets of parameters to try.
        seed: seed of the search, the folds and the intervals.
        jobs: number of processes; the result does not depend on it.
        progress: called with the number of tried candidates and of all candidates.

    Returns:
        The result of the search.

    Raises:
        DataError: too few trials in a case.

    """
    default = default or Learning()
    made = make_cases(trials, min_trials=MIN_TRIALS, cutoff_hz=default.cutoff_hz)
    cases = [thinned(case) for case in made]
    seeds = np.random.SeedSequence(seed).spawn(len(cases) + 2)
    splits = [split(case, own) for case, own in zip(cases, seeds, strict=False)]
    attempts = list(_changes(default))
    court = _Court(cases, splits, jobs, candidates + len(attempts), progress)
    search = _Search(default, court, np.random.default_rng(seeds[-2]), candidates)
    search.run()
    choices = [search.choose(fold) for fold in range(FOLDS + 1)]
    draws = [
        draw_samples(len(case), own)
        for case, own in zip(cases, seeds[-1].spawn(len(cases)), strict=True)
    ]
    compare = partial(_compare, cases, splits, search, choices[:FOLDS], draws)
    return Tuning(
        default=default,
        best=search.tried[choices[FOLDS]],
        folds=[search.tried[choice] for choice in choices[:FOLDS]],
        comparisons=[compare('single'), compare('mean')],
        attempts=_attempts(attempts, court, draws),
        candidates=len(search.tried),
        trials=sum(map(len, cases)),
        start_at_rest=sum(starts_at_rest(trial) for case in made for trial in case.trials),
    )


def starts_at_rest(trial: HandoverTrial) -> bool:
    """
    Tell whether a trial begins at rest.

    Args:
        trial: a conditioned trial.

    Returns:
        Whether both hands are slower than 0.1 m/s in the first sample.

    """
    speeds = [
        np.linalg.norm(velocities(trial.times, positions)[0])
        for positions in (trial.partner, trial.demonstrator)
    ]
    return bool(max(speeds) < REST_SPEED)


@dataclass
class _Court:
    """Scores candidates on all cases, several at a time."""

    cases: Sequence[Case]
    splits: Sequence[Sequence[Split]]
    jobs: int
    expected: int
    progress: Callable[[int, int], None] | None
    done: int = 0

    def judge(self, candidates: Sequence[Candidate]) -> list[list[Verdict]]:
        """Return a verdict for each candidate and case."""
        verdicts = []
        pairs = list(zip(self.cases, self.splits, strict=True))
        run = Parallel(n_jobs=self.jobs, return_as='generator')
        for verdict in run(delayed(_try_all)(pairs, each) for each in candidates):
            verdicts.append(verdict)
            self.done += 1
            if self.progress is not None:
                self.progress(min(self.done, self.expected), self.expected)
        return verdicts


def _try_all(pairs: Sequence[tuple[Case, Sequence[Split]]], candidate: Candidate) -> list[Verdict]:
    return [try_out(case, parts, candidate) for case, parts in pairs]


class _Search:
    """All tried candidates, the default first."""

    def __init__(
        self, default: Learning, court: _Court, random: np.random.Generator, candidates: int
    ) -> None:
        self.default, self.court, self.random = default, court, random
        self.candidates = candidates
        self.pace = float(np.mean([d for case in court.cases for d in case.durations_s]))
        self.tried: list[Learning] = []
        self.places: list[Array] = []
        self.verdicts: list[list[Verdict]] = []

    def run(self) -> None:
        """Try the default, then evenly spread candidates, then candidates near the best."""
        self._try([(self.default, np.full(len(SPACE), np.nan))])
        # takes longer to load than the rest of the package
        from scipy.stats import qmc

        spread = qmc.Sobol(len(SPACE), seed=self.random).random(
            2 ** max(3, int(np.log2(max(self.candidates, 16) / 3)))
        )
        self._try([(self._learning(place), place) for place in spread])
        each = max(1, -(-(self.candidates - len(self.tried)) // (REFINEMENTS * (FOLDS + 1))))
        for refinement in range(REFINEMENTS):
            width = 0.15 / 2**refinement
            places = []
            for fold in range(FOLDS + 1):
                best = self.places[self.choose(fold, among_spread=True)]
                steps = self.random.normal(scale=width, size=(each, len(SPACE)))
                places += list(np.clip(best + steps, 0.0, 1.0))
            self._try([(self._learning(place), place) for place in places])

    def choose(self, fold: int, *, among_spread: bool = False) -> int:
        """Choose the best by the training trials of a fold; the last fold has all trials."""
        sums = [self._training(verdicts, fold) for verdicts in self.verdicts]
        errors = np.array([total.rms_m[0] for total in sums])
        within = np.array([total.within_percent[0, WITHIN] for total in sums])
        allowed = within >= within[0]
        if among_spread:
            allowed[0] = False
            if not allowed.any():
                allowed[1:] = True
        return int(np.where(allowed, errors, np.inf).argmin())

    def _training(self, verdicts: Sequence[Verdict], fold: int) -> Totals:
        return Totals(np.sum([verdict.training[fold].sums for verdict in verdicts], axis=0))

    def _try(self, candidates: Sequence[tuple[Learning, Array]]) -> None:
        self.tried += [learning for learning, _ in candidates]
        self.places += [place for _, place in candidates]
        self.verdicts += self.court.judge([Candidate(learning) for learning, _ in candidates])

    def _learning(self, place: Array) -> Learning:
        values: dict[str, Any] = {
            where.name: where.value(share) for where, share in zip(SPACE, place, strict=True)
        }
        scale, gain = values.pop('duration_scale'), values.pop('goal_velocity_gain')
        parameters = replace(self.default.parameters, **values)
        following = parameters.effective_damping * self.pace * scale
        parameters = replace(
            parameters, goal_velocity_gain=-1.0 if gain >= 1.0 else gain * following
        )
        return replace(self.default, parameters=parameters, duration_scale=scale)


def _compare(
    cases: Sequence[Case],
    splits: Sequence[Sequence[Split]],
    search: _Search,
    choices: Sequence[int],
    draws: Sequence[Array],
    learn: str,
) -> Comparison:
    """Compare the choice of each fold with the default, on the trials that the fold left out."""
    pairs = []
    for number, (case, parts) in enumerate(zip(cases, splits, strict=True)):
        default, tuned = np.zeros((len(case), 6)), np.zeros((len(case), 6))
        for part, choice in zip(parts, choices, strict=False):
            unseen = list(part.unseen)
            if not unseen:
                continue
            for table, which in ((default, 0), (tuned, choice)):
                if learn == 'single':
                    table[unseen] = search.verdicts[which][number].unseen[unseen]
                else:
                    candidate = Candidate(search.tried[which])
                    table[unseen] = learn_mean_unseen(case, part, candidate)
        pairs.append((default, tuned))
    once = [np.ones((1, len(case))) for case in cases]
    before, after = _sums(pairs, once)
    drawn_before, drawn_after = _sums(pairs, draws)
    gains = drawn_before.rms_m - drawn_after.rms_m
    changes = (drawn_after.within_percent - drawn_before.within_percent)[:, WITHIN]
    return Comparison(
        learn=learn,
        default=_worth(before),
        tuned=_worth(after),
        gain_m=float(before.rms_m[0] - after.rms_m[0]),
        gain_interval_m=interval(gains),
        within_change=float((after.within_percent - before.within_percent)[0, WITHIN]),
        within_change_interval=interval(changes),
    )


def _sums(pairs: Sequence[tuple[Array, Array]], draws: Sequence[Array]) -> Iterator[Totals]:
    """Sum the trials of all cases, before and after a change."""
    for tables in zip(*pairs, strict=True):
        parts = [counts @ table for table, counts in zip(tables, draws, strict=True)]
        yield Totals(np.sum(parts, axis=0))


def _worth(totals: Totals) -> Worth:
    return Worth(
        rms_m=float(totals.rms_m[0]),
        within=dict(zip(BANDS, totals.within_percent[0].tolist(), strict=True)),
        final_gap_m=float(totals.gap_m[0]),
    )


def _attempts(
    changes: Sequence[tuple[str, Candidate]], court: _Court, draws: Sequence[Array]
) -> list[Attempt]:
    """Change one thing at a time; the first is no change."""
    verdicts = court.judge([candidate for _, candidate in changes])
    once = [np.ones((1, len(case))) for case in court.cases]
    attempts = []
    for (what, _), cases in zip(changes, verdicts, strict=True):
        pairs = [(a.unseen, b.unseen) for a, b in zip(verdicts[0], cases, strict=True)]
        before, after = _sums(pairs, once)
        drawn_before, drawn_after = _sums(pairs, draws)
        attempts.append(
            Attempt(
                what,
                _worth(after),
                float(before.rms_m[0] - after.rms_m[0]),
                interval(drawn_before.rms_m - drawn_after.rms_m),
            )
        )
    return attempts


def _changes(default: Learning) -> Iterator[tuple[str, Candidate]]:
    parameters = default.parameters

    def changed(**values: Any) -> Candidate:
        return Candidate(replace(default, parameters=replace(parameters, **values)))

    yield 'the defaults', Candidate(default)
    for stiffness in (50.0, 100.0, 400.0):
        yield f'K = {stiffness:g}', changed(stiffness=stiffness)
    for mu in (0.5, 0.6, 0.9):
        yield f'μ = {mu:g}', changed(mu=mu)
    for sigma in (0.02, 0.1, 0.2, 0.3):
        yield f'σ = {sigma:g}', changed(sigma=sigma)
    yield 'μ = 0.65, σ = 0.2', changed(mu=0.65, sigma=0.2)
    for scale in (0.9, 0.95, 1.05, 1.1):
        yield f'τ × {scale:g}', Candidate(replace(default, duration_scale=scale))
    yield 'K_v = 0: ġ ignored', changed(goal_velocity_gain=0.0)
    for constant in (0.05, 0.1, 0.2):
        view = partial(smooth_velocity, time_constant_s=constant)
        yield f'ġ low-passed, {1e3 * constant:g} ms', Candidate(default, view=view)
    for constant in (0.05, 0.1):
        goal_view = partial(smooth_goal, time_constant_s=constant)
        yield f'g and ġ low-passed, {1e3 * constant:g} ms', Candidate(default, view=goal_view)
    for horizon in (0.05, 0.1):
        ahead = partial(looking_ahead, horizon_s=horizon)
        yield f'g {1e3 * horizon:g} ms ahead', Candidate(default, view=ahead)
    yield 'goal estimator (causal)', Candidate(default, view=estimated)
    yield 'goal offset: mean of the others', Candidate(default, common_offset=True)
