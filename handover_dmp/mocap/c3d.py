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
Reader of C3D files: points as integers or floats, of Intel, DEC and MIPS processors.

The library `c3d` reads the header and the parameters, numpy the points. The tests compare this
reader with `ezc3d`, the reference implementation. `ezc3d` is not used here: it crashed on 1 of
150 files with one to four wrong bytes, which would end the whole process; it reads a truncated
file as a shorter one; and it refuses files of MIPS processors and files that store the number of
frames as a float, as the manual advises for long files. The number of frames is stored in up to
four places, none of which every program writes.
"""

from __future__ import annotations

from collections.abc import Sequence
import io
from itertools import count
from pathlib import Path
from typing import Any
import warnings

import c3d
from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.mocap.markers import choose, MarkerRecording
from handover_dmp.mocap.tables import LARGEST_RECORDING_BYTES, read_bytes
import numpy as np
from numpy.typing import NDArray

_MAX_POINTS = 5_000_000
_BLOCK = 512
# Largest value of the 16-bit fields for frames; it means this number or more.
_SATURATED = 65_535
# Two fields with the same number may differ by the rounding of a float, not more.
_ROUNDING = 1e-4
_UP = {f'{sign}{axis}': f'{sign}{axis}'.strip('+') for sign in ('', '+', '-') for axis in 'xyz'}


def read_c3d(path: str | Path, markers: Sequence[str] | None = None) -> MarkerRecording:
    """
    Read a C3D file.

    Args:
        path: the file.
        markers: names of the markers to read; default: all.

    Returns:
        The markers, in the unit of the file; up is the vertical axis of its screen.

    Raises:
        DataError: the file is missing, truncated, without markers or not a C3D file.

    """
    path = Path(path)
    content = read_bytes(path, LARGEST_RECORDING_BYTES)
    try:
        with warnings.catch_warnings():
            # The library warns of contents that this reader does not use.
            warnings.simplefilter('ignore')
            return _read(_Reader(io.BytesIO(content)), content, path, markers)
    except DataError:
        raise
    except Exception as error:
        # On a damaged file the library may raise any exception.
        what = f'{type(error).__name__}: {error}'.replace('\n', ' ')
        raise DataError(f'{path}: not a readable C3D file ({what[:120]})') from error


class _Reader(c3d.Reader):  # type: ignore[misc]
    """The library's reader without its own checks, which refuse many harmless files."""

    def _check_metadata(self) -> None:
        """Leave that to `_check`."""


def _read(
    file: c3d.Reader, content: bytes, path: Path, markers: Sequence[str] | None
) -> MarkerRecording:
    header = file.header
    points = int(header.point_count)
    if points == 0:
        raise DataError(f'{path}: holds no markers')
    _check(file, path)
    rate = _number(file, 'POINT:RATE') or float(header.frame_rate)
    if not 0.0 < rate <= 1e5:
        raise DataError(f'{path}: {rate:g} frames a second')
    processor = int(content[_BLOCK * (header.parameter_block - 1) + 3])
    word = _word(float(header.scale_factor), processor)
    width = 4 * points + int(header.analog_count)
    start = _BLOCK * (int(header.data_block) - 1)
    if not 0 < start < len(content):
        raise DataError(f'{path}: holds no frames')
    frames = _count_frames(file, memoryview(content)[start:], word.itemsize * width, path)
    names = _names(file, points)
    chosen = choose(names, markers)
    if frames * max(len(chosen), 1) > _MAX_POINTS:
        raise DataError(
            f'{path}: {frames} frames of {len(chosen)} markers are more than can be held'
        )
    raw = np.frombuffer(content, word, frames * width, start).reshape(frames, width)
    table = raw[:, : 4 * points].reshape(frames, points, 4)[:, list(chosen.values())]
    values = _values(table, processor)
    places = np.where(values[..., 3:] < 0.0, np.nan, values[..., :3])
    if word.kind == 'i':
        places *= float(header.scale_factor)
    return MarkerRecording(
        np.arange(frames) / rate,
        names,
        {name: places[:, k] for k, name in enumerate(chosen)},
        _text(file, 'POINT:UNITS'),
        _UP.get(_text(file, 'POINT:Y_SCREEN').lower(), ''),
        path.name,
    )


def _check(file: c3d.Reader, path: Path) -> None:
    """Refuse a file whose header and parameters disagree on how to read the data."""
    header = file.header
    analog = int(header.analog_count)
    told = [
        ('number of markers', float(header.point_count), _number(file, 'POINT:USED')),
        ('rate', float(header.frame_rate), _number(file, 'POINT:RATE')),
    ]
    if max(float(header.scale_factor), _number(file, 'POINT:SCALE')) > 0.0:
        told.append(('scale', float(header.scale_factor), _number(file, 'POINT:SCALE')))
    # The header has the number of samples per frame; it also follows from the rates.
    channels = _number(file, 'ANALOG:USED')
    ratio = _number(file, 'ANALOG:RATE') / (_number(file, 'POINT:RATE') or np.inf)
    if analog not in (channels * int(header.analog_per_frame), channels * round(ratio)):
        told.append(('number of analog samples a frame', analog, channels * round(ratio)))
    for what, first, second in told:
        if first and second and abs(first - second) > _ROUNDING * abs(second):
            raise DataError(
                f'{path}: header and parameters disagree on the {what}, {first:g} and {second:g}'
            )


