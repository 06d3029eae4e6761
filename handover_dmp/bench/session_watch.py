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
Invariants of a session with faults: somebody holds the object, and no lost hand is chased.

For the matrix of faults and states, in one process and on the graph.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist

from handover_dmp.handover.controller import HandoverState
from handover_dmp.handover.session import Leg
from handover_dmp.simulation.carried_object import Holder

STAGES = (
    ('picking up', HandoverState.PICKING_UP, Leg.GIVE),
    ('reaching to give', HandoverState.REACHING, Leg.GIVE),
    ('exchange of the give', HandoverState.EXCHANGE, Leg.GIVE),
    ('released', HandoverState.RELEASED, Leg.GIVE),
    ('withdrawing', HandoverState.WITHDRAWING, Leg.GIVE),
    ('waiting', HandoverState.WAITING, Leg.TAKE),
    ('reaching to take', HandoverState.REACHING, Leg.TAKE),
    ('exchange of the take', HandoverState.EXCHANGE, Leg.TAKE),
    ('withdrawing with it', HandoverState.WITHDRAWING, Leg.TAKE),
)
"""Name of each stage of a session, its state, and the handover that is active."""
LEGS = {HandoverState.PICKING_UP.value: Leg.GIVE, HandoverState.WAITING.value: Leg.TAKE}
"""The handover after a state, regardless of the gripper."""
STANDS_S = 0.4
"""Time without a hand after which the wrist stands or retreats: time-out plus braking, s."""
NEARER_M = 0.005
"""Distance by which a wrist may still settle towards the hand as it comes to rest, m."""


class StageWatch:
    """Finds the stage of a session from the sequence of states and the gripper."""

    def __init__(self) -> None:
        """Begin before the first state."""
        self._state = ''
        self._leg = Leg.GIVE

    def see(self, state: str, gripper_closed: bool) -> None:
        """
        Take a state.

        Args:
            state: the present state.
            gripper_closed: whether the gripper is closed; a reach with an open gripper is a take.

        """
        if state != self._state and state == HandoverState.REACHING.value:
            self._leg = Leg.GIVE if gripper_closed else Leg.TAKE
        if state in LEGS:
            self._leg = LEGS[state]
        self._state = state

    @property
    def stage(self) -> str:
        """Name of the present stage; empty if there is none."""
        now = self._state, self._leg
        return next((name for name, state, leg in STAGES if (state.value, leg) == now), '')


class SessionWatch:
    """
    Checks the invariants of a session.

    Attributes:
        broken: violations, one line each.
        is_dropped: whether nobody holds the object.

    """

    def __init__(self) -> None:
        """Start without observations."""
        self.broken: list[str] = []
        self.is_dropped = False
        self._hand: Sequence[float] = ()
        self._wrists: list[Sequence[float]] = []
        self._farthest_m = 0.0
        self._is_told = False

    def see_wrist(
        self, time_s: float, wrist: Sequence[float], hand: Sequence[float] | None, age_s: float
    ) -> None:
        """
        Take the wrist and the known hand.

        Args:
            time_s: time, s.
            wrist: (3,), m, position of the wrist.
            hand: (3,), m, last accepted position of the hand; None before the first.
            age_s: age of that position, s.

        """
        if hand is None:
            return
        if age_s < STANDS_S:
            self._wrists.clear()
            self._is_told = False
        self._wrists.append(wrist)
        distance = dist(wrist, hand)
        if len(self._wrists) == 1 or tuple(hand) != tuple(self._hand):
            # a pose that was held up may come when the hand is lost already
            self._farthest_m = max(dist(each, hand) for each in self._wrists)
        self._hand = hand
        self._farthest_m = max(self._farthest_m, distance)
        nearer_m = self._farthest_m - distance
        if nearer_m > NEARER_M and not self._is_told:
            self._is_told = True
            self.broken.append(
                f'at {time_s:.3f} s: the wrist is {nearer_m:.3f} m nearer to a hand that is lost'
            )

    def see_holder(self, time_s: float, holder: str) -> None:
        """
        Take the holder of the object.

        Args:
            time_s: time, s.
            holder: value of `object/holder`.

        """
        dropped = holder == Holder.NOBODY.value
        if dropped and not self.is_dropped:
            self.broken.append(f'at {time_s:.3f} s: the object is dropped')
        self.is_dropped = dropped
