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

from dataclasses import replace

from handover_dmp.bench.ik_scenarios import follow, limit_drives, minimum_jerk_path
from handover_dmp.common.errors import UsageError
from handover_dmp.common.settings import defaults
from handover_dmp.robot.limits import VelocityBox
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.partner import Partner
from handover_dmp.robot.priority_ik import IkSolution, PriorityIk
from handover_dmp.robot.task_stack import TaskStack
from handover_dmp.robot.tasks import HalfSpace, WristTarget
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog, lsq_linear

DT = 0.005
ARMS = ('lwr4', 'iiwa14', 'panda', 'ur5')
PLAIN = {'self_collision': False, 'forearm_collision': False}


@pytest.fixture(scope='module', params=ARMS)
def arm(request):
    return RobotModel.load(request.param)


@pytest.fixture(scope='module')
def lwr4():
    return RobotModel.load('lwr4')


def follower(ik, orientation=None):
    def step(posture, velocity, position, speed):
        solution = ik.solve(posture, velocity, WristTarget(position, speed, orientation), DT)
        assert solution.solved
        return solution.joint_velocity, solution.speed_scale

    return step


def random_state(arm, rng):
    low = np.maximum(arm.limits.lower, -np.pi)
    high = np.minimum(arm.limits.upper, np.pi)
    posture = rng.uniform(low, high)
    at_limit = rng.random(arm.dof) < 0.2
    posture[at_limit] = np.where(rng.random(arm.dof) < 0.5, low, high)[at_limit]
    return posture


def test_every_level_is_the_best_that_the_levels_above_allow(arm):
    """
    Hold direction and speed against SciPy: bounded least squares, then a linear programme.

    The first gives the least miss of J q̇ = s·v inside the box; the second the greatest s among
    all that miss no more.
    """
    rng = np.random.default_rng(0)
    ik = PriorityIk(arm, **PLAIN)
    box = VelocityBox(arm.limits, ik.stack.braking_share)
    limited = 0
    for _ in range(60):
        posture = random_state(arm, rng)
        lower, upper = box.bounds(posture, np.zeros(arm.dof), DT)
        velocity = rng.uniform(lower, upper)
        jacobian = arm.wrist_jacobian(posture)[:3].copy()
        if (
            np.linalg.svd(jacobian, compute_uv=False)[-1]
            < defaults('priority_ik')['singularity_activation']
        ):
            continue  # there the wrist is asked for less than what is asked here
        position, _ = arm.wrist_pose(posture)
        asked = rng.normal(size=3) * rng.choice([0.02, 0.5, 3.0])
        solution = ik.solve(posture, velocity, WristTarget(position, asked), DT)
        lower, upper = box.bounds(posture, velocity, DT)
        rows = np.column_stack([jacobian, -asked])
        bounds = (np.append(lower, 0.0) - 1e-12, np.append(upper, 1.0) + 1e-12)
        best = lsq_linear(rows, np.zeros(3), bounds, tol=1e-14)
        minimum = np.sqrt(2.0 * best.cost)
        assert solution.residuals['position'] <= minimum + 1e-5
        miss = rows @ np.append(solution.joint_velocity, solution.speed_scale)
        fastest = linprog(
            np.append(np.zeros(arm.dof), -1.0),
            A_eq=rows,
            b_eq=miss,
            bounds=np.column_stack(bounds),
        )
        assert solution.speed_scale >= -fastest.fun - 1e-4
        limited += solution.speed_scale < 0.99
    assert limited >= 10


def test_orientation_takes_what_is_left(arm):
    """Among all with the same wrist velocity none turns the wrist better (least squares)."""
    rng = np.random.default_rng(1)
    ik = PriorityIk(arm, orientation='full', **PLAIN)
    box = VelocityBox(arm.limits, ik.stack.braking_share)
    limited = 0
    for _ in range(25):
        posture = arm.home + rng.uniform(-0.3, 0.3, arm.dof)
        velocity = rng.uniform(-0.1, 0.1, arm.dof)
        position, rotation = arm.wrist_pose(posture)
        jacobian = arm.wrist_jacobian(posture)
        asked = jacobian[:3] @ velocity + rng.normal(size=3) * 0.005
        turn = jacobian[3:] @ velocity + rng.normal(size=3) * 0.2
        target = WristTarget(position, asked, rotation, turn)
        solution = ik.solve(posture, velocity, target, DT)
        assert solution.residuals['position'] < 1e-6
        lower, upper = box.bounds(posture, velocity, DT)
        held = 1e4 * jacobian[:3]  # the wrist's velocity, as good as an equation
        best = lsq_linear(
            np.vstack([held, jacobian[3:]]),
            np.concatenate([held @ solution.joint_velocity, turn]),
            (lower - 1e-12, upper + 1e-12),
            tol=1e-15,
            max_iter=1000,
        )
        miss = np.linalg.norm(jacobian[3:] @ best.x - turn)
        assert solution.residuals['orientation'] <= miss + 1e-4
        limited += miss > 1e-3
    assert limited >= 5


