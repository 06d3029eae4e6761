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

"""What is carried, in the simulated arm: level, handle first, with both hands, as learnt."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

from handover_dmp.common.errors import HandoverError
from handover_dmp.common.settings import defaults
from handover_dmp.handover.lockstep import Handover
from handover_dmp.handover.object_profile import object_names, object_profile
from handover_dmp.handover.scenario import make_scenario
from handover_dmp.handover.session_lockstep import SessionLoop
from handover_dmp.handover.session_scenario import make_session_scenario
from handover_dmp.handover.teaching import learn_from_trials
from handover_dmp.mocap import synthesize, write_trial
from handover_dmp.mocap.synthetic_session import synthesize_sessions
from handover_dmp.robot.descriptions import ArmChoice
import numpy as np
import pytest

UP = np.array([0.0, 0.0, 1.0])
TRIALS = synthesize(0, 2, orientation=True)


def scenario_of(trial, profile, arm='lwr4', base=None):
    with TemporaryDirectory() as folder:
        file = Path(folder) / f'{trial.configuration}_{trial.direction}_{trial.number}.csv'
        write_trial(trial, file)
        return make_scenario(file, arm=ArmChoice(arm), base=base, carried=profile)


def run(scenario):
    handover = Handover(scenario)
    periods = handover.run()
    handover.close()
    return periods


@cache
def carried(name, number=0, arm='lwr4', orientation=True):
    """Run one handover with an object; returns scenario and periods."""
    trial = TRIALS[number]
    if not orientation:
        trial = replace(trial, partner_orientation=None, demonstrator_orientation=None)
    scenario = scenario_of(trial, object_profile(name), arm)
    return scenario, run(scenario)


def tilts(periods) -> np.ndarray:
    """Return by how much what was up at the start is tilted, deg."""
    first = periods[0].wrist_rotation.T @ UP
    up = np.array([period.wrist_rotation @ first for period in periods])[:, 2]
    return np.degrees(np.arccos(np.clip(up, -1.0, 1.0)))


def exchange(periods):
    return next(period for period in periods if period.command.state.value == 'exchange')


def handle(period) -> float:
    """Return the angle between the wrist's z axis and the direction to the hand, deg."""
    way = np.array(period.estimate.position) - period.wrist_position
    cosine = period.wrist_rotation[:, 2] @ way / np.linalg.norm(way)
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def turned(first, second) -> float:
    """Return the angle between two rotations, deg."""
    cosine = (np.trace(first.T @ second) - 1.0) / 2.0
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def test_the_cup_stays_level_and_is_slower_and_gentler() -> None:
    _, periods = carried('cup')
    assert periods[-1].command.state.value == 'done'
    assert tilts(periods).max() < 2.0
    # all of the speed was possible, so its position was feasible
    assert min(period.answer.speed_scale for period in periods) > 0.99
    _, rod = carried('rod', orientation=False)
    assert tilts(rod).max() > 10.0
    assert exchange(periods).time_ns > exchange(rod).time_ns + 0.3e9
    steps = [np.diff([p.command.velocity for p in run], axis=0) for run in (periods, rod)]
    gentle, usual = (float(np.linalg.norm(each, axis=1).max()) / 0.005 for each in steps)
    assert gentle < 0.7 * usual
    assert gentle <= object_profile('cup').acceleration + 1e-6


def test_the_knife_comes_handle_first() -> None:
    _, periods = carried('knife')
    assert periods[-1].command.state.value == 'done'
    assert handle(exchange(periods)) < 10.0
    assert handle(periods[0]) < 45.0


def test_the_box_is_held_out_to_the_middle_of_two_hands() -> None:
    scenario, periods = carried('box', orientation=False)
    rod, _ = carried('rod', orientation=False)
    moved = scenario.model.goal_offset - rod.model.goal_offset
    forward = (rod.model.goal - rod.model.start) * [1.0, 1.0, 0.0]
    forward /= np.linalg.norm(forward)
    np.testing.assert_allclose(moved @ forward, -0.10, atol=1e-9)
    np.testing.assert_allclose(np.cross(forward, moved)[2], -0.20, atol=1e-9)
    met = exchange(periods)
    goal = np.array(met.estimate.position) + scenario.model.goal_offset
    assert np.linalg.norm(met.wrist_position - goal) < 0.02


def test_the_wrist_turns_as_was_learnt_and_is_not_moved_by_it() -> None:
    scenario, periods = carried('rod')
    assert scenario.orientation == 'full'
    met = exchange(periods)
    first = periods[0].wrist_rotation
    learnt = np.linalg.norm(scenario.model.turn.goal)
    assert turned(first, met.wrist_rotation) == pytest.approx(np.degrees(learnt), abs=10.0)
    assert turned(met.wrist_rotation, periods[-1].wrist_rotation) < 10.0
    bare, without = carried('rod', orientation=False)
    assert bare.orientation == 'none'
    np.testing.assert_array_equal(scenario.model.weights, bare.model.weights)
    # the command is the same, and the arm is where it would be without turning
    for here, there in zip(periods, without, strict=False):
        np.testing.assert_allclose(here.command.position, there.command.position, atol=1e-6)
    gaps = [
        max(float(np.linalg.norm(p.wrist_position - q.command.position))
            for q, p in pairwise(run))
        for run in (periods, without)
    ]  # fmt: skip
    assert gaps[0] < gaps[1] + 1e-4


