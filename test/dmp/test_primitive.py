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

"""Stepping, rolling out and batches, of both primitives, against DOP853 and each other."""

from __future__ import annotations

from handover_dmp.common.errors import DataError
from handover_dmp.dmp import ClassicalDmp, DecoupledDmp, DmpParameters, learn
from handover_dmp.dmp.reference_step import reference_step
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.linalg import expm

LIMIT = 2e-5  # m, on every motion here: 0.02 mm
AGREE = 1e-9  # m

START = np.array([0.15, 0.25, 0.35])
VELOCITY = np.array([0.1, 0.0, 0.2])
GOAL = np.array([0.6, 0.1, 0.5])

PROPERTY = settings(max_examples=25, deadline=None)


def still(t):
    return GOAL


def resting(t):
    return np.zeros(3)


def strolling(t):
    return GOAL + np.array([0.2, -0.1, 0.05]) * t


def strolling_velocity(t):
    return np.array([0.2, -0.1, 0.05])


def wandering(t):
    return GOAL + np.array([0.1, -0.05, 0.08]) * np.sin(2 * t) + np.array([0.2, 0.1, 0.0]) * t


def wandering_velocity(t):
    return np.array([0.1, -0.05, 0.08]) * 2 * np.cos(2 * t) + np.array([0.2, 0.1, 0.0])


GOALS = {
    'static': (still, resting),
    'constant velocity': (strolling, strolling_velocity),
    'accelerating': (wandering, wandering_velocity),
}
KINDS = {
    'stiff': (DecoupledDmp, {'formulation': 'stiff'}),
    'printed': (DecoupledDmp, {'formulation': 'printed'}),
    'overdamped, early, narrow': (DecoupledDmp, {'damping': 60.0, 'mu': 0.4, 'sigma': 0.02}),
    'swinging, late, wide': (
        DecoupledDmp,
        {'damping': 8.0, 'mu': 1.0, 'sigma': 0.2, 'goal_velocity_gain': 10.0},
    ),
    'printed, swinging': (DecoupledDmp, {'damping': 8.0, 'formulation': 'printed'}),
    'classical': (ClassicalDmp, {}),
}


def stepped(model, times, goals, velocities, start, velocity, phase_rate=1.0):
    state = model.initial_state(start, velocity)
    states = [state]
    for k in range(len(times) - 1):
        dt = times[k + 1] - times[k]
        state = model.step(state, tuple(goals[k]), tuple(velocities[k]), dt, phase_rate)
        states.append(state)
    return (
        np.array([state.position for state in states]),
        np.array([state.velocity for state in states]),
        states,
    )


def chords(times, goals):
    return (
        np.diff(goals, axis=0, append=goals[-1:]) / np.diff(times, append=times[-1] + 1)[:, None]
    )


@pytest.fixture(scope='module', params=KINDS)
def model(request, reach):
    kind, changes = KINDS[request.param]
    return learn(*reach, DmpParameters(**changes), regression='ridge', basis=50, primitive=kind)


@pytest.mark.parametrize('goal', GOALS)
def test_rollout_is_the_solution_of_the_equations(model, exact, goal):
    times = np.arange(0.0, 2.5, 0.005)
    place, rate = GOALS[goal]
    positions, velocities = exact(model, times, place, rate, START, VELOCITY)
    rollout = model.rollout(
        times, np.array([place(t) for t in times]), start=START, velocity=VELOCITY
    )
    assert np.abs(rollout.positions - positions).max() < LIMIT
    assert np.abs(rollout.velocities - velocities).max() < 1e-3


def test_times_may_be_as_uneven_as_they_like(model, exact):
    """To a goal that keeps its velocity the step is as good from 1 ms to 0.3 s."""
    rng = np.random.default_rng(3)
    times = np.cumsum(np.concatenate([[0.0], rng.choice([0.001, 0.004, 0.03, 0.3], 40)]))
    positions, _ = exact(model, times, strolling, strolling_velocity, START, VELOCITY)
    goals = np.array([strolling(t) for t in times])
    rollout = model.rollout(times, goals, start=START, velocity=VELOCITY)
    assert np.abs(rollout.positions - positions).max() < LIMIT


