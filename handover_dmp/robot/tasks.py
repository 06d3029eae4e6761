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
What one period of the inverse kinematics starts from, and what tasks and limits answer.

A task or a limit is any object with the method of `Task`, `Preference` or `Limit`. To add one,
write its class and hand it to `PriorityIk`; nothing else has to know of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from handover_dmp.common.arrays import Array
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.partner import Partner
from handover_dmp.robot.singularity import smallest_singular_value
import numpy as np
import pinocchio as pin


@dataclass(frozen=True, eq=False)
class WristTarget:
    """
    Where the wrist shall be now, and how fast it shall move.

    Attributes:
        position: (3,), m, in `world`.
        velocity: (3,), m/s.
        rotation: (3, 3), of the wrist in `world`; None if any will do.
        angular_velocity: (3,), rad/s, in `world`; None for zero.

    """

    position: Array
    velocity: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array | None = None
    angular_velocity: Array | None = None


class IkInput:
    """
    The arm at the beginning of a period, and what it is asked for.

    Attributes:
        model: the arm. The joints' placements stand in its `pinocchio_data`.
        joint_positions: (n,), rad.
        joints: the same as plain floats.
        target: of the wrist.
        partner: what is known of the partner; None for nothing.
        dt: length of the period, s.
        joint_jacobian: (6, n), Pinocchio's `computeJointJacobians`.
        position: (3,), m, of the wrist in `world`.
        jacobian: (6, n), of the wrist, linear above angular velocity, along the axes of `world`.
        linear: (3, n), its upper half.
        singular_value: the smallest one of `linear`, m.
        lower: n joint velocities, rad/s, the lower side of the box of the joints' own limits.
        upper: its upper side.
        wrist_velocity: (3,), m/s, what the wrist is asked for. The tasks are asked before the
            limits, and the direction task may change it.
        held_back: names of what has slowed the wrist down already.

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
        pinocchio_model, data, wrist = (
            model.pinocchio_model,
            model.pinocchio_data,
            model.wrist_frame_id,
        )
        self.model = model
        self.joint_positions = joint_positions
        self.joints = joints
        self.target = target
        self.partner = partner
        self.dt = dt
        self.lower, self.upper = box
        self.joint_jacobian = pin.computeJointJacobians(pinocchio_model, data, joint_positions)
        self._pose = pin.updateFramePlacement(pinocchio_model, data, wrist)
        self.position: Array = self._pose.translation
        self.jacobian: Array = pin.getFrameJacobian(
            pinocchio_model, data, wrist, pin.LOCAL_WORLD_ALIGNED
        )
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
    """Something that the arm shall do, as well as the levels above leave it free to."""

    name: str
    """Of its residual in `IkSolution`."""

    def rows(self, period: IkInput) -> Rows | None:
        """
        Give the equations of the task.

        Args:
            period: the arm and what it is asked for.

        Returns:
            Rows A and values b, (m,) or None for zeros, for A q̇ = b where A is (m, n), or for
            A (q̇, s) = b where it is (m, n + 1) and so has the speed scale s in it, too. None if
            nothing is asked for.
            The shape is always the same unless it is None. The arrays may be used again.

        """
        ...


class Preference(Protocol):
    """Something that the joints shall do where all tasks leave them free."""

    def velocity(self, period: IkInput) -> Sequence[float] | None:
        """
        Give the joint velocities that it wants.

        Args:
            period: the arm and what it is asked for.

        Returns:
            n numbers, rad/s; None for none. Those of all preferences are added.

        """
        ...


class HalfSpace(NamedTuple):
    """
    A bound on the joint velocities, row·q̇ ≥ bound.

    Attributes:
        name: what it is called among the active limits.
        row: (n,).
        bound: at most 0, so that standing still is allowed.

    """

    name: str
    row: Array
    bound: float


class Limit(Protocol):
    """Something that must never be broken, beside the limits of the joints."""

    def half_spaces(self, period: IkInput) -> Sequence[HalfSpace]:
        """
        Bound the joint velocities.

        Args:
            period: the arm and what it is asked for.

        Returns:
            The bounds of this period.

        """
        ...
