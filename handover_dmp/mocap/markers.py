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

"""Recordings of markers, as mocap programs export them, and the two wrists among them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from handover_dmp.common.errors import DataError
from handover_dmp.mocap.tables import quote
from handover_dmp.mocap.trial import find_fault, HandoverTrial
import numpy as np
from numpy.typing import NDArray

METRES = {'m': 1.0, 'cm': 0.01, 'mm': 0.001}
# Unseen for longer than this, a hand may have been anywhere.
MAX_GAP_S = 0.25
_NAMES_SHOWN = 20


@dataclass(frozen=True, eq=False)
class MarkerRecording:
    """
    Markers over time.

    Attributes:
        times: (n,) s.
        names: of all markers in the file.
        positions: name of a marker that was read to (n, 3) in the unit of the file; NaN where it
            was not seen.
        unit: `m`, `cm` or `mm`.
        up: the axis that points up, `z` or `y`.
        source: where it comes from, in words.

    """

    times: NDArray[np.float64]
    names: Sequence[str]
    positions: Mapping[str, NDArray[np.float64]]
    unit: str
    up: str
    source: str

    @property
    def known(self) -> str:
        """Names of the markers, for an error message."""
        more = len(self.names) - _NAMES_SHOWN
        names = ', '.join(quote(name)[1:-1] for name in self.names[:_NAMES_SHOWN])
        return names + (f' and {more} more' if more > 0 else '')

    def wrists(
        self,
        partner: Sequence[str],
        demonstrator: Sequence[str],
        *,
        unit: str | None = None,
        up: str | None = None,
    ) -> WristMotion:
        """
        Take the wrists of both partners out of the recording.

        Args:
            partner: markers of P1's wrist; the middle between them is the wrist.
            demonstrator: markers of P2's wrist.
            unit: of the file, where it does not tell or is wrong.
            up: `z` or `y`, where the file does not tell or is wrong.

        Returns:
            Both wrists in metres, z up, at the times when all of these markers were seen.

        Raises:
            DataError: no such marker, never seen together, or samples that make no sense.

        """
        seen = np.ones(len(self.times), dtype=bool)
        wrists = []
        for names in (partner, demonstrator):
            wrist = METRES[unit or self.unit] * np.mean(
                [self._find(name) for name in names], axis=0
            )
            wrists.append(_turn_up(wrist, up or self.up))
            seen &= np.isfinite(wrist).all(axis=1)
        return WristMotion(
            self.times[seen], wrists[0][seen], wrists[1][seen], source=self.source
        ).checked()

    def _find(self, name: str) -> NDArray[np.float64]:
        if name not in self.positions:
            raise DataError(f'{self.source}: no marker {quote(name)}; there are {self.known}')
        return self.positions[name]


@dataclass(frozen=True, eq=False)
class WristMotion:
    """
    Both wrists over a recording of any length, of one handover or of many.

    Attributes:
        times: (n,) s, strictly increasing; gaps are where not both were seen.
        partner: (n, 3) m, z up.
        demonstrator: (n, 3) m, z up.
        source: where it comes from, in words.

    """

    times: NDArray[np.float64]
    partner: NDArray[np.float64]
    demonstrator: NDArray[np.float64]
    source: str

    def checked(self) -> WristMotion:
        """
        Check that these can be the wrists of two people.

        Returns:
            The motion itself.

        Raises:
            DataError: too few samples, or some that make no sense.

        """
        if len(self.times) < 2:
            raise DataError(f'{self.source}: the two wrists are never seen together')
        for first, end in self.spans():
            part = slice(first, end)
            both = np.hstack([self.partner[part], self.demonstrator[part]])
            fault = find_fault(self.times[part], both, max_duration_s=np.inf, minimum=1)
            if fault:
                at = f'{self.times[first + (fault.row or 0)]:.3f} s: '
                raise DataError(f'{self.source}: {at}{fault.what}')
        return self

    def spans(self) -> list[tuple[int, int]]:
        """Return first index and end of every stretch without a gap."""
        breaks = np.flatnonzero(np.diff(self.times) > MAX_GAP_S) + 1
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
            number: of the trial.

        Returns:
            The trial, its time starting at 0.

        Raises:
            DataError: a wrist was out of sight for too long, or the samples make no trial.

        """
        if end - first < 1:
            raise DataError(f'{self.source}: no samples to make a trial of')
        times = self.times[first:end]
        gaps = np.diff(times)
        if len(gaps) and gaps.max() > MAX_GAP_S:
            at = f'{times[int(np.argmax(gaps))]:.3f} s'
            raise DataError(f'{self.source}: {at}: a wrist is out of sight for {gaps.max():.2g} s')
        return HandoverTrial(
            times=np.round(times - float(times[0]), 6),
            partner=self.partner[first:end],
            demonstrator=self.demonstrator[first:end],
            configuration=configuration,
            direction=direction,
            number=number,
            source=self.source,
        )


def choose(names: Sequence[str], wanted: Sequence[str] | None) -> dict[str, int]:
    """
    Find markers among those of a file.

    Args:
        names: of all markers, in order; of two of one name, the first counts.
        wanted: which to find, of those that are there; all if left out.

    Returns:
        Name to place in the order, in the order of `wanted`.

    """
    places: dict[str, int] = {}
    for place, name in enumerate(names):
        places.setdefault(name, place)
    if wanted is None:
        return places
    return {name: places[name] for name in wanted if name in places}


def _turn_up(positions: NDArray[np.float64], up: str) -> NDArray[np.float64]:
    """Turn y up into z up by a quarter turn about x: (x, y, z) becomes (x, −z, y)."""
    if up == 'z':
        return positions
    return np.column_stack([positions[:, 0], -positions[:, 2], positions[:, 1]])