@pytest.mark.parametrize('even', [True, False])
def test_step_rollout_and_batch_agree(model, even):
    rng = np.random.default_rng(4)
    steps = np.full(200, 0.008) if even else rng.uniform(0.0005, 0.06, 200)
    times = 7.0 + np.cumsum(steps)
    goals = GOAL + 0.1 * rng.standard_normal((5, 200, 3))
    rates = rng.standard_normal((5, 200, 3))
    starts = START + 0.1 * rng.standard_normal((5, 3))
    positions, velocities = model.rollout_batch(times, goals, rates, starts)
    assert positions.shape == velocities.shape == (5, 200, 3)
    for each in range(5):
        rollout = model.rollout(times, goals[each], rates[each], start=starts[each])
        one, moving, states = stepped(
            model, times, goals[each].tolist(), rates[each].tolist(), starts[each], None
        )
        assert np.abs(rollout.positions - one).max() < AGREE
        assert np.abs(rollout.velocities - moving).max() < AGREE
        assert np.abs(rollout.positions - positions[each]).max() < AGREE
        assert np.abs(rollout.velocities - velocities[each]).max() < AGREE
        assert rollout.phase == pytest.approx([state.phase for state in states], rel=1e-9)
        weights = [model.goal_weight(state.phase) for state in states]
        assert rollout.goal_weight == pytest.approx(weights, abs=1e-12)


def test_goals_move_straight_from_sample_to_sample_unless_told_otherwise(model):
    times = np.linspace(0.0, 1.6, 161)
    goals = np.array([wandering(t) for t in times])
    left_out = model.rollout(times, goals)
    given_ones = model.rollout(times, goals, chords(times, goals))
    assert np.array_equal(left_out.positions, given_ones.positions)
    batch, _ = model.rollout_batch(times, goals[None])
    assert np.abs(batch[0] - left_out.positions).max() < AGREE


@pytest.mark.sample(5)
@pytest.mark.parametrize('phase_rate', [0.0, 0.3, 0.97, 1.8])
def test_a_slowed_phase_is_the_solution_too(model, exact, phase_rate):
    times = np.arange(0.0, 2.0, 0.01)
    positions, velocities = exact(
        model, times, strolling, strolling_velocity, START, VELOCITY, phase_rate
    )
    goals = np.array([strolling(t) for t in times])
    rates = np.array([strolling_velocity(t) for t in times])
    one, moving, states = stepped(
        model, times, goals.tolist(), rates.tolist(), START, VELOCITY, phase_rate
    )
    assert np.abs(one - positions).max() < LIMIT
    assert np.abs(moving - velocities).max() < 1e-3
    alpha = model.parameters.alpha
    assert states[-1].phase == pytest.approx(np.exp(-alpha * phase_rate * 1.99 / 1.5))


def test_one_long_step_equals_many_short_ones(model):
    state = model.initial_state(START, VELOCITY)
    goal, rate = tuple(GOAL), (0.2, -0.1, 0.05)
    for dt in (0.003, 0.1, 0.9, 40.0):
        whole = model.step(state, goal, rate, dt)
        parts = state
        for k in range(500):
            moved = tuple(g + k * dt / 500 * v for g, v in zip(goal, rate, strict=True))
            parts = model.step(parts, moved, rate, dt / 500)
        assert whole.position == pytest.approx(parts.position, abs=LIMIT / 4)
        assert whole.phase == pytest.approx(parts.phase, rel=1e-6)


@PROPERTY
@given(
    st.floats(1e-4, 0.005),  # not divided
    st.floats(0.0, 1.5),
    st.integers(0, 120),
    st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3),
)
def test_the_fast_step_is_the_reference_step(learnt, dt, rate, before, velocity):
    state = learnt.initial_state(START, VELOCITY)
    for _ in range(before):
        state = learnt.step(state, tuple(GOAL), tuple(velocity), 0.01)
    fast = learnt.step(state, tuple(GOAL), tuple(velocity), dt, rate)
    h = dt / learnt.duration_s
    slow = reference_step(learnt, state, tuple(GOAL), tuple(velocity), h, rate)
    for one, other in zip(fast, slow, strict=True):
        assert np.allclose(one, other, rtol=1e-12, atol=1e-14)


def test_a_step_of_no_length_changes_nothing(model):
    state = model.step(model.initial_state(START, VELOCITY), tuple(GOAL), (0.0,) * 3, 0.3)
    after = model.step(state, tuple(GOAL), (1.0,) * 3, 0.0)
    assert after.position == pytest.approx(state.position, abs=1e-12)
    assert after.velocity == pytest.approx(state.velocity, abs=1e-12)
    assert after.phase == state.phase


def test_a_state_set_to_what_was_measured_goes_on_from_there(reach):
    """The system is linear: what a push changes decays as y'' + (D/τ)y' + (K/τ²)y = 0 does."""
    model = learn(*reach, regression='ridge', basis=50)
    goal, rate, dt = tuple(GOAL), (0.0, 0.0, 0.0), 0.04
    free = model.step(model.initial_state(START), goal, rate, 0.6)
    pushed = free._replace(position=(0.3, 0.3, 0.3), velocity=(0.0, 0.5, 0.0))
    tau, parameters = model.duration_s, model.parameters
    matrix = np.array(
        [[0.0, 1.0], [-parameters.stiffness / tau**2, -parameters.effective_damping / tau]]
    )
    push = np.array([np.subtract(pushed[k], free[k]) for k in (0, 1)])
    for steps in range(1, 6):
        free, pushed = (model.step(state, goal, rate, dt) for state in (free, pushed))
        left = np.array([np.subtract(pushed[k], free[k]) for k in (0, 1)])
        assert np.abs(left - expm(matrix * steps * dt) @ push).max() < AGREE


