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

"""The primitive of an orientation, held against its differential equations and its symmetries."""

from __future__ import annotations

from dataclasses import replace
import json
import pickle

from handover_dmp.common.errors import DataError
from handover_dmp.common.quaternions import multiply, normalized, turns_from_start
from handover_dmp.dmp import (
    DecoupledDmp,
    DmpParameters,
    learn,
    LearntTurn,
    load_model,
    OrientationPrimitive,
    relearn,
    save_model,
)
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

TAU = 1.3
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
part = st.floats(-1.0, 1.0)
quaternions = (
    st.tuples(part, part, part, part).filter(lambda q: np.linalg.norm(q) > 0.1).map(normalized)
)


def demonstration(turn=(1.2, -0.4, 0.7), wobble=(0.3, 0.2, -0.4), count=201):
    """Give times and turns of a hand that turns by so much, not straight."""
    u = np.linspace(0.0, 1.0, count)[:, None]
    share = 10 * u**3 - 15 * u**4 + 6 * u**5
    return TAU * u[:, 0], share * turn + (16 * u**2 * (1 - u) ** 2) * wobble


def movement(parameters=None, room=None, formulation='stiff') -> DecoupledDmp:
    """Learn position and orientation, in a room that is turned."""
    room = room or Rotation.identity()
    parameters = parameters or DmpParameters(formulation=formulation)
    times, turns = demonstration()
    places = room.apply(np.column_stack([np.linspace(0.0, 0.6, len(times)), turns[:, :2] * 0.1]))
    model = learn(times, places, parameters, regression='ridge', basis=25)
    turning = learn(times, room.apply(turns), parameters, regression='ridge', basis=25)
    return model.with_turn(
        LearntTurn.of(turning, (room * Rotation.from_euler('x', 1.0)).as_quat())
    )


MODEL = movement()


def off(a, b) -> float:
    """Return the angle between two orientations, rad."""
    return float((Rotation.from_quat(a) * Rotation.from_quat(b).inv()).magnitude())


@pytest.mark.parametrize(
    'formulation, spin', [('printed', (0.0, 0.0, 0.0)), ('stiff', (0.3, -0.2, 0.4))]
)
def test_it_solves_its_differential_equation(formulation, spin) -> None:
    """(O1) and (O2) by SciPy, on quaternions, with a Jacobian that is integrated."""
    model = movement(formulation=formulation)
    primitive, p = OrientationPrimitive(model), model.parameters
    start = Rotation.from_euler('zyx', [0.4, -0.3, 0.9])
    aim = Rotation.from_rotvec([0.9, 0.2, -0.8])
    spin = np.array(spin)

    def jacobian(turn):
        """J(r) = ∫₀¹ exp(s[r]×) ds."""
        matrices = Rotation.from_rotvec(0.5 * (NODES[:, None] + 1.0) * turn).as_matrix()
        return 0.5 * np.einsum('n,nij->ij', WEIGHTS, matrices)

    def slope(time, y):
        q, v = y[:4] / np.linalg.norm(y[:4]), y[4:]
        u = time / model.duration_s
        turn = (Rotation.from_quat(q) * start.inv()).as_rotvec()
        goal = (Rotation.from_rotvec(spin * time) * aim * start.inv()).as_rotvec()
        goal_rate = np.linalg.solve(jacobian(goal), spin)
        weight = float(model.goal_weight_at_time(np.array([u]))[0])
        shape = (model.basis.activations(np.exp([-p.alpha * u])) @ model.turn.weights)[0]
        gain = p.effective_goal_velocity_gain(model.duration_s)
        pull = weight * (p.stiffness * (goal - turn) + gain * goal_rate)
        force = (1.0 - weight) * model.shape_stiffness * (shape - turn) + pull
        force -= p.effective_damping * v
        x, y_, z = jacobian(turn) @ (v / model.duration_s)
        a, b, c, w = q
        turning = 0.5 * np.array(
            [x * w + y_ * c - z * b, y_ * w + z * a - x * c, z * w + x * b - y_ * a,
             -x * a - y_ * b - z * c]
        )  # fmt: skip
        return np.concatenate([turning, force / model.duration_s])

    dt, steps = 0.01, 180
    times = dt * np.arange(steps + 1)
    begin = np.concatenate([start.as_quat(), np.zeros(3)])
    exact = solve_ivp(slope, (0.0, times[-1]), begin, t_eval=times, rtol=1e-6, atol=1e-8)
    state = primitive.initial_state(start.as_quat())
    for k, time in enumerate(times[:-1]):
        assert off(state.orientation, exact.y[:4, k]) < 5e-5
        goal = (Rotation.from_rotvec(spin * time) * aim).as_quat()
        state = primitive.step(state, dt, goal=tuple(goal), goal_velocity=tuple(spin))
    assert off(state.orientation, exact.y[:4, -1]) < 5e-5
    # and follows a goal that turns without lag
    goal = Rotation.from_rotvec(spin * times[-1]) * aim
    assert off(state.orientation, goal.as_quat()) < 5e-3
    np.testing.assert_allclose(state.angular_velocity, spin, atol=0.05)