def _word(scale: float, processor: int) -> np.dtype[Any]:
    """Return the number type of the data: a negative scale means floats."""
    end = '>' if processor == c3d.c3d.PROCESSOR_MIPS else '<'
    if scale == 0.0 or not np.isfinite(scale):
        raise ValueError(f'a scale of {scale}')
    return np.dtype(f'{end}i2' if scale > 0.0 else f'{end}f4')


def _values(table: NDArray[Any], processor: int) -> Array:
    if table.dtype.kind == 'f' and processor == c3d.c3d.PROCESSOR_DEC:
        # A VAX float has its two halves swapped, and four times the value.
        halves = np.ascontiguousarray(table).view('<u2').reshape(*table.shape, 2)[..., ::-1]
        table = np.ascontiguousarray(halves).view('<f4')[..., 0] / np.float32(4.0)
    return table.astype(np.float64)


def _count_frames(file: c3d.Reader, data: memoryview, frame_bytes: int, path: Path) -> int:
    """
    Find the number of frames.

    Args:
        file: header and parameters.
        data: bytes from the first frame to the end of the file.
        frame_bytes: length of one frame, bytes.
        path: the file, for the error.

    Returns:
        The number of frames.

    """
    room = len(data) // frame_bytes
    told = _told_frames(file)
    if told is None:
        # As many as fit, without the zeros that fill the last block.
        last = bytes(data[max(room * frame_bytes - _BLOCK, 0): room * frame_bytes])  # fmt: skip
        told = room - (len(last) - len(last.rstrip(b'\0'))) // frame_bytes
    # Some programs write a number that exceeds 16 bits modulo 65,536.
    while told > 0 and told + _SATURATED < room:
        told += _SATURATED + 1
    if told > room:
        raise DataError(f'{path}: truncated after {room} of {told} frames')
    if told < 1:
        raise DataError(f'{path}: holds no frames')
    return told


def _told_frames(file: c3d.Reader) -> int | None:
    """Return the stated number of frames; None if it did not fit into the field."""
    first, last = (_words(file, f'TRIAL:ACTUAL_{end}_FIELD') for end in ('START', 'END'))
    if 0 < first <= last:
        return last - first + 1
    for name in ('POINT:LONG_FRAMES', 'POINT:FRAMES'):
        frames = _number(file, name)
        if frames and frames != _SATURATED:
            return int(frames)
    first, last = int(file.header.first_frame), int(file.header.last_frame)
    if last == _SATURATED or last < first:
        return None
    return last - first + 1


def _words(file: c3d.Reader, name: str) -> int:
    """Return an integer stored in two words, the lower one first; 0 if there is none."""
    parameter = file.get(name)
    if parameter is None or parameter.bytes_per_element != 2 or len(parameter.bytes) != 4:
        return 0
    low, high = (int(value) for value in parameter.uint16_array)
    return low + (high << 16)


def _number(file: c3d.Reader, name: str) -> float:
    """Return a parameter: an integer or, in long files, a float; 0 if it is missing."""
    parameter = file.get(name)
    if parameter is None or not parameter.bytes:
        return 0.0
    if parameter.bytes_per_element == 4:
        value = float(parameter.float_value)
        return value if np.isfinite(value) else 0.0
    return float(parameter.uint16_value)


def _names(file: c3d.Reader, points: int) -> list[str]:
    """Return a name for every point; LABELS holds 255 of them, LABELS2 the next, and so on."""
    names: list[str] = []
    for number in count(1):
        part = file.get(f'POINT:LABELS{"" if number == 1 else number}')
        if part is None or len(names) >= points:
            break
        width = part.dimensions[0] if part.dimensions else 0
        starts = range(0, len(part.bytes), width) if width else ()
        names += [_decoded(part.bytes[start: start + width]) for start in starts]  # fmt: skip
    names += [f'point {number}' for number in range(len(names) + 1, points + 1)]
    return names[:points]


def _text(file: c3d.Reader, name: str) -> str:
    parameter = file.get(name)
    if parameter is None:
        return ''
    # Of several values, for example one unit per kind of point, the first counts.
    width = parameter.dimensions[0] if parameter.dimensions else len(parameter.bytes)
    return _decoded(parameter.bytes[:width])


def _decoded(text: bytes) -> str:
    try:
        return text.decode().strip(' \0')
    except UnicodeDecodeError:
        return text.decode('cp1252', errors='replace').strip(' \0')
