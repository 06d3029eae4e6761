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

"""What the arm is told when inputs are incomplete, permuted, late or wrong."""

from __future__ import annotations

from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.partner import Partner
from handover_dmp.robot.priority_ik import PriorityIk
from handover_dmp.robot.tasks import WristTarget
from handover_dmp.robot.wrist_controller import WristController, WristControllerOptions
import numpy as np
from numpy.typing import NDArray
import pytest

PERIOD_S = 0.005


@pytest.fixture(scope='module')
def robot() -> RobotModel:
    return RobotModel.load('lwr4')


@pytest.fixture
def controller(robot: RobotModel) -> WristController:
    return WristController(
        robot, PriorityIk(robot), WristControllerOptions(0.05, 0.05, 0.1, 0.0005)
    )


def target_beside(robot: RobotModel) -> WristTarget:
    place, _ = robot.wrist_pose(robot.home)
    return WristTarget(place + [0.0, 0.1, 0.0], np.zeros(3))


def test_joint_states_may_come_in_any_order_and_with_others(
    robot: RobotModel, controller: WristController
) -> None:
    controller.set_target(target_beside(robot), 0.0)
    names, home = list(robot.joint_names), list(robot.home)
    assert controller.set_joint_state(names, home, [0.0] * robot.dof, 0.0)
    plain = controller.update(0.0, PERIOD_S).velocities
    controller.reset()
    controller.set_target(target_beside(robot), 0.0)
    order = np.random.default_rng(1).permutation(robot.dof + 1)
    mixed_names = np.array([*names, 'finger'])[order].tolist()
    mixed = np.array([*home, 99.0])[order]
    assert controller.set_joint_state(mixed_names, mixed, np.zeros(robot.dof + 1), 0.0)
    assert np.array_equal(controller.update(0.0, PERIOD_S).velocities, plain)
    assert np.abs(plain).max() > 0.0


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        (lambda names, q, v: (names[1:], q[1:], v[1:]), 'lack'),
        (lambda names, q, v: (names[:-1] + ['unknown'], q, v), 'lack'),
        (lambda names, q, v: ([names[1], *names], [0.0, *q], [0.0, *v]), 'twice'),
        (lambda names, q, v: (names, q[1:], v), 'positions'),
        (lambda names, q, v: (names, q, v[1:]), 'velocity has'),
        (lambda names, q, v: (names, [float('nan'), *q[1:]], v), 'not finite'),
        (lambda names, q, v: (names, q, [float('inf'), *v[1:]]), 'not finite'),
    ],
)
def test_wrong_joint_states_stop_the_commands_and_say_why(
    robot: RobotModel, controller: WristController, change: object, reason: str
) -> None:
    names, home, still = list(robot.joint_names), list(robot.home), [0.0] * robot.dof
    controller.set_joint_state(names, home, still, 0.0)
    controller.set_target(target_beside(robot), 0.0)
    moving = controller.update(0.0, PERIOD_S).velocities
    assert moving is not None
    wrong = change(names, home, still)  # type: ignore[operator]
    assert not controller.set_joint_state(*wrong, 0.005)
    assert_comes_to_rest(controller, moving, 0.005, reason)
    assert controller.set_joint_state(names, home, still, 0.01)
    assert controller.update(0.01, PERIOD_S).velocities is not None


def test_joint_states_of_others_are_named_until_those_of_the_arm_have_come(
    robot: RobotModel, controller: WristController
) -> None:
    names, home = list(robot.joint_names), list(robot.home)
    controller.set_target(target_beside(robot), 0.0)
    assert not controller.set_joint_state(['finger'], [0.1], [], 0.0)
    assert 'name finger; expected' in controller.update(0.0, PERIOD_S).reason
    assert controller.set_joint_state(names, home, [float('nan')] * robot.dof, 0.0)
    assert not controller.set_joint_state(['finger'], [0.1], [], 0.0)
    assert controller.update(0.0, PERIOD_S).reason == ''


def test_stale_joint_states_stop_the_commands(
    robot: RobotModel, controller: WristController
) -> None:
    controller.set_joint_state(list(robot.joint_names), robot.home, np.zeros(robot.dof), 0.0)
    controller.set_target(target_beside(robot), 0.06)
    moving = controller.update(0.049, PERIOD_S).velocities
    assert moving is not None
    assert_comes_to_rest(controller, moving, 0.06, 'old')


@pytest.mark.parametrize(
    'changes',
    [
        {'braking_share': 0.9},
        {'orientation': 'level'},
        {'position_gain': 80.0},
        {'posture_gain': 10.0},
        {'limit_margin': 0.5},
        {'self_collision': False},
    ],
)
def test_changed_tasks_do_not_jump(
    robot: RobotModel, controller: WristController, changes: dict[str, object]
) -> None:
    """The acceleration limits of the joints hold from the last command of the old tasks on."""
    names, positions, velocities = list(robot.joint_names), robot.home, np.zeros(robot.dof)
    commands = [velocities]
    for k in range(200):
        now_s = k * PERIOD_S
        if k == 40:
            assert np.abs(velocities).max() > 0.1, 'in motion'
            controller.ik = PriorityIk(robot, **changes)  # type: ignore[arg-type]
        controller.set_joint_state(names, positions, velocities, now_s)
        controller.set_target(target_beside(robot), now_s)
        answer = controller.update(now_s, PERIOD_S).velocities
        assert answer is not None
        velocities = answer
        positions = positions + PERIOD_S * velocities
        commands.append(velocities)
    change = np.abs(np.diff(commands, axis=0)) / PERIOD_S
    assert np.all(change <= robot.limits.acceleration * (1 + 1e-6))


