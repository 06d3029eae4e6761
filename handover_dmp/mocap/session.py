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
A recorded session: both wrists from before the tool is picked up until both have withdrawn.

A session is a CSV file with the columns of a trial, only longer. The index `sessions.csv` beside
it has one line per exchange with its times.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
import re

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.mocap.filtering import RATE_HZ, smooth_columns
from handover_dmp.mocap.segmentation import ORDERS, Segment, segment
from handover_dmp.mocap.tables import quote, read_records, save
from handover_dmp.mocap.trial import DIRECTIONS, read_columns, WristColumns, write_columns
from handover_dmp.mocap.wrists import WristMotion
import numpy as np

SESSIONS_NAME = 'sessions.csv'
STILL_SPEED = 0.05
"""A slower wrist is at rest, m/s; at a pick-up it rests"""
STILL_S = 0.15
"""for at least this time, s,"""
AWAY_M = 0.1
"""and at least this far from the start of its reach, m."""
_WHAT = ('file', 'configuration', 'trial', 'exchange')
_TIMES = ('start_s', 'exchange_s', 'parting_s', 'way_back_from_s', 'way_back_to_s')


@dataclass(frozen=True, eq=False)
class RecordedSession:
    """
    A recording of several exchanges in a row, with their times.

    Attributes:
        motion: both wrists, from rest to rest.
        exchanges: the exchanges, in order.
        configuration: where it took place.
        number: number of the session within its configuration.

    """

    motion: WristMotion
    exchanges: tuple[Segment, ...]
    configuration: str = 'unnamed'
    number: int = 1

    @property
    def file_name(self) -> str:
        """Return the name of its file, `<configuration>_<number>.csv`."""
        return f'{self.configuration}_{self.number}.csv'

    @property
    def pick_up(self) -> Array | None:
        """
        Position of P2's wrist at the pick-up, (3,), m: its last rest before the first give.

        None if the recording begins later, or with a take.
        """
        times, first = self.motion.times, self.exchanges[0]
        before = times < first.start_s
        if first.direction != 'give' or not np.any(before):
            return None
        wrist = self.motion.demonstrator[before]
        speeds = np.linalg.norm(np.gradient(wrist, times[before], axis=0), axis=1)
        away = np.linalg.norm(wrist - wrist[-1], axis=1) > AWAY_M
        stands = np.flatnonzero(np.diff([0, *((speeds < STILL_SPEED) & away), 0]))
        for begin, end in reversed(stands.reshape(-1, 2).tolist()):
            # before the start of a recording nothing is known
            if begin > 0 and times[end - 1] - times[begin] >= STILL_S:
                return np.asarray(wrist[begin:end].mean(axis=0))
        return None

    def low_passed(self, cutoff_hz: float) -> RecordedSession:
        """
        Low-pass and resample the session.

        Args:
            cutoff_hz: cut-off frequency of the zero-phase low-pass, Hz; 0: no low-pass.

        Returns:
            The session at 200 Hz.

        """
        if not cutoff_hz:
            return self
        smoothed = smooth_columns(WristColumns.of(self.motion), RATE_HZ, cutoff_hz)
        return replace(self, motion=replace(self.motion, **smoothed._asdict()))


def read_csv_wrists(path: str | Path) -> WristMotion:
    """
    Read both wrists over a recording of any length from a CSV file with the header of a trial.

    Args:
        path: the file.

    Returns:
        Both wrists, in metres, z up.

    Raises:
        DataError: the file cannot be read, or is no recording of two wrists; names file, line and
            fault.

    """
    path = Path(path)
    return WristMotion(**read_columns(path)._asdict(), source=path.name).checked()


def read_session(path: str | Path) -> RecordedSession:
    """
    Read a recorded session.

    Args:
        path: CSV file, or bag with both wrists. The index beside a CSV file has the times of the
            exchanges; without one they are found by distance and speed.

    Returns:
        The session.

    Raises:
        DataError: the file cannot be read, or contains no exchange.

    """
    path = Path(path)
    if path.suffix.lower() == '.csv':
        motion = read_csv_wrists(path)
    else:
        from handover_dmp.mocap.bag import read_bag_wrists

        motion = read_bag_wrists(path)
    index = path.parent / SESSIONS_NAME
    told = [_told(row, f'{index}: line {line}') for line, row in _lines_of(path)]
    exchanges = told or segment(motion).segments
    if not exchanges:
        raise DataError(f'{path}: contains no exchange')
    configuration, number = describe_session(path) or (path.stem, 1)
    return RecordedSession(motion, tuple(exchanges), configuration, number)


