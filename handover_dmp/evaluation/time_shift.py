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
How much of a distance is time and not position: the shift in time that fits a motion best.

A motion that is right but a little late is far from its reference all the time. Each motion is
therefore shifted in time as a whole, y(u + d), to the least distance from its reference: d is the
lateness, and the rest is the distance in position. Before its start and after its end a motion
stands still, so that no sample is lost and a shift with little overlap has no advantage.
"""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.common.arrays import Array
import numpy as np
from numpy.typing import NDArray

MAX_SHIFT = 0.5
"""Largest shift to either side, as a share of the duration."""

_COARSE = 4


@dataclass(frozen=True)
class TimeShift:
    """
    The best shift in time of some motions.

    Attributes:
        lateness: (...) d, the lateness of each, as a share of its duration; negative: early.
        squared_m2: (...) remaining mean squared distance, m².

    """

    lateness: Array
    squared_m2: Array


def best_time_shift(curves: Array, references: Array) -> TimeShift:
    """
    Shift each motion in time as a whole, to the least distance from its reference.

    Args:
        curves: (..., samples, d) m, evenly spaced in time over the duration.
        references: (..., samples, d) m, of the same durations; broadcast against the curves.

    Returns:
        The shift with the least mean squared distance, and that distance; of equal ones, the
        smallest shift.

    """
    references = np.broadcast_to(references, curves.shape)
    count = curves.shape[-2]
    farthest = round(MAX_SHIFT * (count - 1) / _COARSE)
    steps = np.array(sorted(range(-farthest, farthest + 1), key=abs))
    thin = _errors(curves[..., ::_COARSE, :], references[..., ::_COARSE, :], steps)
    coarse = _COARSE * steps[thin.argmin(axis=0)]
    near = np.array(sorted(range(-_COARSE, _COARSE + 1), key=abs))
    shifts = coarse[None] + near.reshape(-1, *[1] * coarse.ndim)
    errors = np.stack([_error(curves, references, shift) for shift in shifts])
    chosen = errors.argmin(axis=0)
    shift = np.take_along_axis(shifts, chosen[None], axis=0)[0]
    lowest = np.take_along_axis(errors, chosen[None], axis=0)[0]
    # a parabola through the minimum and its neighbours gives the shift between two samples
    before, after = (_error(curves, references, shift + side) for side in (-1, 1))
    bend = before + after - 2.0 * lowest
    slope = 0.5 * (after - before)
    with np.errstate(divide='ignore', invalid='ignore'):
        between = np.where(bend > 0.0, np.clip(-slope / bend, -0.5, 0.5), 0.0)
    limit = MAX_SHIFT * (count - 1)
    lateness = np.clip(shift + between, -limit, limit) / (count - 1)
    remaining = np.maximum(lowest + between * (slope + 0.5 * bend * between), 0.0)
    return TimeShift(np.asarray(lateness), np.asarray(remaining))


def _errors(curves: Array, references: Array, steps: NDArray[np.int_]) -> Array:
    """Return the mean squared distances for common shifts of all curves, (steps, ...)."""
    count = curves.shape[-2]
    moved = (np.clip(np.arange(count) + step, 0, count - 1) for step in steps)
    return np.stack(
        [((curves[..., at, :] - references) ** 2).sum(axis=-1).mean(axis=-1) for at in moved]
    )


def _error(curves: Array, references: Array, shift: NDArray[np.int_]) -> Array:
    """Return the mean squared distance for one shift per curve, (...)."""
    count = curves.shape[-2]
    at = np.clip(shift[..., None] + np.arange(count), 0, count - 1)
    moved = np.take_along_axis(curves, at[..., None], axis=-2)
    return np.asarray(((moved - references) ** 2).sum(axis=-1).mean(axis=-1))