@settings(max_examples=12, deadline=None)
@given(
    st.integers(0, 2**32 - 1), st.sampled_from(ARMS), st.sampled_from(['none', 'full', 'point'])
)
def test_no_limit_is_broken_and_no_step_fails(seed, robot, orientation):
    """Goals anywhere, jumping, in and out of reach; singular starts, starts at the limits."""
    arm = _loaded(robot)
    rng = np.random.default_rng(seed)
    ik = PriorityIk(
        arm,
        orientation=orientation,
        separation=bool(seed % 2),
        self_collision=seed % 3 == 0,
    )
    posture, velocity = random_state(arm, rng), np.zeros(arm.dof)
    if seed % 5 == 0:
        posture = np.clip(np.zeros(arm.dof), arm.limits.lower, arm.limits.upper)
    goal, speed = arm.shoulder, np.zeros(3)
    for step in range(120):
        if step % 30 == 0:
            goal = arm.shoulder + rng.normal(size=3) * arm.reach_m * 0.7
            speed = rng.normal(size=3) * rng.choice([0.0, 0.5, 3.0])
        goal = goal + speed * DT
        hand = Partner(goal + 0.1, speed, goal + [0.3, 0.0, 0.1]) if step % 40 < 30 else None
        target = WristTarget(goal, speed, np.eye(3))
        solution = ik.solve(posture, velocity, target, DT, hand=hand)
        assert solution.solved
        assert solution.residuals['limits'] <= 2e-6
        assert 0.0 <= solution.speed_scale <= 1.0
        _within_limits(arm, velocity, solution)
        velocity = solution.joint_velocity
        posture = posture + velocity * DT
        assert arm.limits.inside(posture, tolerance=1e-12)


@pytest.mark.sample(2)
@pytest.mark.parametrize('robot', ARMS)
def test_no_limit_is_broken_in_many_steps(robot):
    arm = _loaded(robot)
    rng = np.random.default_rng(7)
    ik = PriorityIk(arm)
    posture, velocity = arm.home.copy(), np.zeros(arm.dof)
    goal, speed = arm.shoulder, np.zeros(3)
    for step in range(4_000):
        if step % 500 == 0:
            posture, velocity = random_state(arm, rng), np.zeros(arm.dof)
        if step % 70 == 0:
            goal = arm.shoulder + rng.normal(size=3) * arm.reach_m * 0.7
            speed = rng.normal(size=3) * rng.choice([0.0, 0.5, 3.0])
        goal = goal + speed * DT
        solution = ik.solve(posture, velocity, WristTarget(goal, speed), DT)
        assert solution.solved and solution.residuals['limits'] <= 2e-6
        _within_limits(arm, velocity, solution)
        velocity = solution.joint_velocity
        posture = posture + velocity * DT
        assert arm.limits.inside(posture, tolerance=1e-12)


def test_half_spaces_always_leave_braking(arm):
    """Whatever hand and forearm do, the hardest braking is within every bound of level 1."""
    rng = np.random.default_rng(2)
    ik = PriorityIk(arm, separation=True)
    box = VelocityBox(arm.limits, ik.stack.braking_share)
    for _ in range(150):
        posture = random_state(arm, rng)
        lower, upper = box.bounds(posture, rng.uniform(-1, 1, arm.dof), DT)
        velocity = rng.uniform(lower, upper)
        position, _ = arm.wrist_pose(posture)
        hand = Partner(
            position + rng.normal(size=3) * 0.2,
            rng.normal(size=3) * 2.0,
            position + rng.normal(size=3) * 0.3,
        )
        goal = WristTarget(position + rng.normal(size=3), rng.normal(size=3))
        solution = ik.solve(posture, velocity, goal, DT, hand=hand)
        assert solution.solved and solution.residuals['limits'] <= 2e-6
        _within_limits(arm, velocity, solution)


