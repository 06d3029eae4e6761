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
The partner of a recorded session, played back, who waits at each exchange.

The recording runs as it is, until the hand is held out and would be taken back. There it slows to
a standstill until the object has passed, and then goes on; so a robot that is late drops nothing.
Where the object lies on a table yet, the partner asks for it, and waits until it is picked up.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple

from handover_dmp.common.arrays import Array
from handover_dmp.mocap.filtering import interpolate
from handover_dmp.mocap.segmentation import Segment
from handover_dmp.mocap.session import RecordedSession
from handover_dmp.tracking.playback import HandSample, Replay, TrackedHand
from handover_dmp.tracking.sensor_model import SensorModel
from handover_dmp.tracking.waiting_clock import WaitingClock
import numpy as np

RECEIVERS = {'give': 'partner', 'take': 'robot'}
"""Who holds the object after an exchange, as `object/holder` says it."""
NOT_FETCHED = 'table'
"""As `object/holder` says it, before it is picked up."""
SIGNAL_AHEAD_S = 0.1
"""How long before a reach its signal is given, so that nobody hears of it too late, s."""
BEFORE_PARTING_S = 0.1
"""How long before a hand would leave the exchange it waits, s."""


class SessionSignal(NamedTuple):
    """
    The partner's sign that the robot is to come.

    Attributes:
        stamp_s: when the reach is to start, s.
        direction: `give` (the robot gives) or `take`.

    """

    stamp_s: float
    direction: str


class SessionStep(NamedTuple):
    """
    What there is to say at one time.

    Attributes:
        hands: of each tracker, the poses that arrived since the last step, as
            `TrackedHand.due` gives them.
        truth: where the hand is.
        demonstrator: where the person is whose place the robot takes.
        signals: that became due since the last step.

    """

    hands: list[list[HandSample]]
    truth: HandSample
    demonstrator: HandSample
    signals: list[SessionSignal]


class SessionPlayback:
    """
    A recorded session as trackers see its partner: at rest before, in motion, at rest after.

    While nobody says who holds the object, the partner does not wait, and it all goes as recorded.
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
            session: the recording, low-passed where it is noisy, and when its exchanges are.
            sensors: how each tracker sees the hand.
            tells_lost: whether they say NaN of a pose that is lost.
            lead_s: how much of the recording before the first reach is played, s; all of it if
                left out.
            patience_s: how long the partner holds out the hand for, s, before it goes on as if
                the object had passed.

        """
        motion = session.motion
        self.exchanges = session.exchanges
        self._first_s = max(float(motion.times[0]), session.exchanges[0].start_s - lead_s)
        self._last_s = float(motion.times[-1])
        self._patience_s = patience_s
        self._both = interpolate(motion.times, np.hstack([motion.partner, motion.demonstrator]))
        self._clock = WaitingClock(self._first_s, self._last_s)
        self._at_exchange = 0
        self._signalled = 0
        self._told = False
        self._asks = False
        self._partner = Replay(math.inf, path=lambda elapsed_s: self._places(elapsed_s)[:3])
        self._hands = [
            TrackedHand(self._partner, sensor, tells_lost=tells_lost) for sensor in sensors
        ]

    @property
    def start_s(self) -> float:
        """When the session starts, s; infinite until it is told."""
        return self._hands[0].start_s

    @property
    def next_exchange(self) -> Segment | None:
        """Return the exchange that comes or is; None after the last."""
        over = self._at_exchange == len(self.exchanges)
        return None if over else self.exchanges[self._at_exchange]

    @property
    def ends_s(self) -> float:
        """When the recording is over, s, as far as the partner does not wait; else infinite."""
        return self.start_s + self._clock.when(self._last_s)

    def start(self, at_s: float) -> None:
        """Start the session, or start it anew, at a time, s."""
        for hand in self._hands:
            hand.start(at_s)
        self._clock = WaitingClock(self._first_s, self._last_s)
        self._at_exchange = self._signalled = 0
        self._told = self._asks = False

    def is_waiting(self, now_s: float) -> bool:
        """Tell whether the partner holds out the hand and waits for the object, at a time, s."""
        if self.next_exchange is None or not self._told or self._asks:
            return False
        return self.start_s + self._clock.when(_waiting_place(self.next_exchange)) <= now_s

    def step(self, now_s: float, holder: str | None = None) -> SessionStep:
        """
        Tell everything that is due.

        Args:
            now_s: the time, s.
            holder: who holds the object: `robot`, `partner`, `both`, `table` or `nobody`; None: it
                is not known.

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
        """Go on where the object has passed, wait where it has not."""
        part = self.next_exchange
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
            following = self.next_exchange
            place = _waiting_place(following) if following else self._last_s
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

    def _places(self, elapsed_s: float) -> Array:
        """Return where P1 and P2 are, (6,) m, so long after the start."""
        recorded_s = min(self._clock.recorded(elapsed_s), self._last_s)
        places: Array = self._both(recorded_s)
        return places


class PlayedSession:
    """A session with the face of a `PlayedTrial`, that hears who holds the object."""

    def __init__(self, playback: SessionPlayback) -> None:
        """
        Play a session.

        Args:
            playback: of its partner.

        """
        self._playback = playback
        self._told: SessionStep | None = None
        self._signals: list[float] = []
        self._holder: str | None = None

    @property
    def start_s(self) -> float:
        """When the session starts, s; infinite until it is told."""
        return self._playback.start_s

    def start(self, at_s: float) -> None:
        """Start the session, or start it anew, at a time, s."""
        self._playback.start(at_s)
        self._signals = []

    def hear(self, holder: str) -> None:
        """Take who holds the object, as `object/holder` says it."""
        self._holder = holder

    def hands(self, now_s: float) -> list[list[HandSample]]:
        """Go on to a time, s, and give the poses that arrived since the last call."""
        self._told = self._playback.step(now_s, self._holder)
        self._signals += [signal.stamp_s for signal in self._told.signals]
        return self._told.hands

    def truth(self, _now_s: float) -> list[HandSample]:
        """Give where the hand is, whatever the trackers say."""
        return [] if self._told is None else [self._told.truth]

    def demonstrator(self, _now_s: float) -> list[HandSample]:
        """Give where the person is whose place the robot takes."""
        return [] if self._told is None else [self._told.demonstrator]

    def signals(self) -> list[float]:
        """Give the times at which a handover is to start, s, that were not given yet."""
        signals, self._signals = self._signals, []
        return signals


def _waiting_place(part: Segment) -> float:
    """Return when in the recording the partner's hand is held out for the last time, s."""
    if part.parting_s is None:
        return part.exchange_s
    return max(part.exchange_s, part.parting_s - BEFORE_PARTING_S)
