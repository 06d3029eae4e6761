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

"""Both wrists over a recording of any length, and how they were recorded."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.mocap.trial import find_fault, HandoverTrial, WristColumns
import numpy as np
from numpy.typing import NDArray

# After a longer gap, a hand may have been anywhere, s.
MAX_HIDDEN_S = 0.25
# P2 reaches farther than the first, and a handover takes more room than the second. P1 may hold
# still.
MIN_REACH_M = 0.02
MIN_WORKSPACE_M = 0.05
# A unit that is only assumed must be confirmed by a reach of this length.
SURE_REACH_M = 0.1
# A sample is missing if the next one is later than this number of periods.
_MISSED_PERIODS = 1.8
# Numbers that programs write for unseen markers; 9999999 is from Cortex.
_EMPTY = 9_999_999.0
# Stamps of one moment differ by less, s.
STAMP_ROUNDING_S = 1e-6
# Sources of knowledge about a recording.
ASSUMED = 'assumed'
AS_TOLD = 'as told'
IN_FILE = 'in the file'


class Gap(NamedTuple):
    """
    A time in which a wrist was not seen.

    Attributes:
        who: `P1` or `P2`.
        start_s: last time before the gap at which it was seen, s.
        end_s: first time after the gap at which it was seen, s.

    """

    who: str
    start_s: float
    end_s: float

    def since(self, zero_s: float) -> Gap:
        """Return the gap on a clock that starts at a time, s."""
        return self._replace(start_s=self.start_s - zero_s, end_s=self.end_s - zero_s)

    def hides(self, times: Array) -> NDArray[np.bool_]:
        """Return which times, (n,) s, are within the gap."""
        begin_s, end_s = self.start_s + STAMP_ROUNDING_S, self.end_s - STAMP_ROUNDING_S
        return np.asarray((times > begin_s) & (times < end_s))


class Known(NamedTuple):
    """
    A known property of a recording.

    Attributes:
        value: its value.
        why: source of the knowledge, in words.

    """

    value: str
    why: str


METRES_KNOWN = Known('m', 'by convention')
Z_KNOWN = Known('z', 'by convention')


@dataclass(frozen=True, eq=False)
class WristMotion:
    """
    Both wrists over a recording of any length, of one handover or of many.

    Attributes:
        times: (n,) s, strictly increasing; samples are missing if not both wrists were seen.
        partner: (n, 3) m, z up.
        demonstrator: (n, 3) m, z up.
        source: origin of the recording, in words.
        unit: unit of length in the recording.
        up: axis that points up in the recording.
        gaps: times in which one of the wrists was not seen.
        remarks: further remarks.
        partner_orientation: (n, 4) unit quaternions x, y, z, w; None if unknown.
        demonstrator_orientation: the same for P2.

    """

    times: Array
    partner: Array
    demonstrator: Array
    source: str
    unit: Known = METRES_KNOWN
    up: Known = Z_KNOWN
    gaps: tuple[Gap, ...] = ()
    remarks: tuple[str, ...] = ()
    partner_orientation: Array | None = None
    demonstrator_orientation: Array | None = None

    def checked(self) -> WristMotion:
        """
        Check that these can be the wrists of two people.

        Returns:
            The motion itself.

        Raises:
            DataError: there are too few samples, or some are invalid.

        """
        if len(self.times) < 2:
            raise DataError(f'{self.source}: the two wrists are never seen together')
        for first, end in self.spans():
            part = slice(first, end)
            both = np.hstack([self.partner[part], self.demonstrator[part]])
            fault = find_fault(self.times[part], both, max_duration_s=np.inf, minimum=1)
            if fault:
                at = f'{self.times[first + (fault.row or 0)]:.3f} s: '
                hint = '; --unit says which' if 'millimetres' in fault.what else ''
                raise DataError(f'{self.source}: {at}{fault.what}{hint}')
        self._check_size()
        return self

    def spans(self) -> list[tuple[int, int]]:
        """Return first and end index of every stretch without a gap."""
        breaks = np.flatnonzero(np.diff(self.times) > MAX_HIDDEN_S) + 1
        edges = [0, *breaks.tolist(), len(self.times)]
        return list(pairwise(edges))

    def trial(
        self, first: int, end: int, *, configuration: str, direction: str, number: int
    ) -> HandoverTrial:
        """
        Cut a trial out.

        Args:
            first: index of its first sample.
            end: index after its last sample.
            configuration: where it took place.
            direction: `give` or `take`.
            number: number of the trial.

        Returns:
            The trial; its time starts at 0.

        Raises:
            DataError: a wrist was out of sight for too long, or the samples are no valid trial.

        """
        if end - first < 1:
            raise DataError(f'{self.source}: no samples to make a trial of')
        times = self.times[first:end]
        gaps = np.diff(times)
        if len(gaps) and gaps.max() > MAX_HIDDEN_S:
            at = f'{times[int(np.argmax(gaps))]:.3f} s'
            raise DataError(f'{self.source}: {at}: a wrist is out of sight for {gaps.max():.2g} s')
        columns = WristColumns.of(self).cut(slice(first, end))
        return HandoverTrial(
            **columns._replace(times=np.round(times - float(times[0]), 6))._asdict(),
            configuration=configuration,
            direction=direction,
            number=number,
            source=self.source,
        )

    def _check_size(self) -> None:
        """Refuse a motion that is too small for people, as in a wrong unit."""
        unit = f'if the unit is {self.unit.value}; say which with --unit'
        moved = extent(self.demonstrator)
        if moved < (SURE_REACH_M if self.unit.why == ASSUMED else MIN_REACH_M):
            raise DataError(f'{self.source}: P2 moves only {1e3 * moved:.2g} mm in all, {unit}')
        room = extent(np.vstack([self.partner, self.demonstrator]))
        if room < MIN_WORKSPACE_M:
            raise DataError(f'{self.source}: both wrists stay within {1e3 * room:.2g} mm, {unit}')


def extent(positions: Array) -> float:
    """Return the diagonal of the bounding box of positions (n, 3)."""
    return float(np.linalg.norm(np.ptp(positions, axis=0)))


def mark_unseen(positions: Array) -> Array:
    """
    Replace placeholders for an unseen marker or body by NaN.

    Args:
        positions: (..., 3); placeholders are NaN, the exact origin, and numbers that programs
            write for unseen markers.

    Returns:
        A copy; all three coordinates are NaN if the marker was not seen.

    """
    unseen = ~np.isfinite(positions).all(axis=-1)
    unseen |= (positions == 0.0).all(axis=-1)
    unseen |= (np.abs(positions) == _EMPTY).any(axis=-1)
    return np.where(unseen[..., None], np.nan, positions)


def middle(markers: list[Array], names: str) -> Array:
    """
    Follow the middle between markers of one wrist, even while some of them are not seen.

    Samples with all markers give the offset of each marker from the middle. While some markers
    are missing, the others give the middle, each by its own offset, interpolated over the gap. The
    wrist therefore does not jump when a marker is lost.

    Args:
        markers: (n, 3) each, NaN if the marker was not seen.
        names: names of the markers, for the error.

    Returns:
        (n, 3), NaN if no marker was seen.

    Raises:
        DataError: the markers are never all seen at once.

    """
    if len(markers) == 1:
        return markers[0]
    table = np.stack(markers)
    seen = np.asarray(np.isfinite(table).all(axis=2))
    whole = np.flatnonzero(seen.all(axis=0))
    if len(whole) == 0:
        raise DataError(f'{names} are never all seen at once; leave some of them out')
    centre = table[:, whole].mean(axis=0)
    every = np.arange(table.shape[1])
    total = np.zeros(table.shape[1:])
    for marker, place in zip(table, seen, strict=True):
        offset = marker[whole] - centre
        away = np.column_stack([np.interp(every, whole, column) for column in offset.T])
        total[place] += marker[place] - away[place]
    count = seen.sum(axis=0)[:, None]
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def find_gaps(times: Array, seen: NDArray[Any], who: str) -> list[Gap]:
    """
    Find the gaps of a wrist.

    Args:
        times: (n,) s, of all samples; missing samples are gaps, too.
        seen: (n,) whether the wrist was seen.
        who: `P1` or `P2`.

    Returns:
        The gaps between the first and the last time at which it was seen.

    """
    if len(times) < 3:
        return []
    period = float(np.median(np.diff(times)))
    when = times[seen]
    wide = np.flatnonzero(np.diff(when) > _MISSED_PERIODS * period)
    return [Gap(who, float(when[k]), float(when[k + 1])) for k in wide]