def test_tracks_a_smooth_path_without_lag(arm):
    start, _ = arm.wrist_pose(arm.home)
    path = minimum_jerk_path(start, start + [0.1, 0.15, 0.1], 1.5)
    run = follow(arm, follower(PriorityIk(arm)), arm.home, path, 1.5)
    assert run.errors.max() < 2e-4
    assert run.scales.min() > 0.999


def test_is_not_stopped_by_a_joint_limit_while_there_is_a_way(lwr4):
    drives = limit_drives(lwr4, duration_s=4.0)
    assert len(drives) >= 4
    touched = 0
    for start, path, name in drives:
        run = follow(lwr4, follower(PriorityIk(lwr4, **PLAIN)), start, path, 4.5)
        assert run.errors.max() < 1e-4, name
        assert run.excess(lwr4)['position'] <= 1e-12
        touched += run.excess(lwr4)['position'] > -1e-3
    assert touched >= 2


@pytest.mark.parametrize('direction', [(1.0, 0.0, 0.2), (1.0, 0.5, 0.3), (0.3, 0.3, 1.0)])
def test_rests_at_the_end_of_its_reach(arm, direction):
    towards = np.array(direction) / np.linalg.norm(direction)
    start, _ = arm.wrist_pose(arm.home)
    path = minimum_jerk_path(start, arm.shoulder + (arm.reach_m + 0.05) * towards, 1.5)
    run = follow(arm, follower(PriorityIk(arm, **PLAIN)), arm.home, path, 5.0)
    nearest = arm.shoulder + arm.reach_m * towards
    assert np.linalg.norm(run.wrist[-1] - nearest) < 0.020
    assert run.rms_jerk(1.5) < 0.5
    assert np.abs(run.velocities[-1]).max() < 0.02


def test_comes_back_from_the_end_of_its_reach(arm):
    start, _ = arm.wrist_pose(arm.home)
    away = arm.shoulder + (arm.reach_m + 0.2) * np.array([0.8, 0.0, 0.6])
    out, back = minimum_jerk_path(start, away, 1.0), minimum_jerk_path(away, start, 1.0)

    def path(time_s):
        return out(time_s) if time_s < 2.0 else back(time_s - 2.0)

    run = follow(arm, follower(PriorityIk(arm, **PLAIN)), arm.home, path, 5.0)
    assert run.errors[-1] < 1e-4


@pytest.mark.parametrize('robot', ['lwr4', 'iiwa14'])
def test_leaves_a_straight_arm_of_its_own_accord(robot):
    """Upright and straight nothing can move the wrist down, to first order; the posture can."""
    arm = _loaded(robot)
    straight = np.zeros(arm.dof)
    top, _ = arm.wrist_pose(straight)
    path = minimum_jerk_path(top, top + [0.25, 0.0, -0.35], 1.5)
    run = follow(arm, follower(PriorityIk(arm)), straight, path, 5.0)
    assert run.errors[-1] < 1e-4


def test_too_fast_a_path_is_left_by_little_and_by_less_with_phase_stopping(lwr4):
    start, _ = lwr4.wrist_pose(lwr4.home)
    ends = start + [-0.1, -0.25, 0.0], start + [0.1, 0.25, 0.1]
    path = minimum_jerk_path(*ends, 0.6, bulge=np.array([0.0, 0.0, 0.05]))
    curve = np.array([path(time)[0] for time in np.linspace(0.0, 0.6, 1500)])
    posture = lwr4.inverse(ends[0])
    deviations = []
    for stopping in (False, True):
        ik = PriorityIk(lwr4, **PLAIN)
        run = follow(lwr4, follower(ik), posture, path, 2.0, phase_stopping=stopping)
        assert run.scales.min() < 0.8
        assert run.errors[-1] < 1e-4
        deviations.append(max(np.linalg.norm(curve - w, axis=1).min() for w in run.wrist))
    assert deviations[0] < 0.015 and deviations[1] < 0.010


