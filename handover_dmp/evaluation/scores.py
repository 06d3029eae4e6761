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

"""What one rollout is worth: inside the band or not, how far off, how wide the gap at the end."""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.evaluation.bootstrap import interval
from handover_dmp.evaluation.envelope import Array, Envelope
import numpy as np
from numpy.typing import NDArray

BANDS = (1, 2, 3)
"""The k of the kσ bands in Table I."""


@dataclass(frozen=True)
class Scores:
    """
    The rollouts of one method in one case, each judged by itself.

    Rollouts stand in a table: one row a model, one column a tested trial. A method with a model a
    learnt trial has as many rows as columns; any other method has one row.

    Attributes:
        sigmas: (models, trials, d) least k at which each curve is within kσ.
        squared_m2: (models, trials) mean over the samples of the squared distance to what P2 did.
        gap_m: (models, trials) distance at the end to where P2 was.
        counted: (models, trials) whether the protocol counts this pair.

    """

    sigmas: Array
    squared_m2: Array
    gap_m: Array
    counted: NDArray[np.bool_]

    @property
    def curves(self) -> int:
        """Return the number of curves: three a rollout."""
        return int(self.counted.sum() * self.sigmas.shape[-1])

    @property
    def measures(self) -> Array:
        """(6, models, trials) what `Totals` sums up, of each rollout; 0 where not counted."""
        shares = [(self.sigmas <= k).mean(axis=-1) for k in BANDS]
        measures = np.stack([*shares, self.squared_m2, self.gap_m, np.ones_like(self.gap_m)])
        return np.where(self.counted, measures, 0.0)

    def totals(self, counts: Array) -> Totals:
        """
        Add the rollouts up, each as often as its trials were drawn.

        A rollout of a method with one model counts c_j times. Where each trial i has a model, a
        rollout of it against trial j counts c_i·c_j times, and one against its own trial c_i
        times; the former are scaled so that they keep their share. Without that, a trial that is
        drawn twice would meet itself in the guise of another, and the interval would lie beside
        the figure.

        Args:
            counts: (rounds, trials) how often each trial was drawn; ones for the data as they are.

        Returns:
            The sums, one a round; NaN where one trial alone was drawn and no pair is left.

        """
        if len(self.gap_m) == 1:
            return Totals(np.einsum('mj,bj->bm', self.measures[:, 0], counts))
        trials = counts.shape[1]
        own = np.einsum('mii,bi->bm', self.measures, counts)
        pairs = [((counts @ measure) * counts).sum(axis=1) for measure in self.measures]
        others = np.stack(pairs, axis=1) - np.einsum('mii,bi->bm', self.measures, counts**2)
        drawn = trials**2 - (counts**2).sum(axis=1, keepdims=True)
        with np.errstate(invalid='ignore', divide='ignore'):
            return Totals(own + others * (trials * (trials - 1) / drawn))


@dataclass(frozen=True)
class Totals:
    """
    Sums over rollouts, which can be added over cases.

    Attributes:
        sums: (rounds, 6): rollouts within 1σ, 2σ and 3σ (each curve a third), squared distance in
            m², final gap in m, number of rollouts.

    """

    sums: Array

    def __add__(self, other: Totals) -> Totals:
        return Totals(self.sums + other.sums)

    @property
    def within_percent(self) -> Array:
        """Return (rounds, 3) percentage of curves within 1σ, 2σ, 3σ; NaN without rollouts."""
        return 100.0 * self._mean(slice(0, len(BANDS)))

    @property
    def rms_m(self) -> Array:
        """Return (rounds,) root-mean-square distance in m."""
        return np.sqrt(self._mean(slice(len(BANDS), len(BANDS) + 1))[:, 0])

    @property
    def gap_m(self) -> Array:
        """Return (rounds,) mean final gap in m."""
        return self._mean(slice(len(BANDS) + 1, len(BANDS) + 2))[:, 0]

    def _mean(self, columns: slice) -> Array:
        with np.errstate(invalid='ignore', divide='ignore'):
            return self.sums[:, columns] / self.sums[:, -1:]


@dataclass(frozen=True)
class Summary:
    """
    The figures of one row of the table.

    Attributes:
        within: k to percentage of curves within kσ.
        within_interval: k to its 95 % interval.
        rms_m: root-mean-square distance, m.
        rms_interval_m: its 95 % interval, m.
        final_gap_m: mean gap at the end, m.

    """

    within: dict[int, float]
    within_interval: dict[int, tuple[float, float]]
    rms_m: float
    rms_interval_m: tuple[float, float]
    final_gap_m: float

    @classmethod
    def of(cls, totals: Totals, draws: Totals) -> Summary:
        """
        Turn sums into figures with intervals.

        Args:
            totals: sums over the data as they are, one round.
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
        )


def judge(
    curves: Array,
    references: Array,
    envelope: Envelope,
    counted: NDArray[np.bool_] | None = None,
) -> Scores:
    """
    Judge the rollouts of one or of several models.

    Args:
        curves: (models, trials, samples, d) m, time-normalised.
        references: (trials, samples, d) m, what they are held against, time-normalised.
        envelope: the band, one for all trials or one a trial.
        counted: (models, trials) whether the protocol counts the pair; all if left out.

    Returns:
        The scores.

    """
    distances = ((curves - references) ** 2).sum(axis=-1)
    everything = np.ones(curves.shape[:2], dtype=np.bool_)
    return Scores(
        sigmas=envelope.sigmas(curves),
        squared_m2=distances.mean(axis=-1),
        gap_m=np.sqrt(distances[..., -1]),
        counted=everything if counted is None else counted,
    )
