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
Conversion of joint velocity commands to positions, for an arm whose driver takes positions only.

The positions are the integral of the velocities after checks, watchdog and jerk-limited
interpolation. They begin at the measured position, and their lead over it is limited. Free of ROS.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import NamedTuple

from handover_dmp.common.arrays import Array
from handover_dmp.common.settings import defaults, parameters_of, setting
from handover_dmp.robot.joint_states import MeasuredArm
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.velocity_driver import (
    ArmOptions,
    ArmReport,
    ArmState,
    CommandOutcome,
    VelocityDriver,
)
import numpy as np

BOUNDS_EVERY_S = 0.005
STEPS = 5
"""Number of interpolation steps per period, each of at most 1 ms."""


@dataclass(frozen=True)
class PositionCommanderOptions:
    """Conditions under which the arm stops by itself."""

    joint_state_timeout_s: float = setting(
        'velocity_to_position',
        'joint_state_timeout_s',
        'Age of the joint states beyond which the arm brakes, s',
        0.005,
        10.0,
        read_only=True,
    )
    lead_limit_rad: float = setting(
        'velocity_to_position',
        'lead_limit_rad',
        'Maximum lead of a commanded position over the measured one, rad; beyond it the arm '
        'stops, lest it leaps when its brakes are released',
        0.001,
        1.0,
        read_only=True,
    )


class PositionCommand(NamedTuple):
    """
    Result of one period.

    Attributes:
        positions: (n,), rad, in the model's order; None for no command.
        reason: why there is none, or why the arm brakes; empty in normal operation.

    """

    positions: Array | None
    reason: str


class PositionCommander(MeasuredArm):
    """Integrates joint velocities while it is safe."""

    def __init__(
        self,
        model: RobotModel,
        arm_options: ArmOptions | None = None,
        options: PositionCommanderOptions | None = None,
        *,
        joint_prefix: str = '',
    ) -> None:
        """
        Take the arm; there is no command before its joint states and a velocity command arrive.

        Args:
            model: the arm.
            arm_options: conditions for a stop without commands.
            options: other conditions for a stop.
            joint_prefix: prefix of the driver's joint names.

        """
        super().__init__(model, joint_prefix)
        self.options = options or PositionCommanderOptions()
        usual = parameters_of(ArmOptions, defaults('velocity_to_position'))
        self._driver = VelocityDriver(model, arm_options or ArmOptions(**usual))
        self._engaged = False

    @property
    def report(self) -> ArmReport:
        """Report on the commands since the last reset."""
        return self._driver.report

    def command(self, velocities: Sequence[float] | Array, arrival_s: float) -> CommandOutcome:
        """
        Process a joint velocity command.

        Args:
            velocities: (n,), rad/s, in the model's order.
            arrival_s: time of arrival, s.

        Returns:
            The outcome.

        """
        if not self._engaged and not self._fault(arrival_s):
            self._driver.start_from(self._measured)
            self._engaged = self._driver.report.state is ArmState.READY
        return self._driver.command(velocities, arrival_s)

    def resume(self) -> None:
        """Follow commands again, from the next one on."""
        self._driver.resume()

    def stop(self, reason: str) -> None:
        """
        Brake within the limits and stay stopped until `resume`.

        Args:
            reason: the reason.

        """
        self._driver.stop(reason)

    def update(self, now_s: float, dt: float) -> PositionCommand:
        """
        Advance by one period.

        Args:
            now_s: the time, s, on the clock of the arrivals.
            dt: time since the last call, s.

        Returns:
            Joint positions, or the reason why there are none.

        """
        fault = self._fault(now_s)
        if not self._engaged:
            return PositionCommand(None, fault or self.report.reason or 'no joint command')
        self._driver.watch(now_s)
        if fault and self._driver.moving:
            self._driver.halt(fault)
        elif ahead := self._ahead():
            self._driver.stop(ahead)
        # integrate in steps short enough for the bounds at the position limits
        bounds = max(1, ceil(dt / BOUNDS_EVERY_S - 1e-9))
        for _ in range(bounds):
            self._driver.steps(dt / bounds / STEPS, STEPS)
        at_rest = not self._driver.moving
        # a position controller keeps its last command; the arm may be moved meanwhile, and the
        # next motion begins at its measured position
        self._engaged = not at_rest or self._driver.deadline_s < float('inf')
        return PositionCommand(self._driver.reference, fault or self.report.reason)

    def _fault(self, now_s: float) -> str:
        return self._joint_state_fault(now_s, self.options.joint_state_timeout_s)

    def _ahead(self) -> str:
        ahead = np.abs(self._driver.reference - self._measured)
        worst = int(ahead.argmax())
        if ahead[worst] <= self.options.lead_limit_rad:
            return ''
        return f'{self.model.joint_names[worst]} does not follow: {ahead[worst]:.3f} rad behind'
