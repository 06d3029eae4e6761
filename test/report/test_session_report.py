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

"""A session is told leg by leg, and so is what became of the object."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from handover_dmp.recording import BagWriter
from handover_dmp.recording.messages import (
    boolean,
    joint_state,
    pose_stamped,
    string,
    wrench_stamped,
)
from handover_dmp.report import load_run, write_report
from handover_dmp.report.legs import legs_of
from handover_dmp.report.session import session_facts
from handover_dmp.topics import (
    GRIPPER_COMMAND,
    HAND_POSE,
    INFO,
    JOINT_STATES,
    OBJECT_HOLDER,
    OBJECT_POSE,
    STATE,
    Topic,
    WRIST_POSE,
    WRIST_WRENCH,
)
import numpy as np
import pytest

PERIOD_S = 0.01
END_S = 11.0
STATES = [
    (0.0, 'idle'), (1.0, 'reaching'), (2.5, 'exchange'), (3.0, 'released'), (3.2, 'withdrawing'),
    (4.5, 'waiting'), (6.0, 'reaching'), (7.5, 'exchange'), (8.2, 'withdrawing'), (9.5, 'done'),
]  # fmt: skip
HOLDERS = [(0.0, 'robot'), (2.7, 'both'), (3.02, 'partner'), (7.6, 'both'), (8.1, 'robot')]
GRIPPER = [(0.0, True), (3.0, False), (7.6, True)]
HAND = np.array([0.5, 0.1, 1.0])
HOME = np.array([-0.4, 0.0, 1.0])
GAP = np.array([0.2, 0.0, 0.0])
WEIGHT_N, SHARE, PULL_N = 4.0, 0.75, 0.5
OFFSETS = {'give': [-0.2, 0.0, 0.0], 'take': [-0.22, 0.0, 0.0]}


def between(time_s: float, begin_s: float, end_s: float) -> float:
    u = float(np.clip((time_s - begin_s) / (end_s - begin_s), 0.0, 1.0))
    return 10 * u**3 - 15 * u**4 + 6 * u**5


def wrist_at(time_s: float) -> np.ndarray:
    """Go out and home twice; the second time 20 mm less far."""
    first = between(time_s, 1.0, 2.5) - between(time_s, 3.2, 4.5)
    second = between(time_s, 6.0, 7.5) - between(time_s, 8.2, 9.5)
    return HOME + (first + second) * (HAND - GAP - HOME) - second * np.array([0.02, 0.0, 0.0])


def wrench_at(time_s: float) -> list[float]:
    """Bear the weight, less what the partner carries and pulls before the release at 3 s."""
    if time_s > 3.0:
        return [0.0, 0.0, 0.0]
    touched = time_s > 2.7
    return [PULL_N * touched, 0.0, -WEIGHT_N * (1.0 - SHARE * touched)]


def write_session(folder: Path, **changes: Any) -> Path:
    """Write the bag of a session."""
    told: dict[str, Any] = {'states': STATES, 'holders': HOLDERS, 'gripper': GRIPPER, **changes}
    info = {
        'exchange': 'session', 'configuration': 'engine_bay',
        'release': {'share': 0.5, 'pull_n': 2.0},
        'legs': {name: {'goal_offset_m': offset} for name, offset in OFFSETS.items()},
    } | told.get('info', {})  # fmt: skip
    events = [
        (time_s, topic, make(value))
        for topic, make, values in (
            (STATE, string, told['states']),
            (OBJECT_HOLDER, string, told['holders']),
            (GRIPPER_COMMAND, boolean, told['gripper']),
        )
        for time_s, value in values
    ]
    with BagWriter(folder / 'bag') as bag:

        def write(topic: Topic, message: Any, time_s: float) -> None:
            bag.add_topic(topic.name, topic.type_name)
            bag.write_message(topic.name, message, round(time_s * 1e9))

        write(INFO, string(json.dumps(info)), 0.0)
        for time_s in np.arange(0.0, END_S, PERIOD_S).tolist():
            while events and min(events, key=lambda one: one[0])[0] <= time_s + 1e-9:
                event = min(events, key=lambda one: one[0])
                events.remove(event)
                write(event[1], event[2], time_s)
            time_ns = round(time_s * 1e9)
            write(HAND_POSE, pose_stamped(time_ns, HAND.tolist()), time_s)
            write(WRIST_POSE, pose_stamped(time_ns, wrist_at(time_s).tolist()), time_s)
            write(JOINT_STATES, joint_state(time_ns, ['one'], [0.0], [0.0]), time_s)
            write(OBJECT_POSE, pose_stamped(time_ns, HAND.tolist()), time_s)
            write(WRIST_WRENCH, wrench_stamped(time_ns, wrench_at(time_s), [0.0] * 3), time_s)
    return folder


@pytest.fixture(scope='module')
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_session(tmp_path_factory.mktemp('session'))


def test_each_leg_is_measured_as_a_handover_of_its_own(recorded: Path) -> None:
    give, take = session_facts(load_run(recorded))['legs']
    assert (give['direction'], take['direction']) == ('give', 'take')
    for leg, begin_s, ends_s, home_s in ((give, 1.0, 3.0, 4.5), (take, 6.0, 8.2, 9.5)):
        assert leg['handed_over']
        assert leg['begin_s'] == pytest.approx(begin_s, abs=0.011)
        assert leg['reach_duration_s'] == pytest.approx(1.5, abs=0.011)
        assert leg['exchange_ends_s'] == pytest.approx(ends_s, abs=0.011)
        assert leg['home_s'] == pytest.approx(home_s, abs=0.011)
        # of a reach of minimum jerk, 1.875 times the mean, though the way home is faster
        assert leg['wrist_peak_speed_m_s'] == pytest.approx(1.875 * 0.7 / 1.5, rel=0.05)
    assert give['exchange_gap_m'] == pytest.approx(0.0, abs=1e-6)
    # it stops 20 mm short, and its own goal is 20 mm nearer
    assert take['exchange_gap_m'] == pytest.approx(0.0, abs=1e-6)


def test_legs_keep_what_was_recorded_of_them_alone(recorded: Path) -> None:
    give, take = legs_of(load_run(recorded))
    assert give.run.wrist_times[-1] < take.run.wrist_times[0]
    assert [state for _, state in take.run.states] == ['reaching', 'exchange', 'done']
    assert give.run.goal_offset == pytest.approx(OFFSETS['give'])


def test_the_release_is_told_with_share_and_pull(recorded: Path) -> None:
    give, take = (leg['release'] for leg in session_facts(load_run(recorded))['legs'])
    assert give['rule'] == 'share'
    assert give['share'] == pytest.approx(SHARE, abs=1e-6)
    towards = (HAND - wrist_at(3.0)) / np.linalg.norm(HAND - wrist_at(3.0))
    felt = np.array([PULL_N, 0.0, SHARE * WEIGHT_N])
    assert give['pull_n'] == pytest.approx(felt @ towards, abs=1e-6)
    assert give['gripper_s'] == pytest.approx(3.0, abs=0.011)
    assert give['both_s'] == pytest.approx(0.32, abs=0.011)
    assert (take['rule'], take['share']) == ('distance', None)
    assert take['passed_s'] == pytest.approx(8.1, abs=0.011)


@pytest.mark.parametrize(
    ('changes', 'rule'),
    [
        ({'info': {'release': {'share': 0.9, 'pull_n': 0.4}}}, 'pull'),
        ({'info': {'release': {'share': 0.9, 'pull_n': 9.0}}}, 'distance'),
        ({'info': {'release': {}}}, 'distance'),
    ],
)
def test_the_rule_is_the_one_that_was_met(tmp_path: Path, changes: Any, rule: str) -> None:
    (give, _) = session_facts(load_run(write_session(tmp_path, **changes)))['legs']
    assert give['release']['rule'] == rule


def test_what_became_of_the_object(recorded: Path, tmp_path: Path) -> None:
    facts = session_facts(load_run(recorded))
    assert (facts['dropped'], facts['released_early']) == (False, False)
    fell = [*HOLDERS[:2], (3.02, 'nobody'), (3.1, 'partner'), *HOLDERS[3:]]
    early = [(0.0, 'robot'), (3.05, 'partner'), *HOLDERS[3:]]
    bad = session_facts(load_run(write_session(tmp_path / 'fell', holders=fell)))
    assert (bad['dropped'], bad['released_early']) == (True, False)
    bad = session_facts(load_run(write_session(tmp_path / 'early', holders=early)))
    assert (bad['dropped'], bad['released_early']) == (False, True)
    unknown = session_facts(load_run(write_session(tmp_path / 'unknown', holders=[])))
    assert (unknown['dropped'], unknown['released_early']) == (None, None)


def test_a_session_that_breaks_off_is_told_as_far_as_it_came(tmp_path: Path) -> None:
    run = load_run(write_session(tmp_path, states=[*STATES[:7], (6.5, 'aborted')]))
    give, take = session_facts(run)['legs']
    assert give['handed_over'] and not take['handed_over']
    assert take['exchange_gap_m'] is None
    assert take['release']['rule'] is None


def test_the_report_of_a_session_has_its_legs_its_states_and_figure_3(recorded: Path) -> None:
    report = write_report(recorded)
    assert report['handed_over']
    assert 'session' in report['figures']
    assert (recorded / 'figures' / 'session.png').is_file()
    kept = json.loads((recorded / 'report.json').read_text())
    timeline = kept['session']['timeline']
    assert [one['state'] for one in timeline] == [state for _, state in STATES]
    assert sum(one['duration_s'] for one in timeline) == pytest.approx(END_S, abs=0.03)
    text = (recorded / 'report.md').read_text()
    for words in ('# Session: engine_bay', 'given and taken back', '| give | take |',
                  'the share of the weight', 'never dropped'):  # fmt: skip
        assert words in text


def test_who_waited_for_whom_is_told(recorded: Path) -> None:
    fluency = session_facts(load_run(recorded))['fluency']
    assert fluency['person'] is None
    # the hand never moves; the wrist does for two reaches of 1.5 s and two ways home of 1.3 s,
    # in the midst of each, where 16 u² (1 − u)² > 0.05 / 0.875, for 87 % of it
    assert fluency['robot']['whole']['person_idle'] == pytest.approx(1.0)
    assert fluency['robot']['whole']['robot_idle'] == pytest.approx(1 - 0.87 * 0.56, abs=0.02)
    assert [wait['robot_s'] < 0.3 for wait in fluency['robot']['waits']] == [True, True]
