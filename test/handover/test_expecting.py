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

"""The controller with the partner model: the approach, lost hands, a slow arm, restarts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import log
from pathlib import Path

from handover_dmp.common.errors import DataError
from handover_dmp.dmp import DecoupledDmp, load_model, save_model
from handover_dmp.handover.controller import (
    HandoverController,
    HandoverOptions,
    HandoverState,
    movement_for,
    WristCommand,
)
from handover_dmp.handover.lockstep import Handover
from handover_dmp.handover.recordings import example_model, example_trials
from handover_dmp.handover.scenario import make_scenario
from handover_dmp.handover.teaching import learn_from_trials, rollout_against
from handover_dmp.tracking import GoalEstimator
from handover_dmp.tracking.partner_model import PartnerOptions
from handover_dmp.tracking.tracker import Tracker
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
Hand = Callable[[float], Array]

PERIOD_S = 0.005
OFF = HandoverOptions(partner_model='off', exchange_hold_s=60.0)
AUTO = HandoverOptions(partner_model='auto', exchange_hold_s=60.0)
NOTHING_EXPECTED = PartnerOptions(mu=0.75, sigma=0.05, following=0.0, trust_within_m=0.0)


@pytest.fixture(scope='module')
def model() -> DecoupledDmp:
    return example_model()


def usual(model: DecoupledDmp) -> Hand:
    path = model.partner_path
    assert path is not None
    nodes = np.linspace(0.0, model.duration_s, len(path))
    return lambda t: np.array([np.interp(t, nodes, column) for column in path.T])


@dataclass
class Loop:
    """A controller and a wrist that is where it was told to be."""

    controller: HandoverController
    now_s: float = 0.0
    commands: list[WristCommand] = field(default_factory=list)

    def run(
        self, hand: Hand | None, duration_s: float, *, rate: float = 1.0, begin: bool = False
    ) -> list[WristCommand]:
        first = len(self.commands)
        for _ in range(round(duration_s / PERIOD_S)):
            if hand is not None:
                place = tuple(hand(self.now_s).tolist())
                self.controller.set_hand(self.now_s, place, self.now_s, self.now_s)
            if begin:
                self.controller.start()
                begin = False
            command = self.controller.step(self.now_s, PERIOD_S, rate)
            assert command is not None
            self.controller.set_wrist(command.position)
            self.commands.append(command)
            self.now_s += PERIOD_S
        return self.commands[first:]

    @property
    def accelerations(self) -> Array:
        velocities = np.array([command.velocity for command in self.commands])
        found: Array = np.linalg.norm(np.diff(velocities, axis=0), axis=1) / PERIOD_S
        return found


def loop_of(model: DecoupledDmp, options: HandoverOptions) -> Loop:
    controller = HandoverController(model, options)
    controller.set_wrist(tuple(model.start.tolist()))
    return Loop(controller)


def time_of(model: DecoupledDmp, command: WristCommand) -> float:
    return -log(command.phase) / model.parameters.alpha


@pytest.mark.parametrize('enabled', [True, False])
def test_without_trust_it_is_the_paper_to_the_last_bit(model: DecoupledDmp, enabled: bool) -> None:
    """With a hand that is lost on the way, and an arm that cannot keep up."""
    found = []
    for options in (OFF, replace(AUTO, partner=NOTHING_EXPECTED)):
        rules = replace(options, approach=replace(options.approach, enabled=enabled))
        loop, hand = loop_of(model, rules), usual(model)
        loop.run(hand, 0.4, begin=True)
        loop.run(hand, 0.2, rate=0.4)
        loop.run(None, 0.3)
        loop.run(hand, 1.5)
        found.append([(c.position, c.velocity, c.phase, c.goal_weight) for c in loop.commands])
    assert found[0] == found[1]


def test_an_old_model_runs_as_before(model: DecoupledDmp) -> None:
    old, hand = model.with_partner_path(None), usual(model)
    loops = [loop_of(old, AUTO), loop_of(model, OFF)]
    for loop in loops:
        loop.run(hand, 1.5, begin=True)
    assert loops[0].commands == loops[1].commands
    assert loops[0].commands[-1].expectation is None
    assert loops[0].controller.model is old


def test_the_status_carries_trust_lead_and_rate(model: DecoupledDmp) -> None:
    loop, hand = loop_of(model, AUTO), usual(model)
    before = loop.run(hand, 0.05)[-1].status_values(0.0)
    assert (before['trust'], before['lead'], before['phase_rate']) == (0.0, 0.0, 0.0)
    ahead = loop.run(lambda t: hand(1.3 * (t - 0.05)), 0.6, begin=True)[-1].status_values(0.0)
    assert ahead['trust'] == 1.0
    assert ahead['lead'] > 0.05
    assert 1.0 < ahead['phase_rate'] <= 1.5
    plain = loop_of(model, OFF)
    values = plain.run(hand, 0.2, rate=0.7, begin=True)[-1].status_values(0.0)
    assert (values['trust'], values['phase_rate']) == (0.0, 0.7)


@pytest.mark.parametrize('options', [AUTO, OFF])
def test_hands_over_as_it_was_learnt(model: DecoupledDmp, options: HandoverOptions) -> None:
    loop = loop_of(model, replace(options, exchange_hold_s=0.3))
    loop.run(usual(model), model.duration_s + 1.0, begin=True)
    assert loop.controller.state is HandoverState.DONE


def test_a_lost_hand_stops_the_phase_and_it_goes_on_without_a_rush(model: DecoupledDmp) -> None:
    loop, hand = loop_of(model, AUTO), usual(model)
    loop.run(hand, 0.5, begin=True)
    lost = loop.run(None, 0.6)
    first = round(0.1 / PERIOD_S) + 1
    braking = lost[first:]
    assert len({command.phase for command in braking}) == 1
    assert {command.phase_rate for command in braking} == {0.0}
    assert {command.expectation for command in braking} == {None}
    again = loop.run(hand, 0.3)
    # the hand went on unseen, so it is no more ahead of its time than before
    assert max(command.phase_rate for command in again) <= 1.1
    assert max(abs(command.expectation.lead) for command in again if command.expectation) < 0.05
    loop.run(hand, 1.5)
    assert loop.controller.state is HandoverState.EXCHANGE
    assert loop.accelerations.max() <= AUTO.acceleration_limit * (1 + 1e-9)


@pytest.mark.parametrize('names', [['left'], ['left', 'right']])
def test_expects_the_same_of_a_hand_that_several_trackers_see(
    model: DecoupledDmp, names: list[str]
) -> None:
    """With noise, each at half the rate, against one that sees it truly."""
    random, hand = np.random.default_rng(3), usual(model)
    estimator = GoalEstimator(trackers=[Tracker(name=name) for name in names])
    loop = loop_of(model, AUTO)
    loop.run(hand, 0.8, begin=True)
    controller = HandoverController(model, AUTO, estimator)
    controller.set_wrist(tuple(model.start.tolist()))
    for k in range(round(0.8 / PERIOD_S)):
        now_s = k * PERIOD_S
        place = hand(now_s) + 5e-4 * random.normal(size=3)
        name = names[k % len(names)]
        controller.set_hand(now_s, tuple(place.tolist()), now_s, now_s, tracker=name)
        if k == 0:
            controller.start()
        command = controller.step(now_s, PERIOD_S)
        assert command is not None
        controller.set_wrist(command.position)
    true = loop.commands[-1]
    assert command.expectation is not None and true.expectation is not None
    assert command.expectation.trust == 1.0
    assert np.allclose(command.expectation.goal, true.expectation.goal, atol=0.01)
    assert np.allclose(command.position, true.position, atol=0.01)


def test_a_hand_that_comes_late_into_view_begins_there(model: DecoupledDmp) -> None:
    loop, hand = loop_of(model, AUTO), usual(model)
    loop.run(None, 1.0, begin=True)
    seen = loop.run(lambda t: hand(t - 1.0), 0.7)
    assert all(abs(c.expectation.lead) < 0.01 for c in seen if c.expectation is not None)
    assert seen[-1].phase_rate == pytest.approx(1.0, abs=0.05)


def test_a_new_start_knows_nothing_of_the_last_hand(model: DecoupledDmp) -> None:
    loop, hand = loop_of(model, AUTO), usual(model)
    loop.run(lambda t: hand(1.5 * t), 0.7, begin=True)
    assert loop.commands[-1].expectation is not None
    assert loop.commands[-1].expectation.lead > 0.1
    loop.controller.abort()
    loop.run(hand, 0.5)
    begun_s = loop.now_s
    first = loop.run(lambda t: hand(t - begun_s), 0.3, begin=True)[0]
    assert first.expectation is not None
    assert first.expectation.lead == 0.0
    assert first.phase_rate == 1.0


def test_a_slow_arm_slows_the_phase_and_is_not_made_good(model: DecoupledDmp) -> None:
    loop, hand = loop_of(model, AUTO), usual(model)
    half = loop.run(hand, 0.6, rate=0.5, begin=True)[-1]
    assert time_of(model, half) == pytest.approx(0.3 / model.duration_s, rel=0.05)
    whole = loop.run(hand, 0.3)[-1]
    assert time_of(model, whole) == pytest.approx(0.6 / model.duration_s, rel=0.05)


def test_a_jump_of_the_hand_stays_within_the_acceleration_limit(model: DecoupledDmp) -> None:
    loop, hand = loop_of(model, AUTO), usual(model)
    loop.run(hand, 0.9 * model.duration_s, begin=True)
    jumped = np.array([0.0, 0.3, 0.0])
    loop.run(lambda t: hand(t) + jumped, 2.5)
    assert loop.accelerations.max() <= AUTO.acceleration_limit * (1 + 1e-9)
    gap = np.array(loop.commands[-1].position) - hand(9.0) - jumped - model.goal_offset
    assert np.linalg.norm(gap) < 0.005


@pytest.mark.parametrize('share', [0.2, 0.4, 0.7, 1.0])
@pytest.mark.parametrize('speed', [-0.5, 0.0, 0.5])
def test_the_wrist_does_not_pass_a_hand_that_is_nearer(
    model: DecoupledDmp, share: float, speed: float
) -> None:
    """By the real hand, wherever it was expected, along the line to it."""
    loop = loop_of(model, AUTO)
    start = model.start
    line = (model.goal - start) / np.linalg.norm(model.goal - start)
    first = start + share * (model.goal - start) - model.goal_offset

    def hand(time_s: float) -> Array:
        return np.asarray(first + speed * min(time_s, 0.4) * line)

    beyond = []
    loop.run(hand, 0.005, begin=True)
    for _ in range(500):
        command = loop.run(hand, PERIOD_S)[0]
        goal = hand(loop.now_s) + model.goal_offset
        whole = np.linalg.norm(goal - start)
        if whole > 0.1:
            direction = (goal - start) / whole
            beyond.append((np.array(command.position) - start) @ direction - whole)
    assert max(beyond) <= 0.02
    assert loop.accelerations.max() <= AUTO.acceleration_limit * (1 + 1e-9)


def test_it_may_be_switched_off_and_on_in_motion(model: DecoupledDmp) -> None:
    loop, hand = loop_of(model, AUTO), usual(model)
    loop.run(hand, 0.5, begin=True)
    loop.controller.use(model, OFF)
    assert loop.run(hand, 0.2)[-1].expectation is None
    loop.controller.use(model, AUTO)
    assert loop.run(hand, 1.3)[-1].expectation is None
    assert loop.controller.state is HandoverState.EXCHANGE
    assert loop.accelerations.max() <= AUTO.acceleration_limit * (1 + 1e-9)
    loop.controller.abort()
    loop.run(hand, 0.3)
    assert loop.run(hand, 0.1, begin=True)[-1].expectation is not None


def test_the_movement_has_the_goal_weight_of_the_model(model: DecoupledDmp) -> None:
    assert movement_for(model, OFF) is model
    parameters = movement_for(model, AUTO, stiffness=300.0).parameters
    options = PartnerOptions()
    assert (parameters.stiffness, parameters.mu, parameters.sigma) == (
        300.0,
        options.mu,
        options.sigma,
    )


def test_another_word_is_refused() -> None:
    with pytest.raises(DataError, match='partner_model'):
        HandoverOptions(partner_model='on')


@pytest.mark.parametrize('jointly', [False, True])
def test_learns_the_path_from_one_trial_and_from_several(jointly: bool, tmp_path: Path) -> None:
    first, second = example_trials()
    one = learn_from_trials([first])
    assert one.partner_path.shape == (101, 3)
    assert np.allclose(one.partner_path[[0, -1]], first.partner[[0, -1]], atol=0.01)
    both = learn_from_trials([first, second], jointly=jointly)
    other = learn_from_trials([second])
    mean = 0.5 * (one.partner_path + other.partner_path)
    assert np.allclose(both.partner_path, mean, atol=1e-9)
    save_model(both, tmp_path / 'model.json')
    assert np.array_equal(load_model(tmp_path / 'model.json').partner_path, both.partner_path)


def test_a_rollout_with_it_is_another_and_without_it_the_same(model: DecoupledDmp) -> None:
    trial = example_trials()[1]
    plain = rollout_against(model, trial)
    assert np.array_equal(
        rollout_against(model.with_partner_path(None), trial, partner=PartnerOptions()).positions,
        plain.positions,
    )
    expecting = rollout_against(model, trial, partner=PartnerOptions())
    assert np.array_equal(expecting.times, plain.times)
    assert 0.005 < np.abs(expecting.positions - plain.positions).max() < 0.3


def test_a_simulated_handover_with_and_without() -> None:
    weights = {}
    for word in ('auto', 'off'):
        handover = Handover(make_scenario(partner_model=word))
        try:
            periods = handover.run()
        finally:
            handover.close()
        assert periods[-1].command.state is HandoverState.DONE
        known = [p.command.expectation is not None for p in periods]
        assert any(known) == (word == 'auto')
        weights[word] = handover.controller.model.parameters.sigma
    assert weights == {'auto': PartnerOptions().sigma, 'off': 0.05}
