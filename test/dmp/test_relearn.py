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

"""The same movement with other parameters."""

from __future__ import annotations

from handover_dmp.dmp import DecoupledDmp, learn, relearn
import numpy as np
import pytest

TIMES = np.linspace(0.0, 1.5, 301)
U = TIMES / 1.5
BELL = 10 * U**3 - 15 * U**4 + 6 * U**5
REACH = np.outer(BELL, [0.4, -0.2, 0.1]) + np.outer(np.sin(np.pi * U) ** 3, [0.0, 0.05, 0.05])


@pytest.mark.parametrize(
    'changes',
    [
        {'stiffness': 400.0},
        {'mu': 0.9},
        {'mu': 0.5, 'sigma': 0.1},
        {'damping': 50.0},
        {'formulation': 'printed'},
        {'stiffness': 100.0, 'mu': 0.95, 'sigma': 0.02},
    ],
)
def test_makes_the_movement_that_it_was_learnt_from(changes: dict[str, float | str]) -> None:
    model: DecoupledDmp = learn(TIMES, REACH).with_goal_offset([0.1, 0.2, 0.3])
    other = relearn(model, **changes)
    for name, value in changes.items():
        assert getattr(other.parameters, name) == value
    assert np.array_equal(other.goal_offset, model.goal_offset)
    way = other.rollout(TIMES, other.goal).positions
    assert np.abs(way - REACH).max() < 1e-3


def test_own_parameters_change_nothing() -> None:
    model = learn(TIMES, REACH)
    assert relearn(model, stiffness=model.parameters.stiffness) is model
