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

"""
Joint velocities for a wrist command, with strict priorities: no task disturbs a higher one.

The variables are the joint velocities q̇ and the speed scale s. The levels, in this order:

1. limits: the box of `limits.VelocityBox`, 0 ≤ s ≤ 1, and the half-spaces of separation and
   collision (`separation`, `collision_limits`);
2. the wrist's direction: J_p q̇ = s·v (`direction_task`);
3. its speed: s = 1, or only s ≥ `orientation_slows_to` if that is below 1;
4. orientation: full, one axis, or none (`orientation_task`); if level 3 was relaxed, then s = 1;
5. posture: towards home, away from the position limits and with the elbow away from the partner
   (`posture`).

Each level is solved in the least-squares sense without affecting those above it (`hierarchy`).
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any, NamedTuple

from handover_dmp.common.arrays import Array
from handover_dmp.robot.hierarchy import Box, Hierarchy, SOFTNESS, TOUCHING
from handover_dmp.robot.limits import VelocityBox
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.partner import Partner
from handover_dmp.robot.task_stack import TaskStack
from handover_dmp.robot.tasks import HalfSpace, IkInput, Rows, WristTarget


class IkSolution(NamedTuple):
    """
    Result of one period.

    Attributes:
        joint_velocity: (n,), rad/s.
        speed_scale: s, from 0 to 1: share of the commanded speed that is possible.
        active_limits: the limits that slow the arm, e.g. `joint_3 velocity`, `joint_4 position`,
            `stretch`, `approach`, `lwr4_link_1 to lwr4_wrist`.
        residuals: residual of each level: `limits` (0 unless the arm started outside its limits),
            `position` m/s, `speed` (1 − s), `orientation` rad/s, `posture` rad/s.
        smallest_singular_value: that of the Jacobian of the wrist's position, m.
        solved: whether the solver found a solution; otherwise the arm brakes.

    """

    joint_velocity: Array
    speed_scale: float
    active_limits: tuple[str, ...]
    residuals: dict[str, float]
    smallest_singular_value: float
    solved: bool = True


class PriorityIk:
    """
    Priority inverse kinematics of one arm.

    It has no state except for scratch arrays: the result depends only on the arguments.
    """

    def __init__(
        self, model: RobotModel, stack: TaskStack | None = None, **parameters: Any
    ) -> None:
        """
        Take the arm and its tasks.

        Args:
            model: the arm.
            stack: limits, tasks and preferences; by default those that follow the wrist.
            parameters: their parameters, see `TaskStack.configured`; only for the default stack.

        """
        self.model = model
        self.stack = TaskStack.configured(model, **parameters) if stack is None else stack
        self._box = VelocityBox(model.limits, self.stack.braking_share)
        self._tasks = [task for level in self.stack.levels for task in level]
        self._hierarchies: dict[tuple[int, ...], Hierarchy] = {}
        self._standstill = [0.0] * model.dof
        self._no_residuals = dict.fromkeys(
            ('limits', 'speed', *(task.name for task in self._tasks), 'posture'), 0.0
        )
        self._limit_names = [
            tuple(f'{joint} {limit}' for limit in ('acceleration', 'velocity', 'position'))
            for joint in model.joint_names
        ]
        self._max_velocities = model.limits.velocity.tolist()
        self._max_accelerations = model.limits.acceleration.tolist()

    def __repr__(self) -> str:
        """Return a short description."""
        limits = [type(limit).__name__ for limit in self.stack.limits]
        tasks = [task.name for task in self._tasks]
        return f'PriorityIk({self.model.name}, {", ".join(limits + tasks)})'

    def solve(
        self,
        joint_positions: Array,
        previous_velocity: Array,
        target: WristTarget,
        dt: float,
        *,
        hand: object = None,
    ) -> IkSolution:
        """
        Compute the joint velocities for the next period.

        Args:
            joint_positions: (n,), rad.
            previous_velocity: (n,), rad/s, velocity of the period that ends now.
            target: desired pose and velocity of the wrist.
            dt: length of the next period, s.
            hand: known state of the partner, see `Partner.of`.

        Returns:
            The velocities, and the limits that slow them.

        """
        joints, before = joint_positions.tolist(), previous_velocity.tolist()
        box = self._box.sides(joints, before, dt)
        partner = None if hand is None else Partner.of(hand)
        period = IkInput(self.model, joint_positions, joints, target, partner, dt, box)
        tasks = [task.rows(period) for task in self._tasks]
        half_spaces = [one for limit in self.stack.limits for one in limit.half_spaces(period)]
        hierarchy = self._hierarchy(half_spaces, tasks)
        hierarchy.fill(box, half_spaces, [t for t in tasks if t], self._preferred(period))
        solution, solved = hierarchy.solve()
        held_back = self._cut_to_box(solution, before, box, dt)
        scale = float(solution[-1])
        if not 0.0 <= scale <= 1.0 - 10.0 * SOFTNESS:  # the residual is that of the solver
            solution[-1] = scale = 1.0 if scale > 0.0 else 0.0
        missing = hierarchy.missing(solution)
        residuals = self._no_residuals.copy()
        residuals['speed'] = 1.0 - scale
        parts = iter(hierarchy.parts)
        for task, rows in zip(self._tasks, tasks, strict=True):
            if rows:
                start, end = next(parts)
                residuals[task.name] = math.hypot(*missing[start:end])
        residuals['posture'] = math.hypot(*missing[-len(before):])  # fmt: skip
        held_back += period.held_back
        for half_space, room in zip(half_spaces, missing, strict=False):
            if room < TOUCHING:
                held_back.append(half_space.name)
                residuals['limits'] = max(residuals['limits'], -room)
        return IkSolution(
            solution[:-1], scale, tuple(held_back), residuals, period.singular_value, solved
        )

    def brake(self, joint_positions: Array, velocity: Array, dt: float) -> Array:
        """
        Brake as fast as the limits permit.

        Args:
            joint_positions: (n,), rad.
            velocity: (n,), rad/s, velocity of the period that ends now.
            dt: length of the next period, s.

        Returns:
            Joint velocities for that period, (n,), rad/s; finally zero.

        """
        return self._box.brake(joint_positions, velocity, dt)

    def _hierarchy(self, half_spaces: list[HalfSpace], tasks: list[Rows | None]) -> Hierarchy:
        """Return the arrays for this number of rows."""
        size = (len(half_spaces), *[rows is None for rows in tasks])
        hierarchy = self._hierarchies.get(size)
        if hierarchy is None:
            left = iter(tasks)
            levels = [[next(left) for _ in level] for level in self.stack.levels]
            hierarchy = Hierarchy(self.model.dof, len(half_spaces), levels, self.stack.slowest)
            self._hierarchies[size] = hierarchy
        return hierarchy

    def _preferred(self, period: IkInput) -> Sequence[float]:
        """Sum the preferred joint velocities, n, rad/s."""
        wanted = [preference.velocity(period) for preference in self.stack.preferences]
        given = [one for one in wanted if one is not None]
        if len(given) == 1:
            return given[0]
        return [sum(speeds) for speeds in zip(self._standstill, *given, strict=True)]

    def _cut_to_box(self, solution: Array, before: list[float], box: Box, dt: float) -> list[str]:
        """Clip the joint velocities of a solution to the box, and name the active limits."""
        names = []
        for joint, (speed, previous, low, high) in enumerate(
            zip(solution[:-1].tolist(), before, *box, strict=True)
        ):
            if low + TOUCHING < speed < high - TOUCHING:
                continue
            kept = low if speed < low else high if speed > high else speed
            solution[joint] = kept
            acceleration, velocity, position = self._limit_names[joint]
            if abs(kept - previous) >= self._max_accelerations[joint] * dt - TOUCHING:
                names.append(acceleration)
            elif abs(kept) >= self._max_velocities[joint] - TOUCHING:
                names.append(velocity)
            else:
                names.append(position)
        return names
