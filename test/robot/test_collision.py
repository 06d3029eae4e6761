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

from handover_dmp.robot.collision import CollisionModel, link_capsules
from handover_dmp.robot.model import BasePlacement, RobotModel
from handover_dmp.robot.partner import Partner
from handover_dmp.robot.priority_ik import PriorityIk
from handover_dmp.robot.tasks import WristTarget
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize

DT = 0.005


@pytest.fixture(scope='module', params=('lwr4', 'iiwa14', 'panda', 'ur5'))
def arm(request):
    return RobotModel.load(request.param, base=BasePlacement((0.2, -0.1, 0.4), 0.7))


@pytest.fixture(scope='module')
def bodies(arm):
    return CollisionModel(arm)


def postures(arm, count, seed=0):
    low = np.maximum(arm.limits.lower, -np.pi)
    high = np.minimum(arm.limits.upper, np.pi)
    return np.random.default_rng(seed).uniform(low, high, (count, arm.dof))


def test_capsules_hold_the_geometry_of_the_description(arm):
    geometry = pin.buildGeomFromUrdfString(
        arm.pinocchio_model,
        arm.chain_text,
        pin.GeometryType.COLLISION,
        package_dirs=[str(folder) for folder in arm.urdf_path.parents],
    )
    capsules = link_capsules(arm)
    for item in geometry.geometryObjects:
        if not hasattr(item.geometry, 'vertices'):
            continue
        points = np.array([item.placement.act(p) for p in np.array(item.geometry.vertices())])
        inside = np.zeros(len(points), dtype=bool)
        for capsule in capsules:
            if capsule.joint == item.parentJoint:
                inside |= _from_axis(points, capsule) <= capsule.radius + 1e-9
        assert inside.all()


def test_distances_agree_with_a_search_along_both_axes(arm, bodies):
    for posture in postures(arm, 4):
        jacobian = _joints(arm, posture)
        near = {pair.name: pair for pair in _all_pairs(bodies, jacobian)}
        for i, j in bodies.pairs:
            first, second = bodies.capsules[i], bodies.capsules[j]
            distance = _distance(arm, first, second)
            if distance > 0.0:
                name = f'{first.name} to {second.name}'
                if (
                    sum(
                        bodies.capsules[a].name == first.name
                        and bodies.capsules[b].name == second.name
                        for a, b in bodies.pairs
                    )
                    == 1
                ):
                    assert near[name].distance == pytest.approx(distance, abs=1e-5)


def test_rows_agree_with_finite_differences(arm, bodies):
    step = 1e-6
    for posture in postures(arm, 6, seed=1):
        pairs = _all_pairs(bodies, _joints(arm, posture))
        for joint in range(arm.dof):
            moved = posture.copy()
            moved[joint] += step
            after = _all_pairs(bodies, _joints(arm, moved))
            for pair in pairs:
                same = [p for p in after if p.name == pair.name]
                if len(same) != 1 or pair.distance < 0.005:
                    continue
                change = (same[0].distance - pair.distance) / step
                assert pair.row[joint] == pytest.approx(change, abs=2e-4)


def test_no_pair_is_overlooked(arm):
    """On a random walk every pair that is left out could not have been too fast, at any speed."""
    bodies = CollisionModel(arm)
    rng = np.random.default_rng(2)
    posture, found_any = arm.home.copy(), 0
    for _ in range(200):
        posture = np.clip(
            posture + rng.normal(size=arm.dof) * 0.03, arm.limits.lower, arm.limits.upper
        )
        fastest = arm.limits.velocity * rng.uniform(0.0, 1.0, arm.dof)
        jacobian = _joints(arm, posture)
        found = bodies.near_pairs(jacobian, _allowed, fastest)
        rates = {(pair.name, round(pair.distance, 9)) for pair in found}
        found_any += len(found)
        for pair in _all_pairs(bodies, jacobian):
            if (pair.name, round(pair.distance, 9)) not in rates:
                assert np.abs(pair.row) @ fastest <= _allowed(pair.distance) + 1e-9
    assert found_any > 0 or arm.name == 'lwr4'  # which is slim, and hardly ever near itself


