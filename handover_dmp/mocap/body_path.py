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

"""The path of one tracked body: positions and orientations over time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.mocap.no_pose import no_pose
from handover_dmp.mocap.tables import parse_number, read_records
import numpy as np

PLACE_COLUMNS = ('t', 'x', 'y', 'z')
TURN_COLUMNS = ('qx', 'qy', 'qz', 'qw')
MIN_POSES = 20


@dataclass(frozen=True, eq=False)
class BodyPath:
    """
    The path of a body from one source, without invalid poses.

    Attributes:
        label: name for messages.
        frame: frame of the poses; empty if unknown.
        times: (n,) s, strictly increasing.
        positions: (n, 3) m.
        quaternions: (n, 4) x, y, z, w, of norm 1; None if there are none.
        delay_s: median time from the stamp to the recording, s; 0 if unknown.

    """

    label: str
    frame: str
    times: Array
    positions: Array
    quaternions: Array | None = None
    delay_s: float = 0.0


def make_body_path(
    label: str,
    frame: str,
    times: Array,
    positions: Array,
    quaternions: Array,
    delay_s: float = 0.0,
) -> BodyPath:
    """
    Make a path from raw poses.

    Args:
        label: name for messages.
        frame: frame of the poses.
        times: (n,) s, in any order; of two poses with one stamp the first counts.
        positions: (n, 3) m, NaN if the body was not seen.
        quaternions: (n, 4) x, y, z, w, NaN if there are none.
        delay_s: median time from the stamp to the recording, s.

    Returns:
        The path.

    Raises:
        DataError: too few poses.

    """
    order = np.argsort(times, kind='stable')
    once = order[np.concatenate([[True], np.diff(times[order]) > 0.0])] if len(order) else order
    seen = once[np.isfinite(positions[once]).all(axis=1)]
    if len(seen) < MIN_POSES:
        invalid = len(once) - len(seen)
        lost = f' and {invalid} invalid ones' if invalid else ''
        raise DataError(f'{label}: {len(seen)} poses{lost}; at least {MIN_POSES} are needed')
    turns = quaternions[seen]
    norms = np.linalg.norm(turns, axis=1, keepdims=True)
    turned = bool(np.isfinite(norms).all()) and bool((norms > 0.0).all())
    return BodyPath(
        label,
        frame,
        times[seen],
        positions[seen],
        turns / norms if turned else None,
        delay_s,
    )


def read_body_csv(path: str | Path) -> BodyPath:
    """
    Read a path from a CSV file.

    Args:
        path: the file, with columns `t,x,y,z`, in s and m, and optionally `qx,qy,qz,qw`, in any
            order; other columns are ignored. Empty cells, `nan` and exact zeros mean that the
            body was not seen.

    Returns:
        The path; its frame is empty.

    Raises:
        DataError: names file, line and fault; or there are too few poses.

    """
    path = Path(path)
    records = read_records(path, PLACE_COLUMNS)
    if not records:
        raise DataError(f'{path}: no poses')
    turned = all(column in records[0][1] for column in TURN_COLUMNS)
    rows = []
    for number, record in records:
        where = f'{path}: line {number}'
        time = parse_number(record['t'], 't', where)
        place = tuple(_number(record[column], column, where) for column in PLACE_COLUMNS[1:])
        turn = tuple(
            _number(record[column], column, where) if turned else float('nan')
            for column in TURN_COLUMNS
        )
        seen = not no_pose(place, turn if turned else None)
        rows.append((time, *(place if seen else (float('nan'),) * 3), *turn))
    table = np.array(rows)
    return make_body_path(path.name, '', table[:, 0], table[:, 1:4], table[:, 4:])


def _number(cell: str, name: str, where: str) -> float:
    if cell.strip().lower() in ('', 'nan'):
        return float('nan')
    return parse_number(cell, name, where)
