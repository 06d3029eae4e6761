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
Reader of C3D files.

By the library `c3d`: it is plain Python, so one wheel serves every platform and Python, and a
damaged file ends in an exception. `ezc3d` is released more often, but it is compiled, and it died
of a segmentation fault on 3 of 100 files with one to four wrong bytes in their first 2 KB, which
would take the whole process along.
"""

from __future__ import annotations

from collections.abc import Sequence
import io
from pathlib import Path
import warnings

import c3d
from handover_dmp.common.errors import DataError
from handover_dmp.mocap.markers import choose, MarkerRecording, METRES
from handover_dmp.mocap.tables import LARGEST_RECORDING_BYTES, quote, read_bytes
import numpy as np

_MAX_POINTS = 5_000_000
# Sign of the last word of a point that was not seen.
_RESIDUAL = 3


def read_c3d(path: str | Path, markers: Sequence[str] | None = None) -> MarkerRecording:
    """
    Read a C3D file.

    Args:
        path: the file.
        markers: which ones to read, of those that are there; all if left out.

    Returns:
        The markers, in the unit of the file; up is what it tells of its screen's vertical axis,
        else z.

    Raises:
        DataError: the file is missing, broken off or no such file.

    """
    path = Path(path)
    content = io.BytesIO(read_bytes(path, LARGEST_RECORDING_BYTES))
    try:
        with warnings.catch_warnings():
            # What the library warns of, a file that ends early, is checked below.
            warnings.simplefilter('ignore')
            return _read(c3d.Reader(content), path, markers)
    except DataError:
        raise
    except Exception as error:
        # A damaged file makes the library raise whatever its next operation happens to raise.
        what = f'{type(error).__name__}: {error}'.replace('\n', ' ')
        raise DataError(f'{path}: not a C3D file that can be read ({what[:120]})') from error


def _read(reader: c3d.Reader, path: Path, markers: Sequence[str] | None) -> MarkerRecording:
    names = [label.strip() for label in reader.point_labels][: reader.point_used]
    count = reader.last_frame - reader.first_frame + 1
    rate = float(reader.point_rate)
    if not (names and 0 < count <= _MAX_POINTS and 0.0 < rate <= 1e5):
        raise DataError(f'{path}: {len(names)} markers, {count} frames at {rate:g} Hz')
    chosen = choose(names, markers)
    columns = list(chosen.values())
    if count * max(len(columns), 1) > _MAX_POINTS:
        raise DataError(
            f'{path}: {count} frames of {len(columns)} markers are more than can be held'
        )
    table = np.full((count, len(columns), 3), np.nan)
    read = 0
    for _, points, _ in reader.read_frames(copy=False, analog_transform=False):
        seen = points[columns]
        table[read] = np.where(seen[:, [_RESIDUAL]] < 0.0, np.nan, seen[:, :3])
        read += 1
    if read < count:
        raise DataError(f'{path}: broken off after {read} of {count} frames')
    positions = {name: table[:, k] for k, name in enumerate(chosen)}
    times = np.arange(count) / rate
    return MarkerRecording(times, names, positions, _unit(reader, path), _up(reader), path.name)


def _unit(reader: c3d.Reader, path: Path) -> str:
    parameter = reader.get('POINT:UNITS')
    unit = str(parameter.string_value).strip().lower() if parameter else 'mm'
    unit = unit.strip('\0 ') or 'mm'
    if unit not in METRES:
        raise DataError(f'{path}: unit {quote(unit)}, not one of {", ".join(METRES)}')
    return unit


def _up(reader: c3d.Reader) -> str:
    parameter = reader.get('POINT:Y_SCREEN')
    axis = str(parameter.string_value).strip('\0 ').lower() if parameter else ''
    return 'y' if axis in {'y', '+y'} else 'z'
