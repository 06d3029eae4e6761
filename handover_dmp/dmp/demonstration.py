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

"""A recorded motion prepared for learning: evenly sampled, with its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


MIN_SAMPLES = 4
DEGREE = 5


@dataclass(frozen=True, eq=False)
class Demonstration:
    """
    A motion over normalised time, t/τ.

    Attributes:
        duration_s: τ, s.
        samples: number of samples in the recording.
        u: t/τ, from 0 to 1, (n,).
        position: x, m, (n, d).
        velocity: v = τẋ, m, (n, d).
        acceleration: τv̇ = τ²ẍ, m, (n, d).

    """

    duration_s: float
    samples: int
    u: Array
    position: Array
    velocity: Array
    acceleration: Array


def demonstrate(times: ArrayLike, positions: ArrayLike, count: int) -> Demonstration:
    """
    Sample a recorded motion evenly and differentiate it.

    A quintic spline interpolates the samples, so their stamps need not be even, and the motion
    need not begin or end at rest. Noise is not reduced: filter noisy recordings first.

    Args:
        times: s, (n,), rising.
        positions: m, (n, d).
        count: number of samples of the result.

    Returns:
        The demonstration.

    Raises:
        DataError: there are too few samples, the times do not increase, or a number is not finite.

    """
    stamps, spline = _spline(times, positions)
    duration = float(stamps[-1] - stamps[0])
    u = np.linspace(0.0, 1.0, count)
    velocity = spline.derivative()
    at = np.clip(stamps[0] + duration * u, stamps[0], stamps[-1])
    return Demonstration(
        duration,
        stamps.size,
        u,
        spline(at),
        duration * velocity(at),
        duration**2 * velocity.derivative()(at),
    )


def mean_motion(
    demonstrations: Sequence[tuple[ArrayLike, ArrayLike]], count: int
) -> tuple[Array, Array]:
    """
    Average motions after scaling them to the same duration (the paper's *learn mean*).

    Args:
        demonstrations: times, s, (n,), and positions, m, (n, d), of each; n may differ.
        count: number of samples of the result.

    Returns:
        Times from 0 to the mean duration, s, (count,), and mean positions, m, (count, d).

    Raises:
        DataError: there is no demonstration, one cannot be used, or their dimensions differ.

    """
    if not demonstrations:
        raise DataError('no demonstration to learn from')
    motions = [demonstrate(times, positions, count) for times, positions in demonstrations]
    if len({motion.position.shape[1] for motion in motions}) != 1:
        raise DataError('the demonstrations have different numbers of dimensions')
    duration = float(np.mean([motion.duration_s for motion in motions]))
    return motions[0].u * duration, np.mean([motion.position for motion in motions], axis=0)


def _spline(times: ArrayLike, positions: ArrayLike) -> tuple[Array, BSpline]:
    # imported here: it takes half a second, and a node that only loads a model does not need it
    from scipy.interpolate import make_interp_spline

    stamps, points = np.asarray(times, dtype=float), np.asarray(positions, dtype=float)
    if stamps.ndim != 1 or points.ndim != 2 or len(points) != stamps.size or not points.size:
        raise DataError(
            f'times {stamps.shape} and positions {points.shape} instead of (n,) and (n, d)'
        )
    if stamps.size < MIN_SAMPLES:
        raise DataError(
            f'a demonstration has {stamps.size} samples; at least {MIN_SAMPLES} are needed'
        )
    if not (np.isfinite(stamps).all() and np.isfinite(points).all()):
        raise DataError('the demonstration holds a number that is not finite')
    if (np.diff(stamps) <= 0.0).any():
        raise DataError('the times of the demonstration do not increase')
    degree = min(DEGREE, stamps.size - 1)
    return stamps, make_interp_spline(stamps, points, k=degree - 1 + degree % 2)