def test_another_duration_on_the_way_jumps_neither_position_nor_velocity(model):
    state = model.initial_state(START, VELOCITY)
    for _ in range(100):
        state = model.step(state, tuple(GOAL), (0.0,) * 3, 0.005)
    slower = model.with_duration(2.0 * model.duration_s)
    for dt in (1e-3, 1e-4, 1e-5):
        after = slower.step(state, tuple(GOAL), (0.0,) * 3, dt)
        moved = np.abs(np.subtract(after.position, state.position)).max()
        changed = np.abs(np.subtract(after.velocity, state.velocity)).max()
        assert moved < 2.0 * dt
        assert changed < 100.0 * dt
    assert slower.goal_weight(state.phase) == pytest.approx(model.goal_weight(state.phase))


def test_a_large_batch_is_the_same_as_one_by_one(model):
    """It is shared out to threads; none mixes up its motions, and none is left out."""
    rng = np.random.default_rng(0)
    times = np.linspace(0.0, 1.6, 102)
    rates = 0.2 * rng.normal(size=(1030, 1, 3)) + np.zeros((1, 102, 1))
    goals = GOAL + 0.1 * rng.normal(size=(1030, 1, 3)) + rates * times[:, None]
    starts = 0.1 * rng.normal(size=(1030, 3))
    positions, velocities = model.rollout_batch(times, goals, rates, starts)
    implied = model.rollout_batch(times, goals, starts=starts)
    np.testing.assert_allclose(implied, (positions, velocities), rtol=0.0, atol=1e-9)
    for each in range(0, 1030, 7):
        single = model.rollout(times, goals[each], rates[each], start=starts[each])
        assert positions[each] == pytest.approx(single.positions, abs=1e-9)
        assert velocities[each] == pytest.approx(single.velocities, abs=1e-9)


coordinate = st.floats(-5.0, 5.0)
point = st.tuples(coordinate, coordinate, coordinate)
TIMES = np.arange(0.0, 1.8, 0.01)


@pytest.fixture(scope='module', params=['stiff', 'printed', 'classical'])
def learnt(request, reach):
    kind, changes = KINDS[request.param]
    return learn(*reach, DmpParameters(**changes), regression='ridge', basis=50, primitive=kind)


@PROPERTY
@given(goal=point, start=point, velocity=point)
def test_it_converges_to_any_static_goal(learnt, goal, start, velocity):
    times = np.linspace(0.0, 6.0, 301)
    rollout = learnt.rollout(times, np.array(goal), start=start, velocity=velocity)
    assert rollout.positions[-1] == pytest.approx(goal, abs=1e-4)
    assert np.abs(rollout.velocities[-1]).max() < 1e-3


