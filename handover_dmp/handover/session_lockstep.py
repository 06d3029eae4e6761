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
One session in one process: the objects of the graph in lockstep, without ROS.

Like `lockstep` for a single handover, with a partner who waits for the object at each exchange,
and optionally with the object itself: the controller gets the force on the wrist, and the world
the gripper command.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from handover_dmp.common.arrays import Array
from handover_dmp.common.settings import defaults
from handover_dmp.handover.controller import AFTERWARDS_S, HandoverState
from handover_dmp.handover.lockstep import (
    LockstepLoop,
    Period,
    REPLAY_AT_S,
)
from handover_dmp.handover.session import Leg, SessionController, SessionOptions
from handover_dmp.handover.session_scenario import make_session_scenario, SessionScenario
from handover_dmp.mocap.session import RecordedSession
from handover_dmp.simulation.carried_object import CarriedObjectOptions, Holder
from handover_dmp.tracking import GoalEstimator
from handover_dmp.tracking.playback import HandSample
from handover_dmp.tracking.session_playback import SessionPlayback, SessionSignal, SessionStep
from handover_dmp.tracking.tracker_preset import TrackerPreset
import numpy as np

MAX_WAIT_S = 20.0
"""Time that the partner waits at an exchange before the session is given up, s."""


@dataclass(frozen=True, eq=False)
class SessionPeriod:
    """
    Inputs and outputs of a period of a session, besides those of any handover.

    Attributes:
        period: the period as of a single handover, with the object if there is one.
        leg: the current handover, or the next one.
        gripper_closed: whether the gripper was commanded to be closed.
        truth: (3,), m, true position of the partner's hand.
        demonstrator: (3,), m, wrist position of the recorded demonstrator.
        signals: signals of the partner that became due.

    """

    period: Period
    leg: Leg
    gripper_closed: bool
    truth: Array
    demonstrator: Array
    signals: tuple[SessionSignal, ...]

    @property
    def state(self) -> HandoverState:
        """State of the session."""
        return self.period.command.state

    @property
    def holder(self) -> Holder | None:
        """Holder of the object; None if none is simulated."""
        state = self.period.object_state
        return None if state is None else state.holder


class SessionLoop(LockstepLoop):
    """
    A session that is stepped period by period.

    Attributes:
        scenario: session, movements and arm.
        playback: the partner.
        controller: controller of wrist and gripper.

    """

    controller: SessionController

    def __init__(
        self,
        scenario: SessionScenario,
        *,
        session: SessionOptions | None = None,
        trackers: Sequence[TrackerPreset] = (),
        carried: CarriedObjectOptions | None = None,
    ) -> None:
        """
        Connect the objects.

        Args:
            scenario: session, movements and arm.
            session: rules of the session; by default those of the scenario.
            trackers: trackers of the hand; a perfect one if left out.
            carried: the handed-over object; if left out, or without a mass, distance and speed
                alone end an exchange.

        """
        self.scenario = scenario
        trackers = trackers or (TrackerPreset(),)
        rules = scenario.profile.handover_options(scenario.partner_model)
        estimator = GoalEstimator(trackers=[one.tracker for one in trackers])
        super().__init__(
            scenario.robot,
            scenario.q_start,
            SessionController(scenario.models, rules, estimator, session or scenario.rules),
            tasks=scenario.profile.node_parameters(scenario.models.give)['priority_ik'],
            carried=carried,
        )
        self._sensors = [one.sensor for one in trackers]
        self.playback = self._played(scenario.session)
        self._told: SessionStep | None = None
        self._truth: Array | None = None

    def _played(self, session: RecordedSession) -> SessionPlayback:
        partner = defaults('hand_tracker')
        return SessionPlayback(
            session,
            self._sensors,
            lead_s=partner['session.lead_s'],
            patience_s=partner['session.patience_s'],
        )

    def begin(
        self, replay_at_s: float = REPLAY_AT_S, session: RecordedSession | None = None
    ) -> None:
        """
        Make the partner begin.

        Args:
            replay_at_s: start of the recording, s.
            session: another session than that of the scenario.

        """
        if session is not None:
            self.playback = self._played(session)
        self.playback.start(replay_at_s)

    def hands_at(self, now_s: float) -> list[list[HandSample]]:
        """
        Return for each tracker the poses that arrive in a period.

        Args:
            now_s: its start, s.

        Returns:
            The poses, in order.

        """
        holder = self.arm.holder.value if self.arm.carries else None
        self._told = self.playback.step(now_s, holder)
        return self._told.hands

    def before_control(self, now_s: float) -> None:
        """
        Pass the force on the wrist and the partner's signals to the controller.

        Args:
            now_s: start of the period, s.

        """
        self.feel(now_s)
        for signal in self._told.signals if self._told else ():
            self.controller.signal(signal.stamp_s)

    def feel(self, now_s: float) -> None:
        """
        Pass the force on the wrist to the controller, if there is an object.

        Args:
            now_s: start of the period, s.

        """
        if self.arm.carries:
            self.controller.set_wrench(tuple(self.arm.wrench.force.tolist()), now_s)

    def before_motion(self) -> None:
        """Close or open the gripper; the partner's hand is that of the previous period."""
        self.arm.set_gripper(self.controller.gripper_closed)
        if self._truth is not None:
            self.arm.set_partner_hand(self._truth)
        assert self._told is not None
        self._truth = self._told.truth.position

    def step_session(self) -> SessionPeriod:
        """
        Run one period: all of its messages, then the arm's motion.

        Returns:
            Its inputs and outputs.

        """
        period = self.step()
        assert self._told is not None
        return SessionPeriod(
            period,
            self.controller.leg,
            self.controller.gripper_closed,
            np.array(self._told.truth.position),
            np.array(self._told.demonstrator.position),
            tuple(self._told.signals),
        )

    def run(
        self,
        progress: Callable[[float], None] = lambda _share: None,
        session: RecordedSession | None = None,
    ) -> list[SessionPeriod]:
        """
        Run until the session is done, or given up; call again for the next one.

        Args:
            progress: called with the share of the maximum time that has passed.
            session: a session other than that of the scenario.

        Returns:
            All periods; the state of the last command shows whether the session is done.

        """
        begun_s = self.time_s
        self.begin(begun_s + REPLAY_AT_S, session)
        motion = (session or self.scenario.session).motion
        limit_s = float(motion.times[-1] - motion.times[0]) + MAX_WAIT_S
        periods = [self.step_session()]
        over = (HandoverState.DONE, HandoverState.ABORTED)
        while self.time_s - begun_s < limit_s:
            periods.append(self.step_session())
            progress((self.time_s - begun_s) / limit_s)
            if periods[-1].state in over and periods[-2].state not in over:
                break
        return periods + [self.step_session() for _ in range(round(AFTERWARDS_S / self.period_s))]


def simulate_session(
    scenario: SessionScenario | None = None,
    progress: Callable[[float], None] = lambda _share: None,
    trackers: Sequence[TrackerPreset] = (),
    carried: CarriedObjectOptions | None = None,
) -> list[SessionPeriod]:
    """
    Simulate one session from start to end.

    Args:
        scenario: session, movements and arm; the example if left out.
        progress: called with the completed share.
        trackers: trackers of the hand; a perfect one if left out.
        carried: the handed-over object; without it, distance and speed alone end an exchange.

    Returns:
        All periods, in order.

    Raises:
        UnreachableError: the arm of the example cannot reach the path from any placement.

    """
    with SessionLoop(
        scenario or make_session_scenario(), trackers=trackers, carried=carried
    ) as loop:
        return loop.run(progress)
