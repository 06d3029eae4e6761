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
Reader of the 3D trajectories that Qualisys Track Manager exports as TSV.

Header lines of a name, a tab and a value (`FREQUENCY`, `DATA_INCLUDED`, ..., `MARKER_NAMES` with
one value a marker), perhaps a line of column names, then a line a frame with three values a
marker, before them frame number and time where these were exported too. Millimetres, z up. A
marker that was not seen has empty cells or, in files of older versions, three zeros.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handover_dmp.common.errors import DataError
from handover_dmp.mocap.markers import choose, MarkerRecording
from handover_dmp.mocap.tables import iterate_lines, parse_number, parse_numbers, quote
import numpy as np

_MAX_VALUES = 10_000_000
_MAX_HEADER_LINES = 10_000
_NOT_SEEN = {'', 'nan', 'null', '-'}


def read_qualisys(path: str | Path, markers: Sequence[str] | None = None) -> MarkerRecording:
    """
    Read a Qualisys TSV file.

    Args:
        path: the file.
        markers: which ones to read, of those that are there; all if left out.

    Returns:
        The markers, in millimetres.

    Raises:
        DataError: the file is missing or no such file; names file, line and fault.

    """
    path = Path(path)
    header: dict[str, list[str]] = {}
    layout: _Layout | None = None
    stamps = array('d')
    values = array('d')
    for number, line in iterate_lines(path):
        cells = line.split('\t')
        where = f'{path}: line {number}'
        if layout is None and cells[0][:1].isalpha() and not _not_seen(cells[0]):
            if len(header) > _MAX_HEADER_LINES:
                raise DataError(f'{where}: still no frames')
            header[cells[0].strip()] = [cell.strip() for cell in cells[1:]]
        # Tabs alone are a frame in which no marker was seen.
        elif line.strip(' '):
            layout = layout or _layout(header, markers, len(cells), where)
            if len(values) > _MAX_VALUES:
                raise DataError(f'{where}: more than can be held')
            values.extend(layout.values(cells, where))
            stamps.append(layout.stamp(cells, len(stamps), where))
    if layout is None:
        raise DataError(f'{path}: holds no frames')
    told = _value(header, 'NO_OF_FRAMES', '')
    if told.isdecimal() and len(told) < 12 and int(told) != len(stamps):
        raise DataError(f'{path}: {len(stamps)} frames, the header tells of {int(told)}')
    table = np.array(values).reshape(len(stamps), len(layout.columns), 3)
    # No marker is in the very origin: older versions write that for one that was not seen.
    table[(table == 0.0).all(axis=2)] = np.nan
    positions = {name: table[:, k] for k, name in enumerate(layout.columns)}
    return MarkerRecording(np.array(stamps), layout.names, positions, 'mm', 'z', path.name)


@dataclass(frozen=True)
class _Layout:
    """
    Where in a line the numbers stand.

    Attributes:
        names: of all markers.
        columns: name of a marker that is wanted to the column of its x.
        leading: columns before the first marker.
        time_column: of the time in s; None where it was not exported.
        period_s: time from frame to frame.

    """

    names: list[str]
    columns: dict[str, int]
    leading: int
    time_column: int | None
    period_s: float

    def stamp(self, cells: list[str], frame: int, where: str) -> float:
        if self.time_column is None:
            return frame * self.period_s
        return parse_number(cells[self.time_column], 'time', where)

    def values(self, cells: list[str], where: str) -> list[float]:
        count = self.leading + 3 * len(self.names)
        if len(cells) != count and not (len(cells) == count + 1 and not cells[-1].strip()):
            raise DataError(f'{where}: {len(cells)} values instead of {count}')
        found: list[float] = []
        for name, first in self.columns.items():
            place = cells[first: first + 3]  # fmt: skip
            if any(map(_not_seen, place)):
                place = ['0'] * 3
            found += parse_numbers(place, (name,) * 3, where)
        return found


def _layout(
    header: dict[str, list[str]], markers: Sequence[str] | None, count: int, where: str
) -> _Layout:
    """Find out from the header and the number of cells of the first frame what stands where."""
    names = [name for name in header.get('MARKER_NAMES', []) if name]
    if not names:
        raise DataError(f'{where}: a frame, but no MARKER_NAMES before it')
    kind = _value(header, 'DATA_INCLUDED', '3D')
    if kind != '3D':
        raise DataError(f'{where}: data of kind {quote(kind)}; 3D trajectories are needed')
    titles = ['Frame', *header['Frame']] if 'Frame' in header else ['Time'] * ('Time' in header)
    if titles:
        leading = 2 if titles[1:2] == ['Time'] else 1
    else:
        leading = 2 if count >= 3 * len(names) + 2 else 0
    time_column = leading - 1 if not titles or titles[leading - 1] == 'Time' else None
    if leading == 0:
        time_column = None
    period_s = 0.0
    if time_column is None:
        rate = parse_number(_value(header, 'FREQUENCY', ''), 'FREQUENCY', where)
        if not 0.0 < rate <= 1e5:
            raise DataError(f'{where}: FREQUENCY of {rate:g} Hz')
        period_s = 1.0 / rate
    columns = {name: leading + 3 * place for name, place in choose(names, markers).items()}
    return _Layout(names, columns, leading, time_column, period_s)


def _not_seen(cell: str) -> bool:
    return cell.strip().lower() in _NOT_SEEN


def _value(header: dict[str, list[str]], name: str, otherwise: str) -> str:
    """Return the first value of a header line; `otherwise` where the line is missing or bare."""
    return next(iter(header.get(name, ())), otherwise)
