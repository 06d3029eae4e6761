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

from __future__ import annotations

from math import sqrt

from handover_dmp.dmp.transition import GAUSS_A, GAUSS_B, propagator, steady, varying
from hypothesis import example, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

PROPERTY = settings(max_examples=25, deadline=None)


def ends(stiffness, damping, h, level, slope, velocity):
    """End of y'' = −k y − D y' + level + slope·θ from rest at 0 with a velocity, by expm."""
    # state: y, v, input, slope of the input
    matrix = np.array([[0, 1, 0, 0], [-stiffness, -damping, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0.0]])
    return (expm(matrix * h) @ [0.0, velocity, level, slope])[:2]


@PROPERTY
@given(
    stiffness=st.floats(1e-3, 1e4),
    ratio=st.floats(0.05, 20.0),
    h=st.floats(1e-7, 2.0),
    level=st.floats(-10, 10),
    slope=st.floats(-10, 10),
    velocity=st.floats(-10, 10),
)
@example(stiffness=200.0, ratio=1.0, h=1 / 300, level=1.0, slope=2.0, velocity=0.5)
@example(stiffness=200.0, ratio=1.0, h=9e-6, level=1.0, slope=2.0, velocity=0.5)
@example(stiffness=200.0, ratio=1.0, h=5e-6, level=1.0, slope=2.0, velocity=0.5)
@example(stiffness=0.001, ratio=8.0, h=0.125, level=0.0, slope=2.0, velocity=0.0)
def test_constant_stiffness_is_exact_for_linear_input(stiffness, ratio, h, level, slope, velocity):
    damping = 2.0 * sqrt(stiffness) * ratio
    p12, p22, xa, xb, va, vb = steady(stiffness, damping, h)
    first, second = level + slope * GAUSS_A * h, level + slope * GAUSS_B * h
    y, v = ends(stiffness, damping, h, level, slope, velocity)
    scale = 10.0 * max(h, h * h) + 1e-12
    # of a spring next to none the input moves the rest position far, and most of that cancels
    rest = abs(level) / stiffness + abs(slope) * damping / stiffness**2
    assert p12 * velocity + xa * first + xb * second == pytest.approx(
        y, rel=1e-8, abs=1e-10 * scale + 1e-15 * rest
    )
    assert p22 * velocity + va * first + vb * second == pytest.approx(v, rel=1e-8, abs=1e-9)


def changing(h):
    """End of an interval with stiffness and input that change, by the scheme and exactly."""
    damping = 28.0

    def k(t):
        return 50.0 + 400.0 * t + 300.0 * np.sin(5 * t)

    def push(t):
        return 3.0 + 20.0 * t - 30.0 * t * t

    solution = solve_ivp(
        lambda t, y: [y[1], -k(t) * y[0] - damping * y[1] + push(t)],
        (0.0, h),
        [0.0, 0.7],
        'DOP853',
        rtol=1e-13,
        atol=1e-15,
    )
    a, b = GAUSS_A * h, GAUSS_B * h
    p12, p22, xa, xb, va, vb = varying(k(a), k(b), damping, h)
    return (
        np.array(
            [p12 * 0.7 + xa * push(a) + xb * push(b), p22 * 0.7 + va * push(a) + vb * push(b)]
        )
        - solution.y[:, -1]
    )


def test_changing_stiffness_is_of_fourth_order():
    """The error of one interval falls with the fifth power of its length."""
    errors = [np.abs(changing(h)).max() for h in (0.02, 0.01, 0.005)]
    assert errors[0] < 1e-5
    assert errors[1] < errors[0] / 20
    assert errors[2] < errors[1] / 20


@PROPERTY
@given(st.floats(1.0, 500.0), st.floats(5.0, 60.0), st.floats(1e-5, 0.03), st.floats(0.0, 1.0))
def test_hardly_changing_stiffness_is_like_constant_one(stiffness, damping, h, change):
    constant = steady(stiffness, damping, h)
    moving = varying(stiffness, stiffness * (1.0 + 1e-9 * (1.0 + change)), damping, h)
    assert moving[:2] == pytest.approx(constant[:2], rel=1e-6)
    # single gains differ by how a change within the interval is told, their sums do not
    assert moving[2] + moving[3] == pytest.approx(constant[2] + constant[3], rel=1e-5)
    assert moving[4] + moving[5] == pytest.approx(constant[4] + constant[5], rel=1e-5)


@pytest.mark.parametrize(
    'squared', [-9.0, -1.0001e-4, -0.9999e-4, 0.0, 0.9999e-4, 1.0001e-4, 4.0, 399.0, 401.0]
)
def test_propagator_knows_swinging_creeping_and_what_is_between(squared):
    root = np.sqrt(complex(squared))
    decay = 30.0
    even = (np.exp(-decay) * np.cosh(root)).real
    odd = (np.exp(-decay) * (np.sinh(root) / root if squared else 1.0)).real
    assert propagator(squared, decay) == pytest.approx((even, odd), rel=1e-12)


def test_a_very_stiff_system_over_a_long_interval_stays_finite():
    numbers = steady(1e6, 1e5, 1e4)
    assert np.isfinite(numbers).all()
    level = numbers[2] + numbers[3]
    assert level == pytest.approx(1e-6)
