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
Reader of CSV or text files of Vicon Nexus, and of the objects of Vicon Tracker.

The file is a sequence of sections, each with a line with its name, its rate, a line of names, a
line `Frame,Sub Frame,X,Y,Z,...`, units, then one line per frame, until an empty line. Sections of
devices, joints etc. are skipped. Unseen markers have empty cells. Objects and segments have their
rotation before their position: RX, RY, RZ, RW is a quaternion; RX, RY, RZ, if called helical, is
axis times angle.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import csv
from math import isfinite, nan
from pathlib import Path
from typing import NamedTuple

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.common.quaternions import exponential
from handover_dmp.mocap.markers import choose, MarkerRecording
from handover_dmp.mocap.tables import iterate_lines
from handover_dmp.mocap.wide_table import is_number, period_of_rate, WideTable
import numpy as np

_SECTIONS = ('Trajectories', 'Objects', 'Global Segments')
_TRIPLETS = (('X', 'Y', 'Z'), ('TX', 'TY', 'TZ'))
_TURNS = (['RX', 'RY', 'RZ', 'RW'], ['RX', 'RY', 'RZ'])
NO_TURN = (nan,) * 4
_DELIMITERS = (',', '\t', ';')

_Lines = Iterator[tuple[int, str]]


class _Place(NamedTuple):
    """
    The columns of a marker or object.

    Attributes:
        name: its name.
        first: column of its x.
        turn: columns with its rotation; none if it has no readable one.

    """

    name: str
    first: int
    turn: range


def read_vicon(path: str | Path, markers: Sequence[str] | None = None) -> MarkerRecording:
    """
    Read a file that Vicon Nexus or Tracker exported.

    Args:
        path: the file.
        markers: names of the markers to read; default: all.

    Returns:
        The markers or objects, in the unit of the file.

    Raises:
        DataError: the file is missing or not of this format; names file, line and fault.

    """
    path = Path(path)
    lines = iterate_lines(path)
    other = []
    for _, line in lines:
        title = line.strip(' ,;\t"')
        if title in _SECTIONS:
            return _read_section(path, title, lines, markers)
        if title.replace(' ', '').isalpha() and title != 'Frame':
            other.append(title)
    found = f'; it has {", ".join(other[:5])}' if other else ''
    raise DataError(f'{path}: no section {" or ".join(_SECTIONS)}{found}')


def _read_section(
    path: Path, title: str, lines: _Lines, markers: Sequence[str] | None
) -> MarkerRecording:
    where, rate = _next(path, lines)
    period_s = period_of_rate(rate.strip(' ,;\t"'), 'the rate', where)
    _, labels = _next(path, lines)
    where, titles = _next(path, lines)
    delimiter = next((mark for mark in _DELIMITERS if mark in titles), ',')
    axes = [cell.strip() for cell in _split(titles, delimiter)]
    while axes and not axes[-1]:
        axes.pop()
    places = _places(axes, [cell.strip() for cell in _split(labels, delimiter)], where)
    names = [place.name for place in places]
    chosen = {name: places[k] for name, k in choose(names, markers).items()}
    columns = {name: place.first for name, place in chosen.items()}
    turns = {name: place.turn for name, place in chosen.items() if place.turn}
    table = WideTable(columns, len(axes), None, 0, period_s, turns=turns)
    unit = ''
    unit_of: dict[int, str] = {}
    for number, line in lines:
        cells = _split(line, delimiter)
        where = f'{path}: line {number}'
        if not len(table) and not ''.join(cells[:1]).strip():
            unit = unit or _unit(cells, places, where)
            unit_of = unit_of or dict(enumerate(map(str.strip, cells)))
        elif not cells or not is_number(cells[0]):
            break
        else:
            table.add(cells, where)
    if not len(table):
        raise DataError(f'{path}: no frames in its section {title}')
    orientations = {
        name: _quaternions(values, unit_of.get(turns[name][0], ''))
        for name, values in table.turned().items()
    }
    return MarkerRecording(
        table.times(), names, table.positions(), unit, '', path.name,
        orientations=orientations,
    )  # fmt: skip


def _quaternions(values: Array, unit: str) -> Array:
    """Make quaternions from three or four columns."""
    if values.shape[1] == 4:
        return values
    scale = np.radians(1.0) if unit == 'deg' else 1.0
    turns = scale * np.nan_to_num(values, nan=np.inf)
    return np.array([exponential(t) if all(map(isfinite, t)) else NO_TURN for t in turns.tolist()])


def _next(path: Path, lines: _Lines) -> tuple[str, str]:
    for number, line in lines:
        return f'{path}: line {number}', line
    raise DataError(f'{path}: ends within the header of a section')


def _places(axes: Sequence[str], named: Sequence[str], where: str) -> list[_Place]:
    if axes[:2] != ['Frame', 'Sub Frame']:
        raise DataError(f'{where}: a line that begins with Frame and Sub Frame is expected')
    places = [
        _Place(
            next((name for name in named[column::-1] if name), ''),
            column,
            _turn_before(axes, named, column),
        )
        for column in range(2, len(axes) - 2)
        if tuple(axes[column:][:3]) in _TRIPLETS
    ]
    if not places:
        raise DataError(f'{where}: no columns X, Y, Z')
    return places


def _turn_before(axes: Sequence[str], named: Sequence[str], column: int) -> range:
    """Return the columns with a readable rotation before a position."""
    for turn in _TURNS:
        first = column - len(turn)
        if first >= 0 and list(axes[first:column]) == turn:
            label = named[first].lower() if first < len(named) else ''
            if len(turn) == 4 or 'helical' in label:
                return range(first, column)
    return range(0)


def _unit(cells: Sequence[str], places: Sequence[_Place], where: str) -> str:
    units = {cells[place.first].strip() for place in places if place.first < len(cells)}
    if len(units) > 1:
        raise DataError(f'{where}: positions in more than one unit')
    return ''.join(units)


def _split(line: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:
        return line.split(delimiter)