@pytest.mark.sample(3)
@pytest.mark.parametrize('orientation', ['full', 'level', 'upright', 'point'])
def test_orientation_does_not_disturb_the_position(arm, orientation):
    # a period this short, for between two answers an ideal arm leaves the straight line by an
    # amount of second order in it, which depends on the way of the joints
    dt = 0.0005
    start, rotation = arm.wrist_pose(arm.home)
    path = minimum_jerk_path(start, start + [0.03, 0.035, 0.02], 0.5)
    hand = start + [0.6, 0.3, 0.0]
    errors = []
    for kind in ('none', orientation):
        ik = PriorityIk(arm, orientation=kind, orientation_speed=0.1, position_gain=100.0, **PLAIN)
        posture, velocity, missed = arm.home.copy(), np.zeros(arm.dof), []
        for step in range(1200):
            position, speed = path(step * dt)
            target = WristTarget(position, speed, rotation)
            solution = ik.solve(posture, velocity, target, dt, hand=hand)
            velocity = solution.joint_velocity
            posture = posture + velocity * dt
            reached, _ = arm.wrist_pose(posture)
            missed.append(np.linalg.norm(reached - path((step + 1) * dt)[0]))
        errors.append(np.array(missed))
    np.testing.assert_allclose(errors[0], errors[1], atol=1e-6)


@pytest.mark.parametrize('orientation', ['full', 'level', 'upright', 'point'])
def test_orientation_is_reached_where_the_joints_allow_it(arm, orientation):
    ik = PriorityIk(arm, orientation=orientation, self_collision=False)
    position, home = arm.wrist_pose(arm.home)
    position, home = position.copy(), home.copy()
    hand = position + home @ [0.2, 0.1, 0.6]
    axis = home @ [0.6, 0.0, 0.8]
    rotation = pin.exp3(0.3 * axis) @ home
    posture, velocity = arm.home.copy(), np.zeros(arm.dof)
    if orientation == 'level':
        posture = arm.inverse(position, rotation, q0=arm.home)
    for _ in range(700):
        solution = ik.solve(
            posture, velocity, WristTarget(position, rotation=rotation), DT, hand=hand
        )
        velocity = solution.joint_velocity
        posture = posture + velocity * DT
    reached, turned = arm.wrist_pose(posture)
    np.testing.assert_allclose(reached, position, atol=1e-5)
    off = {
        'full': np.linalg.norm(pin.log3(turned.T @ rotation)),
        'level': np.arccos(np.clip((turned @ home.T)[2, 2], -1, 1)),
        'upright': np.arccos(np.clip((turned @ rotation.T)[2, 2], -1, 1)),
        'point': np.linalg.norm(
            np.cross(turned[:, 2], (hand - position) / np.linalg.norm(hand - position))
        ),
    }[orientation]
    assert off < 0.01


@pytest.mark.parametrize('orientation', ['full', 'level', 'upright', 'point'])
def test_orientation_changes_no_wrist_velocity(arm, orientation):
    """Step by step, from the same state: the wrist's velocity with the task and without it."""
    rng = np.random.default_rng(3)
    kinds = [PriorityIk(arm, orientation=kind, **PLAIN) for kind in ('none', orientation)]
    for _ in range(40):
        posture = arm.home + rng.uniform(-0.4, 0.4, arm.dof)
        velocity = rng.uniform(-0.3, 0.3, arm.dof)
        jacobian = arm.wrist_jacobian(posture)[:3].copy()
        position, _ = arm.wrist_pose(posture)
        asked = jacobian @ velocity + rng.normal(size=3) * 0.01
        target = WristTarget(position, asked, np.eye(3))
        solutions = [k.solve(posture, velocity, target, DT, hand=np.ones(3)) for k in kinds]
        moved = [jacobian @ solution.joint_velocity for solution in solutions]
        if solutions[0].residuals['position'] < 1e-9 and solutions[0].speed_scale > 1 - 1e-9:
            np.testing.assert_allclose(moved[0], moved[1], atol=1e-6)


