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
What a driver puts before an arm that is told joint velocities: checks, watchdog, interpolation.

Whatever is sent, what comes out stays within the limits of position, velocity, acceleration and
jerk. It keeps no time of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from math import inf, isfinite, sqrt

from handover_dmp.common.arrays import Array
from handover_dmp.common.settings import setting
from handover_dmp.robot.interpolator import JointInterpolator
from handover_dmp.robot.model import RobotModel
import numpy as np

# Share of the acceleration limit that braking before an end stop plans with; what is left absorbs
# the lag of the jerk-limited interpolation.
END_STOP_SHARE = 0.5
# The arm comes to rest so far before the end of its range that rounding does not take it beyond.
END_STOP_MARGIN_RAD = 1e-5


@dataclass(frozen=True)
class ArmOptions:
    """When the arm stops by itself."""

    command_timeout_s: float = setting(
        'robot_sim',
        'command_timeout_s',
        'Time without a valid command after which the arm brakes, s',
        0.001,
        10.0,
        read_only=True,
    )
    resume_required: bool = setting(
        'robot_sim',
        'resume_required',
        'Whether an arm that was stopped in motion stays stopped until ~/resume is called',
        read_only=True,
    )
    resume_within_s: float = setting(
        'robot_sim',
        'resume_within_s',
        'Silence after which the arm still continues without ~/resume once commands are back, s; '
        'covers short stalls of a busy machine',
        0.0,
        60.0,
        read_only=True,
    )


class CommandOutcome(str, Enum):
    """What became of a command."""

    ACCEPTED = 'accepted'
    CLIPPED = 'clipped'
    REFUSED = 'refused'
    IGNORED = 'ignored'


class ArmState(str, Enum):
    """
    Whether the arm obeys commands.

    It obeys when it is ready; it waits, braking or at rest, for commands that stay away; it is
    stopped, braking or at rest, until it is told to resume.
    """

    READY = 'ready'
    WAITING = 'waiting'
    STOPPED = 'stopped'


@dataclass(frozen=True)
class ArmReport:
    """
    What the arm has to say about its commands since the last reset.

    Attributes:
        state: whether it obeys.
        accepted: commands taken as they were.
        clipped: commands over the velocity limits, taken slowed down.
        refused: commands of a wrong length or with numbers that are not finite.
        ignored: good commands that came while it was stopped.
        timeouts: how often commands stayed away while it was in motion.
        last_fault: the latest of these in words; empty before the first.

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
        """Say why it does not obey; empty while it does."""
        return '' if self.state is ArmState.READY else f'{self.state.value}: {self.last_fault}'


class VelocityDriver:
    """Turns joint velocity commands into the smooth motion that the arm is to make."""

    def __init__(self, model: RobotModel, options: ArmOptions | None = None) -> None:
        """
        Take the arm, at rest in its home configuration.

        Args:
            model: the robot.
            options: when it stops by itself.

        """
        self.model = model
        self.options = options or ArmOptions()
        limits = model.limits
        braking = END_STOP_SHARE * limits.acceleration
        # From full acceleration one way to braking the other way.
        lag_s = (1.0 + END_STOP_SHARE) * limits.acceleration / limits.jerk
        low, high = limits.lower + END_STOP_MARGIN_RAD, limits.upper - END_STOP_MARGIN_RAD
        self._end_stops = np.column_stack([braking, lag_s, low, high]).tolist()
        self._interpolator = JointInterpolator(limits)
        self.reset(model.home)

    def reset(self, positions: Array) -> None:
        """
        Start anew: at rest, ready, with a clean report.

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
        Go on from rest somewhere else.

        Args:
            positions: (n,), rad.

        """
        self._reference: Array = np.array(positions)
        self._velocity = np.zeros(self.model.dof)
        self._target = np.zeros(self.model.dof)
        self._interpolator.reset(self._velocity)

    @property
    def reference(self) -> Array:
        """Where the motion is: the integral of what `steps` gave, (n,), rad."""
        return np.array(self._reference)

    @property
    def deadline_s(self) -> float:
        """When commands have stayed away for too long, s; infinite while none is awaited."""
        return self._deadline_s

    @property
    def moving(self) -> bool:
        """Whether the arm moves or has been told to."""
        return bool(self._target.any()) or bool(np.abs(self._velocity).max() > 1e-6)

    @property
    def report(self) -> ArmReport:
        """Tell what became of the commands since the last reset."""
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
        Say what the joints are to do from now on.

        A command that is refused or ignored does not count as a sign of life.

        Args:
            velocities: (n,), rad/s, in the model's order.
            time_s: now, s.

        Returns:
            What became of it; `report` says why.

        """
        outcome = self._judge(velocities, time_s)
        self._count[outcome] += 1
        return outcome

    def _judge(self, velocities: Sequence[float] | Array, time_s: float) -> CommandOutcome:
        try:
            wanted = np.array(velocities, dtype=float)
        except (TypeError, ValueError, OverflowError):
            return self._refuse('a command that is not a row of numbers')
        if wanted.shape != (self.model.dof,):
            return self._refuse(f'a command of shape {wanted.shape} for {self.model.dof} joints')
        share = np.abs(wanted) / self.model.limits.velocity
        worst = int(share.argmax())  # that of a number that is none, if there is one
        if not isfinite(share[worst]):
            return self._refuse('a command with numbers that are not finite')
        if self._state is ArmState.STOPPED:
            return CommandOutcome.IGNORED
        self._state = ArmState.READY
        self._deadline_s = time_s + self.options.command_timeout_s
        if share[worst] <= 1.0 + 1e-9:
            self._target = wanted
            return CommandOutcome.ACCEPTED
        # All joints alike, so that the wrist keeps its direction.
        self._target = wanted / share[worst]
        self._last_fault = (
            f'{self.model.joint_names[worst]} told to run at {wanted[worst]:.3g} rad/s, limit '
            f'{self.model.limits.velocity[worst]:.3g}'
        )
        return CommandOutcome.CLIPPED

    def _refuse(self, fault: str) -> CommandOutcome:
        self._last_fault = fault
        return CommandOutcome.REFUSED

    def stop(self, fault: str = 'stopped on request') -> None:
        """
        Brake within the limits and stay so until `resume`.

        Args:
            fault: why, for the report.

        """
        self._state = ArmState.STOPPED
        self._deadline_s = inf
        self._brake(fault)

    def resume(self) -> None:
        """Obey commands again, from the next one on."""
        self._state = ArmState.READY

    def excuse(self, duration_s: float) -> None:
        """
        Wait longer for the next command, where none could come.

        Args:
            duration_s: how much longer, s.

        """
        self._deadline_s += duration_s

    def watch(self, time_s: float) -> None:
        """
        Brake if commands have stayed away for too long; after still longer, wait to be told.

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
        Brake within the limits, and stay so until `resume` if the options say so.

        Args:
            fault: why, for the report.

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
        Go on towards the last command.

        Args:
            dt: length of a step, s.
            count: how many.

        Returns:
            The joint velocities after each, rad/s, as plain floats.

        """
        velocities = self._interpolator.steps(self._clear_of_end_stops(count * dt), dt, count)
        self._velocity = np.array(velocities[-1])
        self._reference = self._reference + dt * np.array(velocities).sum(axis=0)
        return velocities

    def _clear_of_end_stops(self, duration_s: float) -> Array:
        """
        Bound the target so that the arm can always brake before the end of its range.

        The bound is that of a joint that brakes at a share of its acceleration, from where the
        joint will be once that acceleration has been built up.
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
