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
Joint velocities for a wrist command, by strict priorities that no lower task can disturb.

Over the joint velocities q̇ and the speed scale s, in this order:

1. limits: the box of `limits.VelocityBox`, 0 ≤ s ≤ 1, and the half-spaces of separation and
   collision (`separation`, `collision_limits`);
2. the wrist's direction: J_p q̇ = s·v (`direction_task`);
3. its speed: s = 1, or only s ≥ `orientation_slows_to` where that is less;
4. orientation: full, one axis, or none (`orientation_task`), and in the latter case then s = 1;
5. posture: towards home, away from the position limits and with the elbow away from the partner
   (`posture`).

Each level is solved in the least-squares sense without giving up anything of those above it
(`hierarchy`).
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
    The answer for one period.

    Attributes:
        joint_velocity: (n,), rad/s.
        speed_scale: s, from 0 to 1: how much of the speed asked for is possible.
        active_limits: what holds the arm back, e.g. `joint_3 velocity`, `joint_4 position`,
            `stretch`, `approach`, `lwr4_link_1 to lwr4_wrist`.
        residuals: what is missing in each level: `limits` (always 0 unless the arm started
            outside of its limits), `position` m/s, `speed` (1 − s), `orientation` rad/s,
            `posture` rad/s.
        smallest_singular_value: of the Jacobian of the wrist's position, m.
        solved: whether the solver found it; otherwise the arm brakes.

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

    It holds no state but scratch arrays: the answer depends on the arguments alone.
    """

    def __init__(
        self, model: RobotModel, stack: TaskStack | None = None, **parameters: Any
    ) -> None:
        """
        Take the arm and its tasks.

        Args:
            model: the arm.
            stack: limits, tasks and preferences; if left out, those that follow the wrist.
            parameters: of those, see `TaskStack.configured`; not beside a stack of your own.

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
        """Say of which arm it is, and what it heeds."""
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
        Find the joint velocities for the next period.

        Args:
            joint_positions: (n,), rad.
            previous_velocity: (n,), rad/s, of the period that ends now (the last command).
            target: where the wrist shall be, and how fast it shall move.
            dt: length of the next period, s.
            hand: what is known of the partner, see `Partner.of`.

        Returns:
            The velocities, and what held them back.

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
        if not 0.0 <= scale <= 1.0 - 10.0 * SOFTNESS:  # what is missing is the solver's
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
        Slow down as fast as the limits allow.

        Args:
            joint_positions: (n,), rad.
            velocity: (n,), rad/s, of the period that ends now.
            dt: length of the next period, s.

        Returns:
            Joint velocities for it, (n,), rad/s; zero in the end.

        """
        return self._box.brake(joint_positions, velocity, dt)

    def _hierarchy(self, half_spaces: list[HalfSpace], tasks: list[Rows | None]) -> Hierarchy:
        """Give the arrays for as many rows as there are."""
        size = (len(half_spaces), *[rows is None for rows in tasks])
        hierarchy = self._hierarchies.get(size)
        if hierarchy is None:
            left = iter(tasks)
            levels = [[next(left) for _ in level] for level in self.stack.levels]
            hierarchy = Hierarchy(self.model.dof, len(half_spaces), levels, self.stack.slowest)
            self._hierarchies[size] = hierarchy
        return hierarchy

    def _preferred(self, period: IkInput) -> Sequence[float]:
        """Add up what the joints prefer, n, rad/s."""
        wanted = [preference.velocity(period) for preference in self.stack.preferences]
        given = [one for one in wanted if one is not None]
        if len(given) == 1:
            return given[0]
        return [sum(speeds) for speeds in zip(self._standstill, *given, strict=True)]

    def _cut_to_box(self, solution: Array, before: list[float], box: Box, dt: float) -> list[str]:
        """Cut the joint velocities of a solution to the box, and name the limits that hold."""
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
