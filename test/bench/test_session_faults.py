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

"""What no fault may break in a session is noticed; and no fault of a few breaks it."""

from __future__ import annotations

from handover_dmp.bench.session_faults import FAULTS, FaultySession, measured, row
from handover_dmp.bench.session_watch import SessionWatch, STAGES, StageWatch
from handover_dmp.handover.session_scenario import make_session_scenario
import pytest

HAND = (1.0, 0.0, 1.0)


def approached(watch: SessionWatch, until_m: float, age_s: float) -> None:
    """Come from 1 m to a distance of the hand that was last seen so long ago."""
    for step in range(101):
        distance = 1.0 + (until_m - 1.0) * step / 100
        watch.see_wrist(0.01 * step, (HAND[0] - distance, HAND[1], HAND[2]), HAND, age_s)


def test_a_wrist_that_goes_on_towards_a_lost_hand_is_told_once() -> None:
    watch = SessionWatch()
    approached(watch, 0.2, 0.1)
    assert watch.broken == []  # that is what a reach does
    approached(watch, 0.9, 1.0)
    assert len(watch.broken) == 1
    assert 'nearer to a hand that is lost' in watch.broken[0]


def test_a_wrist_that_stands_or_goes_away_from_a_lost_hand_is_not_told() -> None:
    watch = SessionWatch()
    approached(watch, 0.2, 0.1)
    approached(watch, 0.999, 1.0)
    for step in range(100):
        watch.see_wrist(2.0 + step, (-0.01 * step, 0.0, 1.0), HAND, 1.0)
    assert watch.broken == []


def test_a_pose_that_comes_late_is_no_motion_of_the_wrist() -> None:
    watch = SessionWatch()
    approached(watch, 0.5, 0.1)
    wrist = (HAND[0] - 0.5, HAND[1], HAND[2])
    for step in range(100):
        # the last poses before a tracker is stalled arrive when it goes on
        late = HAND if step < 50 else (HAND[0] - 0.05, HAND[1], HAND[2])
        watch.see_wrist(2.0 + 0.01 * step, wrist, late, 0.5)
    assert watch.broken == []


def test_a_wrist_that_follows_poses_which_are_all_late_is_told() -> None:
    watch = SessionWatch()
    approached(watch, 0.5, 0.1)
    for step in range(100):
        moved_m = 0.001 * step
        hand = (HAND[0] - 0.5 * moved_m, HAND[1], HAND[2])
        watch.see_wrist(2.0 + 0.01 * step, (HAND[0] - 0.5 + moved_m, 0.0, 1.0), hand, 0.5)
    assert len(watch.broken) == 1


def test_a_dropped_object_is_told() -> None:
    watch = SessionWatch()
    for holder in ('robot', 'both', 'partner', 'both', 'robot'):
        watch.see_holder(1.0, holder)
    assert watch.broken == []
    watch.see_holder(2.5, 'nobody')
    assert watch.broken == ['at 2.500 s: the object is dropped']


def test_stages_are_told_by_state_and_gripper() -> None:
    watch, seen = StageWatch(), []
    for state, closed in (
        ('idle', False), ('picking_up', False), ('picking_up', True),
        ('reaching', True), ('exchange', True), ('released', False),
        ('withdrawing', False), ('waiting', False), ('reaching', False), ('exchange', False),
        ('exchange', True), ('withdrawing', True), ('done', True),
    ):  # fmt: skip
        watch.see(state, closed)
        seen.append(watch.stage)
    assert list(dict.fromkeys(filter(None, seen))) == [name for name, _, _ in STAGES]
    assert seen[0] == seen[-1] == ''


@pytest.mark.slow
@pytest.mark.parametrize(
    'fault', ['tracker stopped', 'force sensor at zero', 'dmp silent', 'abort', 'reset']
)
def test_a_fault_at_every_stage_drops_nothing(fault: str) -> None:
    assert fault in FAULTS
    found = row(make_session_scenario(pick_up=True), fault)
    assert found.broken == ()
    assert found.done
    assert len(found.stages) == len(STAGES)


@pytest.mark.slow
def test_a_gripper_that_opens_by_itself_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    def opens(session: FaultySession, _fault: str) -> None:
        session.controller.gripper_closed = False
        session.fault = session.fault.__class__('opens', session.time_s, session.time_s)

    monkeypatch.setattr(FaultySession, 'strike', opens)
    found = row(make_session_scenario(pick_up=True), 'opens')
    assert any('dropped' in line for line in found.broken)
    assert measured([found])[0].value > 0.0