def test_the_wrist_is_slowed_along_its_way_where_it_could_not_stay_level(arm):
    rng = np.random.default_rng(5)
    usual, level = (
        PriorityIk(arm, orientation='upright', orientation_slows_to=share, **PLAIN)
        for share in (1.0, 0.25)
    )
    slowed = 0
    for _ in range(60):
        posture = arm.home + rng.uniform(-0.3, 0.3, arm.dof)
        position, rotation = arm.wrist_pose(posture)
        linear = arm.wrist_jacobian(posture)[:3].copy()
        target = WristTarget(position, rng.normal(size=3), rotation)
        # so much time that no acceleration limit counts
        late, there = (k.solve(posture, np.zeros(arm.dof), target, 0.5) for k in (usual, level))
        share = there.speed_scale
        moved = linear @ there.joint_velocity
        np.testing.assert_allclose(moved, share * target.velocity, atol=1e-5)
        assert share >= min(0.25, late.speed_scale) - 1e-6
        assert there.residuals['orientation'] <= late.residuals['orientation'] + 1e-6
        if late.residuals['orientation'] > 0.05 and share > 0.26:
            slowed += 1
            assert share < late.speed_scale
            assert there.residuals['orientation'] < 1e-4
    assert slowed >= 3


@pytest.mark.parametrize('robot', ['lwr4', 'iiwa14', 'panda'])
def test_redundancy_brings_the_arm_home(robot):
    """With the wrist held, what is free goes towards home and off the limits."""
    arm = _loaded(robot)
    rng = np.random.default_rng(4)
    start = arm.inverse(arm.wrist_pose(arm.home)[0], q0=arm.home + rng.uniform(-1, 1, arm.dof))
    position, _ = arm.wrist_pose(start)
    run = follow(
        arm, follower(PriorityIk(arm, **PLAIN)), start, lambda _: (position, np.zeros(3)), 4.0
    )
    assert run.errors.max() < 2e-4
    before, after = (np.linalg.norm(run.joints[i] - arm.home) for i in (0, -1))
    assert after < 0.7 * before


def test_elbow_moves_away_from_the_partner(lwr4):
    position, _ = lwr4.wrist_pose(lwr4.home)
    lwr4.wrist_pose(lwr4.home)
    elbow = lwr4.pinocchio_data.oMi[4].translation.copy()
    hand = elbow + [0.05, 0.2, 0.0]
    apart = []
    for seen in (hand, None):
        ik = PriorityIk(lwr4, **PLAIN)
        posture, velocity = lwr4.home.copy(), np.zeros(7)
        for _ in range(400):
            solution = ik.solve(posture, velocity, WristTarget(position), DT, hand=seen)
            velocity = solution.joint_velocity
            posture = posture + velocity * DT
        reached, _ = lwr4.wrist_pose(posture)
        np.testing.assert_allclose(reached, position, atol=1e-4)
        apart.append(np.linalg.norm(lwr4.pinocchio_data.oMi[4].translation - hand))
    assert apart[0] > apart[1] + 0.03


def test_names_what_holds_it_back(lwr4):
    ik = PriorityIk(lwr4, **PLAIN)
    position, _ = lwr4.wrist_pose(lwr4.home)
    rush = WristTarget(position, np.array([0.0, 3.0, 0.0]))
    first = ik.solve(lwr4.home, np.zeros(7), rush, DT)
    assert any(name.endswith('acceleration') for name in first.active_limits)
    assert first.speed_scale < 0.2 and first.residuals['speed'] == 1.0 - first.speed_scale
    posture, velocity, names = lwr4.home.copy(), np.zeros(7), set()
    for _ in range(100):
        solution = ik.solve(posture, velocity, rush, DT)
        velocity = solution.joint_velocity
        posture = posture + velocity * DT
        names |= set(solution.active_limits)
    assert any(name.endswith('velocity') for name in names)
    at_rest = ik.solve(lwr4.home, np.zeros(7), WristTarget(position), DT)
    assert at_rest.active_limits == () and at_rest.speed_scale == pytest.approx(1.0)
    edge = lwr4.home.copy()
    edge[3] = lwr4.limits.upper[3]
    jacobian = lwr4.wrist_jacobian(edge)[:3]
    wanted = WristTarget(lwr4.wrist_pose(edge)[0], 0.01 * jacobian[:, 3])
    lazy = PriorityIk(lwr4, posture_gain=0.0)
    assert 'joint_4 position' in lazy.solve(edge, np.zeros(7), wanted, DT).active_limits


