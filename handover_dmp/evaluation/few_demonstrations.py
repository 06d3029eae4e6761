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

"""Distance of a movement to people, by the number of demonstrations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.common.files import replacing
from handover_dmp.evaluation.bootstrap import draw_samples, interval
from handover_dmp.evaluation.cases import Case
from handover_dmp.evaluation.rollouts import curves_of, Learning, RolloutTask
from handover_dmp.evaluation.table import TITLES
from handover_dmp.tracking.partner_model import PartnerOptions
from joblib import delayed, Parallel
from matplotlib.figure import Figure
import numpy as np

COUNTS = (1, 2, 3, 4, 6)
METHODS = ('decoupled', 'partner_model')
_COLOURS = {'decoupled': '#8a929c', 'partner_model': '#1f5fb4'}
_ROUNDS = 2000


@dataclass(frozen=True)
class LearningCurve:
    """
    Distance to people by the number of demonstrations.

    Attributes:
        counts: numbers of demonstrations.
        rms_m: by method, root-mean-square distance at each number, m, (len(counts),).
        interval_m: by method, its 95 % interval from resampled trials, m, (len(counts), 2).
        trials: number of tested trials.
        rollouts: number of rollouts of each method at each number.

    """

    counts: tuple[int, ...]
    rms_m: dict[str, Array]
    interval_m: dict[str, Array]
    trials: int
    rollouts: int


def few_demonstrations(
    cases: Sequence[Case],
    *,
    counts: Sequence[int] = COUNTS,
    draws: int = 7,
    learning: Learning | None = None,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> LearningCurve:
    """
    Learn the mean of a few trials, and roll out against one that was left out.

    Every trial of a case serves as a test. At each number of demonstrations every trial serves
    equally often as a demonstration: they are chosen round robin, starting after the tested one.

    Args:
        cases: the cases; those with too few trials for the largest number are left out.
        counts: numbers of demonstrations, rising.
        draws: choices of demonstrations for each tested trial.
        learning: how to learn; always includes the partner model.
        jobs: number of processes; −1 for one per processor. The result does not depend on it.
        progress: called with the number of finished cases and of all cases.

    Returns:
        The distances.

    Raises:
        DataError: no case has enough trials.

    """
    large = [case for case in cases if len(case) > max(counts)]
    if not large:
        raise DataError(f'no case has the {max(counts) + 1} trials that are needed')
    learning = learning or Learning(partner=PartnerOptions())
    run = Parallel(n_jobs=jobs, return_as='generator')
    squares: list[Array] = []  # of each case: (methods, counts, draws, trials)
    for square in run(delayed(_squares)(case, counts, draws, learning) for case in large):
        squares.append(square)
        if progress is not None:
            progress(len(squares), len(large))
    seeds = np.random.SeedSequence(0).spawn(len(large))
    weights = [
        draw_samples(len(case), seed, _ROUNDS) for case, seed in zip(large, seeds, strict=True)
    ]
    means = [square.mean(axis=2) for square in squares]
    trials = sum(map(len, large))
    plain = sum(mean.sum(axis=-1) for mean in means) / trials
    drawn = sum(
        np.einsum('mct,rt->mcr', mean, weight) for mean, weight in zip(means, weights, strict=True)
    )
    spread = np.sqrt(np.asarray(drawn) / trials)
    return LearningCurve(
        tuple(counts),
        {name: np.sqrt(plain[index]) for index, name in enumerate(METHODS)},
        {
            name: np.array([interval(each) for each in spread[index]])
            for index, name in enumerate(METHODS)
        },
        trials,
        trials * draws,
    )


def _squares(case: Case, counts: Sequence[int], draws: int, learning: Learning) -> Array:
    """Return the mean squared distance of each rollout, (methods, counts, draws, trials)."""
    found = np.zeros((len(METHODS), len(counts), draws, len(case)))
    for method, name in enumerate(METHODS):
        for place, count in enumerate(counts):
            for draw, task in _tasks(len(case), count, draws):
                curve = curves_of(case, task, name, learning)[0]
                (tested,) = task.tested
                away = ((curve - case.curves[tested]) ** 2).sum(axis=-1).mean()
                found[method, place, draw, tested] = away
    return found


def _tasks(trials: int, count: int, draws: int) -> Iterator[tuple[int, RolloutTask]]:
    for tested in range(trials):
        for draw in range(draws):
            # first consecutive trials, then every second one, and so on
            step, first = 1 + draw // (trials - 1), draw % (trials - 1)
            places = [(first + step * k) % (trials - 1) for k in range(count)]
            if len(set(places)) < count:
                places = [(first + k) % (trials - 1) for k in range(count)]
            sources = tuple(sorted((tested + 1 + place) % trials for place in places))
            yield draw, RolloutTask(0, sources, (tested,))


def draw_learning_curve(curve: LearningCurve, path: Path) -> None:
    """
    Draw distance against number of demonstrations.

    Args:
        curve: the curve.
        path: image file; its suffix sets the format.

    """
    figure = Figure(figsize=(7.2, 4.2), layout='constrained')
    axes = figure.subplots()
    for shift, name in zip((-0.04, 0.04), METHODS, strict=True):
        low, high = 1e3 * curve.interval_m[name].T
        middle = 1e3 * curve.rms_m[name]
        at = np.array(curve.counts) + shift
        axes.errorbar(
            at,
            middle,
            yerr=(middle - low, high - middle),
            color=_COLOURS[name],
            marker='o',
            lw=2.0,
            elinewidth=1.0,
            capsize=3.0,
            label=TITLES[name],
        )
    axes.set_xticks(curve.counts)
    axes.set_xlabel('demonstrations')
    axes.set_ylabel('distance to P2 (RMS) / mm')
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.25)
    axes.spines[['top', 'right']].set_visible(False)
    axes.legend(frameon=False)
    axes.set_title(
        f'{curve.trials} handovers, unseen by the model; learn mean; bars: 95 % interval',
        fontsize=11,
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=110)
