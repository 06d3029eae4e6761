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

"""Sessions of an evaluation: who waits for whom, told on the page and in the table."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby
import json
from pathlib import Path

from handover_dmp.cli.main import main
from handover_dmp.evaluation.rollouts import Learning
from handover_dmp.evaluation.session_runs import run_alone, SessionMotion
from handover_dmp.evaluation.sessions import evaluate_sessions, sessions_beside, sessions_table
from handover_dmp.handover.controller import HandoverState
from handover_dmp.handover.session import SessionModels
from handover_dmp.handover.session_scenario import trials_of
from handover_dmp.handover.teaching import learn_from_trials
from handover_dmp.mocap.fluency import people_fluency
from handover_dmp.mocap.session import RecordedSession, write_sessions
from handover_dmp.mocap.synthetic_session import synthesize_sessions
from handover_dmp.robot.descriptions import ArmChoice
import numpy as np
import pytest


@pytest.fixture(scope='module')
def sessions() -> list[RecordedSession]:
    return synthesize_sessions(0, 2, configurations=['engine_bay'])


def models_of(session: RecordedSession) -> SessionModels:
    learnt = {
        trial.direction: learn_from_trials([trial], regression='ridge')
        for trial in trials_of(session)
    }
    return SessionModels(learnt['give'], learnt['take'])


def test_a_wrist_without_an_arm_gives_and_takes_back(sessions: list[RecordedSession]) -> None:
    session = sessions[0].low_passed(6.0)
    motion = run_alone(session, models_of(session))
    assert motion.done
    changes = [state for state, _ in groupby(motion.states)]
    assert changes.count(HandoverState.REACHING) == changes.count(HandoverState.EXCHANGE) == 2
    found = motion.fluency()
    assert found is not None
    assert len(found.waits) == 2
    # the shares by another way: straight from the speeds
    began = motion.states.index(HandoverState.REACHING)
    speed = 200.0 * np.linalg.norm(np.diff(motion.wrist[began:], axis=0), axis=1)
    assert found.whole.robot_idle == pytest.approx(float((speed < 0.05).mean()), abs=0.03)
    # the robot is met where P2 was: at the end of the give both hands are as near as people's
    give = trials_of(session)[0]
    met = motion.states.index(HandoverState.EXCHANGE)
    apart = np.linalg.norm(motion.wrist[met] - motion.partner[met])
    assert apart == pytest.approx(
        float(np.linalg.norm(give.demonstrator[-1] - give.partner[-1])), abs=0.05
    )


def test_a_session_that_does_not_end_says_how_far_it_came() -> None:
    states = [HandoverState.REACHING] * 10 + [HandoverState.EXCHANGE] * 250
    states += [HandoverState.WITHDRAWING] * 5 + [HandoverState.EXCHANGE] * 20
    motion = SessionMotion(np.zeros((285, 3)), np.zeros((285, 3)), states)
    assert not motion.done
    expected = 'exchange when the time was over; an exchange lasted 1.2 s'
    assert motion.unfinished() == expected


def test_each_session_is_learnt_from_the_others_and_people_stand_beside(
    sessions: list[RecordedSession], tmp_path: Path
) -> None:
    found = evaluate_sessions(sessions, Learning(), None, tmp_path)
    assert [(one.number, one.learnt) for one in found] == [(1, (2,)), (2, (1,))]
    assert all(one.done == {'DMP': True} for one in found)
    for one, session in zip(found, sessions, strict=True):
        assert one.movers['P2'] == people_fluency(session)
    idle, *_, waits = (one for one in sessions_beside(found))
    people = [people_fluency(session).whole.person_idle for session in sessions]
    assert idle.values['P2'] == pytest.approx(people)
    assert len(waits.pairs) == 4
    table = sessions_table(found, 0)
    assert table.lines[0][2] == f'{np.median(people):.2f}'
    assert table.remarks == []


@pytest.mark.slow
def test_an_arm_gives_and_takes_back_too(sessions: list[RecordedSession], tmp_path: Path) -> None:
    (found,) = evaluate_sessions(sessions[:1], Learning(), ArmChoice('lwr4'), tmp_path)
    assert found.done == {'DMP': True, 'arm': True}
    assert found.learnt == (1,)
    alone, arm = found.movers['DMP'], found.movers['arm']
    assert alone is not None and arm is not None
    assert len(arm.waits) == 2
    assert arm.whole.robot_idle == pytest.approx(alone.whole.robot_idle, abs=0.15)
    assert list(found.movers) == ['DMP', 'arm', 'P2']


def test_a_session_without_a_take_is_said(sessions: list[RecordedSession], tmp_path: Path) -> None:
    half = replace(sessions[0], exchanges=sessions[0].exchanges[:1])
    (found,) = evaluate_sessions([half], Learning(), None, tmp_path)
    assert found.movers['DMP'] is None
    table = sessions_table([found], 0)
    assert table.lines == []
    assert 'have no take' in table.remarks[0]


def test_the_page_of_recordings_tells_how_fluent_they_are(
    sessions: list[RecordedSession], tmp_path: Path
) -> None:
    write_sessions(sessions, tmp_path / 'recorded')
    words = ['evaluate', str(tmp_path / 'recorded'), '-o', str(tmp_path), '--learn', 'mean']
    assert main([*words, '--no-figures']) == 0
    table = json.loads((tmp_path / 'table.json').read_text())
    cases = {(row['exchange'], row['trials']) for row in table['rows']}
    assert cases == {('give', 2), ('take', 2)}
    assert [one['session'] for one in table['sessions']] == [1, 2]
    summed = {one['measure']: one for one in table['sessions_summary']}
    page = (tmp_path / 'index.html').read_text()
    for name in ('person_idle', 'robot_idle', 'concurrent', 'functional_delay', 'wait_robot_s'):
        for median in summed[name]['median'].values():
            assert f'<td>{median:.2f}</td>' in page


def test_a_data_set_without_sessions_says_so_in_a_line() -> None:
    table = sessions_table([], 0)
    assert '<table' not in table.as_html()
    assert '--sessions' in table.as_html()
