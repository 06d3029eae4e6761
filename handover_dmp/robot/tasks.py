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
The input of one period of the inverse kinematics, and the interfaces of tasks and limits.

A task or a limit is any object with the method of `Task`, `Preference` or `Limit`. To add one,
write its class and pass it to `PriorityIk`; no other change is needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple, Protocol

from handover_dmp.common.arrays import Array
from handover_dmp.common.settings import setting
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.partner import Partner
from handover_dmp.robot.singularity import smallest_singular_value
import numpy as np
import pinocchio as pin

ik_setting = partial(setting, 'priority_ik')
"""Makes a field whose default is a parameter of the inverse kinematics."""


@dataclass(frozen=True, eq=False)
class WristTarget:
    """
    Desired pose and velocity of the wrist.

    Attributes:
        position: (3,), m, in `world`.
        velocity: (3,), m/s.
        rotation: (3, 3), rotation of the wrist in `world`; None if any will do.
        angular_velocity: (3,), rad/s, in `world`; None for zero.

    """

    position: Array
    velocity: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array | None = None
    angular_velocity: Array | None = None


class IkInput:
    """
    The arm at the beginning of a period, and its command.

    Attributes:
        model: the arm; its `pinocchio_data` holds the joint placements.
        joint_positions: (n,), rad.
        joints: the same as plain floats.
        target: desired pose and velocity of the wrist.
        partner: known state of the partner; None if unknown.
        dt: length of the period, s.
        joint_jacobian: (6, n), Pinocchio's `computeJointJacobians`.
        position: (3,), m, position of the wrist in `world`.
        jacobian: (6, n), Jacobian of the wrist, linear above angular velocity, in the axes of
            `world`.
        linear: (3, n), its upper half.
        singular_value: smallest singular value of `linear`, m.
        lower: n joint velocities, rad/s, lower bounds from the joints' own limits.
        upper: upper bounds from the same.
        wrist_velocity: (3,), m/s, desired velocity of the wrist. Tasks are evaluated before
            limits, and the direction task may change it.
        held_back: names of the limits that have already slowed the wrist.

    """

    def __init__(
        self,
        model: RobotModel,
        joint_positions: Array,
        joints: list[float],
        target: WristTarget,
        partner: Partner | None,
        dt: float,
        box: tuple[list[float], list[float]],
    ) -> None:
        chain, data, wrist = model.pinocchio_model, model.pinocchio_data, model.wrist_frame_id
        self.model = model
        self.joint_positions = joint_positions
        self.joints = joints
        self.target = target
        self.partner = partner
        self.dt = dt
        self.lower, self.upper = box
        self.joint_jacobian = pin.computeJointJacobians(chain, data, joint_positions)
        self._pose = pin.updateFramePlacement(chain, data, wrist)
        self.position: Array = self._pose.translation
        self.jacobian: Array = pin.getFrameJacobian(chain, data, wrist, pin.LOCAL_WORLD_ALIGNED)
        self.linear = self.jacobian[:3]
        self.singular_value = smallest_singular_value(self.linear)
        self.wrist_velocity = target.velocity
        self.held_back: list[str] = []

    @property
    def rotation(self) -> Array:
        """Rotation of the wrist in `world`, (3, 3)."""
        rotation: Array = self._pose.rotation
        return rotation


Rows = tuple[Array, Array | None]
"""Rows and values of a task, see `Task.rows`."""


class Task(Protocol):
    """An equation that the arm shall satisfy, as far as the levels above permit."""

    name: str
    """Name of its residual in `IkSolution`."""

    def rows(self, period: IkInput) -> Rows | None:
        """
        Return the equations of the task.

        Args:
            period: the arm and its command.

        Returns:
            Rows A and values b, (m,) or None for zeros: A q̇ = b if A is (m, n), or A (q̇, s) = b
            with the speed scale s if A is (m, n + 1). None if the task is inactive.
            The shape is always the same unless it is None. The arrays may be reused.

        """
        ...


class Preference(Protocol):
    """A motion of joints that all tasks leave free."""

    def velocity(self, period: IkInput) -> Sequence[float] | None:
        """
        Return the preferred joint velocities.

        Args:
            period: the arm and its command.

        Returns:
            n numbers, rad/s; None for none. All preferences are added.

        """
        ...


class HalfSpace(NamedTuple):
    """
    A bound on the joint velocities, row·q̇ ≥ bound.

    Attributes:
        name: its name among the active limits.
        row: (n,).
        bound: at most 0, so that standing still is permitted.

    """

    name: str
    row: Array
    bound: float


class Limit(Protocol):
    """A limit that is never exceeded, besides those of the joints."""

    def half_spaces(self, period: IkInput) -> Sequence[HalfSpace]:
        """
        Bound the joint velocities.

        Args:
            period: the arm and its command.

        Returns:
            The bounds of this period.

        """
        ...
