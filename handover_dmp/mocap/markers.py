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

"""Recordings of markers, as exported by mocap programs, and their two wrists."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.mocap.orientation import orientation_at, turn_orientation_up
from handover_dmp.mocap.tables import quote
from handover_dmp.mocap.units import known_unit, METRES
from handover_dmp.mocap.up_axis import doubts, find_up_axis, turn_up, USUAL_UP
from handover_dmp.mocap.wrists import (
    AS_TOLD,
    ASSUMED,
    find_gaps,
    IN_FILE,
    Known,
    mark_unseen,
    MAX_HIDDEN_S,
    middle,
    WristMotion,
)
import numpy as np

_NAMES_SHOWN = 20


@dataclass(frozen=True, eq=False)
class MarkerRecording:
    """
    Markers, or rigid bodies, over time.

    Attributes:
        times: (n,) s.
        names: names of all markers in the file.
        positions: by name of each read marker, (n, 3) in the unit of the file; NaN if it was not
            seen. Placeholders that programs write for unseen markers become NaN.
        unit: unit of length in the file; empty if it names none.
        up: axis that points up in the file; empty if it names none.
        source: origin of the recording, in words.
        usual_unit: default unit of the program that wrote the file.
        usual_up: default up axis of that program.
        orientations: by name of each rigid body, (n, 4) unit quaternions x, y, z, w; NaN if it
            was not seen. Markers have none.

    """

    times: Array
    names: Sequence[str]
    positions: Mapping[str, Array]
    unit: str
    up: str
    source: str
    usual_unit: str = 'mm'
    usual_up: str = 'z'
    orientations: Mapping[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        marked = {name: mark_unseen(places) for name, places in self.positions.items()}
        object.__setattr__(self, 'positions', marked)

    @property
    def known(self) -> str:
        """Names of the markers, for an error message."""
        return name_list(self.names)

    def wrists(
        self,
        partner: Sequence[str],
        demonstrator: Sequence[str],
        *,
        unit: str | None = None,
        up: str | None = None,
    ) -> WristMotion:
        """
        Extract the wrists of both partners from the recording.

        Args:
            partner: markers of P1's wrist; the middle between them is the wrist.
            demonstrator: markers of P2's wrist.
            unit: unit of length; overrides the file.
            up: axis that points up; overrides the file.

        Returns:
            Both wrists in metres, z up, at the times when both were seen; with orientations if a
            wrist is one rigid body.

        Raises:
            DataError: a marker is missing, the wrists are never seen together, unit or axis are
                unknown, or samples are invalid.

        """
        found = self._unit(unit)
        scale = METRES[found.value]
        both = tuple(scale * self._wrist(names) for names in (partner, demonstrator))
        seen = [np.asarray(np.isfinite(wrist).all(axis=1)) for wrist in both]
        together = seen[0] & seen[1]
        motion = WristMotion(
            self.times[together],
            both[0][together],
            both[1][together],
            source=self.source,
            unit=found,
            gaps=(*find_gaps(self.times, seen[0], 'P1'), *find_gaps(self.times, seen[1], 'P2')),
        ).checked()
        # Check the unit first: in a wrong unit, heights mean nothing.
        axis = self._up(up, both)
        remarks: tuple[str, ...] = ()
        if axis.why in (IN_FILE, USUAL_UP):
            remarks = doubts(both, axis.value, assumed=axis.why == USUAL_UP)
        return replace(
            motion,
            partner=turn_up(motion.partner, axis.value),
            demonstrator=turn_up(motion.demonstrator, axis.value),
            up=axis,
            remarks=(*remarks, *self._lost(partner), *self._lost(demonstrator)),
            partner_orientation=self._turned(partner, motion.times, axis.value),
            demonstrator_orientation=self._turned(demonstrator, motion.times, axis.value),
        )

    def _turned(self, names: Sequence[str], at: Array, up: str) -> Array | None:
        if len(names) != 1:
            return None
        turns = orientation_at(self.times, self.orientations.get(names[0]), at, MAX_HIDDEN_S)
        return turn_orientation_up(turns, up)

    def _lost(self, names: Sequence[str]) -> Iterator[str]:
        """Name the markers of a wrist that were missing while others were seen."""
        seen = {name: np.asarray(np.isfinite(self._find(name)).all(axis=1)) for name in names}
        any_seen = np.any(list(seen.values()), axis=0)
        for name, here in seen.items():
            if count := int((any_seen & ~here).sum()):
                share = f'{count} of {len(here)} frames'
                yield f'{quote(name)} is missing in {share}: other markers replace it'

    def _unit(self, unit: str | None) -> Known:
        if unit is not None:
            return Known(known_unit(unit, self.source), AS_TOLD)
        if self.unit.strip(' \0'):
            return Known(known_unit(self.unit, self.source), IN_FILE)
        return Known(self.usual_unit, ASSUMED)

    def _up(self, up: str | None, wrists: tuple[Array, ...]) -> Known:
        if up is not None:
            return Known(up, AS_TOLD)
        if self.up:
            return Known(self.up, IN_FILE)
        return Known(*find_up_axis(wrists, self.usual_up, self.source))

    def _wrist(self, names: Sequence[str]) -> Array:
        markers = [self._find(name) for name in names]
        return middle(markers, f'{self.source}: {name_list(names)}')

    def _find(self, name: str) -> Array:
        if name not in self.positions:
            raise DataError(f'{self.source}: no marker {quote(name)}; there are {self.known}')
        if (count := sum(other == name for other in self.names)) > 1:
            raise DataError(f'{self.source}: {count} markers are named {quote(name)}')
        return self.positions[name]


def choose(names: Sequence[str], wanted: Sequence[str] | None) -> dict[str, int]:
    """
    Find markers among those of a file.

    Args:
        names: names of all markers, in order; of two equal names, the first counts.
        wanted: names to find; missing ones are skipped. Default: all.

    Returns:
        By name, the index of the marker, in the order of `wanted`.

    """
    places: dict[str, int] = {}
    for place, name in enumerate(names):
        places.setdefault(name, place)
    if wanted is None:
        return places
    return {name: places[name] for name in wanted if name in places}


def name_list(names: Sequence[str]) -> str:
    """Return names on one line; long lists are shortened."""
    more = len(names) - _NAMES_SHOWN
    shown = ', '.join(quote(name)[1:-1] for name in names[:_NAMES_SHOWN])
    return shown + (f' and {more} more' if more > 0 else '')
