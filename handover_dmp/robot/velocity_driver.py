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
The driver of a velocity-controlled arm: checks, watchdog, interpolation.

For any input, the output respects the limits of position, velocity, acceleration and jerk. The
driver has no clock of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial
from math import inf, isfinite, sqrt

from handover_dmp.common.arrays import Array
from handover_dmp.common.settings import setting
from handover_dmp.robot.interpolator import JointInterpolator
from handover_dmp.robot.model import RobotModel
import numpy as np

sim_setting = partial(setting, 'robot_sim', read_only=True)
"""Makes a field whose default is a parameter of `robot_sim`, fixed once the node runs."""
# Share of the acceleration limit used to plan braking before a position limit; the rest covers the
# lag of the jerk-limited interpolation.
END_STOP_SHARE = 0.5
# Margin to the position limit, so that rounding does not exceed it.
END_STOP_MARGIN_RAD = 1e-5


@dataclass(frozen=True)
class ArmOptions:
    """Conditions under which the arm stops by itself."""

    command_timeout_s: float = sim_setting(
        'command_timeout_s',
        'Time without a valid command after which the arm brakes, s',
        0.001,
        10.0,
    )
    resume_required: bool = sim_setting(
        'resume_required',
        'Whether an arm that was stopped in motion stays stopped until ~/resume is called',
    )
    resume_within_s: float = sim_setting(
        'resume_within_s',
        'Silence after which the arm still continues without ~/resume once commands are back, s; '
        'covers short stalls of a busy machine',
        0.0,
        60.0,
    )


class CommandOutcome(str, Enum):
    """Outcome of a command."""

    ACCEPTED = 'accepted'
    CLIPPED = 'clipped'
    REFUSED = 'refused'
    IGNORED = 'ignored'


class ArmState(str, Enum):
    """
    Whether the arm follows commands.

    Ready: it follows commands. Waiting: it brakes or rests because commands are missing. Stopped:
    it brakes or rests until `resume`.
    """

    READY = 'ready'
    WAITING = 'waiting'
    STOPPED = 'stopped'


@dataclass(frozen=True)
class ArmReport:
    """
    Report on the commands since the last reset.

    Attributes:
        state: whether the arm follows commands.
        accepted: commands that were followed unchanged.
        clipped: commands above the velocity limits, scaled down.
        refused: commands of a wrong length or with numbers that are not finite.
        ignored: valid commands that arrived while the arm was stopped.
        timeouts: number of times that commands were missing during motion.
        last_fault: description of the last fault; empty before the first.

    """

    state: ArmState
    accepted: int
    clipped: int
    refused: int
    ignored: int
    timeouts: int
    last_fault: str

    @property
    def reason(self) -> str:
        """Return why it does not follow commands; empty while it does."""
        return '' if self.state is ArmState.READY else f'{self.state.value}: {self.last_fault}'


