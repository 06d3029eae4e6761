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

"""The calibration motion: within limits, clear of itself, and telling about every direction."""

from __future__ import annotations

from handover_dmp.robot.calibration_motion import (
    ASTRAY_RAD,
    MotionFollower,
    plan_calibration_motion,
    wrist_box,
)
from handover_dmp.robot.collision import CollisionModel
from handover_dmp.robot.errors import UnreachableError
from handover_dmp.robot.model import RobotModel
import numpy as np
import pytest

DURATION_S = 60.0
SPEED = 0.25
STEP_S = 0.01


@pytest.fixture(scope='module', params=['lwr4', 'panda', 'ur5'])
def planned(request):
    model = RobotModel.load(request.param)
    return model, plan_calibration_motion(model, model.home, DURATION_S, SPEED)


def test_it_begins_and_ends_at_rest_where_the_arm_is(planned) -> None:
    model, motion = planned
    for time_s in (-1.0, 0.0, DURATION_S, DURATION_S + 1.0):
        positions, velocities = motion.at(time_s)
        np.testing.assert_allclose(positions, model.home, atol=1e-12)
        np.testing.assert_allclose(velocities, 0.0, atol=1e-12)


def test_limits_of_joints_and_wrist_are_kept_with_room(planned) -> None:
    model, motion = planned
    times = np.arange(0.0, DURATION_S, STEP_S)
    positions = np.array([motion.at(t)[0] for t in times])
    # by differences, whatever the motion says of its velocities
    velocities = np.diff(positions, axis=0) / STEP_S
    accelerations = np.diff(velocities, axis=0) / STEP_S
    assert all(model.limits.inside(row) for row in positions)
    assert (abs(velocities) <= 0.5 * model.limits.velocity).all()
    assert (abs(accelerations) <= 0.5 * model.limits.acceleration).all()
    told = np.array([motion.at(t)[1] for t in times])
    np.testing.assert_allclose(
        velocities, 0.5 * (told[1:] + told[:-1]), atol=2e-3
    )  # as it says itself
    wrist = np.array([model.wrist_pose(row)[0] for row in positions])
    assert np.linalg.norm(np.diff(wrist, axis=0), axis=1).max() / STEP_S <= SPEED
    low, high = wrist_box(model, motion)
    assert (wrist >= low - 2e-3).all()
    assert (wrist <= high + 2e-3).all()
    clearance = CollisionModel.of(model)
    assert min(clearance.min_distance(row) for row in positions[::50]) > 0.02


def test_it_moves_and_turns_the_wrist_in_every_direction(planned) -> None:
    model, motion = planned
    poses = [model.wrist_pose(motion.at(t)[0]) for t in np.arange(0.0, DURATION_S, 0.1)]
    places = np.array([place for place, _ in poses])
    spread = np.linalg.svd(places - places.mean(axis=0), compute_uv=False) / np.sqrt(len(places))
    assert spread[-1] > 0.04
    turns = np.array([turn for _, turn in poses])
    off = turns - turns.mean(axis=0)
    assert np.linalg.eigvalsh(np.einsum('nij,nik->jk', off, off) / len(off))[0] > 0.15**2


def test_from_beside_the_end_of_a_joint_it_moves_away() -> None:
    model = RobotModel.load('lwr4')
    start = model.home.copy()
    start[6] = model.limits.upper[6] - 0.01
    motion = plan_calibration_motion(model, start, DURATION_S, SPEED)
    positions = [motion.at(t)[0] for t in np.arange(0.0, DURATION_S, 0.05)]
    assert all(model.limits.inside(row) for row in positions)
    np.testing.assert_allclose(motion.at(DURATION_S)[0], start, atol=1e-12)


def test_where_nothing_is_left_of_the_motion_it_is_refused() -> None:
    model = RobotModel.load('lwr4')
    with pytest.raises(UnreachableError, match='open configuration'):
        plan_calibration_motion(model, model.home, DURATION_S, 1e-9)


def test_an_arm_that_follows_stays_near_and_one_that_does_not_is_braked() -> None:
    model = RobotModel.load('lwr4')
    motion = plan_calibration_motion(model, model.home, 20.0, SPEED)
    follower, dt = MotionFollower(model, motion), 0.005
    positions, before = model.home.copy(), np.zeros(model.dof)
    for step in range(round(20.0 / dt)):
        velocities, fault = follower.follow(step * dt, positions, dt)
        assert not fault
        assert (abs(velocities - before) <= model.limits.acceleration * dt + 1e-9).all()
        positions, before = positions + dt * velocities, velocities
        assert abs(positions - motion.at((step + 1) * dt)[0]).max() < 0.01
    assert follower.resting or abs(before).max() < 1e-3
    # now its brakes are shut
    follower, stuck = MotionFollower(model, motion), model.home
    faults = [follower.follow(step * dt, stuck, dt)[1] for step in range(round(10.0 / dt))]
    assert any('does not follow' in fault for fault in faults)
    first = next(step for step, fault in enumerate(faults) if fault)
    assert abs(motion.at(first * dt)[0] - stuck).max() >= ASTRAY_RAD
