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

"""The inverse kinematics: time of a step, limits, and quality of difficult motions."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from importlib import import_module
from statistics import median
from time import perf_counter
from typing import Any

from handover_dmp.bench.ik_scenarios import (
    follow,
    Follower,
    limit_drives,
    minimum_jerk_path,
    PERIOD_S,
)
from handover_dmp.bench.measurement import Measurement, time_call
from handover_dmp.common.arrays import Array
from handover_dmp.robot.interpolator import JointInterpolator
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.priority_ik import PriorityIk
from handover_dmp.robot.tasks import WristTarget
import numpy as np
import pinocchio as pin

LONG_RUN = 100_000
STEPS, BLOCK = 3000, 50
ARMS = ('lwr4', 'iiwa14', 'panda', 'ur5')
ROUNDING = 1e-9


def run(progress: Callable[[str], None]) -> list[Measurement]:
    """
    Measure the inverse kinematics of the LWR 4+ and of pink and placo.

    Args:
        progress: called with the name of each measurement.

    Returns:
        The figures.

    """
    model = RobotModel.load('lwr4')
    plain = PriorityIk(model, self_collision=False, forearm_collision=False)
    start, _ = model.wrist_pose(model.home)
    still = np.zeros(model.dof), start, np.zeros(3)
    peers = {}
    for name, make in _PEERS.items():
        progress(f'looking for {name}')
        with suppress(ImportError, RuntimeError, ValueError):
            follower = make(model)
            follower(model.home, *still)
            peers[name] = follower
    missing = [name for name in _PEERS if name not in peers]
    note = f'not installed: {", ".join(missing)}' if missing else ''
    results = _times(model, plain, peers, note, progress)
    for arm in ARMS:
        results += _limits_kept(RobotModel.load(arm), progress)
    results += _quality(model, {'ours': _follower(plain), **peers}, note, progress)
    results.append(_interpolation(model, progress))
    return results


def _follower(ik: PriorityIk) -> Follower:
    def step(q: Array, velocity: Array, position: Array, speed: Array) -> tuple[Array, float]:
        solution = ik.solve(q, velocity, WristTarget(position, speed), PERIOD_S)
        if not solution.solved:
            raise RuntimeError('no solution')
        return solution.joint_velocity, solution.speed_scale

    return step


def _times(
    model: RobotModel,
    plain: PriorityIk,
    peers: dict[str, Follower],
    note: str,
    progress: Callable[[str], None],
) -> list[Measurement]:
    """Time a step on the same varied path, each follower with its own joints."""
    start, _ = model.wrist_pose(model.home)

    def loop(time_s: float) -> tuple[Array, Array]:
        phase = np.pi * time_s
        return (
            start + 0.1 * np.array([np.sin(phase), np.sin(phase / 2), np.cos(phase) - 1.0]),
            0.1 * np.pi * np.array([np.cos(phase), np.cos(phase / 2) / 2, -np.sin(phase)]),
        )

    progress('time of a step')
    everything = _follower(PriorityIk(model))
    timed = {'ours': everything, 'plain': _follower(plain), **peers}
    spent: dict[str, list[float]] = {name: [] for name in timed}
    floor = []
    states = {name: (model.home.copy(), np.zeros(model.dof)) for name in timed}
    for block in range(STEPS // BLOCK):
        # in turn, so that all see the same machine load, but each long enough to warm its caches
        path = [loop(step * PERIOD_S) for step in range(BLOCK * block, BLOCK * (block + 1))]
        for name, follower in timed.items():
            q, velocity = states[name]
            for position, speed in path:
                begin = perf_counter()
                with suppress(RuntimeError):
                    velocity, _ = follower(q, velocity, position, speed)
                spent[name].append(perf_counter() - begin)
                q = q + velocity * PERIOD_S
            states[name] = q, velocity
        for _ in path:
            begin = perf_counter()
            model.wrist_jacobian(states['ours'][0])
            floor.append(perf_counter() - begin)
    micro = {name: 1e6 * median(times) for name, times in spent.items()}
    minimum = 1e6 * median(floor)
    others = {name: micro[name] for name in peers}
    return [
        Measurement(
            'IK step, seven joints, all limits',
            micro['ours'],
            'µs',
            100.0,
            minimum,
            others,
            note='; '.join(filter(None, ('self-collision among them', note))),
        ),
        Measurement(
            'IK step without self-collision',
            micro['plain'],
            'µs',
            None,
            minimum,
            others,
            note='as the peers',
        ),
    ]


def _limits_kept(model: RobotModel, progress: Callable[[str], None]) -> list[Measurement]:
    """Count broken limits and failed steps for jumping, fast and unreachable goals."""
    limits, rng = model.limits, np.random.default_rng(0)
    ik = PriorityIk(model)
    q, velocity = model.home.copy(), np.zeros(model.dof)
    goal, speed = model.shoulder, np.zeros(3)
    broken = failed = 0
    for step in range(LONG_RUN):
        if step % 10_000 == 0:
            progress(f'limits of {model.name}: {step} of {LONG_RUN} steps')
        if step % 500 == 0:
            q, velocity = rng.uniform(limits.lower, limits.upper), np.zeros(model.dof)
            at_limit = rng.random(model.dof) < 0.2
            q[at_limit] = limits.upper[at_limit]
            if step % 2500 == 0:
                q = np.clip(0.0, limits.lower, limits.upper)  # straight: singular
        if step % 70 == 0:
            goal = model.shoulder + rng.normal(size=3) * 0.7 * model.reach_m
            speed = rng.normal(size=3) * rng.choice([0.0, 0.5, 3.0])
        goal = goal + speed * PERIOD_S
        solution = ik.solve(q, velocity, WristTarget(goal, speed), PERIOD_S)
        change = np.abs(solution.joint_velocity - velocity) / PERIOD_S
        velocity = solution.joint_velocity
        q = q + velocity * PERIOD_S
        broken += bool(
            np.any(np.abs(velocity) > limits.velocity * (1 + ROUNDING))
            or np.any(change > limits.acceleration * (1 + ROUNDING))
            or not limits.inside(q, tolerance=ROUNDING)
        )
        failed += not solution.solved
    return [
        Measurement(f'{model.name}, of {LONG_RUN:,} steps: those {what}', float(count), '', 0.0)
        for what, count in (('that break a limit', broken), ('without a solution', failed))
    ]


def _quality(
    model: RobotModel,
    followers: dict[str, Follower],
    note: str,
    progress: Callable[[str], None],
) -> list[Measurement]:
    """Compare what followers make of difficult motions."""
    progress('driven into joint limits')
    drives = [(start, path) for start, path, _ in limit_drives(model, duration_s=4.0)]
    driven = {
        name: [follow(model, follower, start, path, 4.5) for start, path in drives]
        for name, follower in followers.items()
    }
    errors = {n: 1e3 * max(float(r.errors.max()) for r in runs) for n, runs in driven.items()}
    accelerations = {
        name: max(run.excess(model)['acceleration'] for run in runs)
        for name, runs in driven.items()
    }
    bound = 1.0 + ROUNDING
    what = 'IK driven into a joint limit'
    results = [
        _compared(f'{what}, error', errors, 'mm', 0.1, note),
        _compared(f'{what}, acceleration over its bound', accelerations, 'times', bound, note),
    ]
    progress('beyond reach')
    towards = np.array([1.0, 0.5, 0.3]) / np.linalg.norm([1.0, 0.5, 0.3])
    start, _ = model.wrist_pose(model.home)
    beyond = minimum_jerk_path(start, model.shoulder + (model.reach_m + 0.05) * towards, 1.5)
    beyond_reach = {
        name: follow(model, follower, model.home, beyond, 5.0)
        for name, follower in followers.items()
    }
    edge = model.shoulder + model.reach_m * towards
    standoff = {
        n: 1e3 * float(np.linalg.norm(r.wrist[-1] - edge)) for n, r in beyond_reach.items()
    }
    jerk = {name: run.rms_jerk(2.0) for name, run in beyond_reach.items()}
    results += [
        _compared('IK, target 5 cm beyond reach, standoff', standoff, 'mm', 20.0, note),
        _compared('IK, target 5 cm beyond reach, RMS jerk at rest', jerk, 'rad/s³', 1.0, note),
    ]
    progress('faster than the limits')
    ends = start + [-0.1, -0.25, 0.0], start + [0.1, 0.25, 0.1]
    rush = minimum_jerk_path(*ends, 0.6, bulge=np.array([0.0, 0.0, 0.05]))
    curve = np.array([rush(time_s)[0] for time_s in np.linspace(0.0, 0.6, 2000)])
    q = model.inverse(ends[0])
    for stopping, target in ((False, 15.0), (True, 10.0)):
        run = follow(model, followers['ours'], q, rush, 2.5, phase_stopping=stopping)
        deviation = max(float(np.linalg.norm(curve - at, axis=1).min()) for at in run.wrist)
        results.append(
            Measurement(
                'IK, path 1.6 times too fast, deviation'
                + (' with phase stopping' if stopping else ''),
                1e3 * deviation,
                'mm',
                target,
            )
        )
    return results


def _interpolation(model: RobotModel, progress: Callable[[str], None]) -> Measurement:
    progress('interpolation')
    interpolator = JointInterpolator(model.limits)
    commands = np.random.default_rng(0).uniform(-0.5, 0.5, (40, model.dof)) * model.limits.velocity

    def work() -> None:
        for command in commands:
            for _ in range(5):
                interpolator.step(command, 0.001)

    return Measurement(
        'interpolation, 1 ms step, a new command every fifth',
        1e6 * time_call(work) / (5 * len(commands)),
        'µs',
    )


def _compared(
    name: str, figures: dict[str, float], unit: str, target: float, note: str
) -> Measurement:
    peers = {peer: value for peer, value in figures.items() if peer != 'ours'}
    return Measurement(name, figures['ours'], unit, target, None, peers, note=note)


def _pink(model: RobotModel, *, bound_acceleration: bool = False) -> Follower:
    """Set up pink with the same task: wrist position with high weight, posture with low."""
    pink = import_module('pink')
    limits = import_module('pink.limits')
    tasks = import_module('pink.tasks')
    robot = model.pinocchio_model
    robot.lowerPositionLimit, robot.upperPositionLimit = model.limits.lower, model.limits.upper
    robot.velocityLimit = model.limits.velocity
    wrist = tasks.FrameTask(model.wrist_frame, position_cost=1.0, orientation_cost=0.0)
    posture_task = tasks.PostureTask(cost=1e-3)
    posture_task.set_target(model.home)
    configuration = pink.Configuration(robot, robot.createData(), model.home)
    kept = [limits.ConfigurationLimit(robot), limits.VelocityLimit(robot)]
    acceleration = limits.AccelerationLimit(robot, model.limits.acceleration)
    kept += [acceleration] if bound_acceleration else []

    def step(q: Array, velocity: Array, position: Array, speed: Array) -> tuple[Array, float]:
        acceleration.set_last_integration(velocity, PERIOD_S)
        configuration.update(np.clip(q, model.limits.lower, model.limits.upper))
        wrist.set_target(pin.SE3(np.eye(3), position + speed * PERIOD_S))
        try:
            answer = pink.solve_ik(
                configuration, [wrist, posture_task], PERIOD_S, solver='daqp', limits=kept
            )
        except pink.exceptions.PinkError as error:
            raise RuntimeError(str(error)) from error
        return np.asarray(answer), 1.0

    return step


def _placo(model: RobotModel) -> Follower:
    """Set up placo with the same task: wrist position soft, joint limits hard."""
    placo = import_module('placo')
    robot = placo.RobotWrapper(str(model.urdf_path), placo.Flags.ignore_collisions)
    solver = placo.KinematicsSolver(robot)
    solver.mask_fbase(True)
    solver.enable_joint_limits(True)
    solver.enable_velocity_limits(True)
    solver.dt = PERIOD_S
    wrist = solver.add_position_task(model.wrist_frame, np.zeros(3))
    wrist.configure('wrist', 'soft', 1.0)
    posture_task = solver.add_joints_task()
    posture_task.set_joints(dict(zip(model.joint_names, model.home, strict=True)))
    posture_task.configure('posture', 'soft', 1e-6)

    def step(q: Array, velocity: Array, position: Array, speed: Array) -> tuple[Array, float]:
        for name, value in zip(model.joint_names, q, strict=True):
            robot.set_joint(name, value)
        robot.update_kinematics()
        wrist.target_world = position + speed * PERIOD_S
        change: Any = solver.solve(False)
        return np.asarray(change)[-model.dof:] / PERIOD_S, 1.0  # fmt: skip

    return step


_PEERS: dict[str, Callable[[RobotModel], Follower]] = {
    'pink': _pink,
    'pink with AccelerationLimit': partial(_pink, bound_acceleration=True),
    'placo': _placo,
}