@settings(max_examples=6)
@given(start=quaternions, goal=quaternions, inner=quaternions, room=quaternions,
       signs=st.tuples(st.booleans(), st.booleans()))  # fmt: skip
def test_neither_signs_nor_frames_matter_and_norms_are_one(
    start, goal, inner, room, signs
) -> None:
    room_turn = Rotation.from_quat(room)
    plain = OrientationPrimitive(MODEL)
    weights = room_turn.apply(np.array(MODEL.turn.weights))
    learnt = replace(MODEL.turn, weights=weights, goal=room_turn.apply(np.array(MODEL.turn.goal)))
    turned = OrientationPrimitive(MODEL.with_turn(learnt))
    opposite = [
        tuple(-x for x in q) if s else q for q, s in zip((start, goal), signs, strict=True)
    ]
    states = [
        plain.initial_state(start),
        plain.initial_state(opposite[0]),
        plain.initial_state(multiply(start, inner)),
        turned.initial_state(multiply(room, start)),
    ]
    goals = [goal, opposite[1], multiply(goal, inner), multiply(room, goal)]
    primitives = [plain, plain, plain, turned]
    for _ in range(40):
        states = [
            one.step(state, 0.04, goal=aim)
            for one, state, aim in zip(primitives, states, goals, strict=True)
        ]
        first, flipped, other_axes, other_room = (state.orientation for state in states)
        assert abs(np.linalg.norm(first) - 1.0) < 1e-12
        assert off(flipped, first) < 1e-9
        assert off(other_axes, multiply(first, inner)) < 1e-9
        assert off(other_room, multiply(room, first)) < 1e-9


@settings(max_examples=6)
@given(start=quaternions, goal=quaternions, length=st.sampled_from([0.007, 0.02, 0.05]))
def test_it_starts_where_it_is_and_ends_at_the_goal(start, goal, length) -> None:
    primitive = OrientationPrimitive(MODEL)
    state = primitive.initial_state(start)
    assert off(state.orientation, start) < 1e-12
    steps = int(2.2 * TAU / length)
    for _ in range(steps):
        before = state
        state = primitive.step(state, length, goal=goal)
        # continuous: no further than it turns meanwhile
        most = max(np.linalg.norm(s.angular_velocity) for s in (before, state))
        assert off(state.orientation, before.orientation) < 2.0 * length * most + 1e-3
    assert off(state.orientation, goal) < 1e-3


def test_without_a_goal_it_turns_as_it_was_taught_from_anywhere() -> None:
    times, turns = demonstration()
    model = MODEL
    primitive = OrientationPrimitive(model)
    start = Rotation.from_euler('xyz', [2.0, 0.3, -1.0])
    path, velocities = primitive.rollout(times, start.as_quat())
    wanted = Rotation.from_rotvec(turns) * start
    assert (Rotation.from_quat(path) * wanted.inv()).magnitude().max() < np.radians(0.2)
    assert off(path[-1], wanted[-1].as_quat()) < np.radians(0.05)
    differences = turns_from_start(path)
    np.testing.assert_allclose(np.linalg.norm(velocities[0]), 0.0, atol=1e-9)
    assert np.abs(np.diff(differences, axis=0)).max() < 0.05