class VelocityDriver:
    """Converts joint velocity commands to a smooth motion of the arm."""

    def __init__(self, model: RobotModel, options: ArmOptions | None = None) -> None:
        """
        Take the arm, at rest in its home configuration.

        Args:
            model: the robot.
            options: conditions under which it stops by itself.

        """
        self.model = model
        self.options = options or ArmOptions()
        limits = model.limits
        braking = END_STOP_SHARE * limits.acceleration
        # From full acceleration to full braking.
        lag_s = (1.0 + END_STOP_SHARE) * limits.acceleration / limits.jerk
        low, high = limits.lower + END_STOP_MARGIN_RAD, limits.upper - END_STOP_MARGIN_RAD
        self._end_stops = np.column_stack([braking, lag_s, low, high]).tolist()
        self._interpolator = JointInterpolator(limits)
        self.reset(model.home)

    def reset(self, positions: Array) -> None:
        """
        Restart: at rest, ready, with an empty report.

        Args:
            positions: (n,), rad.

        """
        self.start_from(positions)
        self._deadline_s = inf
        self._state = ArmState.READY
        self._count = dict.fromkeys(CommandOutcome, 0)
        self._timeouts = 0
        self._last_fault = ''

    def start_from(self, positions: Array) -> None:
        """
        Continue from rest at another configuration.

        Args:
            positions: (n,), rad.

        """
        self._reference: Array = np.array(positions)
        self._velocity = np.zeros(self.model.dof)
        self._target = np.zeros(self.model.dof)
        self._interpolator.reset(self._velocity)

    @property
    def reference(self) -> Array:
        """Position of the motion: the integral of the results of `steps`, (n,), rad."""
        return np.array(self._reference)

    @property
    def deadline_s(self) -> float:
        """Time at which a missing command stops the arm, s; infinite while none is expected."""
        return self._deadline_s

    @property
    def moving(self) -> bool:
        """Whether the arm moves or is commanded to move."""
        return bool(self._target.any()) or bool(np.abs(self._velocity).max() > 1e-6)

    @property
    def report(self) -> ArmReport:
        """Report on the commands since the last reset."""
        return ArmReport(
            state=self._state,
            accepted=self._count[CommandOutcome.ACCEPTED],
            clipped=self._count[CommandOutcome.CLIPPED],
            refused=self._count[CommandOutcome.REFUSED],
            ignored=self._count[CommandOutcome.IGNORED],
            timeouts=self._timeouts,
            last_fault=self._last_fault,
        )

    def command(self, velocities: Sequence[float] | Array, time_s: float) -> CommandOutcome:
        """
        Process a joint velocity command.

        A refused or ignored command does not reset the watchdog.

        Args:
            velocities: (n,), rad/s, in the model's order.
            time_s: present time, s.

        Returns:
            The outcome; `report` gives the reason.

        """
        outcome = self._judge(velocities, time_s)
        self._count[outcome] += 1
        return outcome

    def _judge(self, velocities: Sequence[float] | Array, time_s: float) -> CommandOutcome:
        try:
            wanted = np.array(velocities, dtype=float)
        except (TypeError, ValueError, OverflowError):
            return self._refuse('a command that is not a list of numbers')
        if wanted.shape != (self.model.dof,):
            return self._refuse(f'a command of shape {wanted.shape} for {self.model.dof} joints')
        share = np.abs(wanted) / self.model.limits.velocity
        worst = int(share.argmax())  # that of a NaN, if there is one
        if not isfinite(share[worst]):
            return self._refuse('a command with numbers that are not finite')
        if self._state is ArmState.STOPPED:
            return CommandOutcome.IGNORED
        self._state = ArmState.READY
        self._deadline_s = time_s + self.options.command_timeout_s
        if share[worst] <= 1.0 + 1e-9:
            self._target = wanted
            return CommandOutcome.ACCEPTED
        # Scale all joints alike, so that the wrist keeps its direction.
        self._target = wanted / share[worst]
        self._last_fault = (
            f'{self.model.joint_names[worst]} commanded to {wanted[worst]:.3g} rad/s, limit '
            f'{self.model.limits.velocity[worst]:.3g}'
        )
        return CommandOutcome.CLIPPED

    def _refuse(self, fault: str) -> CommandOutcome:
        self._last_fault = fault
        return CommandOutcome.REFUSED

    def stop(self, fault: str = 'stopped on request') -> None:
        """
        Brake within the limits and stay stopped until `resume`.

        Args:
            fault: the reason, for the report.

        """
        self._state = ArmState.STOPPED
        self._deadline_s = inf
        self._brake(fault)

    def resume(self) -> None:
        """Follow commands again, from the next one on."""
        self._state = ArmState.READY

    def excuse(self, duration_s: float) -> None:
        """
        Extend the time-out, e.g. while no command could arrive.

        Args:
            duration_s: extension, s.

        """
        self._deadline_s += duration_s

    def watch(self, time_s: float) -> None:
        """
        Brake if commands are missing for too long; after a longer time, stop until `resume`.

        Args:
            time_s: now, s.

        """
        if time_s < self._deadline_s - 1e-9:
            return
        options = self.options
        if self._state is ArmState.WAITING:
            self.stop(f'no command for {options.resume_within_s:.3f} s')
            return
        patience_s = options.resume_within_s - options.command_timeout_s
        self._deadline_s = inf
        if not self.moving:
            return
        self._timeouts += 1
        fault = f'no command for {options.command_timeout_s:.3f} s'
        if options.resume_required and patience_s > 0.0:
            self._state = ArmState.WAITING
            self._brake(fault)
            self._deadline_s = time_s + patience_s
        else:
            self.halt(fault)

    def halt(self, fault: str) -> None:
        """
        Brake within the limits, and stay stopped until `resume` if the options require it.

        Args:
            fault: the reason, for the report.

        """
        if self.options.resume_required:
            self.stop(fault)
        else:
            self._brake(fault)

    def _brake(self, fault: str) -> None:
        self._target = np.zeros(self.model.dof)
        self._last_fault = fault

    def steps(self, dt: float, count: int) -> list[list[float]]:
        """
        Move towards the last command.

        Args:
            dt: length of a step, s.
            count: number of steps.

        Returns:
            The joint velocities after each step, rad/s, as plain floats.

        """
        velocities = self._interpolator.steps(self._clear_of_end_stops(count * dt), dt, count)
        self._velocity = np.array(velocities[-1])
        self._reference = self._reference + dt * np.array(velocities).sum(axis=0)
        return velocities

    def _clear_of_end_stops(self, duration_s: float) -> Array:
        """
        Bound the target so that the arm can always brake before its position limits.

        The bound assumes braking at a share of the acceleration limit, from the position where
        that acceleration is reached.
        """
        bounded = []
        state = zip(
            self._target.tolist(),
            self._reference.tolist(),
            self._velocity.tolist(),
            self._end_stops,
            strict=True,
        )
        for target, reference, velocity, (braking, lag_s, low, high) in state:
            step, ahead = braking * duration_s, reference + velocity * lag_s
            up, down = max(0.0, high - ahead), max(0.0, ahead - low)
            fastest_up = sqrt(step * step + 2.0 * braking * up) - step
            fastest_down = sqrt(step * step + 2.0 * braking * down) - step
            bounded.append(min(max(target, -fastest_down), fastest_up))
        return np.array(bounded)
