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

"""What a primitive may be told of a hand, on hands of which the answer is known."""

from __future__ import annotations

from handover_dmp.evaluation.cases import Hands
from handover_dmp.evaluation.hand_views import (
    estimated,
    looking_ahead,
    smooth_goal,
    smooth_velocity,
)
import numpy as np
import pytest

SPEED = np.array([0.3, -0.1, 0.05])


@pytest.fixture
def hands() -> Hands:
    times = np.arange(400) / 200
    positions = np.array([0.5, 0.2, 1.0]) + times[:, None] * SPEED
    velocities = np.broadcast_to(SPEED, positions.shape)
    return Hands(times, positions[None], velocities[None], np.array([400]))


def test_a_low_pass_of_constant_speed_keeps_it_and_lags_by_its_time_constant(hands):
    told = smooth_goal(hands, 0.1)
    np.testing.assert_allclose(told.velocities, hands.velocities, atol=1e-12)
    lag = hands.positions[0, -1] - told.positions[0, -1]
    np.testing.assert_allclose(lag, 0.1 * SPEED, rtol=0.03)
    np.testing.assert_array_equal(told.positions[:, 0], hands.positions[:, 0])


def test_a_low_pass_of_a_step_reaches_63_percent_after_its_time_constant(hands):
    velocities = np.zeros_like(hands.velocities)
    velocities[:, 200:] = 1.0
    stepped = Hands(hands.times, hands.positions, velocities, hands.samples)
    told = smooth_velocity(stepped, 0.1)
    assert told.velocities[0, 199, 0] == 0
    assert told.velocities[0, 219, 0] == pytest.approx(1 - np.exp(-1), abs=1e-12)
    assert told.positions is stepped.positions


def test_looking_ahead_is_right_at_constant_speed(hands):
    told = looking_ahead(hands, 0.05)
    np.testing.assert_allclose(told.positions[0, :-10], hands.positions[0, 10:], atol=1e-12)


def test_the_estimator_follows_a_hand_of_constant_speed(hands):
    told = estimated(hands)
    np.testing.assert_allclose(told.positions[0, -1], hands.positions[0, -1], atol=1e-3)
    np.testing.assert_allclose(told.velocities[0, -1], SPEED, atol=0.02)
