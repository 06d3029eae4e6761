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
Segmentation of a long recording of two wrists into handovers, by distance and speed.

An exchange is the moment when the wrists are near each other and have stopped relative to each
other (if they never stop, the moment of least distance). From there the search goes back to the
moment when P2's hand, and P1's if it moves, left its rest. Between two exchanges the wrists must
have parted.

The giver cannot be known for certain from wrists. As a rule the giver starts: the person whose
hand leaves its rest first is taken as the giver, and a P1 who waits with a stretched-out hand as
the receiver. If the order is known (the object goes back and forth, or always in one direction),
set `giver`.

After the exchange the hands part: a hand leaves when it last rested before it gets fast again, and
P2's way back ends at its next rest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
import math
from typing import NamedTuple

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import UsageError
from handover_dmp.mocap.filtering import RATE_HZ, smooth
from handover_dmp.mocap.trial import HandoverTrial
from handover_dmp.mocap.wrists import WristMotion
import numpy as np
from numpy.typing import NDArray

ORDERS = {
    'p2': ('give', 'give'),
    'p1': ('take', 'take'),
    'p2_then_p1': ('give', 'take'),
    'p1_then_p2': ('take', 'give'),
}
"""Directions of the first two exchanges, and of all that follow, by known giver."""
GIVERS = ('first_mover', *ORDERS)
# The wrists are about to meet when they are slow and this near to their least distance; they have
# met when they are this near to the least distance of the following moments.
_ABOUT_TO_MEET_M = 0.02
_MET_M = 0.002
_MOMENTS_S = 0.4
# A hand has started when it reaches this share of the peak speed of its reach.
_STARTED = 0.15


@dataclass(frozen=True)
class Segmentation:
    """
    Thresholds of the segmentation.

    Attributes:
        near_m: distance below which wrists may exchange something, m.
        apart_m: distance to which wrists must part before they can exchange again, m.
        moving_speed: speed below which a hand rests, m/s.
        reach_speed: speed that a reaching hand exceeds, m/s.
        min_reach_m: least length of P2's reach, m.
        margin_s: rest to keep before the first hand starts, s.
        min_duration_s: least duration of a handover, s.
        max_duration_s: largest duration of a single handover, s.
        giver: `first_mover`, `p2` (all are gives), `p1` (all are takes), `p2_then_p1` or
            `p1_then_p2` (alternating).

    Raises:
        UsageError: a threshold is out of range.

    """

    near_m: float = 0.55
    apart_m: float = 0.65
    moving_speed: float = 0.05
    reach_speed: float = 0.2
    min_reach_m: float = 0.15
    margin_s: float = 0.1
    min_duration_s: float = 0.4
    max_duration_s: float = 6.0
    giver: str = 'first_mover'

    def __post_init__(self) -> None:
        if self.giver not in GIVERS:
            raise UsageError(f'giver {self.giver!r} is not one of {", ".join(GIVERS)}')
        rising = (
            ('near_m', self.near_m, 'apart_m', self.apart_m),
            ('moving_speed', self.moving_speed, 'reach_speed', self.reach_speed),
            ('min_duration_s', self.min_duration_s, 'max_duration_s', self.max_duration_s),
        )
        for low_name, low, high_name, high in rising:
            if not 0.0 < low <= high < math.inf:
                raise UsageError(f'{low_name} {low} and {high_name} {high} are not in order')
        if not (0.0 <= self.margin_s < math.inf and 0.0 < self.min_reach_m < math.inf):
            raise UsageError('margin_s or min_reach_m is out of range')


class Segment(NamedTuple):
    """
    One handover in a recording.

    Attributes:
        start_s: its start on the clock of the recording, s.
        exchange_s: time at which the wrists have met, s.
        direction: `give` or `take`.
        parting_s: time at which the first hand left the exchange, s; None if neither left.
        way_back_s: times at which P2's hand left the exchange and rested again, s; None if it did
            not go back.

    """

    start_s: float
    exchange_s: float
    direction: str
    parting_s: float | None = None
    way_back_s: tuple[float, float] | None = None


class Passage(NamedTuple):
    """
    A meeting of the wrists without a usable handover.

    Attributes:
        at_s: time of the meeting, s.
        reason: why it is left out.

    """

    at_s: float
    reason: str


