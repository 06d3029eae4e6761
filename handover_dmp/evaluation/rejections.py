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

"""
Why curves leave the band of people: which, when, by how much, and where the band is narrow.

Sections III.D and III.E of the paper read this from its figures: most rejected curves belong to
one dimension and are learnt from one or two demonstrations, and many leave the band where it is
narrower than 4 cm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.evaluation.cases import Case
from handover_dmp.evaluation.envelope import Envelope, ROUNDING_M
from handover_dmp.evaluation.scores import BANDS
import numpy as np

MIN_WIDTH_M = 0.04
"""The paper calls a band narrower than this a bottleneck."""
AXES = 'XYZ'

_K = BANDS[-1]


@dataclass(frozen=True)
class Rejection:
    """
    One curve that leaves the 3σ band.

    Attributes:
        sources: indices of the trials that it was learnt from.
        tested: index of the trial that it was rolled out against.
        dimension: 0, 1 or 2 for X, Y or Z.
        first: fraction of the duration at which it first leaves the band.
        worst: fraction of the duration at which it is farthest outside.
        beyond_m: largest distance outside the band, m.
        sigmas: least k for which it is within kσ.
        in_bottleneck: whether the band is narrower than the least width at `worst`.
        widened: whether a band that is widened to the least width still rejects it.

    """

    sources: tuple[int, ...]
    tested: int
    dimension: int
    first: float
    worst: float
    beyond_m: float
    sigmas: float
    in_bottleneck: bool
    widened: bool


@dataclass(frozen=True)
class Bottleneck:
    """
    Where the 3σ band of a case is narrowest in one dimension.

    Attributes:
        at: fraction of the duration.
        width_m: width from −3σ to 3σ, m.
        narrow: share of the duration in which the band is narrower than the least width.

    """

    at: float
    width_m: float
    narrow: float


@dataclass(frozen=True)
class Rejections:
    """
    The rejected curves of a case and one source of learning.

    Attributes:
        case: the trials.
        learn: source of learning.
        curves: number of tested curves, three per rollout.
        rejected: the curves that leave the band.
        outside: (samples, 3) number of curves outside, over time.
        widths_m: (samples, 3) width of the band from −3σ to 3σ, m.
        bottlenecks: bottlenecks of X, Y and Z.
        min_width_m: the least width, from −3σ to 3σ, m.

    """

    case: Case
    learn: str
    curves: int
    rejected: tuple[Rejection, ...]
    outside: Array
    widths_m: Array
    bottlenecks: tuple[Bottleneck, ...]
    min_width_m: float

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain types; trials by their numbers."""
        trials = self.case.trials
        return {
            'configuration': self.case.configuration,
            'exchange': self.case.direction,
            'learn': self.learn,
            'curves': self.curves,
            'min_width_m': self.min_width_m,
            'bottlenecks': {
                axis: asdict(neck) for axis, neck in zip(AXES, self.bottlenecks, strict=True)
            },
            'outside': dict(zip(AXES, self.outside.T.tolist(), strict=True)),
            'widths_m': dict(zip(AXES, self.widths_m.T.round(6).tolist(), strict=True)),
            'rejected': [
                {
                    'learnt': [trials[i].number for i in r.sources],
                    'tested': trials[r.tested].number,
                    'dimension': AXES[r.dimension],
                    'first': r.first,
                    'worst': r.worst,
                    'beyond_m': r.beyond_m,
                    'sigmas': r.sigmas if np.isfinite(r.sigmas) else None,
                    'in_bottleneck': r.in_bottleneck,
                    'rejected_when_widened': r.widened,
                }
                for r in self.rejected
            ],
        }


def excess(curves: Array, band: Envelope, min_width_m: float = 0.0) -> Array:
    """
    Measure how far curves are beyond the 3σ band.

    Args:
        curves: (n, samples, d) m.
        band: one for all, or one per curve.
        min_width_m: least width of the band, from −3σ to 3σ, m.

    Returns:
        (n, samples, d) m; above 0 outside.

    """
    half = np.maximum(_K * band.deviation, 0.5 * min_width_m)
    return np.asarray(np.abs(curves - band.mean) - half - ROUNDING_M)


def find_rejections(
    curves: Array, sources: tuple[int, ...], tested: Sequence[int], band: Envelope, width_m: float
) -> list[Rejection]:
    """
    Find the curves of one model that leave the band.

    Args:
        curves: (len(tested), samples, 3) m, time-normalised.
        sources: trials that the model was learnt from.
        tested: trials that it was rolled out against.
        band: one for all, or one per tested trial.
        width_m: the least width of the band, from −3σ to 3σ, m.

    Returns:
        The rejections, rollout by rollout.

    """
    beyond: Array = excess(curves, band)
    outside = np.asarray(beyond > 0.0)
    still = np.asarray((excess(curves, band, width_m) > 0.0).any(axis=1))
    narrow = np.broadcast_to(2 * _K * band.deviation < width_m, beyond.shape)
    sigmas = band.sigmas(curves)
    last = beyond.shape[1] - 1
    found = []
    for row, dimension in np.argwhere(outside.any(axis=1)).tolist():
        over = beyond[row, :, dimension]
        worst = int(over.argmax())
        found.append(
            Rejection(
                sources=sources,
                tested=tested[row],
                dimension=dimension,
                first=float(outside[row, :, dimension].argmax() / last),
                worst=worst / last,
                beyond_m=float(over[worst]),
                sigmas=float(sigmas[row, dimension]),
                in_bottleneck=bool(narrow[row, worst, dimension]),
                widened=bool(still[row, dimension]),
            )
        )
    return found


def band_widths(band: Envelope) -> Array:
    """
    Measure the width of a band.

    Args:
        band: band of a case.

    Returns:
        (samples, 3) from −3σ to 3σ, m.

    """
    return np.asarray(2 * _K * band.deviation)


def bottlenecks(widths_m: Array, width_m: float) -> tuple[Bottleneck, ...]:
    """
    Find where a band is narrowest.

    Args:
        widths_m: (samples, 3) result of `band_widths`.
        width_m: the least width, from −3σ to 3σ, m.

    Returns:
        One for each dimension.

    """
    at = widths_m.argmin(axis=0)
    last = len(widths_m) - 1
    return tuple(
        Bottleneck(int(i) / last, float(column[i]), float((column < width_m).mean()))
        for i, column in zip(at, widths_m.T, strict=True)
    )
