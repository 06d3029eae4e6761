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
Playback of the partner of a recorded session, with a wait at each exchange.

The recording runs until the held-out hand would be withdrawn. There it stops until the object has
changed hands, so a late robot drops nothing. If the object is still on a table, the partner
signals, and waits until it is picked up. If the robot offers the object once more after an
exchange, the partner stays while both hold it.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple

from handover_dmp.common.arrays import Array
from handover_dmp.mocap.filtering import interpolate
from handover_dmp.mocap.segmentation import Segment
from handover_dmp.mocap.session import RecordedSession
from handover_dmp.tracking.playback import HandSample, StartSignals, TrackedHand
from handover_dmp.tracking.sensor_model import SensorModel
from handover_dmp.tracking.waiting_clock import WaitingClock
import numpy as np

RECEIVERS = {'give': 'partner', 'take': 'robot'}
"""Holder of the object after an exchange, as on `object/holder`."""
NOT_FETCHED = 'table'
"""Holder before the object is picked up, as on `object/holder`."""
HELD_BY_BOTH = 'both'
"""Holder during an exchange, as on `object/holder`."""
SIGNAL_AHEAD_S = 0.1
"""Time between the signal of a reach and its start, so that it arrives in time, s."""
BEFORE_PARTING_S = 0.1
"""Time before the end of the exchange at which the hand waits, s."""


class SessionSignal(NamedTuple):
    """
    The partner's signal to the robot.

    Attributes:
        stamp_s: start time of the reach, s.
        direction: `give` (the robot gives) or `take`.

    """

    stamp_s: float
    direction: str


class SessionStep(NamedTuple):
    """
    Poses and signals at one time.

    Attributes:
        hands: for each tracker, the poses that arrived since the last step, as from
            `TrackedHand.due`.
        truth: true position of the hand.
        demonstrator: position of the recorded demonstrator.
        signals: signals that became due since the last step.

    """

    hands: list[list[HandSample]]
    truth: HandSample
    demonstrator: HandSample
    signals: list[SessionSignal]


