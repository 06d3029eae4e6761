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

"""The best shift in time: against shifts that are known, and against trying every one."""

from __future__ import annotations

from handover_dmp.evaluation.time_shift import best_time_shift, MAX_SHIFT
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

Array = NDArray[np.float64]

U = np.linspace(0.0, 1.0, 101)


def reach(late: float, scale: float = 1.0) -> Array:
    """Give a reach of a quarter of the time before and behind it, (101, 3)."""
    u = np.clip(2.0 * (U - late) - 0.5, 0.0, 1.0)
    done = 10 * u**3 - 15 * u**4 + 6 * u**5
    return scale * np.outer(done, [0.5, -0.3, 0.2])


@settings(max_examples=40, deadline=None)
@given(st.floats(-0.24, 0.24))
def test_finds_a_shift_that_is_known(late: float) -> None:
    found = best_time_shift(reach(late), reach(0.0))
    assert abs(found.lateness - late) < 1e-3
    # what linear interpolation between samples leaves, of 0.6 m
    assert np.sqrt(found.squared_m2) < 2e-4


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31))
def test_is_the_least_of_all_shifts(seed: int) -> None:
    random = np.random.default_rng(seed)
    late, scale = random.uniform(-0.2, 0.2), random.uniform(0.7, 1.3)
    curve, reference = reach(late, scale), reach(0.0) + 0.02 * np.sin(9.0 * U)[:, None]

    def remaining(shift: float) -> float:
        at = np.clip(U + shift, 0.0, 1.0)
        moved = np.stack([np.interp(at, U, column) for column in curve.T], axis=1)
        return float(((moved - reference) ** 2).sum(axis=1).mean())

    tried = np.linspace(-MAX_SHIFT, MAX_SHIFT, 401)
    near = tried[int(np.argmin([remaining(shift) for shift in tried]))]
    best = minimize_scalar(remaining, bounds=(near - 0.01, near + 0.01), method='bounded')
    found = best_time_shift(curve, reference)
    assert abs(found.lateness - best.x) < 2e-3
    assert abs(np.sqrt(found.squared_m2) - np.sqrt(best.fun)) < 2e-4


def test_many_at_once_are_each_by_itself() -> None:
    lates = np.array([[0.0, 0.1, -0.13], [0.2, -0.2, 0.05]])
    curves = np.array([[reach(late) for late in row] for row in lates])
    references = np.stack([reach(0.0), reach(0.02), reach(0.0, 1.1)])
    together = best_time_shift(curves, references)
    for row in range(2):
        for column in range(3):
            alone = best_time_shift(curves[row, column], references[column])
            assert together.lateness[row, column] == alone.lateness
            assert together.squared_m2[row, column] == alone.squared_m2


def test_what_never_moves_is_not_late() -> None:
    still = np.ones((101, 3))
    for curve, reference in ((still, still), (still, reach(0.1)), (still + 0.1, still)):
        found = best_time_shift(curve, reference)
        assert found.lateness == 0.0
        assert np.isclose(found.squared_m2, ((curve - reference) ** 2).sum(axis=1).mean())


def test_no_shift_leaves_more_than_none() -> None:
    random = np.random.default_rng(1)
    curves = random.normal(size=(40, 101, 3)).cumsum(axis=1)
    references = random.normal(size=(40, 101, 3)).cumsum(axis=1)
    found = best_time_shift(curves, references)
    plain = ((curves - references) ** 2).sum(axis=-1).mean(axis=-1)
    assert np.all(found.squared_m2 <= plain * (1 + 1e-12))
    assert np.all(np.abs(found.lateness) <= MAX_SHIFT)
