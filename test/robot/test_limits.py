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

from handover_dmp.robot.limits import JointLimits, VelocityBox
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

DT = 0.005
SHARES = st.floats(0.05, 1.0)
SEEDS = st.integers(0, 2**32 - 1)


def limits(lower=-1.0, upper=1.5, velocity=2.0, acceleration=10.0, joints=3):
    full = np.full(joints, 1.0)
    return JointLimits(
        lower * full, upper * full, velocity * full, acceleration * full, full, 100.0 * full
    )


@settings(max_examples=60, deadline=None)
@given(SEEDS, SHARES, st.sampled_from([0.001, 0.005, 0.02]), st.floats(0.5, 50.0))
def test_whatever_is_chosen_inside_the_box_no_limit_is_ever_broken(seed, share, dt, hardest):
    rng = np.random.default_rng(seed)
    joint = limits(acceleration=hardest)
    box = VelocityBox(joint, share)
    position = rng.uniform(joint.lower, joint.upper)
    position[0] = rng.choice([joint.lower[0], joint.upper[0]])
    velocity = np.zeros(3)
    # adversaries: full speed one way, full speed to and fro, anything
    choice = rng.choice(['up', 'down', 'flip', 'any'])
    for step in range(250):
        lower, upper = box.bounds(position, velocity, dt)
        assert np.all(lower <= upper)
        if choice == 'any':
            next_velocity = rng.uniform(lower, upper)
        elif choice == 'flip':
            next_velocity = upper if step // 30 % 2 else lower
        else:
            next_velocity = upper if choice == 'up' else lower
        assert np.all(np.abs(next_velocity) <= joint.velocity)
        assert np.all(np.abs(next_velocity - velocity) <= hardest * dt * (1 + 1e-12) + 1e-14)
        velocity = next_velocity
        position = position + velocity * dt
        assert joint.inside(position, tolerance=1e-12)


def test_a_joint_can_use_all_of_its_range_and_speed():
    joint = limits(joints=1)
    box = VelocityBox(joint, 0.25)
    position, velocity, fastest = joint.lower.copy(), np.zeros(1), 0.0
    for _ in range(2000):
        velocity = box.bounds(position, velocity, DT)[1]
        position = position + velocity * DT
        fastest = max(fastest, velocity[0])
    assert fastest == pytest.approx(2.0)
    assert joint.upper[0] - position[0] < 1e-3


@settings(max_examples=30, deadline=None)
@given(SEEDS)
def test_from_outside_it_comes_back_within_the_acceleration_limit(seed):
    rng = np.random.default_rng(seed)
    joint = limits()
    box = VelocityBox(joint, 0.25)
    position = rng.uniform(joint.lower - 0.3, joint.upper + 0.3)
    velocity = rng.uniform(-4.0, 4.0, 3)
    for _ in range(800):
        lower, upper = box.bounds(position, velocity, DT)
        assert np.all(lower <= upper)
        next_velocity = np.clip(rng.uniform(-5.0, 5.0, 3), lower, upper)
        assert np.all(np.abs(next_velocity - velocity) <= 10.0 * DT + 1e-12)
        velocity = next_velocity
        position = position + velocity * DT
    assert joint.inside(position, tolerance=1e-3)
    assert np.all(np.abs(velocity) <= joint.velocity + 1e-12)


@settings(max_examples=60, deadline=None)
@given(SEEDS)
def test_braking_stops_as_fast_as_the_acceleration_allows(seed):
    rng = np.random.default_rng(seed)
    joint = limits()
    box = VelocityBox(joint, 1.0)
    position, velocity = np.full(3, 0.2), rng.uniform(-2.0, 2.0, 3)
    periods = int(np.ceil(np.abs(velocity).max() / (10.0 * DT) - 1e-9))
    for _ in range(periods):
        velocity = box.brake(position, velocity, DT)
        position = position + velocity * DT
    np.testing.assert_allclose(velocity, 0.0, atol=1e-12)


def test_a_joint_that_turns_for_ever_knows_only_its_speed():
    joint = limits(lower=-np.inf, upper=np.inf)
    lower, upper = VelocityBox(joint, 0.25).bounds(np.full(3, 1e6), np.full(3, 1.99), DT)
    np.testing.assert_allclose(upper, 2.0)
    np.testing.assert_allclose(lower, 1.94)


@pytest.mark.parametrize('share', [0.0, -0.1, 1.01])
def test_a_share_that_could_not_be_kept_is_refused(share):
    with pytest.raises(ValueError, match='braking share'):
        VelocityBox(limits(), share)
