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
Search for the lag that fits best, robust against outliers.

For each lag of a grid, the best transform is found by least trimmed squares (P. Rousseeuw, K. Van
Driessen, Data Min. Knowl. Discov. 12, 2006): the best of several rigid fits (Kabsch) to random
samples of poses is refined by refitting to the share of all poses that it fits best. The fit is
linear, p = A·y + t − R·m, with any matrix A instead of a rotation. So it is also exact for the
marker's offset m, and A reveals a mirrored frame or another unit of length.
"""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.mocap.body_path import BodyPath
from handover_dmp.tracking.reference_path import ReferencePath
import numpy as np
from numpy.typing import NDArray

STEP_S = 0.04
MAX_SAMPLES = 250
HANDFULS = 16
HANDFUL = 4
REFITS = 6
KEPT = 0.6
"""Share of the poses that is fitted; all others may be wrong."""
MIN_OVERLAP = 0.4
"""Minimum share of the poses within the other path at a lag, of those that can be."""
MAX_LAGS = 20_000


@dataclass(frozen=True, eq=False)
class LagSearch:
    """
    Result of the search.

    Attributes:
        lags: (k,) s.
        errors: (k,) m, root mean square over the best share of the poses at each lag; infinite
            if the paths hardly overlap.
        best_s: the lag that fits best, s.
        matrix: (3, 3), from the tracker's positions to those of the reference, at that lag.
        inside: (n,) indices of the tracker's poses that were fitted.

    """

    lags: Array
    errors: Array
    best_s: float
    matrix: Array
    inside: NDArray[np.intp]


def search_lag(
    reference: ReferencePath, tracker: BodyPath, centre_s: float, reach_s: float
) -> LagSearch:
    """
    Find the lag of a tracker.

    Args:
        reference: the known path.
        tracker: the path of the same body with unknown delay and frame.
        centre_s: centre of the search, s; positive: stamped too late.
        reach_s: range to either side, s.

    Returns:
        The lag, and the fit at that lag.

    Raises:
        DataError: the paths do not overlap in time.

    """
    count = min(2 * int(np.ceil(reach_s / STEP_S)) + 1, MAX_LAGS)
    lags = centre_s + np.linspace(-reach_s, reach_s, count)
    chosen = np.unique(np.linspace(0, len(tracker.times) - 1, MAX_SAMPLES).round().astype(np.intp))
    times, seen = tracker.times[chosen], tracker.positions[chosen]
    random = np.random.default_rng(0)
    handfuls = random.random((HANDFULS, len(chosen)))
    masks = [reference.known(times - lag) for lag in lags]
    most = max(int(mask.sum()) for mask in masks)
    fewest = max(MIN_OVERLAP * most, 3 * HANDFUL)
    errors = np.full(count, np.inf)
    fits: dict[int, tuple[Array, NDArray[np.intp]]] = {}
    for k, (lag, mask) in enumerate(zip(lags, masks, strict=True)):
        if mask.sum() < fewest:
            continue
        at = times[mask] - lag
        errors[k], matrix, kept = _trimmed(
            reference.positions(at),
            reference.rotations(at) if reference.turns else None,
            seen[mask],
            handfuls[:, mask],
        )
        fits[k] = matrix, chosen[np.flatnonzero(mask)[kept]]
    best = int(errors.argmin())
    if best not in fits:
        raise DataError(
            f'{tracker.label}: does not overlap in time with the reference within {reach_s:g} s: '
            'increase --max-delay, or check that both are of one recording'
        )
    return LagSearch(lags, errors, float(lags[best]), *fits[best])


def kabsch(known: Array, seen: Array) -> tuple[Array, Array]:
    """
    Fit rigid transforms to several sets of points at once (W. Kabsch, Acta Cryst. A 32, 1976).

    Args:
        known: (b, n, 3) m.
        seen: (b, n, 3) m, the same points in another frame.

    Returns:
        Rotations (b, 3, 3) and translations (b, 3), m, from `seen` to `known`.

    """
    known_middle, seen_middle = known.mean(axis=1), seen.mean(axis=1)
    product = np.swapaxes(known - known_middle[:, None], 1, 2) @ (seen - seen_middle[:, None])
    left, _, right = np.linalg.svd(product)
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    rotations = left @ right
    return rotations, known_middle - np.einsum('bij,bj->bi', rotations, seen_middle)


def _trimmed(
    known: Array, turns: Array | None, seen: Array, handfuls: Array
) -> tuple[float, Array, NDArray[np.intp]]:
    """Fit the best share of the poses; return its error, the matrix and the poses."""
    share = max(int(KEPT * len(seen)), HANDFUL)
    picked = np.argpartition(handfuls, HANDFUL, axis=1)[:, :HANDFUL]
    rotations, shifts = kabsch(known[picked], seen[picked])
    off = known - (seen @ np.swapaxes(rotations, 1, 2) + shifts[:, None])
    squares = np.square(off).sum(axis=2)
    kept = np.partition(squares, share - 1, axis=1)[:, :share].sum(axis=1)
    inside = np.argpartition(squares[kept.argmin()], share - 1)[:share]
    design = np.zeros((len(seen), 3, 12 if turns is None else 15))
    design[:, range(3), range(9, 12)] = 1.0
    for row in range(3):
        design[:, row, 3 * row: 3 * row + 3] = seen - seen.mean(axis=0)  # fmt: skip
    if turns is not None:
        design[:, :, 12:] = -turns
    for _ in range(REFITS):
        part = design[inside].reshape(-1, design.shape[2])
        fit = np.linalg.lstsq(part, known[inside].ravel(), rcond=1e-6)[0]
        squares = np.square(known - design @ fit).sum(axis=1)
        inside = np.argpartition(squares, share - 1)[:share]
    error = float(np.sqrt(squares[inside].mean()))
    return error, np.asarray(fit[:9].reshape(3, 3), dtype=np.float64), inside