def assert_comes_to_rest(
    controller: WristController, moving: NDArray[np.float64], now_s: float, reason: str
) -> None:
    """Assert that blind braking keeps the limits, ends at zero, and then is silent."""
    maximum = controller.model.limits.acceleration * PERIOD_S
    assert moving.any()
    while True:
        answer = controller.update(now_s, PERIOD_S)
        assert reason in answer.reason
        if answer.velocities is None:
            break
        assert np.all(np.abs(answer.velocities - moving) <= maximum + 1e-12)
        assert np.sum(np.abs(answer.velocities)) < np.sum(np.abs(moving))
        moving, now_s = answer.velocities, now_s + PERIOD_S
    assert not moving.any()


def test_a_stale_command_brakes_within_the_acceleration_limit(
    robot: RobotModel, controller: WristController
) -> None:
    q = robot.home.copy()
    previous = np.zeros(robot.dof)
    place, _ = robot.wrist_pose(q)
    fastest = 0.0
    for k in range(200):
        now = k * PERIOD_S
        controller.set_joint_state(list(robot.joint_names), q, previous, now)
        if k < 60:
            moved = place + [0.0, 0.3 * now, 0.0]
            controller.set_target(WristTarget(moved, np.array([0.0, 0.3, 0.0])), now)
        answer = controller.update(now, PERIOD_S)
        assert answer.velocities is not None
        change = np.abs(answer.velocities - previous) / PERIOD_S
        assert np.all(change <= robot.limits.acceleration * (1 + 1e-9))
        fastest = max(fastest, float(np.abs(answer.velocities).max()))
        previous = answer.velocities
        q = q + previous * PERIOD_S
        if k == 71:
            assert 'old' in answer.reason
    assert fastest > 0.1
    assert np.abs(previous).max() == 0.0


@pytest.mark.parametrize('bad', [float('nan'), float('inf')])
def test_a_target_that_is_not_finite_is_refused(
    robot: RobotModel, controller: WristController, bad: float
) -> None:
    assert not controller.set_target(WristTarget(np.array([bad, 0.0, 0.0])), 0.0)
    assert not controller.set_target(WristTarget(np.zeros(3), np.array([bad, 0.0, 0.0])), 0.0)
    assert not controller.set_target(WristTarget(np.zeros(3), rotation=np.diag([bad] * 3)), 0.0)


def test_tells_how_near_to_singular_it_is_while_braking_too(
    controller: WristController, robot: RobotModel
) -> None:
    controller.set_joint_state(robot.joint_names, robot.home, np.zeros(robot.dof), 0.0)
    answer = controller.update(0.0, 0.005)
    assert answer.reason == 'no wrist command yet'
    minimum = np.linalg.svd(robot.wrist_jacobian(robot.home)[:3], compute_uv=False)[-1]
    assert answer.status_values(0.0)['smallest_singular_value'] == pytest.approx(minimum, rel=1e-6)
    controller.set_joint_state(robot.joint_names, robot.home * np.nan, np.zeros(robot.dof), 0.0)
    assert np.isnan(controller.update(0.0, 0.005).status_values(0.0)['smallest_singular_value'])


def test_keeps_off_a_forearm_while_its_elbow_is_known(robot: RobotModel) -> None:
    """As the inverse kinematics does that is told of the elbow itself; until that is too old."""
    controller = WristController(robot, PriorityIk(robot, self_collision=False))
    hand = robot.wrist_pose(robot.home)[0] + [0.1, 0.0, -0.1]
    # a forearm that lies where that of the arm would go
    elbow = robot.shoulder + [0.25, 0.0, 0.15]
    target, partner = WristTarget(hand, np.zeros(3)), Partner(hand, np.zeros(3), elbow)

    def held(limits: tuple[str, ...]) -> set[str]:
        return {limit for limit in limits if 'to forearm' in limit}

    positions, velocities, told = robot.home, np.zeros(robot.dof), ()
    for _ in range(400):
        solution = controller.ik.solve(positions, velocities, target, PERIOD_S, hand=partner)
        told = solution.active_limits
        if held(told):
            break
        velocities = solution.joint_velocity
        positions = positions + PERIOD_S * velocities
    assert held(told)

    def answer(now_s: float, elbow_of_s: float | None) -> set[str]:
        controller.reset()
        controller.set_joint_state(robot.joint_names, positions, velocities, now_s)
        controller.set_target(target, now_s)
        controller.set_hand(Partner(hand, np.zeros(3)), now_s)
        if elbow_of_s is not None:
            assert controller.set_elbow(elbow, elbow_of_s)
        assert not controller.set_elbow(np.full(3, np.nan), now_s)
        found = controller.update(now_s, PERIOD_S).solution
        assert found is not None
        return held(found.active_limits)

    old_s = controller.options.hand_timeout_s + 0.01
    assert answer(10.0, 10.0) == held(told)
    assert answer(10.0, 10.0 - old_s) == set()
    assert answer(10.0, None) == set()
