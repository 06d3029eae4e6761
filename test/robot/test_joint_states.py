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

"""Joint states as drivers publish them are understood, or named for what they are."""

from __future__ import annotations

from math import inf, nan

from handover_dmp.robot.joint_states import JointStateReader
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

NAMES = ('A1', 'A2', 'A3')


@given(st.permutations(['gripper', 'lbr_A1', 'lbr_A2', 'lbr_A3', 'other_A1']))
def test_any_order_among_others(names):
    value = {name: float(i) for i, name in enumerate(names)}
    reader = JointStateReader(NAMES, 'lbr_')
    found = reader.read(names, list(value.values()), [10.0 * v for v in value.values()])
    expected = [value['lbr_' + name] for name in NAMES]
    np.testing.assert_array_equal(found[0], expected)
    np.testing.assert_array_equal(found[1], 10.0 * np.array(expected))


@pytest.mark.parametrize('velocities', [[], [nan, nan, nan], [0.1, nan, 0.1]])
def test_velocities_that_are_nan_are_none(velocities):
    positions, moving = JointStateReader(NAMES).read(NAMES, [1.0, 2.0, 3.0], velocities)
    np.testing.assert_array_equal(positions, [1.0, 2.0, 3.0])
    assert moving is None


def test_nan_of_another_joint_hides_nothing():
    found = JointStateReader(NAMES).read((*NAMES, 'finger'), [1, 2, 3, 4], [0.1, 0.2, 0.3, nan])
    np.testing.assert_array_equal(found[1], [0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    ('names', 'positions', 'velocities', 'fault'),
    [
        (NAMES, [1, 2, 3], [1, 2], 'velocity has 2 values, position 3'),
        (NAMES, [1, 2], [], '3 names, but 2 positions'),
        (NAMES, [1, nan, 3], [], 'positions are not finite'),
        (NAMES, [1, 2, 3], [1, inf, 3], 'velocities are not finite'),
        (('A1', 'A3', 'x'), [1, 2, 3], [], 'lack A2'),
        ((*NAMES, 'A1'), [1, 2, 3, 4], [], 'name a joint twice'),
        (('j1', 'j2'), [1, 2], [], 'name j1, j2; expected A1, A2, A3'),
        ((), [], [], 'name nothing; expected A1'),
    ],
)
def test_what_is_wrong_is_said_as_what_it_is(names, positions, velocities, fault):
    assert fault in JointStateReader(NAMES).read(names, positions, velocities)


def test_a_prefix_is_named_with_what_mends_it():
    names = [f'lbr_{name}' for name in NAMES]
    reader = JointStateReader(NAMES)
    assert not reader.concerns(names)
    told = reader.read(names, [1, 2, 3], [])
    assert told == (
        "joint states name lbr_A1, lbr_A2, lbr_A3; expected A1, A2, A3: set joint_prefix to 'lbr_'"
    )
    assert JointStateReader(NAMES, 'lbr_').concerns(names)


def test_a_prefix_of_some_joints_alone_is_none():
    told = JointStateReader(NAMES).read(['x_A1', 'y_A2', 'z_A3'], [1, 2, 3], [])
    assert 'joint_prefix' not in told
