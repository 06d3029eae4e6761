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

"""The limits, tasks and preferences of an arm in the order of their priority."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import UsageError
from handover_dmp.common.settings import defaults, parameters_of
from handover_dmp.robot.collision_limits import ForearmLimit, SelfCollisionLimit
from handover_dmp.robot.direction_task import DirectionTask
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.orientation_task import OrientationTask
from handover_dmp.robot.posture import ElbowClearance, Posture
from handover_dmp.robot.separation import SeparationLimit
from handover_dmp.robot.tasks import ik_setting, Limit, Preference, Task

SWITCHES: dict[str, Any] = {
    'separation': SeparationLimit,
    'self_collision': SelfCollisionLimit,
    'forearm_collision': ForearmLimit,
}
"""The parameters that enable a limit."""


@dataclass(frozen=True)
class StackOptions:
    """Options that belong to no single task or limit."""

    separation: bool = ik_setting(
        'separation', 'Whether the wrist slows down near the hand (ISO/TS 15066)'
    )
    self_collision: bool = ik_setting(
        'self_collision', 'Whether the links are kept apart from each other'
    )
    forearm_collision: bool = ik_setting(
        'forearm_collision',
        "Whether the links are kept away from the partner's forearm, if partner/elbow is "
        'published',
    )
    braking_share: float = ik_setting(
        'braking_share',
        'Share β of the acceleration limit with which a joint brakes before its position limit',
        0.01,
        1.0,
    )
    orientation_slows_to: float = ik_setting(
        'orientation_slows_to',
        'Share of its speed to which the wrist may be slowed so that its orientation keeps up; '
        '1: it is not slowed',
        0.05,
        1.0,
    )


TASKS = (
    StackOptions,
    DirectionTask,
    OrientationTask,
    Posture,
    ElbowClearance,
    SeparationLimit,
    SelfCollisionLimit,
    ForearmLimit,
)
"""Classes whose fields are the node's parameters of the inverse kinematics."""


@dataclass(frozen=True, eq=False)
class TaskStack:
    """
    The tasks, limits and preferences of an arm.

    Attributes:
        limits: limits besides those of the joints; all on the first level.
        levels: the tasks; tasks of one level share the freedom left by the levels above. The
            speed scale, s = 1, follows the first level.
        preferences: motions of joints that are still free.
        braking_share: β of `limits.VelocityBox`.
        slowest: s to which the levels after the first may slow the wrist; 1: not slowed.

    """

    limits: tuple[Limit, ...]
    levels: tuple[tuple[Task, ...], ...]
    preferences: tuple[Preference, ...]
    braking_share: float
    slowest: float = 1.0

    @classmethod
    def configured(cls, model: RobotModel, **parameters: Any) -> TaskStack:
        """
        Make the stack that follows the wrist of an arm.

        Args:
            model: the arm.
            parameters: parameters of `priority_ik` that differ from `config/handover.yaml`.

        Returns:
            The stack.

        Raises:
            UsageError: a parameter or the orientation is unknown.

        """
        known = defaults('priority_ik')
        unknown = ', '.join(sorted(parameters.keys() - known.keys()))
        if unknown:
            raise UsageError(f'priority_ik has no parameter {unknown}: see docs/parameters.md')
        values = {**known, **parameters}

        def made(kind: type[Any]) -> Any:
            return kind(model, **parameters_of(kind, values))

        return cls(
            limits=tuple(made(limit) for name, limit in SWITCHES.items() if values[name]),
            levels=((made(DirectionTask),), (made(OrientationTask),)),
            preferences=(made(Posture), made(ElbowClearance)),
            braking_share=values['braking_share'],
            slowest=values['orientation_slows_to'],
        )

    def off(self, rotation: Array, target: Array | None) -> float:
        """
        Return the orientation error of a wrist, as far as the stack controls it.

        Args:
            rotation: (3, 3), rotation of the wrist in `world`.
            target: (3, 3), rotation of the target; None if any will do.

        Returns:
            See `OrientationTask.off`.

        """
        tasks = (task for level in self.levels for task in level)
        followed = [t.off(rotation, target) for t in tasks if isinstance(t, OrientationTask)]
        return max(followed, default=0.0)
