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


"""A session that begins with the object on a table."""

from __future__ import annotations

from itertools import groupby

from handover_dmp.bench.faults import InvariantChecker, STATES_OF_SESSIONS
from handover_dmp.handover.controller import HandoverState
from handover_dmp.handover.session_lockstep import SessionLoop
from handover_dmp.handover.session_scenario import make_session_scenario
from handover_dmp.mocap.synthetic_session import synthesize_sessions
from handover_dmp.robot.model import BasePlacement
from handover_dmp.simulation.carried_object import Holder
import numpy as np

BASE = BasePlacement((-0.62, 0.01, 0.97), -0.60)
"""Where the arm stands, as `choose_base_placement` finds it."""


def test_the_arm_fetches_what_the_partner_asks_for_and_gives_it() -> None:
    session = synthesize_sessions(0, 1, configurations=['engine_bay'])[0]
    scenario = make_session_scenario(session, base=BASE, pick_up=True)
    assert scenario.pick_up is not None
    with SessionLoop(scenario, carried=scenario.carried(0.5)) as loop:
        limits, most = scenario.robot.limits, loop.controller.options.acceleration_limit
        checker = InvariantChecker(limits, loop.period_s, most, STATES_OF_SESSIONS)
        periods = loop.run()
        assert [fault for period in periods for fault in checker.check(period.period)] == []
    states = [state.value for state, _ in groupby(period.state for period in periods)]
    assert states == [
        'idle', 'picking_up', 'reaching', 'exchange', 'released', 'withdrawing',
        'waiting', 'reaching', 'exchange', 'withdrawing', 'done',
    ]  # fmt: skip
    holders = [holder for holder, _ in groupby(period.holder for period in periods)]
    assert holders == [
        Holder.TABLE, Holder.ROBOT, Holder.BOTH, Holder.PARTNER, Holder.BOTH, Holder.ROBOT,
    ]  # fmt: skip
    # it lies still until the gripper closes, and that is where the recorded person took it
    lying = [period for period in periods if period.holder is Holder.TABLE]
    places = np.array([period.period.object_state.position for period in lying])
    assert np.ptp(places, axis=0).max() < 1e-4
    gripped = np.linalg.norm(lying[-1].period.wrist_position - scenario.pick_up)
    assert gripped < 0.01
    # the partner, who has asked for it, does not hold out the hand before
    fetching = [p.truth for p in periods if p.state is HandoverState.PICKING_UP]
    until = sum(p.state is HandoverState.PICKING_UP and p.holder is Holder.TABLE for p in periods)
    assert np.ptp(fetching[:until], axis=0).max() < 0.01
