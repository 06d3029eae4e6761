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
Which axis of a recording points up, where the file does not tell.

A person's wrists rest between 0.5 m (hanging, of someone small) and 1.6 m (raised to the shoulder)
above the floor. The origin of a mocap laboratory lies on its floor, so the axis along which both
wrists rest at such heights is the one that points up, if there is just one; an axis along which a
wrist passes zero is none. Where there are more, nobody but the user knows.
"""

from __future__ import annotations

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
import numpy as np

RESTING_M = (0.5, 1.6)
# While they move, they are at least not in the floor nor under the ceiling.
_EVER_M = (0.05, 2.5)
_EVER_QUANTILES = (0.02, 0.98)
# Rows: where the new x, y and z come from. All are rotations: right stays right.
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


USUAL_UP = 'usual of the format, no height tells'


def turn_up(positions: Array, up: str) -> Array:
    """
    Turn a recording so that z points up.

    Args:
        positions: (n, 3), in any unit.
        up: the axis that points up in it, one of `AXES`; for y, (x, y, z) becomes (x, −z, y).

    Returns:
        (n, 3) in the same unit.

    """
    turned: Array = positions @ np.array(_TURNS[up], dtype=np.float64).T
    return turned


def resting_axes(wrists: tuple[Array, ...]) -> list[str]:
    """
    Find the axes along which all wrists rest as high above zero as a person's do.

    Args:
        wrists: (n, 3) m each, NaN where it was not seen.

    Returns:
        Those of `AXES` that may point up.

    """
    return [axis for axis in AXES if all(_may_point_up(axis, wrist) for wrist in wrists)]


def find_up_axis(wrists: tuple[Array, ...], usual: str, source: str) -> tuple[str, str]:
    """
    Find out which axis points up from how high the wrists rest.

    Where they rest at such a height along no axis at all, the origin is not on the floor, heights
    tell nothing, and the axis that the program uses unless told otherwise is taken.

    Args:
        wrists: (n, 3) m each, NaN where it was not seen.
        usual: the axis that the program uses unless told otherwise.
        source: the file, for the error.

    Returns:
        The axis, and in words how it was found.

    Raises:
        DataError: more than one axis may point up.

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
    Doubt an axis that a file or a convention says to point up, by how high the wrists rest.

    Args:
        wrists: (n, 3) m each, NaN where it was not seen.
        up: the axis.
        assumed: whether it is only the usual one of the format.

    Returns:
        A sentence, where it is assumed, or where the wrists rest as high as a person's along
        others alone.

    """
    if assumed:
        return (
            f'nothing tells which axis points up: {up} is assumed, as is usual for the format; '
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
    """Return the samples around which the wrist moves least."""
    if len(wrist) < 3:
        return wrist
    speed = np.linalg.norm(np.gradient(wrist, axis=0), axis=1)
    rest: Array = wrist[speed <= np.quantile(speed, _REST_SHARE)]
    return rest
