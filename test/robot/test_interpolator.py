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

from handover_dmp.robot.interpolator import JointInterpolator
from handover_dmp.robot.model import RobotModel
import numpy as np
import pytest

DT = 0.001


@pytest.fixture(scope='module')
def limits():
    return RobotModel.load('lwr4').limits


def test_keeps_acceleration_and_jerk_whatever_it_is_told(limits):
    rng = np.random.default_rng(0)
    interpolator = JointInterpolator(limits)
    velocities, accelerations = [np.zeros(7)], [np.zeros(7)]
    for _ in range(400):
        command = rng.uniform(-2.0, 2.0, 7) * limits.velocity * rng.choice([0.0, 0.1, 1.0])
        for _ in range(rng.integers(1, 9)):
            velocities.append(interpolator.step(command, DT))
            accelerations.append(interpolator.acceleration)
    velocities, accelerations = np.array(velocities), np.array(accelerations)
    assert np.all(np.abs(velocities) <= limits.velocity * (1 + 1e-9) + 1e-3)
    changes = np.abs(np.diff(velocities, axis=0)) / DT
    assert np.all(changes <= limits.acceleration * (1 + 1e-9))
    jerks = np.abs(np.diff(accelerations, axis=0)) / DT
    assert np.all(jerks <= limits.jerk * (1 + 1e-6))


def test_acceleration_is_the_slope_of_the_velocity(limits):
    interpolator = JointInterpolator(limits)
    command = 0.5 * limits.velocity
    before = interpolator.velocity
    for _ in range(60):
        start = interpolator.acceleration
        velocity = interpolator.step(command, DT)
        mean = (start + interpolator.acceleration) / 2.0
        # exact where the jerk does not change within the step, and else off by half a step of it
        np.testing.assert_allclose((velocity - before) / DT, mean, atol=limits.jerk[0] * DT)
        before = velocity


def test_arrives_at_the_command_and_stays(limits):
    interpolator = JointInterpolator(limits)
    command = np.array([0.3, -0.2, 0.0, 0.1, 0.5, -1.0, 1.5])
    for _ in range(300):
        velocity = interpolator.step(command, DT)
    np.testing.assert_allclose(velocity, command, atol=1e-9)
    np.testing.assert_allclose(interpolator.acceleration, 0.0, atol=1e-6)


def test_follows_a_steady_acceleration_within_its_jerk_time(limits):
    """Behind a ramp of the command at 80 % of the limit it lags by no more than 10 ms."""
    interpolator = JointInterpolator(limits)
    slope = 0.8 * limits.acceleration
    for period in range(20):
        command = slope * 0.005 * (period + 1)
        for _ in range(5):
            velocity = interpolator.step(command, DT)
    assert np.all(command - velocity <= slope * 0.010)


def test_a_lost_command_brakes_at_the_acceleration_limit(limits):
    interpolator = JointInterpolator(limits)
    interpolator.reset(0.8 * limits.velocity)
    stop, steps, hardest = np.zeros(7), 0, np.zeros(7)
    while np.abs(interpolator.step(stop, DT)).max() > 1e-9:
        hardest = np.maximum(hardest, np.abs(interpolator.acceleration))
        steps += 1
        assert steps < 1000
    np.testing.assert_allclose(hardest, limits.acceleration, rtol=1e-6)
    ideal = (0.8 * limits.velocity / limits.acceleration + limits.acceleration / limits.jerk).max()
    assert steps * DT == pytest.approx(ideal, abs=2 * DT)


def test_one_command_gives_the_same_motion_however_often_it_is_repeated(limits):
    once, again = JointInterpolator(limits), JointInterpolator(limits)
    command = 0.4 * limits.velocity
    for _ in range(40):
        np.testing.assert_allclose(
            once.step(command, DT), again.step(command.copy(), DT), atol=1e-12
        )


def test_a_command_that_changes_in_place_is_noticed(limits):
    interpolator = JointInterpolator(limits)
    command = np.full(7, 0.2)
    for _ in range(100):
        interpolator.step(command, DT)
    command[:] = 0.0
    for _ in range(100):
        velocity = interpolator.step(command, DT)
    np.testing.assert_allclose(velocity, 0.0, atol=1e-9)


@pytest.mark.parametrize('command', [np.full(7, np.nan), np.zeros(6)])
def test_what_is_no_command_is_refused(limits, command):
    with pytest.raises(ValueError, match='finite number per joint'):
        JointInterpolator(limits).step(command, DT)
