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

"""A tracker that fails in mid-motion: what the arm does, in lockstep with the simulated arm."""

from __future__ import annotations

from collections.abc import Iterator

from handover_dmp.bench.faults import FaultyHand, InvariantChecker, tracker_faults
from handover_dmp.handover.controller import HandoverState
from handover_dmp.handover.lockstep import Handover, Period
from handover_dmp.handover.scenario import make_scenario, Scenario
from handover_dmp.robot.descriptions import ArmChoice
import numpy as np
import pytest

FROM_S, UNTIL_S = 1.0, 1.6
HAND_TIMEOUT_S = 0.1
# the wrist at human speed, braked at its acceleration limit, then the arm behind it
BRAKING_S = 0.25

GOES_ON = ('frozen', 'out of order', 'duplicated', '30 % dropped')
BRAKES = (
    'stopped',
    'zeros',
    'quaternion of norm 0',
    'jumped by 1 m',
    'not a number',
    'infinite',
    'stamps from the future',
    'stamps from the past',
)


@pytest.fixture(scope='module')
def scenario() -> Scenario:
    return make_scenario()


@pytest.fixture
def handover(scenario: Scenario) -> Iterator[Handover]:
    run = Handover(scenario)
    yield run
    run.close()


def go(handover: Handover, until_s: float) -> list[Period]:
    """Run to a time and hold every period against the invariants."""
    checker = InvariantChecker(
        handover.scenario.robot.limits,
        handover.period_s,
        handover.controller.options.acceleration_limit,
    )
    periods = []
    while handover.time_s < until_s:
        periods.append(handover.step())
        assert checker.check(periods[-1]) == []
    return periods


def speeds(periods: list[Period]) -> np.ndarray:
    return np.array([np.abs(period.joint_velocities).max() for period in periods])


@pytest.mark.parametrize('name', sorted(tracker_faults(0)))
def test_no_fault_of_the_tracker_breaks_an_invariant(handover: Handover, name: str) -> None:
    handover.hands[0] = FaultyHand(handover.hands[0], tracker_faults(1)[name], FROM_S, UNTIL_S)
    handover.begin()
    periods = go(handover, 6.0)
    assert handover.controller.state is HandoverState.DONE
    at = {round(period.time_ns * 1e-9, 3): i for i, period in enumerate(periods)}
    speed = speeds(periods)
    assert speed[at[FROM_S]] > 0.2, 'the fault must come in mid-motion'
    if name in BRAKES:
        still = speed[at[round(FROM_S + HAND_TIMEOUT_S + BRAKING_S, 3)]: at[UNTIL_S]]  # fmt: skip
        assert still.max() < 0.01
    if name in GOES_ON:
        assert speed[at[FROM_S]: at[FROM_S + 0.2]].min() > 0.05  # fmt: skip


def test_a_jump_is_not_followed_at_once(handover: Handover) -> None:
    jump = tracker_faults(0)['jumped by 1 m']
    handover.hands[0] = FaultyHand(handover.hands[0], jump, 1.7, 1.75)
    handover.begin()
    periods = go(handover, 5.0)
    way = np.array([period.wrist_position for period in periods])
    goal = way[-1]
    assert handover.controller.state is HandoverState.DONE
    assert np.linalg.norm(way[340:] - goal, axis=1).max() < 0.15


def check_calm_stop(handover: Handover, where: str) -> None:
    """Show the hand where it cannot be served, and hold the stop of the arm against the rules."""
    base = np.array(handover.scenario.robot.base.position)
    hand_now = handover.scenario.trial.partner[0]
    outward = (hand_now - base) / np.linalg.norm(hand_now - base)
    goal = {
        'out of reach': base + 2.5 * outward,
        'behind the base': base - 0.5 * outward * [1, 1, 0],
        'under the floor': base + 0.3 * outward + [0, 0, -1.5],
        'inside': base + [0.0, 0.0, 0.2],
    }[where]
    offset = np.array(handover.scenario.model.goal_offset)
    handover.hands[0] = FaultyHand(
        handover.hands[0],
        lambda samples: [s._replace(position=goal - offset) for s in samples],
        -1.0,
        1e9,
    )
    handover.begin()
    late = go(handover, 7.0)[800:]
    assert speeds(late).max() < 0.02, 'it must come to rest, in 4 s'
    accelerations = np.diff([p.joint_velocities for p in late], axis=0) / 0.005
    assert np.abs(accelerations).max() < 0.5, 'and not shake'


@pytest.mark.parametrize('where', ['out of reach', 'behind the base', 'under the floor', 'inside'])
def test_a_hand_where_no_hand_can_be_served_gives_a_calm_stop(
    handover: Handover, where: str
) -> None:
    check_calm_stop(handover, where)


@pytest.mark.sample(2)
@pytest.mark.parametrize('robot', ['panda', 'iiwa14'])
def test_so_do_other_arms_at_a_limit_and_a_singularity(robot: str) -> None:
    run = Handover(make_scenario(arm=ArmChoice(robot)))
    try:
        check_calm_stop(run, 'under the floor')
    finally:
        run.close()


def test_time_that_stands_still_or_jumps_moves_nothing_suddenly(handover: Handover) -> None:
    handover.begin()
    go(handover, 1.2)
    before = handover.controller.step(handover.time_s, 0.0)
    paused = [handover.controller.step(handover.time_s, 0.0) for _ in range(50)]
    assert before is not None
    assert all(c is not None and c.position == before.position for c in paused)
    for jumped_s in (handover.time_s + 100.0, 0.3):
        handover.controller.forget_hand()
        command = handover.controller.step(jumped_s, 0.005)
        assert command is not None
        assert np.linalg.norm(np.subtract(command.position, before.position)) < 0.01
        before = command


@pytest.mark.parametrize('count', [8, pytest.param(500, marks=pytest.mark.slow)])
def test_many_in_a_row_are_the_same_and_the_memory_does_not_grow(
    scenario: Scenario, count: int
) -> None:
    import gc

    import psutil

    process = psutil.Process()

    def once() -> np.ndarray:
        run = Handover(scenario)
        periods = run.run()
        run.close()
        assert periods[-1].command.state is HandoverState.DONE
        return np.array([period.joint_positions for period in periods])

    first = once()
    for _ in range(4):
        assert np.array_equal(once(), first)
    gc.collect()
    before = process.memory_info().rss
    for _ in range(count - 5):
        assert np.array_equal(once(), first)
    gc.collect()
    grown = process.memory_info().rss / before
    print(f'{count} handovers, memory times {grown:.4f}')
    assert grown < 1.05
