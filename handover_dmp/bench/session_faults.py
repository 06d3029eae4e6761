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
Every fault at every stage of a session, in one process: a matrix of the outcomes.

The faults are those of the soak test (tracker, joint states, commands, requests) and those of the
force sensor. For each fault, two sessions run in which it occurs at the beginning of every second
stage, lasts a while, and ends before it occurs again; a third session covers the remaining stages.
In every case the limits are kept, the object is never dropped, and the wrist never moves towards a
lost hand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, nan

from handover_dmp.bench.faults import InvariantChecker, STATES_OF_SESSIONS, tracker_faults
from handover_dmp.bench.measurement import Measurement
from handover_dmp.bench.session_watch import SessionWatch, STAGES, StageWatch
from handover_dmp.bench.soak import (
    COMMAND_FAULTS,
    FaultyArm,
    FaultyWristController,
    JOINT_STATE_FAULTS,
    ORDERS,
    Span,
    TARGET_FAULTS,
    TRACKER,
    TRACKER_FAULTS,
)
from handover_dmp.handover.controller import HandoverState
from handover_dmp.handover.session_lockstep import SessionLoop
from handover_dmp.handover.session_scenario import make_session_scenario, SessionScenario
from handover_dmp.robot.velocity_driver import ArmState
from handover_dmp.simulation.carried_object import CarriedObjectOptions, Holder
from handover_dmp.tracking.playback import HandSample

MASS_KG = 0.8
"""Mass of the object, kg."""
LASTS_S = 0.6
"""Duration of a fault, s."""
TAKEN_UP_S = 0.3
"""Time after a fault until a stopped arm is told to resume, s."""
MAX_S = 60.0
"""Longest duration of a session, s."""
IN_MOTION = (HandoverState.PICKING_UP, HandoverState.REACHING)
DELAY_S = {name: 0.4 if state in IN_MOTION else 0.0 for name, state, _ in STAGES}
"""Time from the beginning of a stage to the fault, s; the arm must be in motion."""
WRENCH_FAULTS = ('force sensor silent', 'force sensor at zero', 'force not finite')
FAULTS = (
    *TRACKER_FAULTS,
    *WRENCH_FAULTS,
    *JOINT_STATE_FAULTS,
    *TARGET_FAULTS,
    *COMMAND_FAULTS,
    'abort',
    'reset',
)
"""All faults; of the requests, those that stop a session."""
assert set(FAULTS) >= set(ORDERS) - {'start'}


@dataclass(frozen=True)
class FaultRow:
    """
    One fault at all stages of a session.

    Attributes:
        fault: its name.
        stages: names of the stages in which it occurred.
        done: whether its sessions were completed: both exchanges are over, and the arm is at
            home.
        holder: final holder of the object.
        broken: violated invariants, one line each.
        lasted_s: duration of the sessions, s.

    """

    fault: str
    stages: tuple[str, ...]
    done: bool
    holder: str
    broken: tuple[str, ...]
    lasted_s: float


class FaultySession(SessionLoop):
    """
    A session with a fault in chosen stages.

    Attributes:
        fault: name of the fault, from `strike` on.

    """

    fault = Span('', inf, inf)

    def arm_for(self, scenario: SessionScenario, carried: CarriedObjectOptions) -> None:
        """
        Create an arm and a wrist controller that can fail.

        Args:
            scenario: the scenario.
            carried: the object.

        """
        self.arm.close()
        self.arm = FaultyArm(scenario.robot, carried=carried)
        self.arm.reset(scenario.q_start)
        self.wrist_controller = FaultyWristController(scenario.robot, self.wrist_controller.ik)

    def strike(self, fault: str) -> None:
        """
        Start a fault, which lasts for a while.

        Args:
            fault: its name, of `FAULTS`.

        """
        self.fault = Span(fault, self.time_s, self.time_s + LASTS_S)
        assert isinstance(self.arm, FaultyArm)
        assert isinstance(self.wrist_controller, FaultyWristController)
        self.arm.spans = self.wrist_controller.spans = [self.fault]
        self._of_tracker = tracker_faults(0).get(fault.removeprefix(TRACKER))
        if fault in ORDERS:
            getattr(self.controller, fault)()

    def fails(self, fault: str) -> bool:
        """
        Tell whether a fault is active.

        Args:
            fault: its name.

        Returns:
            Whether it is active.

        """
        return self.fault.name == fault and self.fault.holds(self.time_s)

    def hands_at(self, now_s: float) -> list[list[HandSample]]:
        """Return the poses of a period, s, as altered by the fault."""
        hands = super().hands_at(now_s)
        strikes = self.fault.name.startswith(TRACKER) and self.fault.holds(now_s)
        if not strikes or self._of_tracker is None:
            return hands
        return [self._of_tracker(samples) for samples in hands]

    def feel(self, now_s: float) -> None:
        """Pass the wrench at a time, s, as altered by the fault, to the controller."""
        if self.fails('force sensor at zero'):
            self.controller.set_wrench((0.0, 0.0, 0.0), now_s)
        elif self.fails('force not finite'):
            self.controller.set_wrench((nan, 0.0, 0.0), now_s)
        elif not self.fails('force sensor silent'):
            super().feel(now_s)


