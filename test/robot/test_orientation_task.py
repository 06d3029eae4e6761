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

from handover_dmp.robot.orientation_task import (
    axis_alignment,
    full_orientation,
    orthogonal_directions,
)
import numpy as np
import pytest
from scipy.spatial.transform import Rotation


@pytest.mark.parametrize('seed', range(5))
def test_full_orientation_turns_the_shortest_way_to_the_target(seed):
    rng = np.random.default_rng(seed)
    current, target = Rotation.from_quat(rng.normal(size=(2, 4)))
    for _ in range(600):
        speed = full_orientation(current.as_matrix(), target.as_matrix(), np.zeros(3), 10.0, 3.0)
        assert np.linalg.norm(speed) <= 3.0 + 1e-12
        before = (target * current.inv()).magnitude()
        current = Rotation.from_rotvec(speed * 0.005) * current
        assert (target * current.inv()).magnitude() <= before + 1e-12
    assert (target * current.inv()).magnitude() < 1e-3


@pytest.mark.parametrize('seed', range(5))
def test_axis_alignment_leaves_the_turn_about_the_axis_free(seed):
    rng = np.random.default_rng(seed)
    axis, target = rng.normal(size=(2, 3))
    axis, target = axis / np.linalg.norm(axis), target / np.linalg.norm(target)
    if seed == 0:
        target = -axis  # straight away from it
    for _ in range(800):
        directions, speeds = axis_alignment(axis, target, 10.0, 3.0)
        np.testing.assert_allclose(directions @ axis, 0.0, atol=1e-12)
        axis = Rotation.from_rotvec(directions.T @ speeds * 0.005).apply(axis)
    np.testing.assert_allclose(axis, target, atol=1e-3)


def test_square_to_gives_a_right_angled_frame():
    for axis in [*np.eye(3), *Rotation.random(5, random_state=0).as_matrix()[:, 0]]:
        first, second = orthogonal_directions(axis)
        frame = np.array([axis, first, second])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
