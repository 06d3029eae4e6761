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
Orientations of the wrists of a recording: unit quaternions x, y, z, w.

They are optional; a recording may have positions only.
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

AXES_OF_TURN = ('qx', 'qy', 'qz', 'qw')
NORM_TOLERANCE = 0.01
"""Tolerance of the norm, for numbers with few digits."""
UNIT = 1e-9
"""A norm that differs less from 1 differs only by rounding."""
JUMP_RAD = 1.0
JUMP_RAD_PER_S = 60.0
"""No wrist turns this far and this fast between two samples: the tracker confused bodies."""


def orientation_fault(times: Array, quaternions: Array) -> tuple[int, str] | None:
    """
    Find the first reason why quaternions cannot be those of one wrist.

    Args:
        times: (n,) s.
        quaternions: (n, 4).

    Returns:
        Index of the sample and the fault in words; None if there is no fault.

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
    Normalise quaternions and remove sign jumps.

    Args:
        quaternions: (n, 4), none of norm 0.

    Returns:
        (n, 4); quaternions that need no change stay the same to the last bit.

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
    Interpolate the orientations of a wrist at given times.

    Args:
        times: (n,) s, rising.
        quaternions: (n, 4); anything but a unit quaternion means unknown. None: all unknown.
        at: (m,) s, within the times.
        max_hidden_s: longest gap that is bridged, s.

    Returns:
        (m, 4); None if a gap is longer, or if all are (0, 0, 0, 1), which programs write for
        unknown.

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
    # before the first and after the last orientation, the nearest one counts
    hidden = np.where(after == before, np.abs(when[after] - at), when[after] - when[before])
    if (hidden[~exact] > max_hidden_s).any():
        return None
    between = np.column_stack([np.interp(at, when, column) for column in turns.T])
    return unit_orientations(between)


def turn_orientation_up(quaternions: Array | None, up: str) -> Array | None:
    """
    Rotate orientations as `turn_up` does positions.

    Args:
        quaternions: (n, 4), or None.
        up: the axis that points up in them.

    Returns:
        (n, 4) in a frame whose z points up; None for None.

    """
    if quaternions is None:
        return None
    return with_continuous_signs(
        multiply_all(from_matrices(turn_up(np.eye(3), up).T), quaternions)
    )
