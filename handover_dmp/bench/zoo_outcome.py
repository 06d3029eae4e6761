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

"""Tests of an arm of the zoo: loading, self-check, inverse kinematics, a handover."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from statistics import median
from time import perf_counter

from handover_dmp.bench.zoo import file_limits, FileLimits, ZooArm
from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.handover.controller import HandoverState
from handover_dmp.handover.lockstep import Period, simulate
from handover_dmp.handover.scenario import make_scenario, Scenario
from handover_dmp.robot.descriptions import ArmChoice
from handover_dmp.robot.errors import UnreachableError
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.priority_ik import PriorityIk
from handover_dmp.robot.tasks import WristTarget
from handover_dmp.simulation.self_check import check_models
import numpy as np

PERIOD_S = 0.005
IK_STEPS = 2000
NEW_GOAL = 70
NEW_POSTURE = 500
"""Steps of the inverse kinematics between goals, and between configurations."""
REACH_M = 0.87
"""Reach of an arm for which the recorded motion has the right size, m."""
SMALLER = 0.8
MIN_SCALE = 0.05


@dataclass(frozen=True)
class ZooOutcome:
    """
    The results for an arm.

    Attributes:
        arm: the arm.
        needs: options that the package asked for, in its words; empty if none.
        fault: why the tests stopped; empty if the arm handed over.
        joints: number of joints.
        reach_m: reach from the shoulder, m.
        remarks: remarks on the description.
        engines_apart: relative difference of the mass matrices of the two engines.
        ik_us: median time of a step of the inverse kinematics, µs.
        unsolved: number of its steps without a solution.
        shares: largest used share of the file's limits of `position` and `velocity`, and of the
            assumed limit of `acceleration`.
        scale: scale of the recorded motion.
        gap_m: distance from wrist to goal when the exchange began, m.

    """

    arm: ZooArm
    needs: str = ''
    fault: str = ''
    joints: int = 0
    reach_m: float = 0.0
    remarks: tuple[str, ...] = ()
    engines_apart: float = 0.0
    ik_us: float = 0.0
    unsolved: int = 0
    shares: dict[str, float] | None = None
    scale: float = 0.0
    gap_m: float | None = None


def examine(arm: ZooArm, *, ik_steps: int = IK_STEPS, hand_over: bool = True) -> ZooOutcome:
    """
    Try an arm like a new user: without options, and with them if the package asks for them.

    Args:
        arm: the arm.
        ik_steps: number of steps of the inverse kinematics.
        hand_over: whether to simulate a handover, too.

    Returns:
        The results.

    """
    needs, choice = '', ArmChoice(str(arm.path))
    try:
        try:
            model = RobotModel.load(arm.path)
        except DataError as error:
            needs = str(error).replace(f'{arm.path}: ', '')
            choice = ArmChoice(str(arm.path), arm.wrist_frame, arm.base_frame)
            model = RobotModel.load(
                arm.path, wrist_frame=arm.wrist_frame, base_frame=arm.base_frame
            )
        apart = check_models(model).mass
    except DataError as error:
        return ZooOutcome(arm, needs, str(error).replace(f'{arm.path}: ', ''))
    limits = file_limits(model.urdf_text, model.joint_names)
    ik_us, unsolved, shares = _random_steps(model, limits, ik_steps)
    scale, gap_m, fault = 0.0, None, ''
    if hand_over:
        try:
            scenario, scale = _within_reach(choice, model.reach_m)
        except UnreachableError as error:
            fault = str(error)
        else:
            periods = simulate(scenario)
            gap_m = _gap(scenario, periods)
            fault = '' if gap_m is not None else 'the exchange did not begin'
            shares = _larger(shares, _moved(model, limits, periods))
    return ZooOutcome(
        arm, needs, fault, model.dof, model.reach_m, model.remarks, apart, ik_us, unsolved, shares,
        scale, gap_m,
    )  # fmt: skip


def _within_reach(choice: ArmChoice, reach_m: float) -> tuple[Scenario, float]:
    """Scale the recorded motion down to the reach of the arm."""
    scale = min(1.0, reach_m / REACH_M)
    while True:
        try:
            return make_scenario(arm=choice, scale=scale), scale
        except UnreachableError as error:
            scale *= SMALLER
            if scale < MIN_SCALE or not isfinite(error.missing_m):
                raise


def _random_steps(
    model: RobotModel, limits: FileLimits, steps: int
) -> tuple[float, int, dict[str, float]]:
    """Follow jumping, fast and unreachable goals, from random configurations."""
    rng, ik = np.random.default_rng(0), PriorityIk(model)
    low, high = model.limits.one_turn
    q, velocity = model.home.copy(), np.zeros(model.dof)
    goal, speed = model.shoulder, np.zeros(3)
    times, unsolved = [], 0
    shares = _shares(model, limits, q, velocity, velocity)
    for step in range(steps):
        if step % NEW_POSTURE == 0:
            q, velocity = rng.uniform(low, high), np.zeros(model.dof)
        if step % NEW_GOAL == 0:
            goal = model.shoulder + rng.normal(size=3) * 0.7 * model.reach_m
            speed = rng.normal(size=3) * rng.choice([0.0, 0.5, 3.0])
        goal = goal + speed * PERIOD_S
        begin = perf_counter()
        solution = ik.solve(q, velocity, WristTarget(goal, speed), PERIOD_S)
        times.append(perf_counter() - begin)
        change = (solution.joint_velocity - velocity) / PERIOD_S
        velocity = solution.joint_velocity
        q = q + velocity * PERIOD_S
        unsolved += not solution.solved
        shares = _larger(shares, _shares(model, limits, q, velocity, change))
    return 1e6 * median(times), unsolved, shares


def _moved(model: RobotModel, limits: FileLimits, periods: list[Period]) -> dict[str, float]:
    """Return the used shares of the limits in a handover, from the measured joints."""
    positions = np.array([period.joint_positions for period in periods])
    velocities = np.array([period.joint_velocities for period in periods])
    given = [period.answer.velocities for period in periods]
    commands = np.array([np.zeros(model.dof) if v is None else v for v in given])
    changes = np.diff(commands, axis=0) / PERIOD_S
    fastest = np.maximum(np.abs(velocities), np.abs(commands))
    return _shares(model, limits, positions, fastest, changes)


def _shares(
    model: RobotModel, limits: FileLimits, q: Array, velocity: Array, change: Array
) -> dict[str, float]:
    ended = np.isfinite(limits.lower) & np.isfinite(limits.upper)
    lower, upper = np.where(ended, (limits.lower, limits.upper), [[-1.0], [1.0]])
    half = np.where(ended, (upper - lower) / 2.0, np.inf)
    middle = (upper + lower) / 2.0
    return {
        'position': float((np.abs(q - middle) / half).max()),
        'velocity': float((np.abs(velocity) / limits.velocity).max()),
        'acceleration': float((np.abs(change) / model.limits.acceleration).max()),
    }


def _larger(some: dict[str, float], others: dict[str, float]) -> dict[str, float]:
    return {name: max(share, others[name]) for name, share in some.items()}


def _gap(scenario: Scenario, periods: list[Period]) -> float | None:
    """Return the distance of the wrist from its goal when the exchange began, m."""
    hand = scenario.trial.partner[0]
    for period in periods:
        seen = [sample.position for samples in period.hands for sample in samples]
        hand = seen[-1] if seen else hand
        if period.command.state is HandoverState.EXCHANGE:
            goal = hand + scenario.model.goal_offset
            return float(np.linalg.norm(period.wrist_position - goal))
    return None
