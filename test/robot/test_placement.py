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

import math

from handover_dmp.mocap.data_set import read_data_set
from handover_dmp.mocap.filtering import condition
from handover_dmp.robot.collision import CollisionModel
from handover_dmp.robot.descriptions import example_robot_data_folder
from handover_dmp.robot.errors import UnreachableError
from handover_dmp.robot.model import BasePlacement, RobotModel
from handover_dmp.robot.placement import choose_base_placement
from handover_dmp.robot.priority_ik import PriorityIk
from handover_dmp.robot.tasks import WristTarget
import numpy as np
import pytest

DT = 0.005


@pytest.fixture(scope='module')
def lwr4():
    return RobotModel.load('lwr4')


def arc(length=0.5, turn=0.4, height=1.0):
    share = np.linspace(0.0, 1.0, 80)[:, None]
    eased = share**3 * (10 - 15 * share + 6 * share**2)
    towards = np.array([np.cos(turn), np.sin(turn), 0.3])
    return (
        [0.3, -0.4, height]
        + length * eased * towards / np.linalg.norm(towards)
        + 0.05 * np.sin(np.pi * eased) * [0.0, 0.0, 1.0]
    )


@pytest.mark.sample(2)
@pytest.mark.parametrize('robot', ['lwr4', 'iiwa14', 'panda', 'ur5'])
@pytest.mark.parametrize('length', [0.0, 0.4, 0.8])
def test_the_arm_follows_from_where_it_is_put(robot, length):
    arm = RobotModel.load(robot)
    path = arc(length)
    partner = path[-1] + [0.3, 0.1, 0.0]
    placed = arm.placed(choose_base_placement(path, arm, partner=partner))
    _followed(placed, path, max(1.6, 5.0 * length))
    ahead = (partner - path[0])[:2]
    if length < 0.6:  # a longer way ends out of reach from behind its start
        assert (path[0, :2] - placed.shoulder[:2]) @ ahead / np.linalg.norm(ahead) > 0.05
        distances = np.linalg.norm(path - placed.shoulder, axis=1)
        assert distances.max() < 0.95 * arm.reach_m


def test_the_ends_of_a_way_there_and_back_are_in_reach(lwr4):
    ends = [arc(0.4, turn) for turn in (-0.5, 0.1, 0.6)]
    path = np.vstack([part for there in ends for part in (there, there[::-1])])
    placed = lwr4.placed(choose_base_placement(path, lwr4, partner=np.array([0.9, -0.3, 1.2])))
    for there in ends:
        assert np.linalg.norm(there[-1] - placed.shoulder) < 0.9 * lwr4.reach_m


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('file', 'wrist', 'base', 'length'),
    [
        # an arm that hangs from a shoulder, one before a chest, one on the back of a robot that
        # walks, and one whose first joint slides
        ('simple_humanoid_description/urdf/simple_humanoid.urdf', 'r_wrist', 'torso', 0.35),
        ('g1_description/urdf/g1_29dof_rev_1_0.urdf', 'left_wrist_yaw_link', 'torso_link', 0.25),
        ('anymal_b_simple_description/robots/anymal-kinova.urdf', None, None, 0.6),
        ('tiago_description/robots/tiago_no_hand.urdf', None, None, 0.6),
    ],
)
def test_an_arm_is_put_where_its_own_body_leaves_it_room(file, wrist, base, length):
    path = arc(length)
    description = example_robot_data_folder() / 'robots' / file
    if not description.is_file():
        pytest.skip('an older example-robot-data, without this robot')
    arm = RobotModel.load(description, wrist_frame=wrist, base_frame=base)
    placed = arm.placed(choose_base_placement(path, arm))
    ik, bodies = PriorityIk(placed), CollisionModel.of(placed)
    posture, velocity = placed.inverse(path[0]), np.zeros(placed.dof)
    steps = 1000
    for step in range(steps):
        share = step / steps
        eased, rate = share**2 * (3 - 2 * share), 6 * share * (1 - share) / (steps * DT)
        i = eased * (len(path) - 1)
        at = np.array([np.interp(i, range(len(path)), path[:, k]) for k in range(3)])
        later = np.array([np.interp(i + 1e-3, range(len(path)), path[:, k]) for k in range(3)])
        speed = (later - at) / 1e-3 * rate * (len(path) - 1)
        assert np.linalg.norm(placed.wrist_pose(posture)[0] - at) < 0.005
        assert step % 50 or bodies.min_distance(posture) > 0.019
        velocity = ik.solve(posture, velocity, WristTarget(at, speed), DT).joint_velocity
        posture = posture + velocity * DT