def test_forearm_distance_and_row(arm, bodies):
    rng = np.random.default_rng(3)
    moving = np.array([0.1, -0.2, 0.3])
    for posture in postures(arm, 5, seed=4):
        hand = arm.shoulder + rng.normal(size=3) * 0.4
        elbow = hand + np.array([0.2, 0.1, 0.1])
        pairs = bodies.near_forearm(_joints(arm, posture), hand, elbow, moving, 2.0)
        joint = int(rng.integers(arm.dof))
        moved = posture.copy()
        moved[joint] += 1e-6
        after = bodies.near_forearm(_joints(arm, moved), hand, elbow, moving, 2.0)
        shift = 1e-6 * moving
        _joints(arm, posture)
        drifted = bodies.near_forearm(
            _joints(arm, posture), hand + shift, elbow + shift, moving, 2.0
        )
        assert len(pairs) == len(after) == len(drifted) > 0
        for pair, other, later in zip(pairs, after, drifted, strict=True):
            if pair.distance < 0.01:
                continue
            assert pair.row[joint] == pytest.approx(
                (other.distance - pair.distance) / 1e-6, abs=2e-4
            )
            assert pair.drift == pytest.approx((later.distance - pair.distance) / 1e-6, abs=2e-4)


@pytest.mark.parametrize('robot', ['lwr4', 'panda', 'ur5'])
def test_the_arm_never_touches_itself(robot):
    """Goals in its own body, as fast as it can: it stays apart where it would collide without."""
    arm = RobotModel.load(robot)
    ik = PriorityIk(arm, forearm_collision=False)
    bodies = CollisionModel(arm)
    rng = np.random.default_rng(5)
    minimum = np.inf
    for _ in range(8):
        goal = arm.shoulder + rng.normal(size=3) * [0.12, 0.12, 0.2] - [0.0, 0.0, 0.15]
        minimum = min(minimum, _min_distance(arm, ik, bodies, goal))
    assert minimum > 0.005


def test_without_the_rows_it_would_touch():
    arm = RobotModel.load('ur5')
    blind = PriorityIk(arm, forearm_collision=False, self_collision=False)
    goal = arm.shoulder + [0.05, 0.0, -0.1]
    assert _min_distance(arm, blind, CollisionModel(arm), goal) < -0.01


def _min_distance(arm, ik, bodies, goal):
    posture, velocity, minimum = arm.home.copy(), np.zeros(arm.dof), np.inf
    for _ in range(200):
        solution = ik.solve(posture, velocity, WristTarget(goal), DT)
        assert solution.solved and solution.residuals['limits'] < 2e-6
        velocity = solution.joint_velocity
        posture = posture + velocity * DT
        minimum = min(minimum, bodies.min_distance(posture))
    return minimum


def test_the_arm_keeps_off_the_forearm_but_not_off_the_hand():
    arm = RobotModel.load('lwr4')
    bodies = CollisionModel(arm)
    start, _ = arm.wrist_pose(arm.home)
    goal = start + [0.1, 0.0, -0.1]
    elbow = arm.shoulder + [0.25, 0.0, 0.15]  # a forearm that lies where the arm's own would go
    partner = Partner(goal, np.zeros(3), elbow)
    minimum = []
    for avoid in (True, False):
        ik = PriorityIk(arm, forearm_collision=avoid, self_collision=False)
        posture, velocity = arm.home.copy(), np.zeros(arm.dof)
        distances = []
        for _ in range(600):
            solution = ik.solve(posture, velocity, WristTarget(goal), DT, hand=partner)
            velocity = solution.joint_velocity
            posture = posture + velocity * DT
            pairs = bodies.near_forearm(_joints(arm, posture), goal, elbow, np.zeros(3), 2.0)
            distances.append(min(pair.distance for pair in pairs))
        minimum.append(min(distances[100:]))
    assert minimum[0] > minimum[1]


def _allowed(distance):
    return np.sqrt(3.0 * np.maximum(distance - 0.02, 0.0))


def _all_pairs(bodies, jacobian):
    return bodies.near_pairs(jacobian, lambda _distance: -1.0, np.zeros(jacobian.shape[1]))


def _joints(arm, posture):
    return pin.computeJointJacobians(arm.pinocchio_model, arm.pinocchio_data, posture)


def _from_axis(points, capsule):
    axis = capsule.end - capsule.start
    share = np.clip((points - capsule.start) @ axis / max(axis @ axis, 1e-18), 0.0, 1.0)
    return np.linalg.norm(points - capsule.start - share[:, None] * axis, axis=1)


def _distance(arm, first, second):
    poses = arm.pinocchio_data.oMi
    a, b = (poses[first.joint].act(end) for end in (first.start, first.end))
    c, d = (poses[second.joint].act(end) for end in (second.start, second.end))

    def square(shares):
        s, t = shares
        apart = a + s * (b - a) - c - t * (d - c)
        return apart @ apart

    found = minimize(
        square, [0.5, 0.5], bounds=[(0, 1), (0, 1)], options={'ftol': 1e-16, 'gtol': 1e-12}
    )
    return np.sqrt(found.fun) - first.radius - second.radius
