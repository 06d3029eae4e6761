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
Images of PyBullet's software renderer as arrays, for any build of PyBullet.

A build without NumPy returns tuples of millions of numbers, which takes longer than rendering.
Since most of a picture is empty, only the windows in which a coarse image shows bodies are then
rendered.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil, floor
from typing import Any

from handover_dmp.common.quiet_pybullet import pybullet
import numpy as np
from numpy.typing import NDArray

COARSE = 8
"""Pixels per coarse pixel, in width and in height."""
MARGIN = 2
"""Margin around found bodies, coarse pixels; missed parts are thinner than one."""
STRIPS = 4
"""Number of windows side by side, each as high as its content."""
MIN_PIXELS = 500_000
"""In a smaller picture, several renderings take longer than the tuples of the whole."""

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
        width: width of the picture, pixels.
        height: height of the picture, pixels.
        view: view matrix, 16 numbers, column by column.
        projection: projection matrix, 16 numbers, column by column.
        client: PyBullet's number of the world.
        by_windows: whether to skip empty parts; None: if that is faster.
        lighting: arguments of `pybullet.getCameraImage`.

    Returns:
        Red, green, blue and alpha, (height, width, 4), zero without a body; and the body of each
        pixel, (height, width), its number in the lower 24 bits, −1 without a body.

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
    """Find the rows and columns with bodies, in windows side by side."""
    columns, rows = ceil(width / COARSE), ceil(height / COARSE)
    found = _render(columns, rows, view, projection, client)[1] >= 0
    if not found.any():
        # bodies may be smaller than a coarse pixel
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
    """Return the range of some indices with a margin, within 0 to `size`."""
    return slice(max(int(indices[0]) - MARGIN, 0), min(int(indices[-1]) + 1 + MARGIN, size))


def _enlarged(part: slice, factor: float, size: int) -> slice:
    """Convert a range of coarse pixels to pixels."""
    return slice(floor(part.start * factor), min(floor(part.stop * factor), size))


def _of_window(
    projection: Matrix, width: int, height: int, rows: slice, columns: slice
) -> list[float]:
    """Change a projection so that a window fills the picture; the first row is on top."""
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
    Convert numbers from 0 to 255 to an array.

    Args:
        values: an array, or a tuple from a PyBullet that was built without NumPy.

    Returns:
        An array, of the same shape or flat.

    """
    # ten times as fast as NumPy for a tuple of millions
    return np.frombuffer(bytes(values) if isinstance(values, tuple) else values, np.uint8)


def integers_of(values: Any) -> Seen:
    """
    Convert integers to an array.

    Args:
        values: an array, or a tuple from a PyBullet that was built without NumPy.

    Returns:
        An array, of the same shape or flat.

    """
    return np.asarray(values, np.int32)
