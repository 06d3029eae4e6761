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

"""Whole sessions with a simulated arm, an object with mass and a partner who waits for it."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from itertools import groupby, pairwise

from handover_dmp.bench.faults import InvariantChecker, STATES_OF_SESSIONS
from handover_dmp.handover.controller import HandoverState
from handover_dmp.handover.session import Leg
from handover_dmp.handover.session_lockstep import SessionLoop, SessionPeriod
from handover_dmp.handover.session_scenario import make_session_scenario, SessionScenario
from handover_dmp.mocap.session import RecordedSession
from handover_dmp.mocap.synthetic_session import synthesize_sessions
from handover_dmp.robot.model import BasePlacement
from handover_dmp.simulation.carried_object import Holder
from handover_dmp.tracking.playback import HandSample
import numpy as np
import pytest

S = HandoverState
BASES = {
    'engine_bay': BasePlacement((-0.63, 0.07, 0.91), -0.46),
    'under_car': BasePlacement((-0.64, 0.18, -0.06), -0.51),
    'hydraulic_lift': BasePlacement((-0.62, 0.11, 1.12), -0.51),
}
"""Where the arm stands, as `choose_base_placement` finds it."""
LOST_S = 0.1
WHOLE = [
    'idle', 'reaching', 'exchange', 'released', 'withdrawing',
    'waiting', 'reaching', 'exchange', 'withdrawing', 'done',
]  # fmt: skip


def sessions_of(configuration: str, seed: int, number: int) -> RecordedSession:
    session = synthesize_sessions(seed, number, configurations=[configuration])[-1]
    return session.low_passed(6.0)


@lru_cache(maxsize=3)
def scenario_of(configuration: str) -> SessionScenario:
    """Learn from one session, to be run against another one."""
    taught = sessions_of(configuration, 0, 1)
    scenario = make_session_scenario(taught, base=BASES[configuration])
    object.__setattr__(scenario, 'session', sessions_of(configuration, 0, 2))
    return scenario


class BlindLoop(SessionLoop):
    """A session whose tracker dies for good once the two have met."""

    is_blind = False

    def hands_at(self, now_s: float) -> list[list[HandSample]]:
        self.is_blind |= self.controller.state is S.EXCHANGE
        hands = super().hands_at(now_s)
        return [[] for _ in hands] if self.is_blind else hands


def states_of(periods: list[SessionPeriod]) -> list[str]:
    return [state.value for state, _ in groupby(period.state for period in periods)]


def check_arm(loop: SessionLoop, periods: list[SessionPeriod]) -> None:
    """Hold every period against the limits of joints, wrist command and states."""
    limits, options = loop.scenario.robot.limits, loop.controller.options
    checker = InvariantChecker(
        limits, loop.period_s, options.acceleration_limit, STATES_OF_SESSIONS
    )
    assert [fault for period in periods for fault in checker.check(period.period)] == []


def check_object(periods: list[SessionPeriod], mass_kg: float) -> None:
    """Nobody drops it; who opens the gripper does so when the partner has enough of it."""
    weight_n = 9.81 * mass_kg
    assert all(period.holder is not Holder.NOBODY for period in periods)
    for before, after in pairwise(periods):
        if before.gripper_closed and not after.gripper_closed:
            assert (before.state, after.state, after.leg) == (S.EXCHANGE, S.RELEASED, Leg.GIVE)
            seen = after.period.object_state
            assert seen is not None
            assert seen.holder is Holder.BOTH
            carried = 1.0 + seen.wrench.force[2] / weight_n
            # any force of the partner but one that lifts is a pull, also downwards
            x, y, z = seen.wrench.force
            pulled = float(np.linalg.norm([x, y, min(z + weight_n, 0.0)]))
            assert carried > 0.4 or pulled > 8.0


def check_lost_hand(periods: list[SessionPeriod]) -> None:
    """Once it has braked for a hand that is not seen, the command does not come nearer to it."""
    seen_s, place, allowed_m = -np.inf, np.zeros(3), 0.0
    for period in periods:
        now_s = period.period.time_ns * 1e-9
        if period.period.command.hand_age_s == 0.0:
            seen_s, place = now_s, period.truth
        distance = float(np.linalg.norm(period.period.command.position - place))
        if now_s - seen_s < LOST_S + 0.1:
            allowed_m = distance
        elif np.isfinite(seen_s):
            assert distance > allowed_m - 1e-3, (period.state, now_s - seen_s)
            allowed_m = max(allowed_m, distance)


def check_sessions(
    configuration: str, sessions: Iterable[RecordedSession], mass_kg: float
) -> None:
    """Run sessions in a row: the object stays with who has it from one to the next."""
    scenario = scenario_of(configuration)
    with SessionLoop(scenario, carried=scenario.carried(mass_kg)) as loop:
        for number, session in enumerate(sessions):
            periods = loop.run(session=session)
            check_arm(loop, periods)
            check_object(periods, mass_kg)
            assert states_of(periods) == (WHOLE if number == 0 else ['done', *WHOLE[1:]])
            holders = [holder for holder, _ in groupby(period.holder for period in periods)]
            assert holders == [
                Holder.ROBOT, Holder.BOTH, Holder.PARTNER, Holder.BOTH, Holder.ROBOT,
            ]  # fmt: skip


def test_what_a_person_is_given_they_hold() -> None:
    check_sessions('engine_bay', [sessions_of('engine_bay', 0, 2)], 0.5)


@pytest.mark.slow
@pytest.mark.timeout(7200)
@pytest.mark.parametrize(
    ('configuration', 'number', 'mass_kg'),
    [('engine_bay', 34, 0.5), ('under_car', 33, 1.2), ('hydraulic_lift', 33, 0.3)],
)
def test_a_hundred_sessions_in_a_row_drop_nothing(
    configuration: str, number: int, mass_kg: float
) -> None:
    row = (divmod(k + 1, 5) for k in range(number))
    sessions = (sessions_of(configuration, seed, trial + 1) for seed, trial in row)
    check_sessions(configuration, sessions, mass_kg)


@pytest.mark.slow
def test_without_an_object_distance_and_speed_tell() -> None:
    with SessionLoop(scenario_of('engine_bay')) as loop:
        periods = loop.run()
        check_arm(loop, periods)
    assert states_of(periods) == WHOLE
    assert [p.leg for p, q in pairwise(periods) if p.gripper_closed and not q.gripper_closed] == [
        Leg.GIVE
    ]


def test_a_hand_that_stays_away_leaves_the_object_with_who_has_it() -> None:
    """A tracker that dies for good as both hold the object: the load alone tells."""
    scenario = scenario_of('engine_bay')
    with BlindLoop(scenario, carried=scenario.carried(0.5)) as loop:
        loop.begin()
        periods = [loop.step_session() for _ in range(round(10.5 / loop.period_s))]
        check_arm(loop, periods)
    check_object(periods, 0.5)
    check_lost_hand(periods)
    assert periods[-1].holder is Holder.PARTNER
    assert 'waiting' in states_of(periods)