def test_an_arm_that_moves_in_a_plane_alone(tmp_path):
    links = ''.join(f'<link name="l{i}"/>' for i in range(4))
    joints = ''.join(
        f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/><origin '
        'xyz="0.3 0 0"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="1" effort="9"/>'
        '</joint>'
        for i in range(3)
    )
    file = tmp_path / 'flat.urdf'
    file.write_text(f'<robot name="flat">{links}{joints}</robot>')
    arm = RobotModel.load(file)
    path = np.linspace([0.0, 0.0, 1.0], [0.1, 0.2, 1.1], 50)
    path[:, 0] += 0.1 * np.sin(np.linspace(0.0, np.pi, 50))
    with pytest.raises(UnreachableError, match=r'flat cannot .*: its wrist can hardly leave'):
        choose_base_placement(path, arm)


def test_does_not_depend_on_where_the_arm_stands_now(lwr4):
    path = arc()
    here = choose_base_placement(path, lwr4)
    there = choose_base_placement(path, lwr4.placed(BasePlacement((1.0, -2.0, 0.3), 2.0)))
    np.testing.assert_allclose(here.position, there.position, atol=1e-6)
    assert here.yaw == pytest.approx(there.yaw, abs=1e-6)


def test_turns_and_moves_with_the_way(lwr4):
    path = arc()
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    here = choose_base_placement(path, lwr4)
    there = choose_base_placement(path @ turn.T + [1.0, 2.0, 3.0], lwr4)
    np.testing.assert_allclose(
        there.position, turn @ np.array(here.position) + [1.0, 2.0, 3.0], atol=1e-6
    )
    turned = math.remainder(there.yaw - here.yaw - np.pi / 2, 2 * np.pi)
    assert turned == pytest.approx(0.0, abs=1e-6)


def test_names_what_is_missing(lwr4):
    path = np.linspace([0.0, 0.0, 1.0], [2.5, 0.0, 1.0], 50)
    with pytest.raises(
        UnreachableError, match=r'2\.50 m from any base placement: one point is 0\.\d+ m'
    ) as caught:
        choose_base_placement(path, lwr4)
    # half of its length cannot be more than the reach, from nowhere
    assert caught.value.missing_m >= 1.25 - lwr4.reach_m


@pytest.mark.sample(3)
@pytest.mark.parametrize('configuration', ['raw', 'p01', 'p02', 'p03', 'p04'])
def test_recorded_ways_of_people(kth_folder, lwr4, configuration):
    trials = [t for t in read_data_set(kth_folder) if t.configuration == configuration]
    for trial in trials[:: 1 if configuration == 'raw' else 5]:
        trial = condition(trial)
        placed = lwr4.placed(
            choose_base_placement(trial.demonstrator, lwr4, partner=trial.partner[-1])
        )
        # at half their speed, for some recordings start with the hand in full motion
        _followed(placed, trial.demonstrator, 2.0 * trial.duration_s)


def _followed(arm, path, duration_s):
    """Let the inverse kinematics follow a way; it never gets off it, and never to the limits."""
    ik = PriorityIk(arm)
    posture, velocity = arm.inverse(path[0]), np.zeros(arm.dof)
    times = np.linspace(0.0, duration_s, len(path))
    errors, ease = [], []
    for now in np.arange(0.0, duration_s, DT):
        # from rest to rest, whatever the recording does
        share = now / duration_s
        clock = duration_s * share**2 * (3 - 2 * share)
        at, later = (
            np.array([np.interp(t, times, path[:, i]) for i in range(3)])
            for t in (clock, min(clock + 6 * share * (1 - share) * 1e-3, duration_s))
        )
        reached, _ = arm.wrist_pose(posture)
        errors.append(np.linalg.norm(reached - at))
        solution = ik.solve(posture, velocity, WristTarget(at, (later - at) / 1e-3), DT)
        velocity = solution.joint_velocity
        posture = posture + velocity * DT
        ease.append(solution.smallest_singular_value)
        assert not any(name.endswith('position') for name in solution.active_limits)
    assert max(errors) < 0.005
    assert min(ease) > 0.08
