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
What PyBullet's software renderer sees, as arrays, whichever build of PyBullet it is.

A build without NumPy gives tuples of millions of numbers, which takes longer than to render them.
Most of a picture is empty, so there only those windows are rendered in which a coarse look finds
bodies.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil, floor
from typing import Any

from handover_dmp.common.quiet_pybullet import pybullet
import numpy as np
from numpy.typing import NDArray

COARSE = 8
"""Pixels, in width and in height, for one of the coarse look."""
MARGIN = 2
"""Pixels of the coarse look around what it finds; what it missed is thinner than one."""
STRIPS = 4
"""Windows side by side, each as high as what is in it."""
MIN_PIXELS = 500_000
"""In a smaller picture, to render it several times takes longer than the tuples of the whole."""

Pixels = NDArray[np.uint8]
Seen = NDArray[np.int32]
Matrix = Sequence[float]


def camera_image(
    width: int,
    height: int,
    view: Matrix,
    projection: Matrix,
    client: int,
    *,
    by_windows: bool | None = None,
    **lighting: Any,
) -> tuple[Pixels, Seen]:
    """
    Render the bodies of a world.

    Args:
        width: of the picture, pixels.
        height: of the picture, pixels.
        view: 16 numbers, column by column.
        projection: 16 numbers, column by column.
        client: PyBullet's number of the world.
        by_windows: whether to leave out what is empty; None: where that is faster.
        lighting: as `pybullet.getCameraImage` names it.

    Returns:
        Red, green, blue and alpha, (height, width, 4), zero where there is no body, and what is
        seen, (height, width): the number of the body in its lower 24 bits, −1 where there is none.

    """
    if by_windows is None:
        by_windows = not pybullet.isNumpyEnabled() and width * height >= MIN_PIXELS
    if not by_windows:
        rgba, seen = _render(width, height, view, projection, client, **lighting)
        return rgba * (seen[..., None] >= 0), seen
    rgba, seen = np.zeros((height, width, 4), np.uint8), np.full((height, width), -1, np.int32)
    for rows, columns in _windows(width, height, view, projection, client):
        window = _of_window(projection, width, height, rows, columns)
        size = columns.stop - columns.start, rows.stop - rows.start
        rgba[rows, columns], seen[rows, columns] = _render(*size, view, window, client, **lighting)
    rgba[seen < 0] = 0
    return rgba, seen


def _windows(
    width: int, height: int, view: Matrix, projection: Matrix, client: int
) -> Iterator[tuple[slice, slice]]:
    """Find the rows and columns in which there are bodies, in windows side by side."""
    columns, rows = ceil(width / COARSE), ceil(height / COARSE)
    found = _render(columns, rows, view, projection, client)[1] >= 0
    if not found.any():
        # what is there may be smaller than what was looked at
        yield slice(0, height), slice(0, width)
        return
    whole = _around(np.flatnonzero(found.any(axis=0)), columns)
    for strip in np.array_split(np.arange(whole.start, whole.stop), STRIPS):
        if not strip.size:
            continue
        beside = found[:, _around(strip, columns)]
        if beside.any():
            filled = _around(np.flatnonzero(beside.any(axis=1)), rows)
            across = slice(int(strip[0]), int(strip[-1]) + 1)
            yield (
                _enlarged(filled, height / rows, height),
                _enlarged(across, width / columns, width),
            )


def _around(indices: NDArray[np.intp], size: int) -> slice:
    """Give the range of some indices, with a margin, within 0 to `size`."""
    return slice(max(int(indices[0]) - MARGIN, 0), min(int(indices[-1]) + 1 + MARGIN, size))


def _enlarged(part: slice, factor: float, size: int) -> slice:
    """Turn a range of coarse pixels into one of pixels."""
    return slice(floor(part.start * factor), min(floor(part.stop * factor), size))


def _of_window(
    projection: Matrix, width: int, height: int, rows: slice, columns: slice
) -> list[float]:
    """Change a projection so that a window of its picture, the first row on top, is all of it."""
    matrix = np.reshape(projection, (4, 4)).T.copy()
    middle_x = (columns.start + columns.stop) / width - 1.0
    middle_y = 1.0 - (rows.start + rows.stop) / height
    matrix[0] = (matrix[0] - middle_x * matrix[3]) * (width / (columns.stop - columns.start))
    matrix[1] = (matrix[1] - middle_y * matrix[3]) * (height / (rows.stop - rows.start))
    flat: list[float] = matrix.T.ravel().tolist()
    return flat


def _render(
    width: int, height: int, view: Matrix, projection: Matrix, client: int, **lighting: Any
) -> tuple[Pixels, Seen]:
    _, _, rgba, _, seen = pybullet.getCameraImage(
        width,
        height,
        view,
        projection,
        **lighting,
        shadow=0,
        renderer=pybullet.ER_TINY_RENDERER,
        physicsClientId=client,
    )
    return bytes_of(rgba).reshape(height, width, 4), integers_of(seen).reshape(height, width)


def bytes_of(values: Any) -> Pixels:
    """
    Take in numbers from 0 to 255.

    Args:
        values: an array, or a tuple from a PyBullet that was built without NumPy.

    Returns:
        An array, of the same shape or flat.

    """
    # from a tuple of millions, a tenth of the time that NumPy takes
    return np.frombuffer(bytes(values) if isinstance(values, tuple) else values, np.uint8)


def integers_of(values: Any) -> Seen:
    """
    Take in integers.

    Args:
        values: an array, or a tuple from a PyBullet that was built without NumPy.

    Returns:
        An array, of the same shape or flat.

    """
    return np.asarray(values, np.int32)
