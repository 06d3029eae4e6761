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

from types import SimpleNamespace

from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.partner import Partner
from handover_dmp.robot.priority_ik import PriorityIk
from handover_dmp.robot.separation import SeparationLimit
from handover_dmp.robot.tasks import WristTarget
import numpy as np
import pytest

DT = 0.005
RULE = SeparationLimit(RobotModel.load('lwr4'), 0.3, 0.25, 1.0)


def test_partner_in_any_form():
    assert Partner.of(None) is None
    point = Partner.of([1.0, 2.0, 3.0])
    np.testing.assert_allclose(point.position, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(point.velocity, 0.0)
    estimate = SimpleNamespace(position=(1, 2, 3), velocity=(0.1, 0, 0), stamp_s=4.0)
    np.testing.assert_allclose(Partner.of(estimate).velocity, [0.1, 0.0, 0.0])
    assert Partner.of(estimate).elbow is None
    same = Partner(np.zeros(3), np.zeros(3), np.ones(3))
    assert Partner.of(same) is same


def test_who_brakes_at_the_deceleration_arrives_with_the_speed():
    """Follow V(d) towards a hand at rest and look at the deceleration that it takes."""
    distance, speeds = 1.5, []
    while distance > 0.25:
        speed = RULE.allowed(distance, DT)
        speeds.append(speed)
        distance -= speed * DT
    decelerations = -np.diff(speeds) / DT
    assert decelerations.max() <= 1.0 + 1e-9
    assert speeds[-1] == 0.25
    assert speeds[0] == pytest.approx(np.sqrt(0.25**2 + 2 * 1.2), abs=0.01)


def test_half_spaces_hold_exactly_what_the_ball_holds_along_the_command():
    rng = np.random.default_rng(0)
    for _ in range(300):
        wrist = rng.normal(size=3)
        hand = Partner(wrist + 0.2 * rng.normal(size=3), rng.normal(size=3) * 0.08)
        velocity = rng.normal(size=3) * rng.choice([0.1, 1.0])
        allowed = RULE.allowed(float(np.linalg.norm(hand.position - wrist)), DT)
        if np.linalg.norm(hand.velocity) > allowed:
            continue  # the hand breaks the rule, and to stand still is allowed nevertheless
        directions, bounds = RULE.rows(wrist, velocity, hand, DT)
        assert np.all(bounds >= 0.0)
        np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
        for share in np.linspace(0.0, 1.0, 21):
            relative = np.linalg.norm(share * velocity - hand.velocity)
            if np.all(directions @ (share * velocity) <= bounds + 1e-12):
                assert relative <= allowed + 1e-9
        # and nothing is taken away that the ball allows
        slow = 0.999 * min(1.0, _leaves(velocity, hand.velocity, allowed))
        assert np.all(directions @ (slow * velocity) <= bounds + 1e-9)


def test_standing_still_is_always_allowed():
    wrist, rushing = np.zeros(3), Partner(np.array([0.2, 0.0, 0.0]), np.array([-3.0, 1.0, 0.0]))
    _, bounds = RULE.rows(wrist, np.array([1.0, 0.0, 0.0]), rushing, DT)
    assert np.all(bounds >= 0.0)


@pytest.mark.parametrize('robot', ['lwr4', 'iiwa14', 'panda', 'ur5'])
def test_wrist_slows_down_on_its_way_to_the_hand(robot):
    arm = RobotModel.load(robot)
    start, _ = arm.wrist_pose(arm.home)
    hand = start + [-0.05, 0.55, -0.1]
    posture, speeds, distances = _reach(arm, hand, np.zeros(3), separation=True)
    near = distances <= RULE.separation_distance
    assert near.any() and distances[-1] < 0.005
    assert speeds[near].max() <= 0.25 + 1e-6
    assert np.all(speeds <= [RULE.allowed(d, DT) + 1e-6 for d in distances])
    _, free, _ = _reach(arm, hand, np.zeros(3), separation=False)
    assert free.max() > 1.5 * speeds[near].max(), 'the rule has nothing to do here'
    assert arm.limits.inside(posture)


def test_wrist_follows_a_receding_hand_at_the_speed_relative_to_it():
    arm = RobotModel.load('lwr4')
    start, _ = arm.wrist_pose(arm.home)
    away = np.array([0.0, 0.2, 0.0])
    _, speeds, distances = _reach(arm, start + [0.0, 0.15, 0.0], away, separation=True)
    within = distances <= RULE.separation_distance
    assert speeds[within].max() <= 0.25 + 1e-6
    assert distances[-1] < 0.01, 'it catches up, for which it must be faster than 0.25 m/s'


def test_near_a_hand_that_is_not_known_the_wrist_is_slow_everywhere():
    arm = RobotModel.load('lwr4')
    start, _ = arm.wrist_pose(arm.home)
    hand = start + [-0.05, 0.55, -0.1]
    _, speeds, distances = _reach(arm, hand, np.zeros(3), separation=True, seen=False)
    assert speeds.max() <= 0.25 + 1e-6
    assert distances[-1] < 0.005


def _reach(arm, hand, hand_velocity, *, separation, duration_s=3.0, seen=True):
    """Give the last posture, wrist speed relative to the hand, and distance at each start."""
    ik = PriorityIk(
        arm,
        separation=separation,
        separation_distance=RULE.separation_distance,
        separation_speed=RULE.separation_speed,
        separation_deceleration=RULE.separation_deceleration,
        self_collision=False,
    )
    posture, velocity = arm.home.copy(), np.zeros(arm.dof)
    speeds, distances = [], []
    for step in range(round(duration_s / DT)):
        at = hand + hand_velocity * min(step * DT, 1.0)
        moving = hand_velocity * (step * DT < 1.0)
        jacobian = arm.wrist_jacobian(posture)[:3].copy()
        wrist, _ = arm.wrist_pose(posture)
        target = WristTarget(at, moving + 1.5 * (at - wrist) / np.linalg.norm(at - wrist + 1e-9))
        if np.linalg.norm(at - wrist) < 0.05:
            target = WristTarget(at, moving)
        partner = Partner(at, moving) if seen else None
        solution = ik.solve(posture, velocity, target, DT, hand=partner)
        velocity = solution.joint_velocity
        speeds.append(np.linalg.norm(jacobian @ velocity - moving))
        distances.append(np.linalg.norm(at - wrist))
        posture = posture + velocity * DT
    return posture, np.array(speeds), np.array(distances)


def _leaves(velocity, hand, allowed):
    """Give the largest share of the command inside the ball, by bisection; 0 if none is."""
    shares = np.linspace(0.0, 1.0, 2001)
    inside = np.linalg.norm(shares[:, None] * velocity - hand, axis=1) <= allowed
    if not inside[0]:
        return 0.0
    return shares[max(np.argmin(inside) - 1, 0)] if not inside.all() else 1.0
