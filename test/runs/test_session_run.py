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

"""What the folder of a session tells is what happened in it."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

from handover_dmp.handover.recordings import read_model, recorded_session
from handover_dmp.handover.session_lockstep import simulate_session
from handover_dmp.handover.session_scenario import make_session_scenario
from handover_dmp.report import load_run
from handover_dmp.report.session import session_facts
from handover_dmp.runs.bag import write_session_bag
from handover_dmp.runs.folder import keep_session, session_info
import numpy as np
import pytest

MASS_KG = 0.5


def test_bag_and_inputs_of_a_session_tell_what_happened(tmp_path: Path) -> None:
    scenario = make_session_scenario()
    periods = simulate_session(scenario, carried=scenario.carried(MASS_KG))
    info = session_info(scenario, MASS_KG)
    file = keep_session(tmp_path, scenario)
    write_session_bag(tmp_path / 'bag', scenario, periods, info)

    record = load_run(tmp_path)
    assert record.info == info
    times = np.array([one.period.time_ns for one in periods]) * 1e-9
    states = [one.state.value for one in periods]
    first = [next(group)[0] for _, group in groupby(enumerate(states), lambda one: one[1])]
    facts = session_facts(record)
    assert [one['state'] for one in facts['timeline']] == [states[index] for index in first]
    assert facts['timeline'][-1]['state'] == 'done'
    begun = [one['begin_s'] for one in facts['timeline']]
    assert begun == pytest.approx(times[first], abs=0.006)
    closed = [one.gripper_closed for one in periods]
    changes = [next(group)[1] for _, group in groupby(enumerate(closed), lambda one: one[1])]
    assert [one['closed'] for one in facts['gripper']] == changes
    holders = [one.holder.value for one in periods if one.holder is not None]
    assert [one['holder'] for one in facts['holders']] == [who for who, _ in groupby(holders)]
    assert (facts['dropped'], facts['released_early']) == (False, False)

    again = recorded_session(file, cutoff_hz=0.0)
    assert again.motion.partner == pytest.approx(scenario.session.motion.partner, abs=1e-6)
    assert read_model(tmp_path / 'model.json').goal == pytest.approx(scenario.models.give.goal)
    assert read_model(tmp_path / 'take_model.json').goal == pytest.approx(
        scenario.models.take.goal
    )