def test_brakes_to_a_standstill(arm):
    ik = PriorityIk(arm)
    velocity = 0.8 * arm.limits.velocity
    posture = arm.home.copy()
    periods = int(np.ceil((velocity / arm.limits.acceleration).max() / DT)) + 1
    for _ in range(periods):
        slower = ik.brake(posture, velocity, DT)
        assert np.all(np.abs(slower - velocity) <= arm.limits.acceleration * DT + 1e-12)
        velocity = slower
        posture = posture + velocity * DT
    np.testing.assert_array_equal(velocity, 0.0)


def test_depends_on_nothing_but_its_arguments(lwr4):
    rng = np.random.default_rng(6)
    used, states = PriorityIk(lwr4), []
    for _ in range(30):
        posture = lwr4.home + rng.uniform(-0.5, 0.5, 7)
        velocity = rng.uniform(-0.2, 0.2, 7)
        goal = WristTarget(rng.normal(size=3), rng.normal(size=3))
        states.append((posture, velocity, goal))
    first = [used.solve(*state, DT).joint_velocity for state in states]
    again = [used.solve(*state, DT).joint_velocity for state in reversed(states)][::-1]
    for one, other, state in zip(first, again, states, strict=True):
        np.testing.assert_array_equal(one, other)
        fresh = PriorityIk(lwr4).solve(*state, DT)
        assert isinstance(fresh, IkSolution)
        np.testing.assert_allclose(fresh.joint_velocity, one, atol=1e-9)


def test_refuses_an_orientation_that_it_does_not_know(lwr4):
    with pytest.raises(
        UsageError, match="orientation is 'sideways', not one of none, full, level, upright, point"
    ):
        PriorityIk(lwr4, orientation='sideways')


def test_refuses_a_parameter_that_it_does_not_know(lwr4):
    with pytest.raises(UsageError, match='priority_ik has no parameter speed'):
        PriorityIk(lwr4, speed=1.0)


def _within_limits(arm, before, solution):
    velocity = solution.joint_velocity
    assert np.all(np.abs(velocity) <= arm.limits.velocity * (1 + 1e-12))
    change = np.abs(velocity - before)
    assert np.all(change <= arm.limits.acceleration * DT * (1 + 1e-9) + 1e-14)


_arms: dict[str, RobotModel] = {}


def _loaded(robot):
    if robot not in _arms:
        _arms[robot] = RobotModel.load(robot)
    return _arms[robot]


class _Wall:
    """A limit of a user's own: the wrist goes no further along x."""

    def __init__(self, x):
        self.x = x

    def half_spaces(self, period):
        room = max(self.x - period.position[0], 0.0)
        return [HalfSpace('wall', -period.linear[0], -5.0 * room)]


def test_takes_a_limit_of_a_users_own(lwr4):
    wrist, _ = lwr4.wrist_pose(lwr4.home)
    path = minimum_jerk_path(wrist, wrist + [0.2, 0.1, 0.0], 1.5)
    stack = TaskStack.configured(lwr4, **PLAIN)
    ik = PriorityIk(lwr4, replace(stack, limits=(_Wall(wrist[0] + 0.1),)))
    run = follow(lwr4, follower(ik), lwr4.home, path, 2.0)
    assert run.wrist[:, 0].max() < wrist[0] + 0.1 + 1e-3
    solution = ik.solve(run.joints[-1], run.velocities[-1], WristTarget(run.targets[-1]), DT)
    assert 'wall' in solution.active_limits


class _Spin:
    """A task of a user's own: the last joint turns at a speed."""

    name = 'spin'

    def __init__(self, dof, speed):
        self.row, self.speed = np.eye(dof)[-1:], np.array([speed])

    def rows(self, period):
        return self.row, self.speed


def test_takes_a_task_of_a_users_own_below_the_wrist(lwr4):
    stack = TaskStack.configured(lwr4, **PLAIN)
    stack = replace(stack, levels=(*stack.levels, (_Spin(lwr4.dof, 0.3),)))
    wrist, _ = lwr4.wrist_pose(lwr4.home)
    run = follow(
        lwr4, follower(PriorityIk(lwr4, stack)), lwr4.home, lambda _: (wrist, np.zeros(3)), 1.0
    )
    assert run.velocities[-1, -1] == pytest.approx(0.3, abs=1e-4)
    assert run.errors.max() < 1e-5
