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

"""Quaternions and turns, held against SciPy's rotations."""

from __future__ import annotations

from handover_dmp.common.quaternions import (
    angular_velocity,
    conjugate,
    exponential,
    from_matrices,
    logarithm,
    multiply,
    multiply_all,
    nearest_turn,
    normalized,
    rotated,
    to_matrix,
    turn_rate,
    turns_from_start,
    with_continuous_signs,
)
from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
from scipy.spatial.transform import Rotation

part = st.floats(-1.0, 1.0)
quaternions = (
    st.tuples(part, part, part, part).filter(lambda q: np.linalg.norm(q) > 0.1).map(normalized)
)
# down to turns that are next to none, where the closed forms cancel
turns = st.tuples(st.tuples(part, part, part), st.sampled_from([1e-9, 1e-5, 1e-3, 1.0, 3.0])).map(
    lambda drawn: tuple(drawn[1] * x for x in drawn[0])
)


@settings(max_examples=40)
@given(a=quaternions, b=quaternions, vector=st.tuples(part, part, part))
def test_products_are_rotations_one_after_another(a, b, vector) -> None:
    both = Rotation.from_quat(a) * Rotation.from_quat(b)
    product = Rotation.from_quat(multiply(a, b))
    assert (both * product.inv()).magnitude() < 1e-14
    np.testing.assert_allclose(rotated(a, vector), Rotation.from_quat(a).apply(vector), atol=1e-14)
    np.testing.assert_allclose(to_matrix(a), Rotation.from_quat(a).as_matrix(), atol=1e-14)
    back = from_matrices(to_matrix(a))
    np.testing.assert_allclose(abs(float(np.dot(back, a))), 1.0, atol=1e-14)
    np.testing.assert_allclose(multiply_all([a, b], b)[0], multiply(a, b), atol=1e-15)
    np.testing.assert_allclose(multiply_all(a, [b, a])[0], multiply(a, b), atol=1e-15)


@settings(max_examples=40)
@given(turn=turns, q=quaternions)
def test_exponential_and_logarithm_undo_each_other(turn, q) -> None:
    np.testing.assert_allclose(
        Rotation.from_quat(exponential(turn)).as_matrix(),
        Rotation.from_rotvec(turn).as_matrix(),
        atol=1e-14,
    )
    assert np.linalg.norm(logarithm(q)) <= np.pi + 1e-12
    assert logarithm(q) == logarithm(tuple(-x for x in q)) or q[3] == 0.0
    np.testing.assert_allclose(abs(np.dot(exponential(logarithm(q)), q)), 1.0, atol=1e-14)
    if np.linalg.norm(turn) < 3.1:
        np.testing.assert_allclose(logarithm(exponential(turn)), turn, atol=1e-12, rtol=1e-9)


@settings(max_examples=40)
@given(turn=turns, rate=st.tuples(part, part, part))
def test_the_jacobian_is_the_derivative(turn, rate) -> None:
    assume(np.linalg.norm(turn) < 3.1)
    step = 1e-5
    ahead, behind = (
        Rotation.from_rotvec(np.array(turn) + sign * step * np.array(rate)) for sign in (1, -1)
    )
    differences = (ahead * behind.inv()).as_rotvec() / (2.0 * step)
    velocity = angular_velocity(turn, rate)
    np.testing.assert_allclose(velocity, differences, atol=1e-7)
    np.testing.assert_allclose(turn_rate(turn, velocity), rate, atol=1e-10)


@settings(max_examples=40)
@given(turn=turns, revolutions=st.integers(-2, 2), q=quaternions)
def test_the_nearest_turn_is_the_same_rotation_nearby(turn, revolutions, q) -> None:
    angle = np.linalg.norm(turn)
    assume(1e-3 < angle < 3.0)
    far = np.array(turn) * (1.0 + 2.0 * np.pi * revolutions / angle)
    np.testing.assert_allclose(nearest_turn(turn, far), far, atol=1e-9)
    found = nearest_turn(logarithm(q), far)
    off = Rotation.from_rotvec(found) * Rotation.from_quat(q).inv()
    assert off.magnitude() < 1e-12


def test_turns_go_on_beyond_half_a_revolution() -> None:
    angles = np.linspace(0.0, 9.0, 200)
    axis = np.array([0.6, -0.48, 0.64])
    path = (
        Rotation.from_rotvec(angles[:, None] * axis) * Rotation.random(random_state=1)
    ).as_quat()
    signs = np.where(np.arange(200) % 7, 1.0, -1.0)[:, None]
    np.testing.assert_allclose(turns_from_start(signs * path), angles[:, None] * axis, atol=1e-9)
    continuous = with_continuous_signs(signs * path)
    assert (np.einsum('ij,ij->i', continuous[1:], continuous[:-1]) > 0.99).all()
    assert conjugate(tuple(path[0])) == (*(-path[0][:3]), path[0][3])


def test_what_is_no_rotation_has_no_quaternion() -> None:
    matrices = np.stack([np.zeros((3, 3)), np.full((3, 3), 0.5), -np.eye(3), np.eye(3)])
    found = from_matrices(matrices)
    assert np.isnan(found[:3]).all()
    np.testing.assert_array_equal(found[3], [0.0, 0.0, 0.0, 1.0])
