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

from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.singularity import (
    limit_outward_speed,
    singular_slope,
    smallest_singular_direction,
    smallest_singular_value,
)
import numpy as np
import pytest


@pytest.fixture(scope='module', params=('lwr4', 'iiwa14', 'panda', 'ur5'))
def arm(request):
    return RobotModel.load(request.param)


def postures(arm, count=8):
    rng = np.random.default_rng(1)
    return arm.home + rng.uniform(-0.8, 0.8, (count, arm.dof))


def test_agrees_with_the_singular_value_decomposition(arm):
    for posture in postures(arm):
        linear = arm.wrist_jacobian(posture)[:3].copy()
        left, values, _ = np.linalg.svd(linear)
        value, direction = smallest_singular_value(linear), smallest_singular_direction(linear)
        assert value == pytest.approx(values[2], rel=1e-9)
        assert abs(direction @ left[:, 2]) == pytest.approx(1.0, abs=1e-9)


def test_slope_agrees_with_finite_differences(arm):
    for posture in postures(arm):
        linear = arm.wrist_jacobian(posture)[:3].copy()
        direction = smallest_singular_direction(linear)
        along = linear.T @ direction
        step = 1e-5
        squares = [
            smallest_singular_value(arm.wrist_jacobian(posture + side * step * along)[:3]) ** 2
            for side in (1.0, -1.0)
        ]
        expected = (squares[0] - squares[1]) / (2 * step)
        arm.wrist_jacobian(posture)
        assert singular_slope(arm, posture, linear, direction) == pytest.approx(
            expected, rel=1e-4, abs=1e-7
        )


def test_only_what_stretches_is_slowed():
    direction = np.array([1.0, 0.0, 0.0])
    sideways_out = np.array([0.5, 0.3, 0.0])
    slope = -0.01  # moving along `direction` stretches
    kept, cut = limit_outward_speed(sideways_out, direction, 0.1, slope, 0.06, 5.0)
    assert cut and kept[1] == 0.3
    # σ̇ = slope·r/(2σ³) is now −rate·(σ − least)
    assert slope * kept[0] / (2 * 0.1**3) == pytest.approx(-5.0 * (0.1 - 0.06))
    back, cut = limit_outward_speed(-sideways_out, direction, 0.1, slope, 0.06, 5.0)
    assert not cut and np.array_equal(back, -sideways_out)
    rest, cut = limit_outward_speed(sideways_out, direction, 0.05, slope, 0.06, 5.0)
    assert cut and rest[0] == 0.0
