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
How the wrists of a recording are turned, where it tells: unit quaternions x, y, z, w.

Beside the positions, and optional: what has none is a recording all the same.
"""

from __future__ import annotations

from handover_dmp.common.arrays import Array
from handover_dmp.common.quaternions import (
    from_matrices,
    multiply_all,
    with_continuous_signs,
)
from handover_dmp.mocap.up_axis import turn_up
import numpy as np
from numpy.typing import ArrayLike

Array = Array

AXES_OF_TURN = ('qx', 'qy', 'qz', 'qw')
NORM_TOLERANCE = 0.01
"""By how much the norm may differ from 1, as that of numbers with few digits does."""
UNIT = 1e-9
"""A norm that differs by less is 1 but for rounding."""
JUMP_RAD = 1.0
JUMP_RAD_PER_S = 60.0
"""No wrist turns this far from one sample to the next this fast: the body was mistaken."""


def orientation_fault(times: Array, quaternions: Array) -> tuple[int, str] | None:
    """
    Find the first reason why quaternions cannot be those of one wrist.

    Args:
        times: (n,) s.
        quaternions: (n, 4).

    Returns:
        Index of the sample and the fault in words; None where there is none.

    """
    finite = np.isfinite(quaternions).all(axis=1)
    if not finite.all():
        return int(np.argmin(finite)), 'an orientation is not a finite number'
    norms = np.linalg.norm(quaternions, axis=1)
    wrong = np.abs(norms - 1.0) > NORM_TOLERANCE
    if wrong.any():
        row = int(np.argmax(wrong))
        return row, f'a quaternion of norm {norms[row]:.3g} instead of 1'
    unit = quaternions / norms[:, None]
    cosine = np.abs(np.einsum('ij,ij->i', unit[1:], unit[:-1]))
    angles = 2.0 * np.arccos(np.minimum(cosine, 1.0))
    jumps = (angles > JUMP_RAD) & (angles > JUMP_RAD_PER_S * np.abs(np.diff(times)))
    if not jumps.any():
        return None
    row = int(np.argmax(jumps)) + 1
    return row, f'a turn by {np.degrees(angles[row - 1]):.0f} deg from one sample to the next'


def unit_orientations(quaternions: ArrayLike) -> Array:
    """
    Bring quaternions to norm 1, with signs that do not jump.

    Args:
        quaternions: (n, 4), none of norm 0.

    Returns:
        (n, 4); those that are so already stay the same to the last bit.

    """
    given = np.array(quaternions, dtype=np.float64)
    norms = np.linalg.norm(given, axis=1)
    off = np.abs(norms - 1.0) > UNIT
    given[off] /= norms[off, None]
    return with_continuous_signs(given)


def orientation_at(
    times: Array, quaternions: ArrayLike | None, at: Array, max_hidden_s: float
) -> Array | None:
    """
    Give the orientations of a wrist at the times when its position counts.

    Args:
        times: (n,) s, rising.
        quaternions: (n, 4), anything but a unit quaternion where it is not known; None: nowhere.
        at: (m,) s, within the times.
        max_hidden_s: what is not known for longer than this is not known at all, s.

    Returns:
        (m, 4); None where it is not known throughout, or where a program only wrote the same
        (0, 0, 0, 1) everywhere, which stands for none.

    """
    if quaternions is None or not len(at):
        return None
    given = np.asarray(quaternions, dtype=np.float64)
    with np.errstate(invalid='ignore', over='ignore'):
        known = np.abs(np.linalg.norm(given, axis=1) - 1.0) <= NORM_TOLERANCE
    if not known.any() or (np.abs(given[known]) == (0.0, 0.0, 0.0, 1.0)).all():
        return None
    when, turns = times[known], unit_orientations(given[known])
    place = np.searchsorted(when, at)
    exact = when[np.minimum(place, len(when) - 1)] == at
    if exact.all():
        return with_continuous_signs(turns[place])
    after, before = np.clip(place, 0, len(when) - 1), np.clip(place - 1, 0, len(when) - 1)
    hidden = np.where(place == before + 1, when[after] - when[before], np.inf)
    hidden = np.where(after == before, np.abs(when[after] - at), hidden)
    if (hidden[~exact] > max_hidden_s).any():
        return None
    between = np.column_stack([np.interp(at, when, column) for column in turns.T])
    return unit_orientations(between)


def turn_orientation_up(quaternions: Array | None, up: str) -> Array | None:
    """
    Turn orientations as `turn_up` does positions.

    Args:
        quaternions: (n, 4); None for none.
        up: the axis that points up in them.

    Returns:
        (n, 4) in a room whose z points up; None for none.

    """
    if quaternions is None:
        return None
    return with_continuous_signs(
        multiply_all(from_matrices(turn_up(np.eye(3), up).T), quaternions)
    )