@dataclass(frozen=True, eq=False)
class SegmentedMotion:
    """
    A recording and the handovers found in it.

    Attributes:
        motion: the recording.
        thresholds: thresholds of the segmentation.
        segments: the handovers, in order.
        passages: meetings that were left out, and why.

    """

    motion: WristMotion
    thresholds: Segmentation
    segments: list[Segment]
    passages: list[Passage]

    def trials(self, configuration: str, *, way_back: bool = False) -> list[HandoverTrial]:
        """
        Cut the handovers out of the recording, unfiltered.

        Args:
            configuration: where they took place.
            way_back: whether to include P2's way back of each.

        Returns:
            One trial per handover, gives and takes numbered from 1 each, times from 0.

        """
        trials: list[HandoverTrial] = []
        for part in self.segments:
            number = 1 + sum(trial.direction == part.direction for trial in trials)
            trial = self._cut(part.start_s, part.exchange_s, configuration, part, number)
            if way_back and part.way_back_s:
                back = self._cut(*part.way_back_s, configuration, part, number)
                trial = replace(trial, way_back=back)
            trials.append(trial)
        return trials

    def _cut(
        self, start_s: float, end_s: float, configuration: str, part: Segment, number: int
    ) -> HandoverTrial:
        first, end = np.searchsorted(self.motion.times, [start_s - 1e-9, end_s + 1e-9])
        return self.motion.trial(
            int(first),
            int(end),
            configuration=configuration,
            direction=part.direction,
            number=number,
        )


def segment(motion: WristMotion, thresholds: Segmentation | None = None) -> SegmentedMotion:
    """
    Find the handovers in a recording.

    Args:
        motion: both wrists.
        thresholds: thresholds of the segmentation.

    Returns:
        The handovers, and the meetings that were left out.

    """
    thresholds = thresholds or Segmentation()
    segments: list[Segment] = []
    passages: list[Passage] = []
    for first, end in motion.spans():
        times = motion.times[first:end]
        if len(times) < 4 or times[-1] - times[0] < thresholds.min_duration_s:
            continue
        section = SmoothedSection.of(motion, first, end)
        free_from = 0
        meetings = section.meetings(thresholds)
        nexts = [near for near, _ in meetings[1:]] + [len(section.times) - 1]
        for (near, apart), following in zip(meetings, nexts, strict=False):
            found = section.handover(free_from, near, apart, following, thresholds)
            free_from = apart
            if isinstance(found, Passage):
                passages.append(found)
            else:
                segments.append(found)
    if thresholds.giver in ORDERS:
        order = ORDERS[thresholds.giver]
        segments = [
            found._replace(direction=order[number % 2]) for number, found in enumerate(segments)
        ]
    return SegmentedMotion(motion, thresholds, segments, passages)


