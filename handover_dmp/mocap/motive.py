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
Reader of the CSV that OptiTrack's Motive exports, format version 1.2 and later.

The file has a line of names and values (`Format Version`, `Length Units`, `Coordinate Space`,
...); lines with the type (rigid body, marker, ...), name, identifier and, from 1.24 on, parent of
each column, and whether it is a rotation or a position; a line `Frame,Time (Seconds),X,Y,Z,...`;
then one line per frame. Unseen bodies have empty cells. Rotations are read if they are
quaternions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import csv
from pathlib import Path
import re
from typing import NamedTuple

from handover_dmp.common.errors import DataError
from handover_dmp.mocap.markers import choose, MarkerRecording
from handover_dmp.mocap.tables import iterate_lines, quote
from handover_dmp.mocap.wide_table import WideTable

_MAX_HEADER_LINES = 20
_MIN_VERSION = (1, 2)
# Of several entries with one name, measured ones come before solved ones.
_TYPES = ('Rigid Body', 'Marker', 'Bone', 'Rigid Body Marker', 'Bone Marker')
# These types are given in the frame of their body, unless the file says that all are global.
_LOCAL_TYPES = ('Bone', 'Rigid Body Marker', 'Bone Marker')


class _Place(NamedTuple):
    """
    Three columns that hold a position.

    Attributes:
        rank: rank of its type in `_TYPES`.
        name: name of the body or marker.
        column: column of x.
        turn: column of the x of its quaternion; -1 if there is none.

    """

    rank: int
    name: str
    column: int
    turn: int = -1


def read_motive(path: str | Path, markers: Sequence[str] | None = None) -> MarkerRecording:
    """
    Read a CSV file of Motive.

    Args:
        path: the file.
        markers: names of the rigid bodies or markers to read; default: all.

    Returns:
        The rigid bodies and markers, in the unit of the file.

    Raises:
        DataError: the file is missing or not of this format; names file, line and fault.

    """
    path = Path(path)
    rows = _rows(path)
    where, first = next(rows, (str(path), []))
    about = _about(first, where)
    header: list[list[str]] = []
    for where, row in rows:
        if row and row[0].strip() == 'Frame':
            break
        if len(header) >= _MAX_HEADER_LINES:
            raise DataError(f'{where}: no line that begins with Frame up to here')
        if any(cell.strip() for cell in row):
            header.append(row)
    else:
        raise DataError(f'{path}: no line that begins with Frame')
    titles = [cell.strip() for cell in row]
    places = _places(header, titles, about.get('Coordinate Space', 'Global'), where)
    names = [place.name for place in places]
    chosen = {name: places[k] for name, k in choose(names, markers).items()}
    columns = {name: place.column for name, place in chosen.items()}
    turns = {n: range(p.turn, p.turn + 4) for n, p in chosen.items() if p.turn >= 0}
    time = next((k for k, title in enumerate(titles) if title.startswith('Time (')), None)
    if time is None:
        raise DataError(f'{where}: no column Time (Seconds)')
    table = WideTable(columns, len(titles), time, 0, turns=turns)
    for where, row in rows:
        if row:
            table.add(row, where)
    table.check_frames(path, about.get('Total Exported Frames', ''))
    unit = about.get('Length Units', '')
    return MarkerRecording(
        table.times(), names, table.positions(), unit, _up(about), path.name, 'm', 'y',
        table.turned(),
    )  # fmt: skip


def _rows(path: Path) -> Iterator[tuple[str, list[str]]]:
    for number, line in iterate_lines(path):
        where = f'{path}: line {number}'
        try:
            yield where, next(csv.reader([line]), [])
        except csv.Error as error:
            raise DataError(f'{where}: {error}') from error


def _about(row: Sequence[str], where: str) -> dict[str, str]:
    """Return the names and values of the first line."""
    cells = [cell.strip() for cell in row]
    about = dict(zip(cells[::2], cells[1::2], strict=False))
    version = re.fullmatch(r'([0-9]{1,3})\.([0-9]{1,4})', about.get('Format Version', ''))
    if version is None:
        raise DataError(
            f'{where}: not a CSV file of Motive, which would begin with Format Version; '
            'export it with its header'
        )
    # 1.2 was followed by 1.21.
    if (int(version[1]), int(version[2][0])) < _MIN_VERSION:
        raise DataError(f'{where}: format version {version[0]}; 1.2 or later is needed')
    return about


def _up(about: dict[str, str]) -> str:
    """Return the up axis if the header names it."""
    for name in ('Up Axis', 'Vertical Axis'):
        axis = about.get(name, '').lower().removesuffix(' axis').strip('+ ')
        if axis in ('x', 'y', 'z'):
            return axis
    return ''


def _places(
    header: Sequence[Sequence[str]], titles: Sequence[str], space: str, where: str
) -> list[_Place]:
    """Find the columns of every position, the best of several with one name."""
    if len(header) < 3:
        raise DataError(f'{where}: the lines of types, names and components are missing')
    types, labels, components = header[0], header[1], header[-1]
    best: dict[str, _Place] = {}
    repeated = []
    turns: dict[tuple[str, str], int] = {}
    for column in range(len(titles) - 2):
        if titles[column:][:3] != ['X', 'Y', 'Z']:
            continue
        kind, name, component = (
            row[column].strip() if column < len(row) else '' for row in (types, labels, components)
        )
        if component == 'Rotation' and titles[column:][:4] == ['X', 'Y', 'Z', 'W']:
            turns.setdefault((kind, name), column)
        if kind not in _TYPES or component != 'Position':
            continue
        if kind in _LOCAL_TYPES and space != 'Global':
            continue
        place = _Place(_TYPES.index(kind), name.strip('"'), column)
        known = best.get(place.name)
        if known is not None and known.rank == place.rank:
            repeated.append(place)
        elif known is None or place.rank < known.rank:
            best[place.name] = place
    if not best:
        raise DataError(f'{where}: no positions of bodies or markers in space {quote(space)}')
    twice = [place for place in repeated if place.rank == best[place.name].rank]
    return [
        place._replace(turn=turns.get((_TYPES[place.rank], place.name), -1))
        for place in (*best.values(), *twice)
    ]
