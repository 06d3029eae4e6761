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

"""A whole session: in which order, with which gripper, how softly, and what a lost hand stops."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
import re

from handover_dmp.bench.faults import STATES_OF_SESSIONS
from handover_dmp.common.errors import DataError
from handover_dmp.dmp import DecoupledDmp
from handover_dmp.handover.controller import HandoverController, HandoverOptions, HandoverState
from handover_dmp.handover.recordings import example_model
from handover_dmp.handover.release import ReleaseOptions
from handover_dmp.handover.session import Leg, SessionController, SessionModels, SessionOptions
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

PERIOD_S = 0.005
LIMIT = 20.0
"""m/s²; the acceleration limit of `config/handover.yaml`."""
LOST_S = 0.1
"""Age of a hand that is lost; `hand_timeout_s` of `config/handover.yaml`."""
S = HandoverState
GIVE, TAKE = example_model(), example_model(direction='take')
MODELS = SessionModels(GIVE, TAKE)
TOPICS = Path(__file__).resolve().parents[2] / 'docs' / 'topics.md'


def documented_states() -> dict[HandoverState, set[HandoverState]]:
    """Read the diagram of docs/topics.md."""
    text = TOPICS.read_text(encoding='utf-8')
    diagram = text.split('<!-- states of a session -->')[1].split('<!-- end of the states -->')[0]
    found: dict[HandoverState, set[HandoverState]] = {state: set() for state in HandoverState}
    for before, after in re.findall(r'(\w+) --> (\w+):', diagram):
        found[HandoverState(before)].add(HandoverState(after))
    return found


def hand_of(model: DecoupledDmp) -> np.ndarray:
    return np.array(model.goal) - np.array(model.goal_offset)


@dataclass(frozen=True)
class Moment:
    """What one period saw and said."""

    now_s: float
    state: HandoverState
    leg: Leg
    closed: bool
    position: np.ndarray
    velocity: np.ndarray
    hand: np.ndarray
    seen: bool


@dataclass
class Loop:
    """A session, a wrist that is where it was told to be, and a hand that rests or moves."""

    session: SessionOptions = field(default_factory=SessionOptions)
    options: HandoverOptions = field(default_factory=HandoverOptions)

    def __post_init__(self) -> None:
        self.controller = SessionController(MODELS, self.options, session=self.session)
        self.controller.set_wrist(tuple(GIVE.start))
        self.hand = hand_of(GIVE)
        self.hand_velocity = np.zeros(3)
        self.now_s = 0.0
        self.moments: list[Moment] = []
        self.force: tuple[float, float, float] | None = None

    def step(self, periods: int = 1, *, seen: bool = True) -> None:
        for _ in range(periods):
            self.hand = self.hand + self.hand_velocity * PERIOD_S
            if seen:
                self.controller.set_hand(self.now_s, tuple(self.hand), self.now_s, self.now_s)
            if self.force is not None:
                self.controller.set_wrench(self.force, self.now_s)
            command = self.controller.step(self.now_s, PERIOD_S)
            assert command is not None
            assert command.state is self.controller.state
            self.controller.set_wrist(command.position)
            self.moments.append(
                Moment(
                    self.now_s,
                    command.state,
                    self.controller.leg,
                    self.controller.gripper_closed,
                    np.array(command.position),
                    np.array(command.velocity),
                    self.hand,
                    seen,
                )
            )
            self.now_s += PERIOD_S

    def until(self, *states: HandoverState, seen: bool = True, max_s: float = 20.0) -> None:
        end_s = self.now_s + max_s
        while self.controller.state not in states:
            self.step(seen=seen)
            assert self.now_s < end_s, f'{self.controller.state} for {max_s} s'

    def run_session(self) -> None:
        self.step(20)
        self.controller.signal(self.now_s)
        self.until(S.WAITING)
        self.step(40)
        self.hand = hand_of(TAKE)
        self.step(300)
        self.controller.signal(self.now_s)
        self.until(S.DONE)

    @property
    def changes(self) -> list[tuple[str, str, bool]]:
        found = [(m.state.value, m.leg.value, m.closed) for m in self.moments]
        return [found[0], *(b for a, b in pairwise(found) if a != b)]


def check_motion(moments: list[Moment]) -> None:
    """Positions and velocities belong together, and no velocity changes too fast."""
    for before, after in pairwise(moments):
        change = np.linalg.norm(after.velocity - before.velocity)
        assert change <= LIMIT * PERIOD_S * (1 + 1e-9), (before.state, after.state)
        mean = 0.5 * (after.velocity + before.velocity)
        gone = after.position - before.position
        assert np.linalg.norm(gone - mean * PERIOD_S) < 2e-5, (before.state, after.state)


def check_gripper(moments: list[Moment]) -> None:
    """Check that it opens in the exchange of a give alone, where the wrist is at the hand."""
    offset = np.array(GIVE.goal_offset)
    for before, after in pairwise(moments):
        if before.closed and not after.closed:
            assert (before.state, after.state, after.leg) == (S.EXCHANGE, S.RELEASED, Leg.GIVE)
            assert np.linalg.norm(after.position - after.hand - offset) < 0.025


def check_lost_hand(moments: list[Moment]) -> None:
    """Once it has braked for a lost hand, the wrist does not come nearer to it."""
    last, place, allowed_m = -np.inf, np.zeros(3), 0.0
    for moment in moments:
        if moment.seen:
            last, place = moment.now_s, moment.hand
        distance = float(np.linalg.norm(moment.position - place))
        if moment.now_s - last < LOST_S + 0.1:
            allowed_m = distance
        elif np.isfinite(last):
            assert distance > allowed_m - 1e-3, (moment.state, moment.now_s - last)
            allowed_m = max(allowed_m, distance)


def check_states(moments: list[Moment]) -> None:
    for before, after in pairwise(moments):
        assert after.state is before.state or after.state in STATES_OF_SESSIONS[before.state]


def test_gives_waits_takes_back_and_goes_home() -> None:
    loop = Loop()
    loop.run_session()
    assert loop.changes == [
        ('idle', 'give', True),
        ('reaching', 'give', True),
        ('exchange', 'give', True),
        ('released', 'give', False),
        ('withdrawing', 'give', False),
        ('waiting', 'take', False),
        ('reaching', 'take', False),
        ('exchange', 'take', False),
        ('exchange', 'take', True),
        ('withdrawing', 'take', True),
        ('done', 'take', True),
    ]
    home = np.array(GIVE.start)
    for moment in loop.moments:
        if moment.state in (S.WAITING, S.DONE):
            assert np.linalg.norm(moment.position - home) < 1.5e-3
    check_motion(loop.moments)
    check_gripper(loop.moments)


def test_a_second_session_follows_a_new_signal() -> None:
    loop = Loop()
    loop.run_session()
    loop.hand = hand_of(GIVE)
    loop.step(300)
    assert loop.controller.state is S.DONE
    loop.controller.signal(loop.now_s)
    loop.until(S.WAITING)
    assert not loop.controller.gripper_closed
    check_motion(loop.moments)


def test_the_give_is_a_single_handover_to_the_bit() -> None:
    loop = Loop()
    single = HandoverController(GIVE, loop.options)
    single.set_wrist(tuple(GIVE.start))
    for controller in (single, loop.controller):
        controller.signal(0.2)
    loop.hand_velocity = np.array([-0.02, 0.03, 0.01])
    loop.until(S.RELEASED)
    for moment in loop.moments[:-1]:
        single.set_hand(moment.now_s, tuple(moment.hand), moment.now_s, moment.now_s)
        command = single.step(moment.now_s, PERIOD_S)
        assert command is not None
        assert (command.position, command.velocity, command.state) == (
            tuple(moment.position),
            tuple(moment.velocity),
            moment.state,
        )
        single.set_wrist(command.position)


def test_goes_home_along_the_way_it_came_and_slowly_near_the_hand() -> None:
    loop = Loop()
    loop.step(20)
    loop.controller.start()
    loop.until(S.WAITING)
    there = np.array([m.position for m in loop.moments if m.state is S.REACHING])
    back = [m for m in loop.moments if m.state is S.WITHDRAWING]
    goal, options = hand_of(GIVE) + GIVE.goal_offset, loop.session.withdrawal
    for moment in back:
        assert np.linalg.norm(there - moment.position, axis=1).min() < 0.01
        speed = np.linalg.norm(moment.velocity)
        assert speed <= options.speed * (1 + 1e-4)
        if np.linalg.norm(moment.position - goal) < options.near_m:
            assert speed <= options.near_speed * 1.05
    assert max(float(np.linalg.norm(m.velocity)) for m in back) > 0.9 * options.speed


def test_a_hand_that_was_followed_about_is_not_followed_on_the_way_home() -> None:
    loop = Loop(options=HandoverOptions(exchange_hold_s=4.0))
    loop.step(20)
    loop.controller.start()
    loop.until(S.EXCHANGE)
    for velocity in ([0.0, 0.3, 0.0], [0.0, -0.3, 0.0], [0.0, 0.0, 0.3], [0.0, 0.0, -0.3]):
        loop.hand_velocity = np.array(velocity)
        loop.step(160)
    loop.hand_velocity = np.zeros(3)
    loop.until(S.WAITING)
    lengths = {
        state: sum(
            float(np.linalg.norm(b.position - a.position))
            for a, b in pairwise(loop.moments)
            if b.state is state
        )
        for state in (S.REACHING, S.EXCHANGE, S.WITHDRAWING)
    }
    assert lengths[S.EXCHANGE] > 0.8
    assert lengths[S.WITHDRAWING] < 1.15 * lengths[S.REACHING]


def test_picks_the_object_up_first_where_it_has_to() -> None:
    place = (GIVE.start[0] + 0.1, GIVE.start[1] - 0.2, GIVE.start[2] - 0.1)
    loop = Loop(SessionOptions(pick_up=True, pick_up_position=place))
    loop.step(20)
    assert not loop.controller.gripper_closed
    loop.controller.signal(loop.now_s)
    loop.until(S.REACHING)
    picking = [m for m in loop.moments if m.state is S.PICKING_UP]
    closing = next(m for m in picking if m.closed)
    assert np.linalg.norm(closing.position - place) < 2e-3
    assert np.linalg.norm(loop.moments[-1].position - GIVE.start) < 2e-3
    loop.until(S.WAITING)
    assert loop.controller.next_leg is Leg.TAKE
    check_motion(loop.moments)


def test_takes_when_the_hand_comes_with_the_object_and_not_when_it_goes() -> None:
    loop = Loop(SessionOptions(take_start='motion'))
    loop.step(20)
    loop.controller.start()
    loop.until(S.WAITING)
    away = loop.hand - loop.moments[-1].position
    away = away / np.linalg.norm(away)
    aside = np.cross(away, [0.0, 0.0, 1.0])
    for velocity, expected in ((away, S.WAITING), (aside, S.WAITING), (-away, S.REACHING)):
        loop.hand_velocity = 0.3 * velocity
        loop.step(100)
        loop.hand_velocity = np.zeros(3)
        loop.step(20)
        assert loop.controller.state is expected


def test_a_wait_that_takes_too_long_ends_the_session_at_home() -> None:
    loop = Loop(SessionOptions(wait_timeout_s=1.0))
    loop.step(20)
    loop.controller.start()
    loop.until(S.WAITING)
    since_s = loop.now_s
    loop.until(S.DONE)
    assert loop.now_s - since_s == pytest.approx(1.0, abs=0.02)
    # nothing is in the gripper, so that the next handover can only be a take
    assert loop.controller.next_leg is Leg.TAKE


@pytest.mark.parametrize('pull_n', [4.0, 25.0])
def test_the_gripper_opens_by_the_pull_that_is_set_and_no_less(pull_n: float) -> None:
    loop = Loop(session=SessionOptions(release=ReleaseOptions(pull_n=pull_n)))
    loop.force = (0.0, 0.0, -8.0)
    loop.step(120)
    loop.controller.signal(loop.now_s)
    loop.until(S.EXCHANGE)
    for share in (0.5, 0.9):
        loop.force = (share * pull_n, 0.0, -8.0)
        loop.step(200)
        assert loop.controller.state is S.EXCHANGE
    loop.force = (1.1 * pull_n, 0.0, -8.0)
    loop.until(S.RELEASED, max_s=0.3)
    check_gripper(loop.moments)


def in_an_exchange_without_end(**session: float) -> Loop:
    loop = Loop(SessionOptions(exchange_timeout_s=2.0, **session))
    loop.force = (0.0, 0.0, -8.0)
    loop.step(100)
    loop.controller.signal(loop.now_s)
    loop.until(S.EXCHANGE)
    loop.step(300)
    assert loop.controller.state is S.EXCHANGE
    assert not loop.controller.is_overdue
    loop.step(99)
    return loop


def test_a_partner_who_never_takes_is_told_of_and_the_object_held() -> None:
    loop = in_an_exchange_without_end()
    loop.step(2)
    assert loop.controller.is_overdue
    loop.step(1000)
    assert loop.controller.state is S.EXCHANGE
    assert loop.controller.gripper_closed
    # it still gives, once the partner takes
    loop.force = (0.0, 0.0, -1.0)
    loop.until(S.RELEASED, max_s=1.0)
    assert not loop.controller.is_overdue


def test_goes_home_with_what_nobody_takes_where_it_is_told_to() -> None:
    loop = in_an_exchange_without_end(withdraws_untaken=True)
    loop.until(S.WITHDRAWING, max_s=0.1)
    assert loop.controller.is_overdue
    loop.until(S.IDLE)
    assert np.linalg.norm(loop.moments[-1].position - GIVE.start) < 1e-3
    assert all(moment.closed for moment in loop.moments)
    assert loop.controller.next_leg is Leg.GIVE
    loop.controller.signal(loop.now_s)
    loop.until(S.EXCHANGE)
    assert loop.controller.leg is Leg.GIVE
    assert not loop.controller.is_overdue


def test_does_not_tear_at_what_is_touched_nor_without_feeling_it() -> None:
    for force in ((0.0, 4.0, -8.0), None):
        loop = in_an_exchange_without_end(withdraws_untaken=True)
        loop.controller.session = replace(loop.session, exchange_timeout_s=2.5)
        loop.force = force
        loop.step(600)
        assert loop.controller.state is S.EXCHANGE
        assert loop.controller.is_overdue


def test_a_take_that_never_ends_is_told_of_and_held() -> None:
    loop = Loop(SessionOptions(exchange_timeout_s=1.0, withdraws_untaken=True))
    loop.controller.begin_with('partner')
    loop.force = (0.0, 0.0, 0.0)
    loop.hand = hand_of(TAKE)
    loop.step(100)
    loop.controller.signal(loop.now_s)
    loop.until(S.EXCHANGE)
    loop.step(1000)
    assert loop.controller.state is S.EXCHANGE
    assert loop.controller.is_overdue
    assert loop.controller.gripper_closed


@pytest.mark.parametrize('pick_up', [False, True])
def test_begins_with_the_take_where_the_partner_has_the_object(pick_up: bool) -> None:
    loop = Loop(SessionOptions(pick_up=pick_up))
    assert loop.controller.begin_with('partner')
    assert not loop.controller.begin_with('partner')
    assert not loop.controller.gripper_closed
    loop.hand = hand_of(TAKE)
    loop.step(20)
    loop.controller.signal(loop.now_s)
    loop.until(S.DONE)
    states = [moment.state for moment in loop.moments]
    assert S.PICKING_UP not in states
    assert S.WAITING not in states
    assert loop.controller.gripper_closed


def test_what_the_robot_holds_is_never_let_go_of_by_being_told_so() -> None:
    loop = Loop()
    for holder in ('robot', 'both', 'nobody', 'who?'):
        assert not loop.controller.begin_with(holder)
        assert loop.controller.gripper_closed
    loop.controller.signal(loop.now_s)
    loop.until(S.REACHING)
    assert not loop.controller.begin_with('partner')
    assert loop.controller.gripper_closed
    fetching = Loop(SessionOptions(pick_up=True))
    assert fetching.controller.begin_with('both')
    assert fetching.controller.gripper_closed
    assert fetching.controller.next_leg is Leg.GIVE


def test_a_signal_on_the_way_home_is_not_lost_and_one_in_a_reach_is() -> None:
    loop = Loop()
    loop.step(20)
    loop.controller.signal(loop.now_s)
    loop.until(S.REACHING)
    loop.controller.signal(loop.now_s)
    loop.until(S.WITHDRAWING)
    loop.controller.signal(loop.now_s)
    loop.until(S.WAITING)
    loop.step()
    assert loop.controller.state is S.REACHING
    loop.controller.signal(loop.now_s)
    loop.until(S.DONE)
    loop.step(300)
    assert loop.controller.state is S.DONE


def test_goes_on_away_from_a_hand_that_is_lost_and_stands_before_it() -> None:
    loop = Loop()
    loop.step(20)
    loop.controller.start()
    loop.until(S.WITHDRAWING)
    loop.step(40)
    loop.until(S.WAITING, seen=False)
    # a hand that was last seen between the wrist and its home
    loop = Loop()
    loop.step(20)
    loop.controller.start()
    loop.until(S.WITHDRAWING)
    loop.step(20)
    loop.hand = 0.5 * (loop.moments[-1].position + np.array(GIVE.start))
    loop.step(220)
    loop.step(400, seen=False)
    halted = loop.moments[-1]
    assert halted.state is S.WITHDRAWING
    assert np.linalg.norm(halted.velocity) == 0.0
    loop.hand = hand_of(GIVE)
    loop.until(S.WAITING)
    check_motion(loop.moments)
    check_lost_hand(loop.moments)


@pytest.mark.parametrize('state', [S.RELEASED, S.WITHDRAWING, S.WAITING])
@pytest.mark.parametrize('how', ['abort', 'hold', 'reset'])
def test_what_was_picked_up_and_given_is_taken_back_after_it_was_broken_off(
    state: HandoverState, how: str
) -> None:
    """And not looked for where it was picked up."""
    place = (GIVE.start[0] + 0.1, GIVE.start[1] - 0.2, GIVE.start[2] - 0.1)
    loop = Loop(SessionOptions(pick_up=True, pick_up_position=place))
    loop.step(20)
    loop.controller.start()
    loop.until(state)
    getattr(loop.controller, how)()
    loop.step(100)
    assert loop.controller.next_leg is Leg.TAKE
    loop.hand = hand_of(TAKE)
    loop.step(220)
    assert loop.controller.start()
    loop.until(S.DONE)
    assert loop.controller.gripper_closed
    check_gripper(loop.moments)


@pytest.mark.parametrize('told_first', [False, True])
def test_what_lies_on_the_table_again_is_fetched_from_there(told_first: bool) -> None:
    place = (GIVE.start[0] + 0.1, GIVE.start[1] - 0.2, GIVE.start[2] - 0.1)
    loop = Loop(SessionOptions(pick_up=True, pick_up_position=place))
    loop.step(20)
    loop.controller.begin_with('table')
    loop.controller.start()
    loop.controller.begin_with('partner')
    loop.until(S.WAITING)
    if told_first:
        loop.controller.begin_with('table')
    loop.controller.reset()
    if not told_first:
        assert loop.controller.next_leg is Leg.TAKE
        assert loop.controller.begin_with('table')
    loop.step(120)
    assert loop.controller.start()
    assert loop.controller.state is S.PICKING_UP


@pytest.mark.parametrize('state', [S.RELEASED, S.WITHDRAWING])
@pytest.mark.parametrize('how', ['abort', 'reset'])
def test_what_is_felt_is_felt_from_where_it_was_broken_off(state: HandoverState, how: str) -> None:
    """With nothing in the gripper, and then with the object in it again."""
    loop = Loop()
    loop.force = (0.0, 0.0, -8.0)
    loop.step(120)
    loop.controller.start()
    loop.until(S.EXCHANGE)
    loop.force = (0.0, 0.0, -1.0)
    loop.until(S.RELEASED)
    loop.force = (0.0, 0.0, 0.1)
    loop.until(state)
    for _ in range(2):
        getattr(loop.controller, how)()
        loop.hand = hand_of(TAKE)
        loop.step(220)
        assert loop.controller.start()
        loop.until(S.EXCHANGE)
        loop.step(300)
        # what has not come over yet is not pulled at
        assert loop.controller.state is S.EXCHANGE
        assert loop.controller.gripper_closed
        loop.force = (0.0, 0.0, -8.0)
        loop.until(S.WITHDRAWING)
        getattr(loop.controller, how)()
        loop.hand = hand_of(GIVE)
        loop.step(220)
        assert loop.controller.start()
        loop.until(S.EXCHANGE)
        loop.step(100)
        assert loop.controller.state is S.EXCHANGE
        loop.force = (0.0, 0.0, -1.0)
        loop.until(S.RELEASED)
        loop.force = (0.0, 0.0, 0.1)
        loop.until(state)
    check_gripper(loop.moments)


@pytest.mark.parametrize('state', [S.REACHING, S.EXCHANGE, S.RELEASED, S.WITHDRAWING, S.WAITING])
@pytest.mark.parametrize('how', ['abort', 'reset', 'hold'])
def test_an_abort_or_a_reset_stops_it_anywhere_and_it_still_finds_home(
    state: HandoverState, how: str
) -> None:
    loop = Loop()
    loop.step(20)
    loop.controller.start()
    loop.until(state)
    loop.step(60)
    closed = loop.controller.gripper_closed
    getattr(loop.controller, how)()
    begun = len(loop.moments)
    loop.step(200)
    assert loop.controller.state is (S.IDLE if how == 'reset' else S.ABORTED)
    assert loop.controller.gripper_closed is closed
    assert np.linalg.norm(loop.moments[-1].velocity) == 0.0
    moved = loop.moments[-1].position - loop.moments[begun].position
    assert np.linalg.norm(moved) < 0.05
    loop.hand = hand_of(GIVE if closed else TAKE)
    loop.step(220)
    assert loop.controller.start()
    assert loop.controller.leg is (Leg.GIVE if closed else Leg.TAKE)
    loop.until(S.WAITING, S.DONE)
    assert np.linalg.norm(loop.moments[-1].position - GIVE.start) < 5e-3
    check_gripper(loop.moments)
    if how != 'hold':
        check_motion(loop.moments)


@st.composite
def troubles(draw: st.DrawFn) -> list[tuple[str, int, tuple[float, float, float]]]:
    """Things that happen one after the other, each for some periods, with a velocity."""
    what = st.sampled_from(
        ['lost', 'seen', 'seen', 'moves', 'signal', 'signal', 'start', 'abort', 'reset', 'back']
    )
    speed = st.floats(-0.5, 0.5)
    return draw(
        st.lists(
            st.tuples(what, st.integers(1, 400), st.tuples(speed, speed, speed)),
            min_size=4,
            max_size=16,
        )
    )


@settings(max_examples=10)
@given(
    troubles(),
    st.sampled_from(['signal', 'motion']),
    st.sampled_from([0.0, 0.6]),
    st.booleans(),
)
def test_whatever_happens_it_drops_nothing_and_never_moves_towards_a_lost_hand(
    events: list[tuple[str, int, tuple[float, float, float]]],
    take_start: str,
    wait_timeout_s: float,
    pick_up: bool,
) -> None:
    place = (GIVE.start[0], GIVE.start[1] - 0.15, GIVE.start[2])
    rules = SessionOptions(
        take_start=take_start,
        wait_timeout_s=wait_timeout_s,
        pick_up=pick_up,
        pick_up_position=place,
    )
    loop = Loop(rules)
    loop.step(10)
    loop.controller.signal(loop.now_s)
    for what, periods, velocity in events:
        loop.hand_velocity = np.array(velocity) if what == 'moves' else np.zeros(3)
        if what == 'signal':
            loop.controller.signal(loop.now_s)
        elif what in ('start', 'abort', 'reset'):
            getattr(loop.controller, what)()
        elif what == 'back':
            loop.hand = hand_of(TAKE)
        loop.step(periods, seen=what != 'lost')
    check_states(loop.moments)
    check_gripper(loop.moments)
    check_motion(loop.moments)
    check_lost_hand(loop.moments)


@pytest.mark.parametrize('leg', [Leg.GIVE, Leg.TAKE])
def test_the_gripper_waits_while_poses_say_that_the_hand_is_elsewhere(leg: Leg) -> None:
    """Without a force: until the hand is seen where it was, or the jump is believed."""
    loop = Loop()
    loop.step(20)
    loop.controller.signal(loop.now_s)
    if leg is Leg.TAKE:
        loop.until(S.WAITING)
        loop.hand = hand_of(TAKE)
        loop.step(300)
        loop.controller.signal(loop.now_s)
    loop.until(S.EXCHANGE)
    closed = loop.controller.gripper_closed
    assert closed is (leg is Leg.GIVE)
    if closed:
        loop.step(round(loop.options.exchange_hold_s / PERIOD_S) - 3)
    met = loop.hand
    loop.hand = met + (0.3, 0.0, 0.2)
    loop.step(30)
    assert loop.controller.gripper_closed is closed
    loop.hand = met
    loop.step(400)
    assert loop.controller.gripper_closed is not closed


def test_the_diagram_of_the_documents_is_that_of_the_checks() -> None:
    assert documented_states() == STATES_OF_SESSIONS


def test_refuses_what_makes_no_sense() -> None:
    with pytest.raises(DataError, match='take_start'):
        SessionOptions(take_start='sometime')
    with pytest.raises(DataError, match='three numbers'):
        SessionOptions(pick_up_position=(0.0, float('nan'), 0.0))
    assert replace(SessionOptions(), pick_up=True).pick_up