def row(scenario: SessionScenario, fault: str) -> FaultRow:
    """
    Run the sessions in which a fault occurs at every stage.

    Args:
        scenario: the scenario.
        fault: its name, of `FAULTS`.

    Returns:
        The outcome.

    """
    names = [name for name, _, _ in STAGES]
    runs = [_strike(scenario, fault, names[first::2]) for first in (0, 1)]
    # a session that is broken off may leave out a stage
    if left := [name for name in names if not any(name in run.stages for run in runs)]:
        runs.append(_strike(scenario, fault, left))
    return FaultRow(
        fault,
        tuple(name for name in names if any(name in run.stages for run in runs)),
        all(run.done for run in runs),
        next((run.holder for run in runs if not run.done), runs[-1].holder),
        tuple(line for run in runs for line in run.broken),
        sum(run.lasted_s for run in runs),
    )


def _strike(scenario: SessionScenario, fault: str, stages: Sequence[str]) -> FaultRow:
    carried = scenario.carried(MASS_KG)
    with FaultySession(scenario, carried=carried) as session:
        session.arm_for(scenario, carried)
        return _run(session, fault, stages)


def _run(session: FaultySession, fault: str, wanted: Sequence[str]) -> FaultRow:
    limit = session.controller.options.acceleration_limit
    limits, period_s = session.scenario.robot.limits, session.period_s
    checker = InvariantChecker(limits, period_s, limit, next_states=STATES_OF_SESSIONS)
    watch, stages, broken = SessionWatch(), StageWatch(), []
    struck: list[str] = []
    again_s = stage_since_s = 0.0
    before = ''
    session.begin()
    while session.time_s < MAX_S and not _is_over(session):
        now_s = session.time_s
        stages.see(session.controller.state.value, session.controller.gripper_closed)
        if stages.stage != before:
            before, stage_since_s = stages.stage, now_s
        is_new = (
            before in wanted and before not in struck and now_s - stage_since_s >= DELAY_S[before]
        )
        if is_new and now_s > again_s:
            struck.append(before)
            session.strike(fault)
            again_s = session.fault.until_s + TAKEN_UP_S
        elif now_s > again_s:
            _take_up(session)
        period = session.step()
        broken += checker.check(period)
        age_s = period.command.hand_age_s
        watch.see_wrist(now_s, period.wrist_position.tolist(), session.controller.hand, age_s)
        watch.see_holder(now_s, session.arm.holder.value)
        if watch.is_dropped:
            break
    return FaultRow(
        fault,
        tuple(struck),
        _is_over(session),
        session.arm.holder.value,
        (*broken, *watch.broken),
        session.time_s,
    )


def _is_over(session: FaultySession) -> bool:
    state, partner = session.controller.state, session.playback
    if state is HandoverState.DONE:
        return True
    # who took something twice keeps it
    kept = state is HandoverState.WAITING and session.arm.holder is Holder.PARTNER
    return kept and partner.next_exchange is None


def _take_up(session: FaultySession) -> None:
    """Resume a stopped arm or a stopped session."""
    if session.arm.report.state is ArmState.STOPPED:
        session.arm.resume()
    begun = session.fault.from_s < inf
    if begun and session.controller.state in (HandoverState.ABORTED, HandoverState.IDLE):
        session.controller.start()


def run(progress: Callable[[str], None]) -> list[Measurement]:
    """
    Run every fault at every stage of a session.

    Args:
        progress: called with the present step.

    Returns:
        A figure for each fault, and the number of faults that violated an invariant.

    """
    progress('making the session')
    scenario = make_session_scenario(pick_up=True)
    rows: list[FaultRow] = []
    for fault in FAULTS:
        progress(f'{len(rows)} of {len(FAULTS)}: {fault}')
        rows.append(row(scenario, fault))
    return measured(rows)


def measured(rows: Sequence[FaultRow]) -> list[Measurement]:
    """
    Make figures from the matrix.

    Args:
        rows: all rows.

    Returns:
        The number of rows with violations, and for each fault the number of its stages.

    """
    broken = [f'{each.fault}: {line}' for each in rows for line in each.broken]
    figures = [
        Measurement(
            'session faults: what no fault may break',
            len(broken),
            'times',
            target=0.0,
            note='; '.join(broken[:5]) or f'in {len(rows)} sessions',
        )
    ]
    figures += [
        Measurement(
            f'session faults: {each.fault}',
            len(each.stages),
            f'of {len(STAGES)} stages',
            target=float(len(STAGES)),
            higher_is_better=True,
            note=f'{"done" if each.done else f"with {each.holder}"} after {each.lasted_s:.1f} s',
        )
        for each in rows
    ]
    return figures
