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
Reader of the TSV files of Qualisys Track Manager: 3D trajectories, and 6D rigid bodies.

The file has header lines of a name, a tab and a value (`FREQUENCY`, `DATA_INCLUDED`, ...,
`MARKER_NAMES` or `BODY_NAMES` with one value each); an optional line of column titles; then one
line per frame: three values per marker or, for a body, position, three angles, residual and the
nine elements of its rotation matrix; before them frame number and time if these were exported. The
matrix is stored column by column: Rot[0], Rot[1], Rot[2] is the direction of the body's x axis.
Lengths are in millimetres. Unseen markers have empty cells, a residual below 0 or, in files of
older versions, three zeros.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
import re

from handover_dmp.common.errors import DataError
from handover_dmp.common.quaternions import from_matrices
from handover_dmp.mocap.markers import choose, MarkerRecording
from handover_dmp.mocap.tables import iterate_lines, quote
from handover_dmp.mocap.wide_table import is_number, is_unseen, period_of_rate, WideTable

_MAX_HEADER_LINES = 10_000
_DECIMAL_COMMA = re.compile('-?[0-9]+,[0-9]+', re.ASCII)
# Number of cells of a marker, and of a rigid body.
_STRIDES = {'3D': 3, '6D': 16}
_NAMES = {'3D': 'MARKER_NAMES', '6D': 'BODY_NAMES'}


def read_qualisys(path: str | Path, markers: Sequence[str] | None = None) -> MarkerRecording:
    """
    Read a Qualisys TSV file.

    Args:
        path: the file.
        markers: names of the markers to read; default: all.

    Returns:
        The markers or rigid bodies, in millimetres.

    Raises:
        DataError: the file is missing or not of this format; names file, line and fault.

    """
    path = Path(path)
    header: dict[str, list[str]] = {}
    names: list[str] = []
    titles: list[str] = []
    table: WideTable | None = None
    for number, line in iterate_lines(path):
        cells = line.split('\t')
        where = f'{path}: line {number}'
        if table is None and _is_header(cells):
            if len(header) > _MAX_HEADER_LINES:
                raise DataError(f'{where}: no frames up to here')
            if any(header.get(kind) for kind in _NAMES.values()) and not _is_keyword(cells[0]):
                titles = [cell.strip() for cell in cells]
            else:
                header[cells[0].strip()] = [cell.strip() for cell in cells[1:]]
        # A line of tabs is a frame in which no marker was seen.
        elif line.strip(' '):
            if table is None:
                names, table = _layout(header, titles, markers, cells, where)
            table.add(cells, where)
    if table is None:
        commas = any(_DECIMAL_COMMA.fullmatch(cell) for cell in titles)
        hint = '; decimal commas are not supported' if commas else ''
        raise DataError(f'{path}: holds no frames{hint}')
    told = _value(header, 'NO_OF_FRAMES', '')
    if told.isdecimal() and len(told) < 12 and int(told) not in (len(table), table.frame_span()):
        raise DataError(f'{path}: {len(table)} frames, but the header says {int(told)}')
    orientations = {
        name: from_matrices(elements.reshape(-1, 3, 3).transpose(0, 2, 1))
        for name, elements in table.turned().items()
    }
    return MarkerRecording(
        table.times(), names, table.positions(), '', '', path.name, orientations=orientations
    )


def _is_header(cells: Sequence[str]) -> bool:
    """Tell whether a line belongs to the header or titles; a frame has only numbers."""
    if _is_keyword(cells[0]):
        return True
    return not any(map(is_number, cells)) and not all(map(is_unseen, cells))


def _is_keyword(cell: str) -> bool:
    word = cell.strip()
    return len(word) > 2 and word.isascii() and word.replace('_', '').isalpha() and word.isupper()


def _layout(
    header: dict[str, list[str]],
    titles: list[str],
    markers: Sequence[str] | None,
    cells: Sequence[str],
    where: str,
) -> tuple[list[str], WideTable]:
    """Find the columns from the header and the cells of the first frame."""
    kind = _value(header, 'DATA_INCLUDED', '3D').upper()
    if kind not in _STRIDES:
        raise DataError(
            f'{where}: data of kind {quote(kind)}; 3D trajectories or 6D bodies are needed'
        )
    names = [name for name in header.get(_NAMES[kind], []) if name]
    if not names:
        raise DataError(f'{where}: a frame, but no {_NAMES[kind]} before it')
    stride = _STRIDES[kind]
    leading = _leading(titles, names, stride, len(cells))
    before = [title.lower() for title in titles[:leading]] or ['frame', 'time'][:leading]
    time = before.index('time') if 'time' in before else None
    frame = before.index('frame') if 'frame' in before else None
    period_s = 0.0
    if time is None:
        period_s = period_of_rate(_value(header, 'FREQUENCY', ''), 'FREQUENCY', where)
    columns = {name: leading + stride * k for name, k in choose(names, markers).items()}
    bodies = columns if kind == '6D' else {}
    residuals = {name: first + 6 for name, first in bodies.items()}
    turns = {name: range(first + 7, first + 16) for name, first in bodies.items()}
    width = leading + stride * len(names)
    return names, WideTable(columns, width, time, frame, period_s, residuals, turns)


def _leading(titles: list[str], names: list[str], stride: int, count: int) -> int:
    """Return the number of columns before the first marker."""
    first = f'{names[0]} X'
    if first in titles:
        return titles.index(first)
    if titles:
        return sum(title.lower() in ('frame', 'time') for title in titles[:2])
    return 2 if count >= stride * len(names) + 2 else 0


def _value(header: dict[str, list[str]], name: str, otherwise: str) -> str:
    """Return the first value of a header line; `otherwise` if line or value is missing."""
    return next(iter(header.get(name, ())), otherwise)