class SessionPlayback:
    """
    A recorded session with its partner seen by trackers: at rest before and after.

    If the holder of the object is unknown, the partner does not wait.
    """

    def __init__(
        self,
        session: RecordedSession,
        sensors: Sequence[SensorModel] = (SensorModel(),),
        *,
        tells_lost: bool = False,
        lead_s: float = math.inf,
        patience_s: float = math.inf,
    ) -> None:
        """
        Take the recording and the trackers.

        Args:
            session: the recording, filtered if noisy, with its exchanges.
            sensors: model of each tracker.
            tells_lost: whether a lost pose is published as NaN.
            lead_s: part of the recording before the first reach that is played, s; all of it if
                left out.
            patience_s: time for which the partner holds out the hand, s, before continuing as if
                the object had changed hands.

        """
        motion = session.motion
        self.exchanges = session.exchanges
        self._first_s = max(float(motion.times[0]), session.exchanges[0].start_s - lead_s)
        self._last_s = float(motion.times[-1])
        self._patience_s = patience_s
        self._both = interpolate(motion.times, np.hstack([motion.partner, motion.demonstrator]))
        self._hands = [
            TrackedHand(self._partner_at, sensor, tells_lost=tells_lost) for sensor in sensors
        ]
        self._rewind()

    @property
    def start_s(self) -> float:
        """Start time of the session, s; infinite until it is set."""
        return self._hands[0].start_s

    @property
    def next_exchange(self) -> Segment | None:
        """Return the current or next exchange; None after the last."""
        over = self._at_exchange == len(self.exchanges)
        return None if over else self.exchanges[self._at_exchange]

    def start(self, at_s: float) -> None:
        """Start or restart the session at a time, s."""
        for hand in self._hands:
            hand.start(at_s)
        self._rewind()

    def _rewind(self) -> None:
        self._clock = WaitingClock(self._first_s, self._last_s)
        self._at_exchange = self._signalled = 0
        self._told = self._asks = self._stays = False
        self._apart_s = 0.0

    def is_waiting(self, now_s: float) -> bool:
        """Return whether the partner holds out the hand and waits for the object, at a time, s."""
        if self.next_exchange is None or not self._told or self._asks:
            return False
        return self.start_s + self._clock.when(_waiting_place(self.next_exchange)) <= now_s

    def step(self, now_s: float, holder: str | None = None) -> SessionStep:
        """
        Return all poses and signals that are due.

        Args:
            now_s: the time, s.
            holder: holder of the object: `robot`, `partner`, `both`, `table` or `nobody`; None:
                unknown.

        Returns:
            Poses and signals.

        """
        elapsed_s = max(now_s - self.start_s, 0.0)
        if self.start_s <= now_s:
            self._hear(elapsed_s, holder)
        places = self._places(elapsed_s)
        return SessionStep(
            [hand.due(now_s) for hand in self._hands],
            HandSample(now_s, places[:3]),
            HandSample(now_s, places[3:]),
            self._due_signals(now_s),
        )

    def _hear(self, elapsed_s: float, holder: str | None) -> None:
        """Continue if the object has changed hands, otherwise wait."""
        part = self.next_exchange
        is_between = part is None or self._clock.recorded(elapsed_s) < part.start_s
        if self._at_exchange and (is_between or self._stays):
            self._stay_with_what_both_hold(elapsed_s, holder)
        if part is None:
            return
        if holder is None:
            if not self._told and self._clock.recorded(elapsed_s) >= _waiting_place(part):
                self._at_exchange += 1
            return
        if not self._told:
            self._told, self._asks = True, holder == NOT_FETCHED
            place = part.start_s if self._asks else _waiting_place(part)
            self._clock.go_on(elapsed_s, place)
        if self._asks:
            asked_s = elapsed_s - self._clock.when(part.start_s)
            if holder == NOT_FETCHED and asked_s <= self._patience_s:
                return
            self._asks = False
            self._clock.go_on(elapsed_s, _waiting_place(part))
        waited_s = elapsed_s - self._clock.when(_waiting_place(part))
        begun = self._clock.recorded(elapsed_s) >= part.start_s
        if (begun and holder == RECEIVERS[part.direction]) or waited_s > self._patience_s:
            self._at_exchange += 1
            self._clock.go_on(elapsed_s, self._next_place_s)

    @property
    def _next_place_s(self) -> float:
        """Time in the recording at which the partner waits next, or its end, s."""
        part = self.next_exchange
        return _waiting_place(part) if part else self._last_s

    def _stay_with_what_both_hold(self, elapsed_s: float, holder: str | None) -> None:
        """Stand still after an exchange while both hold the object, or patience ends."""
        if holder != HELD_BY_BOTH:
            self._apart_s = elapsed_s
        stays = 0.0 < elapsed_s - self._apart_s <= self._patience_s
        if stays != self._stays:
            self._stays = stays
            place = self._clock.recorded(elapsed_s) if stays else self._next_place_s
            self._clock.go_on(elapsed_s, place)

    def _due_signals(self, now_s: float) -> list[SessionSignal]:
        due = []
        while self._signalled < len(self.exchanges):
            part = self.exchanges[self._signalled]
            stamp_s = self.start_s + self._clock.when(part.start_s)
            if not stamp_s <= now_s + SIGNAL_AHEAD_S:
                break
            due.append(SessionSignal(stamp_s, part.direction))
            self._signalled += 1
        return due

    def _partner_at(self, elapsed_s: float) -> Array:
        return self._places(elapsed_s)[:3]

    def _places(self, elapsed_s: float) -> Array:
        """Return the positions of P1 and P2, (6,) m, at a time after the start."""
        recorded_s = min(self._clock.recorded(elapsed_s), self._last_s)
        return np.asarray(self._both(recorded_s))


class PlayedSession(SessionPlayback, StartSignals):
    """A session with the interface of a `PlayedTrial`, and with the holder of the object."""

    _present: SessionStep | None = None
    _holder: str | None = None

    def start(self, at_s: float) -> None:
        """Start or restart the session at a time, s."""
        super().start(at_s)
        self._signals = ()

    def hear(self, holder: str) -> None:
        """Process the holder of the object, as on `object/holder`."""
        self._holder = holder

    def hands(self, now_s: float) -> list[list[HandSample]]:
        """Advance to a time, s, and return the poses that arrived since the last call."""
        self._present = self.step(now_s, self._holder)
        self._signals = (*self._signals, *(one.stamp_s for one in self._present.signals))
        return self._present.hands

    def truth(self, _now_s: float) -> list[HandSample]:
        """Return the true position of the hand."""
        return [] if self._present is None else [self._present.truth]

    def demonstrator(self, _now_s: float) -> list[HandSample]:
        """Return the position of the recorded demonstrator."""
        return [] if self._present is None else [self._present.demonstrator]


def _waiting_place(part: Segment) -> float:
    """Return the last time in the recording at which the partner's hand is held out, s."""
    if part.parting_s is None:
        return part.exchange_s
    return max(part.exchange_s, part.parting_s - BEFORE_PARTING_S)
