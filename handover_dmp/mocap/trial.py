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

"""One recorded handover: the wrists of both partners over time, and its CSV file."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from pathlib import Path
import re
from typing import Any, NamedTuple

from handover_dmp.common.arrays import Array, read_only
from handover_dmp.common.errors import DataError
from handover_dmp.mocap.orientation import AXES_OF_TURN, orientation_fault, unit_orientations
from handover_dmp.mocap.tables import read_records, read_table, save
import numpy as np

HEADER = ('t', 'p1_x', 'p1_y', 'p1_z', 'p2_x', 'p2_y', 'p2_z')
TURN_HEADERS = tuple(tuple(f'{who}_{axis}' for axis in AXES_OF_TURN) for who in ('p1', 'p2'))
"""Optional columns of the orientation of each wrist."""
_HEADERS = tuple(
    (*HEADER, *chain(*turned)) for turned in ((), TURN_HEADERS[:1], TURN_HEADERS[1:], TURN_HEADERS)
)
DIRECTIONS = ('give', 'take')
INDEX_NAME = 'trials.csv'
WAY_BACK_FOLDER = 'way_back'
INDEX_COLUMNS = ('file', 'configuration', 'exchange', 'trial')

MIN_SAMPLES = 10
LARGEST_COORDINATE_M = 100.0
LARGEST_STAMP_S = 1e12
MIN_PERIOD_S = 1e-5
MAX_SAMPLE_PERIOD_S = 2.0
MAX_DURATION_S = 600.0
# No hand is this fast, and no dropped sample hides such a distance: the frame has changed.
JUMP_M = 0.3
JUMP_SPEED = 15.0
# Programs write three zeros for an unseen marker; a hand may pass the origin only slowly.
ZERO_JUMP_M = 0.02
ZERO_JUMP_SPEED = 5.0

_NAME = re.compile(r'(?P<configuration>.+)_(?P<exchange>give|take)_(?P<number>[0-9]{1,9})')


@dataclass(frozen=True, eq=False)
class HandoverTrial:
    """
    One handover between two people.

    P1 is the partner, who stays human (the mechanic). P2 is the demonstrator, whom the robot
    replaces (the assistant). Positions are in the room's frame, z up. The arrays are read-only
    copies.

    Attributes:
        times: (n,) seconds, strictly increasing, n >= 10.
        partner: (n, 3) metres, wrist of P1.
        demonstrator: (n, 3) metres, wrist of P2.
        configuration: where it took place, e.g. `engine_bay`.
        direction: `give` (P2 gives to P1) or `take` (P2 takes from P1).
        number: number of the trial within its configuration and exchange.
        source: origin of the trial, in words.
        partner_orientation: (n, 4) unit quaternions x, y, z, w of P1's wrist, without sign jumps;
            None if unknown.
        demonstrator_orientation: the same for P2.
        way_back: both wrists from the time when P2's leaves the exchange until it rests; None if
            unknown.

    Raises:
        DataError: the samples cannot belong to one handover.

    """

    times: Array
    partner: Array
    demonstrator: Array
    configuration: str = 'unnamed'
    direction: str = 'give'
    number: int = 1
    source: str = ''
    partner_orientation: Array | None = None
    demonstrator_orientation: Array | None = None
    way_back: HandoverTrial | None = None

    def __post_init__(self) -> None:
        for name in ('times', 'partner', 'demonstrator'):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        shapes = (self.times.shape, self.partner.shape, self.demonstrator.shape)
        count = len(self.times) if self.times.ndim else 0
        if shapes != ((count,), (count, 3), (count, 3)):
            raise DataError(f'{self.label}: shapes {shapes} instead of (n,), (n, 3), (n, 3)')
        if self.way_back is not None and self.way_back.way_back is not None:
            raise DataError(f'{self.label}: the way back must not have a way back itself')
        if self.direction not in DIRECTIONS:
            raise DataError(
                f"{self.label}: exchange {self.direction!r} instead of 'give' or 'take'"
            )
        if fault := find_fault(self.times, np.hstack([self.partner, self.demonstrator])):
            where = '' if fault.row is None else f'sample {fault.row}: '
            raise DataError(f'{self.label}: {where}{fault.what}')
        for name in ('partner_orientation', 'demonstrator_orientation'):
            if (given := getattr(self, name)) is not None:
                object.__setattr__(self, name, self._unit(np.asarray(given, dtype=np.float64)))

    def _unit(self, quaternions: Array) -> Array:
        if quaternions.shape != (len(self.times), 4):
            raise DataError(f'{self.label}: orientations of shape {quaternions.shape}, not (n, 4)')
        if fault := orientation_fault(self.times, quaternions):
            raise DataError(f'{self.label}: sample {fault[0]}: {fault[1]}')
        return read_only(unit_orientations(quaternions))

    def __repr__(self) -> str:
        """Return label, number of samples and duration."""
        return f'HandoverTrial({self.label}, {len(self.times)} samples, {self.duration_s:.2f} s)'

    @property
    def label(self) -> str:
        """Readable name: configuration, exchange and number."""
        return f'{self.configuration} {self.direction} {self.number}'

    @property
    def duration_s(self) -> float:
        """Time from the first sample to the last, s."""
        return float(self.times[-1] - self.times[0])

    @property
    def rate_hz(self) -> float:
        """Return the sampling rate from the median period, Hz."""
        return float(1.0 / np.median(np.diff(self.times)))


class Fault(NamedTuple):
    """
    A fault in a set of samples.

    Attributes:
        row: index of the sample; None if the fault concerns all samples.
        what: the fault in words.

    """

    row: int | None
    what: str


def find_fault(
    times: Array,
    positions: Array,
    *,
    minimum: int = MIN_SAMPLES,
    max_duration_s: float = MAX_DURATION_S,
) -> Fault | None:
    """
    Find the first reason why samples cannot belong to one handover.

    Args:
        times: (n,) s.
        positions: (n, 3 k) m, the coordinates of k points side by side.
        minimum: least number of samples.
        max_duration_s: longest time from the first to the last sample, s.

    Returns:
        The fault, or None.

    """
    if len(times) < minimum:
        return Fault(None, f'{len(times)} samples, at least {minimum} are needed')
    finite = np.isfinite(times) & np.isfinite(positions).all(axis=1)
    if not finite.all():
        return Fault(int(np.argmin(finite)), 'a value is not a finite number')
    checks = (
        _time_fault(times, max_duration_s),
        _place_fault(positions),
        _jump_fault(times, positions),
    )
    faults = [fault for fault in checks if fault is not None]
    return min(faults, key=lambda fault: -1 if fault.row is None else fault.row, default=None)


def read_trial(
    path: str | Path,
    *,
    configuration: str | None = None,
    direction: str | None = None,
    number: int | None = None,
) -> HandoverTrial:
    """
    Read a trial from its CSV file.

    The file has the header `t,p1_x,p1_y,p1_z,p2_x,p2_y,p2_z` and one line per sample, in seconds
    and metres. Optional orientations follow as `p1_qx,p1_qy,p1_qz,p1_qw`, the same for P2, or
    both: unit quaternions. Configuration, direction and number come from the arguments, otherwise
    from the line of a `trials.csv` beside the file, otherwise from its name
    `<configuration>_<exchange>_<number>.csv`; a file of another name counts as a give, number 1,
    of a configuration of that name. A file of the same name in the folder `way_back` beside it is
    P2's way back.

    Args:
        path: the file.
        configuration: configuration, if known.
        direction: `give` or `take`, if known.
        number: number of the trial, if known.

    Returns:
        The trial.

    Raises:
        DataError: the file is missing or not a trial; names file, line and fault.

    """
    path = Path(path)
    columns = read_columns(path)
    if fault := find_fault(columns.times, np.hstack([columns.partner, columns.demonstrator])):
        where = '' if fault.row is None else f'line {fault.row + 2}: '
        raise DataError(f'{path}: {where}{fault.what}')
    if None in (configuration, direction, number):
        known = _from_index(path) or describe(path)
        configuration = known[0] if configuration is None else configuration
        direction = direction or known[1] or 'give'
        number = known[2] if number is None else number
    if direction not in DIRECTIONS:
        raise DataError(f"{path}: exchange {direction!r} instead of 'give' or 'take'")
    about: dict[str, Any] = {
        'configuration': configuration,
        'direction': direction,
        'number': number,
    }
    way_back = None
    if path.parent.name != WAY_BACK_FOLDER and way_back_file(path).exists():
        way_back = read_trial(way_back_file(path), **about)
    return HandoverTrial(**columns._asdict(), **about, source=path.name, way_back=way_back)


class WristColumns(NamedTuple):
    """
    The columns of a file as arrays.

    Attributes:
        times: (n,) s.
        partner: (n, 3) m.
        demonstrator: (n, 3) m.
        partner_orientation: (n, 4) unit quaternions x, y, z, w; None if there are none.
        demonstrator_orientation: the same for P2.

    """

    times: Array
    partner: Array
    demonstrator: Array
    partner_orientation: Array | None
    demonstrator_orientation: Array | None

    @classmethod
    def of(cls, recorded: Any) -> WristColumns:
        """
        Take the columns of an object with attributes of these names.

        Args:
            recorded: a trial or a recording.

        Returns:
            Its columns.

        """
        return cls(*(getattr(recorded, name) for name in cls._fields))

    def cut(self, part: slice) -> WristColumns:
        """Return some of the samples."""
        columns: list[Any] = [None if column is None else column[part] for column in self]
        return WristColumns(*columns)


def read_columns(path: Path) -> WristColumns:
    """
    Read the columns of a trial, or of a recording of any length.

    Args:
        path: CSV file.

    Returns:
        The columns; numbers are finite, orientations are checked, positions are not.

    Raises:
        DataError: the file cannot be read, has other columns, or an orientation is invalid.

    """
    names, values = read_table(path, _HEADERS)
    turns: list[Array | None] = [None, None]
    for who, (first, *_) in enumerate(TURN_HEADERS):
        if first in names:
            turns[who] = quaternions = values[:, names.index(first):][:, :4]  # fmt: skip
            if fault := orientation_fault(values[:, 0], quaternions):
                raise DataError(f'{path}: line {fault[0] + 2}: {fault[1]}')
    return WristColumns(values[:, 0], values[:, 1:4], values[:, 4:7], *turns)


def way_back_file(path: Path) -> Path:
    """Return the file of the way back for the file of a trial."""
    return path.parent / WAY_BACK_FOLDER / path.name


def describe(path: Path) -> tuple[str, str | None, int]:
    """
    Parse the file name of a trial.

    Args:
        path: the file; only its name matters.

    Returns:
        Configuration, direction and number from `<configuration>_<exchange>_<number>.*`. For
        another name: that name, None and 1; other names do not tell the direction (Motive calls
        every recording `Take 2023-05-01`).

    """
    match = _NAME.fullmatch(path.stem)
    if match:
        return match['configuration'], match['exchange'], int(match['number'])
    return path.stem, None, 1


def write_trial(trial: HandoverTrial, path: str | Path) -> None:
    """
    Write a trial as CSV, atomically; reading it back gives the same values to the last bit.

    The way back is written first, as a file of the same name in the folder `way_back` beside it.

    Args:
        trial: the trial.
        path: the file; its folder is created if missing.

    Raises:
        DataError: the file cannot be written.

    """
    if trial.way_back is not None:
        write_trial(trial.way_back, way_back_file(Path(path)))
    write_columns(WristColumns.of(trial), path)


def write_columns(columns: WristColumns, path: str | Path) -> None:
    """
    Write the wrists of two people as CSV, atomically.

    Args:
        columns: the columns; `read_columns` reads them back to the last bit.
        path: the file; its folder is created if missing.

    Raises:
        DataError: the file cannot be written.

    """
    turns = zip(TURN_HEADERS, columns[3:], strict=True)
    turned = {names: quaternions for names, quaternions in turns if quaternions is not None}
    header = [*HEADER, *chain(*turned)]
    rows = np.column_stack([*columns[:3], *turned.values()]).tolist()
    lines = [','.join(header), *(','.join(map(repr, row)) for row in rows)]
    save(Path(path), '\n'.join(lines) + '\n')


def _time_fault(times: Array, max_duration_s: float) -> Fault | None:
    if abs(times[0]) > LARGEST_STAMP_S:
        return Fault(0, f'time {times[0]:g} s is absurd')
    periods = np.diff(times)
    wrong = (periods < MIN_PERIOD_S) | (periods > MAX_SAMPLE_PERIOD_S)
    if not wrong.any():
        if times[-1] - times[0] > max_duration_s:
            return Fault(None, f'{times[-1] - times[0]:.0f} s are too long for one handover')
        return None
    row = int(np.argmax(wrong)) + 1
    before, now = times[row - 1], times[row]
    if now < before:
        return Fault(row, f'time runs backwards, from {before:g} to {now:g} s')
    if now == before:
        return Fault(row, f'time {now:g} s is repeated')
    if now - before > MAX_SAMPLE_PERIOD_S:
        return Fault(row, f'no sample for {now - before:.3g} s before this one')
    return Fault(row, f'only {now - before:.3g} s after the sample before')


def _place_fault(positions: Array) -> Fault | None:
    far = np.abs(positions).max(axis=1) > LARGEST_COORDINATE_M
    if not far.any():
        return None
    row = int(np.argmax(far))
    value = positions[row][np.argmax(np.abs(positions[row]))]
    return Fault(row, f'a position of {value:g} m; are these millimetres?')


def _jump_fault(times: Array, positions: Array) -> Fault | None:
    if len(times) < 2:
        return None
    with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
        steps = np.diff(positions, axis=0).reshape(len(times) - 1, -1, 3)
        every = np.sqrt(np.square(steps).sum(axis=2))
        lengths = every.max(axis=1)
        periods = np.abs(np.diff(times))
        jumps = (lengths > JUMP_M) & (lengths > JUMP_SPEED * periods)
        zero = (positions.reshape(len(times), -1, 3) == 0.0).all(axis=2)
        lost = (zero[1:] != zero[:-1]) & (every > ZERO_JUMP_M)
        lost &= every > ZERO_JUMP_SPEED * periods[:, None]
    if lost.any():
        row = int(np.argmax(lost.any(axis=1))) + 1
        return Fault(row, 'a jump to or from 0, 0, 0: leave out unseen samples')
    if not jumps.any():
        return None
    row = int(np.argmax(jumps)) + 1
    return Fault(row, f'a jump of {lengths[row - 1]:.2g} m from one sample to the next')


def _from_index(path: Path) -> tuple[str, str, int] | None:
    try:
        for _, row in read_records(path.parent / INDEX_NAME, INDEX_COLUMNS):
            if row['file'] == path.name:
                return row['configuration'], row['exchange'], int(row['trial'])
    except (DataError, ValueError):
        # A faulty index must not prevent reading one trial; read_data_set reports faulty indices.
        return None
    return None