@dataclass(frozen=True, eq=False)
class SmoothedSection:
    """
    A stretch of the recording without gaps, smoothed, at an even rate.

    Attributes:
        times: (m,) s.
        demonstrator: (m, 3) m.
        distance: (m,) m, from wrist to wrist.
        speeds: (m,) m/s each, speeds of P1 and P2.
        closing: (m,) m/s, relative speed of the wrists.

    """

    times: Array
    demonstrator: Array
    distance: Array
    speeds: tuple[Array, Array]
    closing: Array

    @classmethod
    def of(cls, motion: WristMotion, first: int, end: int) -> SmoothedSection:
        """
        Smooth a stretch of a recording.

        Args:
            motion: the recording.
            first: index of the first sample.
            end: index after the last sample, at least 4 later.

        Returns:
            The stretch.

        """
        both = np.hstack([motion.partner[first:end], motion.demonstrator[first:end]])
        times, positions, velocities = smooth(motion.times[first:end], both, RATE_HZ)
        return cls(
            times=times,
            demonstrator=positions[:, 3:],
            distance=np.linalg.norm(positions[:, 3:] - positions[:, :3], axis=1),
            speeds=(
                np.linalg.norm(velocities[:, :3], axis=1),
                np.linalg.norm(velocities[:, 3:], axis=1),
            ),
            closing=np.linalg.norm(velocities[:, 3:] - velocities[:, :3], axis=1),
        )

    def meetings(self, thresholds: Segmentation) -> list[tuple[int, int]]:
        """Return the indices at which the wrists come near and have parted again."""
        found: list[tuple[int, int]] = []
        at = 0
        while True:
            near = _first(self.distance[at:] < thresholds.near_m)
            if near is None:
                return found
            near += at
            parted = _first(self.distance[near:] > thresholds.apart_m)
            at = len(self.times) if parted is None else near + parted
            found.append((near, at))

    def handover(
        self, free_from: int, near: int, apart: int, following: int, thresholds: Segmentation
    ) -> Segment | Passage:
        """
        Find exchange, start and end of the handover for a meeting from `near` to `apart`.

        The handover lies between its neighbours, from `free_from` to `following`.
        """
        meeting = self._exchange(near, apart, thresholds)
        at_s = float(self.times[meeting])

        partner_speed, demonstrator_speed = self.speeds
        onset = _onset(demonstrator_speed, free_from, meeting, thresholds)
        if onset is None:
            return Passage(at_s, 'P2 does not reach')
        reach_m = float(np.linalg.norm(self.demonstrator[meeting] - self.demonstrator[onset]))
        if reach_m < thresholds.min_reach_m:
            return Passage(at_s, f'P2 reaches only {reach_m:.2f} m')
        start, partner_first = onset, False
        partner_onset = _onset(partner_speed, free_from, meeting, thresholds)
        reaching = slice(onset, meeting + 1)
        if partner_onset is not None and (partner_speed[reaching] > thresholds.reach_speed).any():
            start = min(onset, partner_onset)
            partner_first = _started(partner_speed, partner_onset, meeting) < _started(
                demonstrator_speed, onset, meeting
            )
        start = max(start - round(thresholds.margin_s * RATE_HZ), free_from)
        start_s = float(self.times[start])
        if not thresholds.min_duration_s <= at_s - start_s <= thresholds.max_duration_s:
            return Passage(at_s, f'lasts {at_s - start_s:.2f} s')
        direction = 'take' if partner_first else 'give'
        leaves = [_leaves(speed, meeting, following, thresholds) for speed in self.speeds]
        left = [index for index in leaves if index is not None]
        parting_s = float(self.times[min(left)]) if left else None
        back_s = self._way_back(leaves[1], following, thresholds)
        return Segment(start_s, at_s, direction, parting_s, back_s)

    def _way_back(
        self, leaves: int | None, following: int, thresholds: Segmentation
    ) -> tuple[float, float] | None:
        """Return start and end of P2's way back, with a margin of rest at the end."""
        if leaves is None:
            return None
        speed = self.speeds[1][leaves: following + 1]  # fmt: skip
        fast = int(np.argmax(speed > thresholds.reach_speed))
        rests = _first(speed[fast:] < thresholds.moving_speed)
        if rests is None:
            return None
        end = leaves + fast + rests
        way_m = float(np.linalg.norm(self.demonstrator[end] - self.demonstrator[leaves]))
        duration_s = float(self.times[end] - self.times[leaves])
        if way_m < thresholds.min_reach_m or duration_s < thresholds.min_duration_s:
            return None
        end = min(end + round(thresholds.margin_s * RATE_HZ), following)
        return float(self.times[leaves]), float(self.times[end])

    def _exchange(self, near: int, apart: int, thresholds: Segmentation) -> int:
        together = self.distance[near:apart]
        close = together <= together.min() + _ABOUT_TO_MEET_M
        slow = _first(close & (self.closing[near:apart] < thresholds.moving_speed))
        if slow is None:
            return near + int(np.argmin(together))
        moments = together[slow: slow + round(_MOMENTS_S * RATE_HZ)]  # fmt: skip
        return near + slow + int(np.argmax(moments <= moments.min() + _MET_M))


def _onset(speed: Array, free_from: int, meeting: int, thresholds: Segmentation) -> int | None:
    """Return the index at which the last reach before the exchange left its rest."""
    fast = np.flatnonzero(speed[free_from: meeting + 1] > thresholds.reach_speed)  # fmt: skip
    if len(fast) == 0:
        return None
    return _last_rest(speed, free_from, free_from + int(fast[-1]), thresholds)


def _leaves(speed: Array, meeting: int, following: int, thresholds: Segmentation) -> int | None:
    """Return the index at which the first motion after the exchange left its rest."""
    fast = _first(speed[meeting: following + 1] > thresholds.reach_speed)  # fmt: skip
    return None if fast is None else _last_rest(speed, meeting, meeting + fast, thresholds)


def _last_rest(speed: Array, first: int, end: int, thresholds: Segmentation) -> int:
    """Return the last index before `end` at which a hand rests; `first` if it never does."""
    rests = np.flatnonzero(speed[first:end] < thresholds.moving_speed)
    return first + int(rests[-1]) if len(rests) else first


def _started(speed: Array, onset: int, meeting: int) -> int:
    """Return the index at which a hand has started to reach, relative to its peak speed."""
    reach = speed[onset: meeting + 1]  # fmt: skip
    return onset + int(np.argmax(reach > _STARTED * reach.max()))


def _first(true: NDArray[np.bool_]) -> int | None:
    """Return the index of the first True."""
    index = int(np.argmax(true)) if len(true) else 0
    return index if len(true) and true[index] else None
