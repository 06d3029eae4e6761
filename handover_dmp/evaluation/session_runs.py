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

"""A recorded session in which the robot replaces P2: the movements alone, or an arm."""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.common.arrays import Array
from handover_dmp.common.settings import defaults
from handover_dmp.handover.controller import AFTERWARDS_S, HandoverOptions, HandoverState
from handover_dmp.handover.lockstep import REPLAY_AT_S
from handover_dmp.handover.session import SessionController, SessionModels
from handover_dmp.handover.session_lockstep import MAX_WAIT_S, SessionLoop
from handover_dmp.handover.session_scenario import SessionScenario, trials_of
from handover_dmp.mocap.filtering import RATE_HZ, smooth
from handover_dmp.mocap.fluency import fluency_of_motions, SessionFluency
from handover_dmp.mocap.session import RecordedSession
from handover_dmp.tracking.session_playback import SessionPlayback
import numpy as np

OVER = HandoverState.DONE, HandoverState.ABORTED


@dataclass(frozen=True, eq=False)
class SessionMotion:
    """
    The motion of a session.

    Attributes:
        partner: (n, 3) m, the hand at 200 Hz.
        wrist: (n, 3) m, the wrist at the same times.
        states: (n,) states of the session.

    """

    partner: Array
    wrist: Array
    states: list[HandoverState]

    @property
    def done(self) -> bool:
        """Whether the object was given and taken back."""
        return self.states[-1] is HandoverState.DONE

    def unfinished(self) -> str:
        """Describe how far an uncompleted session got."""
        last = self.states[-1].name.lower().replace('_', ' ')
        longest, length = 0, 0
        for state in self.states:
            length = length + 1 if state is HandoverState.EXCHANGE else 0
            longest = max(longest, length)
        told = f'{last} when the time was over'
        return f'{told}; an exchange lasted {longest / RATE_HZ:.1f} s' if longest else told

    def fluency(self) -> SessionFluency | None:
        """
        Measure the fluency from the first reach on.

        Returns:
            The measures; None if the robot never began.

        """
        began = [n for n, state in enumerate(self.states) if state is HandoverState.REACHING]
        if not began:
            return None
        met = [
            n / RATE_HZ
            for n in range(1, len(self.states))
            if self.states[n] is HandoverState.EXCHANGE is not self.states[n - 1]
        ]
        times = np.arange(len(self.states)) / RATE_HZ
        moved, _, velocities = smooth(times, np.hstack([self.partner, self.wrist]))
        partner, wrist = (moved, velocities[:, :3]), (moved, velocities[:, 3:])
        return fluency_of_motions(partner, wrist, began[0] / RATE_HZ, met)


def run_alone(
    session: RecordedSession, models: SessionModels, partner_model: str = 'off'
) -> SessionMotion:
    """
    Run a session with an ideal wrist that is always at the commanded position.

    The object changes hands when the gripper opens or closes; the partner waits for it. The wrist
    starts where P2 did.

    Args:
        session: the recorded session, low-passed.
        models: the movements.
        partner_model: `auto` or `off`.

    Returns:
        The motion, until the session is complete or can no longer be completed.

    """
    told = defaults('hand_tracker')
    playback = SessionPlayback(
        session, lead_s=told['session.lead_s'], patience_s=told['session.patience_s']
    )
    playback.start(REPLAY_AT_S)
    controller = SessionController(models, HandoverOptions(partner_model=partner_model))
    controller.set_wrist(tuple(trials_of(session)[0].demonstrator[0].tolist()))
    partner, wrist, states = [], [], []
    for period in range(round(_longest_s(session) * RATE_HZ)):
        now_s = period / RATE_HZ
        step = playback.step(now_s, 'robot' if controller.gripper_closed else 'partner')
        for seen in step.hands[0]:
            controller.set_hand(seen.stamp_s, tuple(seen.position.tolist()), now_s, now_s)
        for signal in step.signals:
            controller.signal(signal.stamp_s)
        command = controller.step(now_s, 1.0 / RATE_HZ)
        assert command is not None
        controller.set_wrist(command.position)
        partner.append(step.truth.position)
        wrist.append(command.position)
        states.append(command.state)
        if command.state in OVER and now_s > REPLAY_AT_S:
            break
    return SessionMotion(np.array(partner), np.array(wrist), states)


def run_arm(scenario: SessionScenario) -> SessionMotion:
    """
    Run a session with a simulated arm and the object.

    Args:
        scenario: session, movements and arm.

    Returns:
        The motion, until the session is complete or can no longer be completed.

    """
    with SessionLoop(scenario, carried=scenario.carried()) as loop:
        periods = loop.run()
    return SessionMotion(
        np.array([one.truth for one in periods]),
        np.array([one.period.wrist_position for one in periods]),
        [one.state for one in periods],
    )


def _longest_s(session: RecordedSession) -> float:
    times = session.motion.times
    return float(times[-1] - times[0]) + REPLAY_AT_S + MAX_WAIT_S + AFTERWARDS_S