@PROPERTY
@given(goal=point, start=point, rate=st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_it_does_not_lag_behind_a_goal_of_constant_velocity(learnt, goal, start, rate):
    if isinstance(learnt, ClassicalDmp):
        pytest.skip('the classical primitive lags, which is why there is another')
    times = np.linspace(0.0, 6.0, 601)
    goals = np.array(goal) + np.outer(times, rate)
    rollout = learnt.rollout(times, goals, start=start)
    assert np.abs(rollout.positions[-1] - goals[-1]).max() < 1e-6


def test_the_classical_one_lags_as_the_equations_say(reach):
    classical = learn(*reach, regression='ridge', primitive=ClassicalDmp)
    times = np.linspace(0.0, 6.0, 601)
    goals = GOAL + np.outer(times, [0.2, 0.0, 0.0])
    rollout = classical.rollout(times, goals)
    parameters = classical.parameters
    lag = parameters.effective_damping * classical.duration_s * 0.2 / parameters.stiffness
    assert goals[-1, 0] - rollout.positions[-1, 0] == pytest.approx(lag, rel=1e-3)
    assert lag > 0.04


@PROPERTY
@given(shift=point, turn=st.tuples(*[st.floats(-3.0, 3.0)] * 3))
def test_moving_and_turning_the_scene_moves_and_turns_the_motion(learnt, shift, turn):
    """Rows of weights are vectors of the scene, so they turn with it."""
    from scipy.spatial.transform import Rotation

    matrix = Rotation.from_rotvec(turn).as_matrix()
    goals = np.array([wandering(t) for t in TIMES])
    plain = learnt.rollout(TIMES, goals, start=START, velocity=VELOCITY)
    turned = learnt.with_weights(learnt.weights @ matrix.T).rollout(
        TIMES,
        goals @ matrix.T + shift,
        start=matrix @ START + shift,
        velocity=matrix @ VELOCITY,
    )
    assert np.abs(turned.positions - (plain.positions @ matrix.T + shift)).max() < AGREE
    assert np.abs(turned.velocities - plain.velocities @ matrix.T).max() < AGREE


@PROPERTY
@given(factor=st.floats(0.2, 5.0))
def test_another_duration_scales_time_alone(learnt, factor):
    goals = np.array([wandering(t) for t in TIMES])
    plain = learnt.rollout(TIMES, goals, start=START, velocity=VELOCITY)
    if learnt.parameters.goal_velocity_gain >= 0.0:
        pytest.fail('the gain is a time and would have to be scaled as well')
    scaled = learnt.with_duration(learnt.duration_s * factor).rollout(
        TIMES * factor, goals, start=START, velocity=VELOCITY / factor
    )
    assert np.abs(scaled.positions - plain.positions).max() < AGREE
    assert np.abs(scaled.velocities * factor - plain.velocities).max() < 10 * AGREE


large = st.floats(-1e9, 1e9)


@PROPERTY
@given(
    position=st.tuples(large, large, large),
    velocity=st.tuples(large, large, large),
    goal=st.tuples(large, large, large),
    rate=st.tuples(large, large, large),
    dt=st.floats(0.0, 1e6),
    phase_rate=st.floats(0.0, 1e3),
    phase=st.floats(0.0, 1.0, exclude_min=True),
)
def test_it_is_finite_for_every_finite_input(
    learnt, position, velocity, goal, rate, dt, phase_rate, phase
):
    state = learnt.initial_state(position, velocity)._replace(phase=phase)
    for _ in range(3):
        state = learnt.step(state, goal, rate, dt, phase_rate)
    assert np.isfinite(state.position).all()
    assert np.isfinite(state.velocity).all()
    assert 0.0 < state.phase <= 1.0
    assert 0.0 <= learnt.goal_weight(state.phase) <= 1.0


@pytest.mark.parametrize('dimensions', [1, 2, 7])
def test_any_number_of_dimensions(dimensions, exact):
    times = np.linspace(0.0, 1.0, 201)
    path = np.sin(np.outer(times, np.arange(1, dimensions + 1)))
    model = learn(times, path, regression='ridge', basis=40)
    goal = path[-1] + 0.1
    truth, _ = exact(
        model, times, lambda t: goal, lambda t: 0 * goal, path[0], np.zeros(dimensions)
    )
    rollout = model.rollout(times, goal, start=path[0])
    assert np.abs(rollout.positions - truth).max() < LIMIT
    rates = np.zeros((201, dimensions)).tolist()
    one, _, _ = stepped(model, times, [tuple(goal)] * 201, rates, path[0], None)
    assert np.abs(one - rollout.positions).max() < AGREE


def test_a_single_sample_is_the_start(learnt):
    rollout = learnt.rollout([3.0], GOAL, start=START)
    assert rollout.positions == pytest.approx(START[None])
    positions, _ = learnt.rollout_batch([3.0], GOAL[None, None], starts=START[None])
    assert positions[0] == pytest.approx(START[None])


@pytest.mark.parametrize(
    ('arguments', 'fault'),
    [
        (([0.0, 1.0], np.zeros((3, 3))), 'goals'),
        (([0.0, 0.0], GOAL), 'times'),
        (([0.0, np.nan], GOAL), 'times'),
        (([0.0, 1.0], GOAL, np.zeros((5, 3))), 'velocities'),
    ],
)
def test_rollout_refuses_what_does_not_fit(learnt, arguments, fault):
    with pytest.raises(DataError, match=fault):
        learnt.rollout(*arguments)


@pytest.mark.parametrize(('dt', 'rate'), [(-0.1, 1.0), (np.nan, 1.0), (0.1, -1.0), (np.inf, 1.0)])
def test_step_refuses_to_go_back(learnt, dt, rate):
    with pytest.raises(DataError, match='step'):
        learnt.step(learnt.initial_state(), tuple(GOAL), (0.0,) * 3, dt, rate)


@pytest.mark.parametrize(
    'change', [{'duration_s': 0.0}, {'duration_s': np.inf}, {'weights': np.zeros((3, 3))}]
)
def test_a_model_that_does_not_fit_together_is_refused(learnt, change):
    from dataclasses import replace

    with pytest.raises(DataError):
        replace(learnt, **change)
