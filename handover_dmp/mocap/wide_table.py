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

"""The part that text files of all mocap programs share: a line a frame, three cells a marker."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

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
    The frames of a recording as they are read, line by line.

    Attributes:
        columns: name of a marker that is wanted to the column of its x.
        width: cells that a line must have.
        time: column of the time in s; None where the file has none.
        frame: column of the number of the frame; None where the file has none.
        period_s: time from frame to frame; used where the file has no times.
        residuals: name of a marker to the column that is below 0 where it was not seen.
        turns: name of a body to the columns that tell how it is turned.

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
            DataError: too few or too many cells, or one that is no number.

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
            # nobody depends on them, so what is no number is no reason to refuse the file
            self._turned.extend(float(c) if is_number(c := cells[k]) else np.nan for k in columns)
        self._stamps.append(self._stamp(cells, where))

    def times(self) -> Array:
        """
        Give the time of every frame; where frames are missing, time goes on without them.

        Returns:
            (n,) s.

        """
        stamps = np.array(self._stamps)
        return stamps if self.time is not None else (stamps - stamps[:1]) * self.period_s

    def frame_span(self) -> int:
        """Return the number of frames from the first to the last, with those that are missing."""
        if self.time is not None or not self._stamps:
            return len(self._stamps)
        return round(self._stamps[-1] - self._stamps[0]) + 1

    def positions(self) -> dict[str, Array]:
        """Give (n, 3) for every marker, NaN where it was not seen."""
        table = np.array(self._values).reshape(len(self._stamps), len(self.columns), 3)
        return {name: table[:, k] for k, name in enumerate(self.columns)}

    def turned(self) -> dict[str, Array]:
        """Give (n, columns) for every body whose turns were read, NaN where there was none."""
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
    """Tell whether a cell says that there is nothing in it."""
    return cell.strip().lower() in _NOT_SEEN


def is_number(cell: str) -> bool:
    """Tell whether a cell holds a number, or the word for none."""
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
        name: what the file calls it, for the error.
        where: file and line, for the error.

    Returns:
        The period, s.

    Raises:
        DataError: no number, or not a rate.

    """
    rate = parse_number(text, name, where)
    if not 0.0 < rate <= _MAX_RATE_HZ:
        raise DataError(f'{where}: {name} of {rate:g} Hz')
    return 1.0 / rate
