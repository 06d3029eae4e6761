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

"""The long soak, cut short: it must hold, and it must notice when something does not."""

from __future__ import annotations

from handover_dmp.bench import soak
from handover_dmp.bench.soak import COMMAND_FAULTS, JOINT_STATE_FAULTS, Soak, Span, TARGET_FAULTS
from handover_dmp.handover.scenario import make_scenario, Scenario
from handover_dmp.robot.velocity_driver import ArmOptions
from handover_dmp.simulation.arm import SimulatedArm
import numpy as np
import pytest

STRIKES = [*JOINT_STATE_FAULTS, *TARGET_FAULTS, *COMMAND_FAULTS]


class Struck(Soak):
    """Faults in mid-motion, at once, for longer than the arm goes on after by itself."""

    names: tuple[str, ...] = ()

    def _draw(self, duration_s: float) -> list[Span]:
        end_s = 1.2 + ArmOptions().resume_within_s
        return [Span(name, 1.1, end_s) for name in self.names]


@pytest.fixture(scope='module')
def scenario() -> Scenario:
    return make_scenario()


@pytest.mark.parametrize('fault', STRIKES)
def test_every_fault_of_the_graph_stops_the_arm_or_does_nothing(
    scenario: Scenario, fault: str
) -> None:
    struck = Struck([scenario])
    struck.names = (fault,)
    struck.hand_over()
    assert struck.broken == []
    assert struck.done == 1
    # after the others the driver wants to be told to go on
    harmless = ('joint states', 'over the limits', 'flood', 'dmp', 'wrist command')
    assert struck.stops == (0 if any(word in fault for word in harmless) else 1)


def test_all_faults_of_the_joint_states_at_once(scenario: Scenario) -> None:
    struck = Struck([scenario])
    struck.names = tuple(JOINT_STATE_FAULTS[1:])
    struck.hand_over()
    assert struck.broken == []


def test_random_faults(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(soak, 'SEEDS', 1)
    figures = soak.run(lambda _text: None, minutes=2.0, maximum=4)
    assert [figure.name for figure in figures if figure.reached is False] == []


def test_an_arm_that_breaks_its_limits_is_noticed(
    scenario: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        SimulatedArm, 'joint_velocities', property(lambda arm: 3.0 * np.ones(arm.model.dof))
    )
    struck = Struck([scenario])
    struck.names = ('tracker jumped by 1 m',)
    struck.hand_over()
    assert any('faster than its limit' in line for line in struck.broken)
