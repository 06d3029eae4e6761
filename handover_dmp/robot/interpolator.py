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

"""Jerk-limited interpolation of velocity commands, from several milliseconds to one."""

from __future__ import annotations

from math import isfinite

from handover_dmp.common.arrays import Array
from handover_dmp.robot.limits import JointLimits
import numpy as np
from ruckig import ControlInterface, InputParameter, Result, Ruckig, Synchronization, Trajectory


class JointInterpolator:
    """
    Moves the joint velocities to the last command within the acceleration and jerk limits.

    A new plan (with ruckig, velocity interface, time-optimal for each joint) is made only when the
    command changes, from the present velocity and acceleration; otherwise the plan is sampled.
    Neither velocity nor acceleration ever jumps. A command of zero, as after the commands are
    lost, brakes every joint at its acceleration limit.
    """

    def __init__(self, limits: JointLimits) -> None:
        """
        Take the limits; the arm is at rest.

        Args:
            limits: limits of the joints; accelerations and jerks are respected.

        """
        dof = len(limits.velocity)
        self._velocity_limit = limits.velocity
        self._planner = Ruckig(dof)
        self._plan = Trajectory(dof)
        self._input = InputParameter(dof)
        self._input.control_interface = ControlInterface.Velocity
        self._input.synchronization = Synchronization.No
        self._input.max_velocity = limits.velocity.tolist()
        self._input.max_acceleration = limits.acceleration.tolist()
        self._input.max_jerk = limits.jerk.tolist()
        self.reset(np.zeros(dof))

    def reset(self, velocity: Array) -> None:
        """
        Restart at a velocity, without acceleration.

        Args:
            velocity: (n,), rad/s.

        """
        self._velocity: list[float] = np.asarray(velocity, dtype=float).tolist()
        self._acceleration = [0.0] * len(self._velocity)
        self._command = b''
        self._time_s = 0.0

    @property
    def velocity(self) -> Array:
        """Return the joint velocities of the last step, (n,), rad/s."""
        return np.array(self._velocity)

    @property
    def acceleration(self) -> Array:
        """Return the joint accelerations at that time, (n,), rad/s²."""
        return np.array(self._acceleration)

    def step(self, target_velocity: Array, dt: float) -> Array:
        """
        Move towards a command.

        Args:
            target_velocity: (n,), rad/s; clipped to the velocity limits.
            dt: time step, s.

        Returns:
            The joint velocities after `dt`, (n,), rad/s.

        Raises:
            ValueError: the command is not finite, or is not one number per joint.

        """
        return np.array(self.steps(target_velocity, dt, 1)[0])

    def steps(self, target_velocity: Array, dt: float, count: int) -> list[list[float]]:
        """
        Move towards a command in several steps.

        Args:
            target_velocity: (n,), rad/s; clipped to the velocity limits.
            dt: length of a step, s.
            count: number of steps.

        Returns:
            The joint velocities after each step, rad/s, as plain floats.

        Raises:
            ValueError: the command is not finite, or is not one number per joint.

        """
        command = target_velocity.tobytes()
        if command != self._command:
            self._replan(target_velocity)
            self._command = command
        velocities = []
        for _ in range(count):
            self._time_s += dt
            _, self._velocity, self._acceleration = self._plan.at_time(self._time_s)
            velocities.append(self._velocity)
        return velocities

    def _replan(self, target_velocity: Array) -> None:
        if target_velocity.shape != (len(self._velocity),) or not all(
            map(isfinite, target_velocity.tolist())
        ):
            raise ValueError(f'joint velocities {target_velocity}: need a finite number per joint')
        limit = self._velocity_limit
        request = self._input
        request.current_velocity = self._velocity
        request.current_acceleration = self._acceleration
        request.target_velocity = np.minimum(np.maximum(target_velocity, -limit), limit).tolist()
        result = self._planner.calculate(request, self._plan)
        if result not in (Result.Working, Result.Finished):
            raise ValueError(f'no motion from {request.current_velocity} to {target_velocity}')
        self._time_s = 0.0
