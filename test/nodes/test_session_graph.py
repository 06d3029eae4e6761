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

"""A session of the whole graph, with an object of mass, held against the same in one process."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import Any

from handover_dmp.handover.lockstep import REPLAY_AT_S
from handover_dmp.handover.recordings import example_model
from handover_dmp.handover.session import SessionModels, SessionOptions
from handover_dmp.handover.session_lockstep import SessionLoop
from handover_dmp.handover.session_scenario import make_session_scenario, SessionScenario
from handover_dmp.handover.withdrawal import WithdrawalOptions
from handover_dmp.nodes.conversions import NANOSECONDS
from handover_dmp.nodes.graph import Graph
from handover_dmp.recording import read_bag
from handover_dmp.robot.model import BasePlacement
from handover_dmp.simulation.carried_object import CarriedObjectOptions
from handover_dmp.topics import GRIPPER_COMMAND, OBJECT_HOLDER, STATE, WRIST_WRENCH
import pytest

pytestmark = [pytest.mark.ros, pytest.mark.timeout(400)]

MASS_KG = 0.5
# with the way home quicker than by default: that is most of the time
WITHDRAWAL = WithdrawalOptions(speed=1.0, near_speed=0.5)
MAX_S = 40.0
SAME_S = 0.06
"""A grip and a wrench that come one period later in the graph move a change by no more, s."""


def parameters_of(folder: Path, scenario: SessionScenario) -> dict[str, dict[str, Any]]:
    base = scenario.robot.base
    arm = {
        'base_position': [float(x) for x in base.position],
        'base_yaw': float(base.yaw),
    }
    return {
        'recorder': {'folder': str(folder / 'bag'), **arm},
        'hand_tracker': {'source': 'session', 'replay_at_s': REPLAY_AT_S},
        'dmp': {
            'session.enabled': True,
            'session.withdrawal_speed': WITHDRAWAL.speed,
            'session.near_speed': WITHDRAWAL.near_speed,
        },
        'priority_ik': arm,
        'robot_sim': {
            **arm,
            'initial_positions': scenario.q_start.tolist(),
            'object.mass_kg': MASS_KG,
            'real_time_factor': 0.0,
        },
    }


def changes(bag: Path, topic: str) -> list[tuple[Any, float]]:
    """Values of a topic and when each came first, s."""
    found: list[tuple[Any, float]] = []
    for _, message, time_ns in read_bag(bag, [topic]):
        if not found or found[-1][0] != message.data:
            found.append((message.data, time_ns / NANOSECONDS))
    return found


def test_a_session_of_the_graph_is_that_of_one_process(tmp_path: Path) -> None:
    models = SessionModels(example_model(), example_model(direction='take'))
    scenario = make_session_scenario(models=models, base=BasePlacement((-0.63, 0.07, 0.91), -0.46))
    carried = CarriedObjectOptions(mass_kg=MASS_KG)
    rules = SessionOptions(withdrawal=WITHDRAWAL)
    with SessionLoop(scenario, session=rules, carried=carried) as loop:
        alone = loop.run()
    with Graph(tmp_path, parameters_of(tmp_path, scenario)) as graph:
        graph.pause(False)
        assert graph.wait_for_state(('done', 'aborted'), MAX_S, lambda: None)
        graph.linger(0.1)
    bag = tmp_path / 'bag'
    expected = [
        (state.value, next(group).period.time_ns / NANOSECONDS)
        for state, group in groupby(alone, lambda period: period.state)
    ]
    states = changes(bag, STATE.name)
    assert [state for state, _ in states] == [state for state, _ in expected]
    for (state, there_s), (_, here_s) in zip(states[1:], expected[1:], strict=True):
        assert there_s == pytest.approx(here_s, abs=SAME_S), state
    holders = [holder.value for holder, _ in groupby(period.holder for period in alone) if holder]
    assert [holder for holder, _ in changes(bag, OBJECT_HOLDER.name)] == holders
    assert [closed for closed, _ in changes(bag, GRIPPER_COMMAND.name)] == [True, False, True]
    wrenches = sum(1 for _ in read_bag(bag, [WRIST_WRENCH.name]))
    assert wrenches > 200 * (expected[-1][1] - 1.0)