def test_a_rod_changes_nothing() -> None:
    profile = object_profile('rod')
    model = learn_from_trials([TRIALS[0]])
    assert profile.movement_with(model) is model
    assert profile.acceleration == defaults('dmp')['acceleration_limit']
    assert profile.node_parameters(model.with_turn(None)) == {'dmp': {}, 'priority_ik': {}}


def test_what_is_slow_leaves_the_partner_their_own_pace() -> None:
    model = learn_from_trials([TRIALS[0]])
    slow = object_profile('cup').movement_with(model)
    assert slow.duration_s == pytest.approx(1.5 * model.duration_s)
    assert slow.turn is None
    u = np.linspace(0.0, 1.0, len(model.partner_path))
    for column, other in zip(model.partner_path.T, slow.partner_path.T, strict=True):
        # at the same time in s, not in units of τ
        np.testing.assert_allclose(np.interp(u / 1.5, u, other), column, atol=2e-3)


@pytest.mark.parametrize(
    'text, fault',
    [
        ('cup: {orientation: askew}', "orientation is 'askew', not one of"),
        ('cup: {colour: [1, 2]}', 'colour is not three numbers'),
        ('cup: {mass_kg: .nan}', 'mass_kg is nan; it must be from'),
        ('cup: {weight: 3}', "unknown field 'weight'"),
        ('cup: 3', "object 'cup' has no fields"),
        ('[1, 2]', 'must hold one object'),
        ('cup: {shape: [', 'not proper YAML'),
    ],
)
def test_a_faulty_object_is_refused_in_one_line(text, fault, tmp_path) -> None:
    file = tmp_path / 'mine.yaml'
    file.write_text(text)
    with pytest.raises(HandoverError, match=fault) as error:
        object_profile(str(file))
    assert str(error.value).startswith(str(file))
    assert '\n' not in str(error.value)


def test_objects_of_ones_own_are_rods_but_for_what_they_say(tmp_path) -> None:
    file = tmp_path / 'mine.yaml'
    file.write_text('tray: {orientation: upright, mass_kg: 1}')
    tray, rod = object_profile(str(file)), object_profile('rod')
    assert tray == replace(rod, name='tray', orientation='upright', mass_kg=1.0)
    assert object_names()[0] == 'rod'
    with pytest.raises(HandoverError, match='rod, cup, knife, box, or a'):
        object_profile('tray')


@pytest.mark.slow
@pytest.mark.parametrize('arm', ['lwr4', 'iiwa14'])
@pytest.mark.parametrize('number', range(1, len(TRIALS), 2))
def test_cup_and_knife_wherever_and_whoever_gives(number, arm) -> None:
    _, periods = carried('cup', number, arm)
    assert periods[-1].command.state.value == 'done'
    assert tilts(periods).max() < 2.0
    _, periods = carried('knife', number, arm)
    assert handle(exchange(periods)) < 10.0


@pytest.mark.slow
@pytest.mark.parametrize('arm', ['lwr4', 'iiwa14'])
@pytest.mark.parametrize('configuration', ['engine_bay', 'under_car', 'hydraulic_lift'])
@pytest.mark.parametrize('name', ['cup', 'box'])
def test_cup_and_box_stay_level_through_a_session(name, configuration, arm) -> None:
    session = synthesize_sessions(0, 2, configurations=[configuration])[-1]
    scenario = make_session_scenario(
        session, arm=ArmChoice(arm), profile=object_profile(name), pick_up=True
    )
    with SessionLoop(scenario, carried=scenario.carried()) as loop:
        periods = loop.run()
    assert periods[-1].state.value == 'done'
    assert tilts([each.period for each in periods]).max() < 2.0


@pytest.mark.slow
@pytest.mark.parametrize(('farther_m', 'most'), [(0.1, 6.0), (0.2, 12.5)])
def test_a_cup_out_of_reach_tilts_as_little_as_is_told(farther_m, most) -> None:
    """With the arm farther away than it is placed, stretched out or short of the hand."""
    trial, cup = TRIALS[1], object_profile('cup')
    placed = scenario_of(trial, cup)
    way = (placed.model.goal - placed.model.start) * [1.0, 1.0, 0.0]
    place = np.array(placed.robot.base.position) - farther_m * way / np.linalg.norm(way)
    base = replace(placed.robot.base, position=tuple(place.tolist()))
    tilted = [
        tilts(run(scenario_of(trial, profile, base=base))).max()
        for profile in (cup, replace(cup, slows_to=1.0))
    ]
    # in time rather than level, it tilts by twice as much
    assert 2.0 < tilted[0] < most < 0.55 * tilted[1]