def test_its_clock_is_that_of_the_position() -> None:
    model = MODEL
    primitive = OrientationPrimitive(model)
    place, turn = model.initial_state(), primitive.initial_state()
    for rate in np.random.default_rng(0).uniform(0.0, 1.5, 100):
        place = model.step(place, tuple(model.goal), (0.0, 0.0, 0.0), 0.01, rate)
        turn = primitive.step(turn, 0.01, rate)
        assert turn.turned.phase == pytest.approx(place.phase, rel=1e-12)


def test_a_goal_weight_by_place_takes_over_early() -> None:
    primitive = OrientationPrimitive(MODEL)
    goal = Rotation.from_rotvec([-0.7, 0.5, 0.2]) * Rotation.from_quat(MODEL.turn.start)
    by_time = by_place = primitive.initial_state()
    for _ in range(100):
        by_time = primitive.step(by_time, 0.005, goal=tuple(goal.as_quat()))
        by_place = primitive.step(by_place, 0.005, goal=tuple(goal.as_quat()), goal_weight=1.0)
    assert off(by_place.orientation, goal.as_quat()) < 0.1
    assert off(by_time.orientation, goal.as_quat()) > 0.3
    assert by_place.turned.phase == pytest.approx(by_time.turned.phase, rel=1e-12)


def test_it_brakes_and_turns_back() -> None:
    primitive = OrientationPrimitive(MODEL)
    state = primitive.initial_state()
    for _ in range(120):
        state = primitive.step(state, 0.005)
    resting, turned = state, state
    for _ in range(200):
        resting = resting.braked(0.005, 10.0)
        before, turned = turned, turned.turned_back(0.005, 1.0, 4.0)
        change = np.subtract(turned.turned.velocity, before.turned.velocity)
        assert np.linalg.norm(change) <= 4.0 * 0.005 + 1e-12
    assert resting.angular_velocity == (0.0, 0.0, 0.0)
    assert resting.turned.phase == state.turned.phase
    for _ in range(400):
        turned = turned.turned_back(0.005, 1.0, 4.0)
    assert off(turned.orientation, turned.origin) < 1e-4


def test_learning_anew_and_files_keep_it(tmp_path) -> None:
    model = MODEL
    times, _ = demonstration()
    path, _ = OrientationPrimitive(model).rollout(times)
    other = relearn(model, mu=0.6, sigma=0.1, stiffness=300.0)
    again, _ = OrientationPrimitive(other).rollout(times)
    assert (Rotation.from_quat(path) * Rotation.from_quat(again).inv()).magnitude().max() < 2e-3
    slower = OrientationPrimitive(model.with_duration(2.0 * TAU)).rollout(2.0 * times)[0]
    np.testing.assert_allclose(slower, path, atol=1e-9)
    save_model(model, tmp_path / 'model.json')
    for back in (load_model(tmp_path / 'model.json'), pickle.loads(pickle.dumps(model))):
        for name in ('start', 'goal', 'weights', 'start_velocity'):
            np.testing.assert_array_equal(getattr(back.turn, name), getattr(model.turn, name))


@pytest.mark.parametrize(
    'change, fault',
    [
        ({'start': [0.0, 0.0, 0.0, 2.0]}, 'not a unit quaternion'),
        ({'weights': [[0.0, 0.0, 0.0]]}, 'weights has 1 entries'),
        ({'goal': [0.0, 1.0]}, 'goal has 2 entries'),
        (None, 'turn is missing'),
    ],
)
def test_a_file_with_a_faulty_turn_is_refused(change, fault, tmp_path) -> None:
    file = tmp_path / 'model.json'
    save_model(MODEL, file)
    document = json.loads(file.read_text())
    if change is None:
        del document['turn']
    else:
        document['turn'] |= change
    file.write_text(json.dumps(document))
    with pytest.raises(DataError, match=fault):
        load_model(file)


def test_a_movement_without_it_has_no_primitive() -> None:
    with pytest.raises(DataError, match='without orientations'):
        OrientationPrimitive(MODEL.with_turn(None))
    with pytest.raises(DataError, match='weights'):
        MODEL.with_turn(replace(MODEL.turn, weights=np.zeros((3, 3))))
