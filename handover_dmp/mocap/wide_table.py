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

"""Common part of the text files of mocap programs: a line per frame, three cells per marker."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.mocap.tables import parse_number, parse_numbers
import numpy as np

_MAX_VALUES = 10_000_000
_MAX_RATE_HZ = 1e5
_NOT_SEEN = {'', 'nan', '-nan', 'nan(ind)', '-nan(ind)', 'null', '-', 'no data', 'n/a', '#n/a'}


@dataclass(eq=False)
class WideTable:
    """
    The frames of a recording, read line by line.

    Attributes:
        columns: by name of each wanted marker, the column of its x.
        width: required number of cells of a line.
        time: column of the time in s; None if the file has none.
        frame: column of the frame number; None if the file has none.
        period_s: time from frame to frame, s; used if the file has no times.
        residuals: by name of a marker, the column that is below 0 if it was not seen.
        turns: by name of a body, the columns of its rotation.

    """

    columns: Mapping[str, int]
    width: int
    time: int | None
    frame: int | None
    period_s: float = 0.0
    residuals: Mapping[str, int] = field(default_factory=dict)
    turns: Mapping[str, Sequence[int]] = field(default_factory=dict)
    _stamps: array[float] = field(default_factory=lambda: array('d'))
    _values: array[float] = field(default_factory=lambda: array('d'))
    _turned: array[float] = field(default_factory=lambda: array('d'))

    def __len__(self) -> int:
        """Return the number of frames so far."""
        return len(self._stamps)

    def add(self, cells: Sequence[str], where: str) -> None:
        """
        Read the line of a frame.

        Args:
            cells: its cells; empty ones beyond the last column do not count.
            where: file and line, for the error.

        Raises:
            DataError: there are too few or too many cells, or a cell is no number.

        """
        beyond = ''.join(cells[self.width:])  # fmt: skip
        if len(cells) < self.width or beyond.strip():
            raise DataError(f'{where}: {len(cells)} values instead of {self.width}')
        if len(self._values) > _MAX_VALUES:
            raise DataError(f'{where}: more than can be held')
        for name, first in self.columns.items():
            place = cells[first:][:3]
            seen = not any(map(is_unseen, place)) and self._is_measured(name, cells, where)
            self._values.extend(
                parse_numbers(place, (name,) * 3, where) if seen else (np.nan,) * 3
            )
        for columns in self.turns.values():
            # rotations are optional, so an invalid number does not refuse the file
            self._turned.extend(float(c) if is_number(c := cells[k]) else np.nan for k in columns)
        self._stamps.append(self._stamp(cells, where))

    def times(self) -> Array:
        """
        Return the time of every frame; missing frames leave a gap in time.

        Returns:
            (n,) s.

        """
        stamps = np.array(self._stamps)
        return stamps if self.time is not None else (stamps - stamps[:1]) * self.period_s

    def check_frames(self, path: Path, told: str) -> None:
        """
        Refuse a recording without frames, or with fewer than its header says.

        Args:
            path: the file, for the error.
            told: number of frames in the header; anything but a number counts as unknown.

        Raises:
            DataError: there are no frames, or too few.

        """
        if not len(self):
            raise DataError(f'{path}: holds no frames')
        if told.isdecimal() and len(told) < 12 and int(told) > len(self):
            raise DataError(f'{path}: {len(self)} frames, but the header says {int(told)}')

    def frame_span(self) -> int:
        """Return the number of frames from the first to the last, including missing ones."""
        if self.time is not None or not self._stamps:
            return len(self._stamps)
        return round(self._stamps[-1] - self._stamps[0]) + 1

    def positions(self) -> dict[str, Array]:
        """Return (n, 3) for every marker, NaN if it was not seen."""
        table = np.array(self._values).reshape(len(self._stamps), len(self.columns), 3)
        return {name: table[:, k] for k, name in enumerate(self.columns)}

    def turned(self) -> dict[str, Array]:
        """Return (n, columns) for every body with rotations, NaN if there was none."""
        sizes = [len(columns) for columns in self.turns.values()]
        table = np.array(self._turned).reshape(len(self._stamps), sum(sizes))
        parts = np.split(table, np.cumsum(sizes)[:-1], axis=1) if sizes else []
        return dict(zip(self.turns, parts, strict=True))

    def _stamp(self, cells: Sequence[str], where: str) -> float:
        if self.time is not None:
            return parse_number(cells[self.time], 'time', where)
        if self.frame is not None:
            return parse_number(cells[self.frame], 'frame', where)
        return float(len(self._stamps))

    def _is_measured(self, name: str, cells: Sequence[str], where: str) -> bool:
        column = self.residuals.get(name)
        if column is None or is_unseen(cells[column]):
            return True
        return parse_number(cells[column], f'residual of {name}', where) >= 0.0


def is_unseen(cell: str) -> bool:
    """Tell whether a cell means that nothing was seen."""
    return cell.strip().lower() in _NOT_SEEN


def is_number(cell: str) -> bool:
    """Tell whether a cell holds a number, or a word for a missing one."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def period_of_rate(text: str, name: str, where: str) -> float:
    """
    Turn a rate into a period.

    Args:
        text: the rate, Hz.
        name: its name in the file, for the error.
        where: file and line, for the error.

    Returns:
        The period, s.

    Raises:
        DataError: the text is no number, or no rate.

    """
    rate = parse_number(text, name, where)
    if not 0.0 < rate <= _MAX_RATE_HZ:
        raise DataError(f'{where}: {name} of {rate:g} Hz')
    return 1.0 / rate
