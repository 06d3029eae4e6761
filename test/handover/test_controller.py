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

"""The rules of a handover, on the learnt movement and simulated hands."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan
from typing import Any

from handover_dmp.dmp import DecoupledDmp, relearn
from handover_dmp.handover.controller import (
    HandoverController,
    HandoverOptions,
    HandoverState,
    RETURN_SPEED,
)
from handover_dmp.handover.recordings import example_model
import numpy as np
import pytest

PERIOD_S = 0.005


@pytest.fixture(scope='module')
def model() -> DecoupledDmp:
    return example_model()


class Loop:
    """A controller, a wrist that is where it was told to be, and a hand that moves on a line."""

    def __init__(self, model: DecoupledDmp, **options: object) -> None:
        rules = HandoverOptions(**options)  # type: ignore[arg-type]
        self.controller = HandoverController(model, rules)
        self.hand = np.array(model.goal) - np.array(model.goal_offset)
        self.hand_velocity = np.zeros(3)
        self.now_s = 0.0
        self.controller.set_wrist(tuple(model.start))
        self.positions = [np.array(model.start)]
        self.velocities = [np.zeros(3)]
        self.wrist_follows = True

    def step(self, periods: int = 1, *, seen: bool = True, pose: object = None) -> None:
        for _ in range(periods):
            self.hand = self.hand + self.hand_velocity * PERIOD_S
            if seen:
                shown = tuple(self.hand if pose is None else pose)
                self.controller.set_hand(self.now_s, shown, self.now_s, self.now_s)
            command = self.controller.step(self.now_s, PERIOD_S)
            assert command is not None
            if self.wrist_follows:
                self.controller.set_wrist(command.position)
            self.positions.append(np.array(command.position))
            self.velocities.append(np.array(command.velocity))
            self.now_s += PERIOD_S

    @property
    def largest_acceleration(self) -> float:
        change = np.diff(np.array(self.velocities), axis=0)
        return float(np.linalg.norm(change, axis=1).max() / PERIOD_S)

    @property
    def state(self) -> HandoverState:
        return self.controller.state


def test_hands_over_after_the_signal_and_not_before(model: DecoupledDmp) -> None:
    loop = Loop(model)
    loop.step(40)
    assert loop.state is HandoverState.IDLE
    assert np.allclose(loop.positions, loop.positions[0])
    loop.controller.signal(0.4)
    loop.step(39)
    assert loop.state is HandoverState.IDLE
    loop.step(2)
    assert loop.state is HandoverState.REACHING
    loop.step(round((model.duration_s + 2.0) / PERIOD_S))
    assert loop.state is HandoverState.DONE
    exchange_position = np.array(loop.controller.exchange_position)
    assert (
        np.linalg.norm(exchange_position - model.goal)
        < loop.controller.options.exchange_distance_m
    )


@pytest.mark.parametrize(
    ('start', 'moves', 'expected'),
    [
        ('motion', True, HandoverState.REACHING),
        ('motion', False, HandoverState.IDLE),
        ('service', True, HandoverState.IDLE),
        ('signal', True, HandoverState.IDLE),
    ],
)
def test_starts_by_what_it_is_told_to(
    model: DecoupledDmp, start: str, moves: bool, expected: HandoverState
) -> None:
    loop = Loop(model, start=start)
    loop.step(20)
    loop.hand_velocity = np.array([0.3 if moves else 0.0, 0.0, 0.0])
    loop.step(30)
    assert loop.state is expected


def test_brakes_within_the_acceleration_limit_when_the_hand_is_gone(model: DecoupledDmp) -> None:
    loop = Loop(model)
    loop.step(5)
    loop.controller.start()
    loop.step(round(0.5 * model.duration_s / PERIOD_S))
    speed = np.linalg.norm(loop.velocities[-1])
    assert speed > 0.1
    loop.step(19, seen=False)
    assert np.linalg.norm(loop.velocities[-1]) > 0.0
    loop.step(60, seen=False)
    assert np.linalg.norm(loop.velocities[-1]) == 0.0
    halted = loop.positions[-1]
    loop.step(200, seen=False)
    assert np.array_equal(loop.positions[-1], halted)
    loop.step(round((model.duration_s + 2.0) / PERIOD_S))
    assert loop.state is HandoverState.DONE
    assert loop.largest_acceleration <= loop.controller.options.acceleration_limit * (1 + 1e-9)


def test_a_jump_of_the_hand_is_ignored_then_followed_without_a_jump(model: DecoupledDmp) -> None:
    loop = Loop(model, exchange_hold_s=60.0)
    loop.step(5)
    loop.controller.start()
    loop.step(round(0.9 * model.duration_s / PERIOD_S))
    before = loop.positions[-1]
    loop.step(4, pose=loop.hand + [1.0, 0.0, 0.0])
    assert np.linalg.norm(loop.positions[-1] - before) < 0.05
    loop.hand = loop.hand + np.array([0.0, 0.3, 0.0])
    loop.step(800)
    assert np.linalg.norm(loop.positions[-1] - (loop.hand + model.goal_offset)) < 1e-3
    steps = np.linalg.norm(np.diff(loop.positions, axis=0), axis=1)
    assert loop.largest_acceleration <= loop.controller.options.acceleration_limit * (1 + 1e-9)
    assert steps.max() < 0.02


@pytest.mark.parametrize('bad', [nan, inf, -inf, 1e30])
def test_numbers_that_are_none_never_reach_the_command(model: DecoupledDmp, bad: float) -> None:
    loop = Loop(model)
    loop.step(5)
    loop.controller.start()
    loop.step(50)
    loop.controller.set_wrist((bad, 0.0, 0.0))
    loop.step(100, pose=(bad, 0.0, 0.0))
    assert np.isfinite(loop.positions).all()
    assert np.linalg.norm(loop.velocities[-1]) == 0.0, 'no good pose for 0.5 s: it must stand'


@pytest.mark.parametrize('offset_s', [10.0, -10.0])
def test_stamps_of_another_time_count_as_no_hand(model: DecoupledDmp, offset_s: float) -> None:
    loop = Loop(model)
    loop.step(5)
    loop.controller.start()
    loop.step(50)
    for _ in range(60):
        stamp_s = loop.now_s + offset_s
        assert loop.controller.set_hand(stamp_s, tuple(loop.hand), loop.now_s, loop.now_s)
        loop.step(seen=False)
    assert np.linalg.norm(loop.velocities[-1]) == 0.0
    loop.step(round((model.duration_s + 2.0) / PERIOD_S))
    assert loop.state is HandoverState.DONE


def test_a_command_cannot_run_away_from_an_arm_that_is_held(model: DecoupledDmp) -> None:
    loop = Loop(model)
    loop.wrist_follows = False
    loop.step(5)
    loop.controller.start()
    loop.step(round(2.0 * model.duration_s / PERIOD_S))
    ahead = np.linalg.norm(np.array(loop.positions) - model.start, axis=1)
    limit = loop.controller.options.tracking_error_limit_m
    assert ahead.max() < limit + 0.02
    assert loop.state is HandoverState.REACHING


@pytest.mark.parametrize(
    'changes',
    [
        {'stiffness': 400.0, 'mu': 0.9},
        {'sigma': 0.2},
        {'sigma': 0.01, 'mu': 0.4},
        {'damping': 60.0},
        {'goal_velocity_gain': 0.0},
        {'formulation': 'printed'},
    ],
)
def test_changed_parameters_do_not_jump(model: DecoupledDmp, changes: dict[str, Any]) -> None:
    loop = Loop(model)
    loop.step(5)
    loop.controller.start()
    loop.step(round(0.6 * model.duration_s / PERIOD_S))
    loop.controller.use(relearn(model, **changes), loop.controller.options)
    loop.step(round(1.5 * model.duration_s / PERIOD_S))
    assert loop.largest_acceleration <= loop.controller.options.acceleration_limit * (1 + 1e-9)
    assert loop.state in (HandoverState.EXCHANGE, HandoverState.DONE)


@pytest.mark.parametrize(
    'changes',
    [
        {'acceleration_limit': 5.0},
        {'tracking_error_limit_m': 0.01},
        {'phase_stopping': False},
        {'exchange_distance_m': 0.3},
    ],
)
def test_changed_rules_do_not_jump(model: DecoupledDmp, changes: dict[str, Any]) -> None:
    loop = Loop(model)
    loop.step(5)
    loop.controller.start()
    loop.step(round(0.6 * model.duration_s / PERIOD_S))
    loop.controller.use(model, replace(loop.controller.options, **changes))
    loop.step(round(0.8 * model.duration_s / PERIOD_S))
    assert loop.largest_acceleration <= HandoverOptions().acceleration_limit * (1 + 1e-9)
    steps = np.linalg.norm(np.diff(loop.positions, axis=0), axis=1)
    speeds = np.linalg.norm(loop.velocities[1:], axis=1)
    assert np.all(steps <= PERIOD_S * (speeds + HandoverOptions().acceleration_limit * PERIOD_S))


def test_a_signal_after_a_handover_begins_the_next_once_the_arm_is_back(
    model: DecoupledDmp,
) -> None:
    loop = Loop(model)
    begun_at = np.array(model.start)
    loop.step(5)
    loop.controller.signal(loop.now_s)
    loop.step(round((model.duration_s + 2.0) / PERIOD_S))
    assert loop.state is HandoverState.DONE
    # the hand is somewhere else at once, as where a recording begins again
    loop.hand = loop.hand + np.array([0.3, 0.3, 0.0])
    loop.controller.signal(loop.now_s)
    first = len(loop.positions)
    while loop.state is HandoverState.IDLE:
        assert loop.now_s < 20.0
        loop.step()
    assert loop.state is HandoverState.REACHING
    np.testing.assert_allclose(loop.positions[-1], begun_at, atol=0.003)
    back = np.linalg.norm(loop.velocities[first:-1], axis=1)
    assert 0.25 < back.max() <= RETURN_SPEED + 1e-9
    loop.step(round((model.duration_s + 2.0) / PERIOD_S))
    assert loop.state is HandoverState.DONE
    assert loop.largest_acceleration <= loop.controller.options.acceleration_limit * (1 + 1e-9)


def test_the_arm_goes_back_only_while_the_hand_is_seen(model: DecoupledDmp) -> None:
    loop = Loop(model)
    loop.step(5)
    loop.controller.signal(loop.now_s)
    loop.step(round((model.duration_s + 2.0) / PERIOD_S))
    place = loop.positions[-1]
    loop.controller.signal(loop.now_s)
    loop.step(200, seen=False)
    assert loop.state is HandoverState.IDLE
    np.testing.assert_array_equal(loop.positions[-1], place)
    loop.step(20)
    assert np.linalg.norm(loop.velocities[-1]) > 0.0


def test_abort_brakes_and_only_a_new_start_moves_again(model: DecoupledDmp) -> None:
    loop = Loop(model)
    loop.step(5)
    loop.controller.start()
    loop.step(round(0.5 * model.duration_s / PERIOD_S))
    loop.controller.abort()
    loop.controller.signal(loop.now_s)
    loop.step(200)
    assert loop.state is HandoverState.ABORTED
    assert np.linalg.norm(loop.velocities[-1]) == 0.0
    assert loop.controller.start()
    assert not loop.controller.start()
    loop.step(round((model.duration_s + 2.0) / PERIOD_S))
    assert loop.state is HandoverState.DONE
    assert loop.largest_acceleration <= loop.controller.options.acceleration_limit * (1 + 1e-9)
