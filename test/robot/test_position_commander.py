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

"""Positions that an arm may be told: the integral of the commands, within every limit, or none."""

from __future__ import annotations

from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.position_commander import PositionCommander, PositionCommanderOptions
from handover_dmp.robot.velocity_driver import ArmOptions, ArmState
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

DT = 0.005
ARM = RobotModel.load('lwr4')
START = ARM.home + 0.05


class Follower:
    """An arm that follows its position commands exactly, one period later."""

    def __init__(self, commander, *, stuck=False):
        self.commander = commander
        self.place = START.copy()
        self.stuck = stuck
        self.now_s = 0.0
        self.told = []
        self.reason = ''

    def period(self, velocities=None, *, states=True):
        self.now_s += DT
        if states:
            assert self.commander.set_joint_state(ARM.joint_names, self.place, [], self.now_s)
        if velocities is not None:
            self.commander.command(velocities, self.now_s)
        positions, self.reason = self.commander.update(self.now_s, DT)
        if positions is not None:
            self.told.append(positions)
            if not self.stuck:
                self.place = positions
        return positions


@pytest.fixture
def arm():
    return Follower(PositionCommander(ARM))


def test_nothing_is_commanded_before_states_and_a_command_have_come(arm):
    assert arm.period(states=False) is None
    assert 'no joint states yet' in arm.reason
    assert arm.period() is None
    assert 'no joint command' in arm.reason
    assert arm.period(np.zeros(ARM.dof), states=False) is not None


def test_positions_begin_where_the_arm_is_and_arrive_at_the_velocity(arm):
    wanted = 0.3 * ARM.limits.velocity
    for _ in range(100):
        arm.period(wanted)
    assert np.abs(arm.told[0] - START).max() < 1e-3
    np.testing.assert_allclose((arm.told[-1] - arm.told[-2]) / DT, wanted, rtol=1e-9)


@settings(deadline=None, max_examples=15, derandomize=True)
@given(seed=st.integers(0, 10_000))
def test_every_limit_is_kept_whatever_is_sent(seed):
    rng = np.random.default_rng(seed)
    arm = Follower(PositionCommander(ARM, ArmOptions(0.05, resume_required=False)))
    wanted = np.zeros(ARM.dof)
    for k in range(400):
        if k % 40 == 0:
            wanted = rng.uniform(-3.0, 3.0, ARM.dof) * ARM.limits.velocity
        arm.period(wanted if rng.random() < 0.9 else None)
    told = np.array([START, *arm.told])
    velocity = np.diff(told, axis=0) / DT
    acceleration = np.diff(velocity, axis=0, prepend=np.zeros((1, ARM.dof))) / DT
    assert np.all(told >= ARM.limits.lower) and np.all(told <= ARM.limits.upper)
    assert np.abs(velocity / ARM.limits.velocity).max() <= 1.0 + 1e-6
    assert np.abs(acceleration / ARM.limits.acceleration).max() <= 1.0 + 1e-6


def test_commands_that_stay_away_brake_the_arm_until_it_is_told_to_resume(arm):
    wanted = 0.3 * ARM.limits.velocity
    for _ in range(100):
        arm.period(wanted)
    before = len(arm.told) - 1
    for _ in range(200):
        if arm.period() is None:
            break
    stopping = np.array(arm.told[before:])
    speed = np.abs(np.diff(stopping, axis=0)).max(axis=1)
    assert speed[-1] < 1e-4  # rest is reached within the last period
    assert len(stopping) * DT < 0.05 + 1.5 * np.max(wanted / ARM.limits.acceleration)
    assert 'no command for 0.050 s' in arm.reason
    arm.place = arm.place + 0.02  # somebody moves it meanwhile
    assert arm.period(wanted) is None
    arm.commander.resume()
    first = arm.period(wanted)
    assert np.abs(first - arm.told[-2]).max() > 0.01
    assert np.abs(first - (arm.told[-2] + 0.02)).max() < 1e-3


def test_an_arm_that_does_not_follow_is_stopped_and_named(arm):
    arm.stuck = True
    for _ in range(400):
        arm.period(0.3 * ARM.limits.velocity)
    assert arm.commander.report.state is ArmState.STOPPED
    assert 'does not follow' in arm.reason
    ahead = np.abs(np.array(arm.told) - START).max()
    limit = PositionCommanderOptions().lead_limit_rad
    braking = (0.3 * ARM.limits.velocity) ** 2 / ARM.limits.acceleration
    assert limit < ahead < limit + np.max(braking) + 0.02


def test_joint_states_that_stay_away_brake_the_arm(arm):
    wanted = 0.3 * ARM.limits.velocity
    for _ in range(50):
        arm.period(wanted)
    for _ in range(100):
        arm.period(wanted, states=False)
    assert arm.commander.report.state is ArmState.STOPPED
    assert 'old' in arm.reason
    assert np.abs(arm.told[-1] - arm.told[-2]).max() < 1e-4


@pytest.mark.parametrize('wrong', [[0.1] * 6, [float('nan')] * 7, 'abc', []])
def test_wrong_commands_are_refused(arm, wrong):
    arm.period(np.zeros(ARM.dof))
    arm.commander.command(wrong, arm.now_s)
    assert arm.commander.report.refused == 1
    np.testing.assert_array_equal(arm.period(), START)


def test_names_with_a_prefix():
    commander = PositionCommander(ARM, joint_prefix='left_')
    assert not commander.set_joint_state(ARM.joint_names, START, [], 0.0)
    assert 'expected left_' in commander.update(0.0, DT).reason
    names = [f'left_{name}' for name in ARM.joint_names]
    assert commander.set_joint_state(names, START, [float('nan')] * 7, 0.0)
