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

"""Scores of rollouts: inside the band or not, distance, gap at the end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.evaluation.bootstrap import interval
from handover_dmp.evaluation.envelope import Envelope
from handover_dmp.evaluation.time_shift import best_time_shift
import numpy as np
from numpy.typing import NDArray

BANDS = (1, 2, 3)
"""The k of the kσ bands in Table I."""

_SQUARED, _GAP, _COUNT, _SHIFTED, _LATE, _LATE_SQUARED = range(len(BANDS), len(BANDS) + 6)


@dataclass(frozen=True)
class Scores:
    """
    The scores of the rollouts of one method in one case.

    The arrays have one row per model and one column per tested trial. A method with one model per
    learnt trial has as many rows as columns; any other method has one row.

    Attributes:
        sigmas: (models, trials, d) least k for which each curve is within kσ.
        squared_m2: (models, trials) mean squared distance to P2 over the samples, m².
        gap_m: (models, trials) distance to P2 at the end, m.
        counted: (models, trials) whether the protocol counts this pair.
        shifted_m2: (models, trials) squared distance after the best shift in time, m²; None if
            no shift was computed.
        lateness_s: (models, trials) that shift, s; negative if the rollout is early.

    """

    sigmas: Array
    squared_m2: Array
    gap_m: Array
    counted: NDArray[np.bool_]
    shifted_m2: Array | None = None
    lateness_s: Array | None = None

    @classmethod
    def blank(cls, models: int, trials: int) -> Scores:
        """
        Make a table in which nothing counts yet.

        Args:
            models: number of rows.
            trials: number of columns.

        Returns:
            Zeros, with shifts in time.

        """
        shape = models, trials
        gap, squared, shifted, lateness = np.zeros((4, *shape))
        counted = np.zeros(shape, dtype=np.bool_)
        return cls(np.zeros((*shape, 3)), squared, gap, counted, shifted, lateness)

    def enter(self, row: int, trials: Sequence[int], scores: Scores) -> None:
        """
        Enter the scores of one model.

        Args:
            row: row of the model.
            trials: columns of its trials.
            scores: one row for these trials, with shifts in time.

        """
        for field in fields(self):
            getattr(self, field.name)[row, list(trials)] = getattr(scores, field.name)[0]

    @property
    def curves(self) -> int:
        """Return the number of curves: three per rollout."""
        return int(self.counted.sum() * self.sigmas.shape[-1])

    @property
    def measures(self) -> Array:
        """(6 or 9, models, trials) summands of `Totals`, 0 for rollouts that do not count."""
        measures = [(self.sigmas <= k).mean(axis=-1) for k in BANDS]
        measures += [self.squared_m2, self.gap_m, np.ones_like(self.gap_m)]
        if self.shifted_m2 is not None and self.lateness_s is not None:
            measures += [self.shifted_m2, self.lateness_s, self.lateness_s**2]
        return np.where(self.counted, np.stack(measures), 0.0)

    def totals(self, counts: Array) -> Totals:
        """
        Sum the rollouts, each as often as its trials were drawn.

        For a method with one model, a rollout against trial j counts c_j times. If each trial i
        has a model, its rollout against trial j counts c_i·c_j times, and against its own trial
        c_i times; the former are scaled to keep their share. Otherwise a trial that is drawn twice
        would be paired with itself as if it were another, and the interval would be biased.

        Args:
            counts: (rounds, trials) number of draws of each trial; ones for the data as they are.

        Returns:
            The sums, one per round; NaN if a round drew a single trial and no pair is left.

        """
        if len(self.gap_m) == 1:
            return Totals(np.einsum('mj,bj->bm', self.measures[:, 0], counts))
        trials = counts.shape[1]
        own = np.einsum('mii,bi->bm', self.measures, counts)
        pairs = [((counts @ measure) * counts).sum(axis=1) for measure in self.measures]
        others = np.stack(pairs, axis=1) - np.einsum('mii,bi->bm', self.measures, counts**2)
        drawn = trials**2 - (counts**2).sum(axis=1, keepdims=True)
        # without a pair, what is left of the difference is a rounding error
        share = trials * (trials - 1) / np.where(drawn > 0, drawn, np.nan)
        return Totals(own + others * share)

    def by_trial(self) -> Totals:
        """Sum the rollouts against each trial: one row per trial instead of per round."""
        return Totals(self.measures.sum(axis=1).T)


@dataclass(frozen=True)
class Totals:
    """
    Sums over rollouts, which can be added over cases.

    Attributes:
        sums: (rounds, 6): rollouts within 1σ, 2σ and 3σ (each curve a third), squared distance in
            m², final gap in m, number of rollouts; with shifts in time, (rounds, 9): also squared
            distance after the best shift in m², that shift in s, its square in s².

    """

    sums: Array

    def __add__(self, other: Totals) -> Totals:
        return Totals(self.sums + other.sums)

    @property
    def within_percent(self) -> Array:
        """Return (rounds, 3) percentage of curves within 1σ, 2σ, 3σ; NaN without rollouts."""
        return 100.0 * np.stack([self._mean(column) for column in range(len(BANDS))], axis=1)

    @property
    def rms_m(self) -> Array:
        """Return (rounds,) root-mean-square distance in m."""
        return np.sqrt(self._mean(_SQUARED))

    @property
    def gap_m(self) -> Array:
        """Return (rounds,) mean final gap in m."""
        return self._mean(_GAP)

    @property
    def shifted_rms_m(self) -> Array:
        """Return (rounds,) root-mean-square distance after the best shift in time, m."""
        return np.sqrt(self._mean(_SHIFTED))

    @property
    def lateness_s(self) -> Array:
        """Return (rounds,) mean of that shift, s; positive if the rollouts are late."""
        return self._mean(_LATE)

    @property
    def lateness_deviation_s(self) -> Array:
        """Return (rounds,) standard deviation of that shift, s."""
        variance = self._mean(_LATE_SQUARED) - self.lateness_s**2
        return np.sqrt(np.maximum(variance, 0.0))

    def as_json(self, row: int = 0) -> dict[str, Any]:
        """
        Return the means of one row as plain types.

        Args:
            row: the row.

        Returns:
            Percentages within 1σ, 2σ and 3σ; distance, final gap and distance after the best
            shift in time, m; that shift, s.

        """
        return {
            'within': dict(zip(map(str, BANDS), self.within_percent[row].tolist(), strict=True)),
            'rms_m': float(self.rms_m[row]),
            'final_gap_m': float(self.gap_m[row]),
            'shifted_rms_m': float(self.shifted_rms_m[row]),
            'lateness_s': float(self.lateness_s[row]),
        }

    def _mean(self, column: int) -> Array:
        if column >= self.sums.shape[1]:
            return np.full(len(self.sums), np.nan)
        with np.errstate(invalid='ignore', divide='ignore'):
            return np.asarray(self.sums[:, column] / self.sums[:, _COUNT])


@dataclass(frozen=True)
class Summary:
    """
    The figures of one row of the table.

    Attributes:
        within: by k, percentage of curves within kσ.
        within_interval: by k, its 95 % interval.
        rms_m: root-mean-square distance, m.
        rms_interval_m: its 95 % interval, m.
        final_gap_m: mean gap at the end, m.
        shifted_rms_m: root-mean-square distance after the best shift in time of each rollout, m.
        lateness_s: mean of these shifts, s; positive if the method is late.
        lateness_deviation_s: their standard deviation, s.

    """

    within: dict[int, float]
    within_interval: dict[int, tuple[float, float]]
    rms_m: float
    rms_interval_m: tuple[float, float]
    final_gap_m: float
    shifted_rms_m: float
    lateness_s: float
    lateness_deviation_s: float

    @classmethod
    def of(cls, totals: Totals, draws: Totals) -> Summary:
        """
        Compute the figures and their intervals from sums.

        Args:
            totals: sums over the original data, one round.
            draws: sums over resampled trials, many rounds.

        Returns:
            The figures.

        """
        within, drawn = totals.within_percent[0], draws.within_percent
        return cls(
            within={k: float(within[c]) for c, k in enumerate(BANDS)},
            within_interval={k: interval(drawn[:, c]) for c, k in enumerate(BANDS)},
            rms_m=float(totals.rms_m[0]),
            rms_interval_m=interval(draws.rms_m),
            final_gap_m=float(totals.gap_m[0]),
            shifted_rms_m=float(totals.shifted_rms_m[0]),
            lateness_s=float(totals.lateness_s[0]),
            lateness_deviation_s=float(totals.lateness_deviation_s[0]),
        )


def judge(
    curves: Array,
    references: Array,
    envelope: Envelope,
    counted: NDArray[np.bool_] | None = None,
    *,
    durations_s: Array | None = None,
) -> Scores:
    """
    Score the rollouts of one or several models.

    Args:
        curves: (models, trials, samples, d) m, time-normalised.
        references: (trials, samples, d) m, reference curves, time-normalised.
        envelope: the band, one for all trials or one per trial.
        counted: (models, trials) whether the protocol counts the pair; default: all.
        durations_s: (trials,) s; if given, the lateness of each rollout is computed, too.

    Returns:
        The scores.

    """
    distances = ((curves - references) ** 2).sum(axis=-1)
    everything = np.ones(curves.shape[:2], dtype=np.bool_)
    shifted = lateness = None
    if durations_s is not None:
        shift = best_time_shift(curves, references)
        shifted, lateness = shift.squared_m2, shift.lateness * durations_s
    return Scores(
        sigmas=envelope.sigmas(curves),
        squared_m2=distances.mean(axis=-1),
        gap_m=np.sqrt(distances[..., -1]),
        counted=everything if counted is None else counted,
        shifted_m2=shifted,
        lateness_s=lateness,
    )
