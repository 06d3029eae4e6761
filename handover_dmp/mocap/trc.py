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
Reader of TRC, the marker trajectories of OpenSim and of Motion Analysis' Cortex.

The file has a line with its type; a line of names and a line of their values (`DataRate`,
`NumFrames`, `Units`, ...); a line `Frame#`, `Time` and the names of the markers; a line of axes;
an optional empty line; then one line per frame. Tabs separate the cells, or commas in files from
a spreadsheet program. Unseen markers have empty cells.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from pathlib import Path

from handover_dmp.common.errors import DataError
from handover_dmp.mocap.markers import choose, MarkerRecording
from handover_dmp.mocap.tables import iterate_lines
from handover_dmp.mocap.wide_table import WideTable

_HEADER_LINES = 5
_LEADING = 2


def read_trc(path: str | Path, markers: Sequence[str] | None = None) -> MarkerRecording:
    """
    Read a TRC file.

    Args:
        path: the file.
        markers: names of the markers to read; default: all.

    Returns:
        The markers, in the unit of the file.

    Raises:
        DataError: the file is missing or not of this format; names file, line and fault.

    """
    path = Path(path)
    lines = iterate_lines(path)
    first = [line for _, line in islice(lines, _HEADER_LINES)]
    between = '\t' if '\t' in ''.join(first[:1]) else ','
    head = [[cell.strip() for cell in line.split(between)] for line in first]
    if not head or head[0][0] != 'PathFileType':
        raise DataError(f'{path}: line 1: not a TRC file, which would begin with PathFileType')
    if len(head) < _HEADER_LINES or head[3][0] != 'Frame#':
        raise DataError(f'{path}: line 4: a line that begins with Frame# is expected')
    about = dict(zip(head[1], head[2], strict=False))
    names = [name for name in head[3][_LEADING:] if name]
    if not names:
        raise DataError(f'{path}: line 4: names no markers')
    columns = {name: _LEADING + 3 * k for name, k in choose(names, markers).items()}
    table = WideTable(columns, _LEADING + 3 * len(names), 1, 0)
    for number, line in lines:
        if line.strip(between).strip():
            table.add(line.split(between), f'{path}: line {number}')
    table.check_frames(path, about.get('NumFrames', ''))
    return MarkerRecording(
        table.times(), names, table.positions(), about.get('Units', ''), '', path.name, 'mm', 'y'
    )
