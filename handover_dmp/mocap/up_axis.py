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
The up axis of a recording whose file does not name it.

A person's wrists rest between 0.5 m (hanging, small person) and 1.6 m (raised to the shoulder)
above the floor. The origin of a mocap laboratory is on its floor. The up axis is therefore the
axis along which both wrists rest at such heights, if there is exactly one; an axis along which a
wrist crosses zero does not count. If there are several, only the user knows.
"""

from __future__ import annotations

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
import numpy as np

RESTING_M = (0.5, 1.6)
# Range of heights while the wrists move: above the floor and below the ceiling, m.
_EVER_M = (0.05, 2.5)
_EVER_QUANTILES = (0.02, 0.98)
# Rows: origin of the new x, y and z. All are rotations, so frames stay right-handed.
_TURNS = {
    'z': ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    '-z': ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    'y': ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    '-y': ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    'x': ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
    '-x': ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
}
AXES = tuple(_TURNS)
_REST_SHARE = 0.2


USUAL_UP = 'default of the format; the heights do not tell'


def turn_up(positions: Array, up: str) -> Array:
    """
    Rotate a recording so that z points up.

    Args:
        positions: (n, 3), in any unit.
        up: the axis that points up in it, one of `AXES`; for y, (x, y, z) becomes (x, −z, y).

    Returns:
        (n, 3) in the same unit.

    """
    return np.asarray(positions @ np.array(_TURNS[up], dtype=np.float64).T)


def resting_axes(wrists: tuple[Array, ...]) -> list[str]:
    """
    Find the axes along which all wrists rest at a person's height above zero.

    Args:
        wrists: (n, 3) m each, NaN if the wrist was not seen.

    Returns:
        The axes, of `AXES`, that may point up.

    """
    return [axis for axis in AXES if all(_may_point_up(axis, wrist) for wrist in wrists)]


def find_up_axis(wrists: tuple[Array, ...], usual: str, source: str) -> tuple[str, str]:
    """
    Find the up axis from the heights of the resting wrists.

    If no axis fits, the origin is not on the floor and heights mean nothing; then the default
    axis of the program is taken.

    Args:
        wrists: (n, 3) m each, NaN if the wrist was not seen.
        usual: default up axis of the program.
        source: the file, for the error.

    Returns:
        The axis, and in words how it was found.

    Raises:
        DataError: several axes may point up.

    """
    fit = resting_axes(wrists)
    if len(fit) > 1:
        raise DataError(
            f'{source}: it does not tell which axis points up, and the wrists rest at a '
            f"person's height along {' and '.join(fit)}; say which with --up"
        )
    if not fit:
        return usual, USUAL_UP
    return fit[0], 'by the height of the wrists'


def doubts(wrists: tuple[Array, ...], up: str, *, assumed: bool = False) -> tuple[str, ...]:
    """
    Check an up axis from a file or a convention against the heights of the resting wrists.

    Args:
        wrists: (n, 3) m each, NaN if the wrist was not seen.
        up: the axis.
        assumed: whether it is only the default of the format.

    Returns:
        A warning if the axis is assumed, or if the wrists rest at a person's height only along
        other axes.

    """
    if assumed:
        return (
            f'the up axis is unknown: {up} is assumed, the default of the format; '
            'say which with --up',
        )
    fit = resting_axes(wrists)
    if not fit or up in fit:
        return ()
    return (
        f"{up} is said to point up, but the wrists rest at a person's height along "
        f'{" and ".join(fit)}: say which with --up',
    )


def _may_point_up(axis: str, wrist: Array) -> bool:
    seen = wrist[np.isfinite(wrist).all(axis=1)]
    lowest, highest = np.quantile(turn_up(seen, axis)[:, 2], _EVER_QUANTILES)
    resting = float(np.median(turn_up(_at_rest(seen), axis)[:, 2]))
    return bool(
        _EVER_M[0] <= lowest <= highest <= _EVER_M[1] and RESTING_M[0] <= resting <= RESTING_M[1]
    )


def _at_rest(wrist: Array) -> Array:
    """Return the samples around the slowest moment of the wrist."""
    if len(wrist) < 3:
        return wrist
    speed = np.linalg.norm(np.gradient(wrist, axis=0), axis=1)
    return np.asarray(wrist[speed <= np.quantile(speed, _REST_SHARE)])