def describe_session(path: str | Path) -> tuple[str, int] | None:
    """
    Look a recording up in the index beside it.

    Args:
        path: file of the recording.

    Returns:
        Configuration and number; None if no index names it.

    Raises:
        DataError: the index cannot be read.

    """
    for _, row in _lines_of(Path(path)):
        return row['configuration'], int(row['trial'])
    return None


def _lines_of(path: Path) -> list[tuple[int, dict[str, str]]]:
    """Return the lines of the index beside a recording that name it."""
    index = path.parent / SESSIONS_NAME
    if not index.exists():
        return []
    lines = read_records(index, (*_WHAT, *_TIMES))
    named = [(line, row) for line, row in lines if row['file'] == path.name]
    for line, row in named:
        if not re.fullmatch('[0-9]{1,9}', row['trial'], re.ASCII):
            raise DataError(f'{index}: line {line}: trial {quote(row["trial"])} is not a number')
    return named


def giver_of(path: str | Path) -> str | None:
    """
    Find the giver of a recording in the index beside it.

    Args:
        path: file of the recording.

    Returns:
        A value of `Segmentation.giver`; None if no index names the recording, or no value fits.

    """
    directions = [row['exchange'] for _, row in _lines_of(Path(path))]
    for giver, order in ORDERS.items():
        if directions and directions == [order[k % 2] for k in range(len(directions))]:
            return giver
    return None


def session_files(folder: str | Path) -> list[Path]:
    """
    List the recordings that the index of a folder names.

    Args:
        folder: folder with `sessions.csv`.

    Returns:
        Their files, in the order of the index.

    Raises:
        DataError: there is no index, or it cannot be read.

    """
    folder = Path(folder)
    rows = read_records(folder / SESSIONS_NAME, _WHAT)
    return [folder / name for name in dict.fromkeys(row['file'] for _, row in rows)]


def write_sessions(
    sessions: Sequence[RecordedSession],
    folder: str | Path,
    progress: Callable[[], object] | None = None,
) -> None:
    """
    Write sessions as CSV files, and finally their index.

    Args:
        sessions: the sessions, no two of one configuration and number.
        folder: output folder; created if missing.
        progress: called after each session.

    Raises:
        DataError: two sessions have the same name, or a file exists already; then nothing is
            written.

    """
    folder = Path(folder)
    names = Counter(session.file_name for session in sessions)
    for name, count in names.items():
        if count > 1:
            raise DataError(f'{folder}: more than one session would be written as {name}')
    for name in (*names, SESSIONS_NAME):
        if (folder / name).exists():
            raise DataError(f'{folder / name}: exists already; a recording is never overwritten')
    lines = [','.join((*_WHAT, *_TIMES))]
    for session in sessions:
        write_columns(WristColumns.of(session.motion), folder / session.file_name)
        lines += [_row(session, part) for part in session.exchanges]
        if progress:
            progress()
    save(folder / SESSIONS_NAME, '\n'.join(lines) + '\n')


def _row(session: RecordedSession, part: Segment) -> str:
    back = part.way_back_s or (None, None)
    times = (part.start_s, part.exchange_s, part.parting_s, *back)
    cells = ['' if time is None else repr(round(time, 6)) for time in times]
    what = session.file_name, session.configuration, str(session.number), part.direction
    return ','.join((*what, *cells))


def _told(row: dict[str, str], where: str) -> Segment:
    """Read a line of the index."""
    if row['exchange'] not in DIRECTIONS:
        raise DataError(f"{where}: exchange {quote(row['exchange'])} instead of 'give' or 'take'")
    try:
        start, meeting, parting, *back = (float(row[name] or 'nan') for name in _TIMES)
    except ValueError as error:
        raise DataError(f'{where}: a time is not a number') from error
    # unknown times are NaN, which compares as in order
    in_order = start < meeting and not parting < meeting and not back[1] <= back[0]
    if not in_order:
        raise DataError(f'{where}: the times are not in order')
    return Segment(
        start,
        meeting,
        row['exchange'],
        None if np.isnan(parting) else parting,
        None if np.isnan(back).any() else (back[0], back[1]),
    )
