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
The simulated arm behind what a real driver would put before it: checks, interpolation, watchdog.

Whatever is sent to it, it stays within the limits of position, velocity, acceleration and jerk. It
keeps simulated time alone, so that the same commands at the same times give the same motion, bit
for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from math import inf, isfinite, sqrt
from types import TracebackType

from handover_dmp.common.errors import UsageError
from handover_dmp.common.settings import setting
from handover_dmp.robot.interpolator import JointInterpolator
from handover_dmp.robot.model import RobotModel
from handover_dmp.simulation.partner_figure import PartnerFigure
from handover_dmp.simulation.self_check import check_models, ModelMismatchError
from handover_dmp.simulation.world import World, WorldOptions
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The longest time, in steps, for which the joints are not read and the bounds not renewed.
STEPS_AT_ONCE = 5
# Share of the acceleration limit that braking before an end stop plans with; what is left absorbs
# the lag of the jerk-limited interpolation.
END_STOP_SHARE = 0.5
# The arm comes to rest so far before the end of its range that rounding does not take it beyond.
END_STOP_MARGIN_RAD = 1e-5


@dataclass(frozen=True)
class ArmOptions:
    """
    When the arm stops by itself.

    Attributes:
        command_timeout_s: simulated time without a good command after which it brakes, s.
        resume_required: whether it then stays stopped, if it was in motion, until `resume`.

    """

    command_timeout_s: float = setting('robot_sim', 'command_timeout_s')
    resume_required: bool = setting('robot_sim', 'resume_required')


class CommandOutcome(str, Enum):
    """What became of a command."""

    ACCEPTED = 'accepted'
    CLIPPED = 'clipped'
    REFUSED = 'refused'
    IGNORED = 'ignored'


class ArmState(str, Enum):
    """Whether the arm obeys commands, or waits, at rest or braking, until it is told to resume."""

    READY = 'ready'
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


class SimulatedArm:
    """A robot in PyBullet that takes joint velocities, as a velocity-controlled real arm does."""

    def __init__(
        self,
        model: RobotModel,
        *,
        figure: PartnerFigure | None = None,
        options: ArmOptions | None = None,
        world_options: WorldOptions | None = None,
    ) -> None:
        """
        Load the arm into a world of its own, at rest in its home posture.

        Args:
            model: the robot.
            figure: the human partner; None: nobody.
            options: when it stops by itself.
            world_options: how its world is stepped.

        Raises:
            DataError: PyBullet cannot read the URDF, or finds another robot in it.
            ModelMismatchError: it has another robot than Pinocchio.

        """
        self.model = model
        self.options = options or ArmOptions()
        self.world = World(model, figure=figure, options=world_options)
        try:
            check_models(model, self.world)
        except ModelMismatchError:
            self.close()
            raise
        self._time_step_s = self.world.options.time_step_s
        self._gain = self.world.options.tracking_gain
        self._figure_period_s = 1.0 / figure.options.update_rate_hz if figure is not None else 0.0
        limits = model.limits
        braking = END_STOP_SHARE * limits.acceleration
        # From full acceleration one way to braking the other way.
        lag_s = (1.0 + END_STOP_SHARE) * limits.acceleration / limits.jerk
        low, high = limits.lower + END_STOP_MARGIN_RAD, limits.upper - END_STOP_MARGIN_RAD
        self._end_stops = np.column_stack([braking, lag_s, low, high]).tolist()
        self._interpolator = JointInterpolator(model.limits)
        self.reset()

    def reset(self, positions: Sequence[float] | Array | None = None) -> None:
        """
        Start anew: at rest in a posture, at time zero, ready, with a clean report.

        Args:
            positions: (n,), rad; None: the model's home posture.

        Raises:
            UsageError: wrong length, not finite or beyond the limits.

        """
        limits = self.model.limits
        home = self.model.home if positions is None else np.array(positions, dtype=float)
        if home.shape != (self.model.dof,) or not np.all(np.isfinite(home)):
            raise UsageError(f'a posture of {self.model.name} is {self.model.dof} finite numbers')
        if np.any(home < limits.lower - 1e-9) or np.any(home > limits.upper + 1e-9):
            raise UsageError(f'the posture is beyond the joint limits of {self.model.name}')
        self.world.reset(home)
        self._reference: Array = np.array(home)
        self._velocity = np.zeros(self.model.dof)
        self._target = np.zeros(self.model.dof)
        self._interpolator.reset(self._velocity)
        self._positions, self._velocities = np.array(home), np.zeros(self.model.dof)
        self._steps = 0
        self._until_s = 0.0
        self._deadline_s = inf
        self._state = ArmState.READY
        self._count = dict.fromkeys(CommandOutcome, 0)
        self._timeouts = 0
        self._last_fault = ''
        self._hand: Array | None = None
        self._figure_due_s = 0.0

    @property
    def time_s(self) -> float:
        """Return the simulated time since the last reset, s."""
        return self._steps * self._time_step_s

    @property
    def joint_positions(self) -> Array:
        """Measured, (n,), rad, in the model's order."""
        return self._positions

    @property
    def joint_velocities(self) -> Array:
        """Measured, (n,), rad/s, in the model's order."""
        return self._velocities

    @property
    def reference_positions(self) -> Array:
        """Tell what the motors follow: the integral of the interpolated commands, (n,), rad."""
        return np.array(self._reference)

    @property
    def moving(self) -> bool:
        """Whether the arm moves or has been told to."""
        return bool(np.any(self._target)) or bool(np.any(np.abs(self._velocity) > 1e-6))

    @property
    def report(self) -> ArmReport:
        """Tell what the arm has to say about its commands since the last reset."""
        return ArmReport(
            state=self._state,
            accepted=self._count[CommandOutcome.ACCEPTED],
            clipped=self._count[CommandOutcome.CLIPPED],
            refused=self._count[CommandOutcome.REFUSED],
            ignored=self._count[CommandOutcome.IGNORED],
            timeouts=self._timeouts,
            last_fault=self._last_fault,
        )

    def command(self, velocities: Sequence[float] | Array) -> CommandOutcome:
        """
        Say what the joints are to do from now on; nothing moves before the next `advance`.

        A command that is refused or ignored does not count as a sign of life.

        Args:
            velocities: (n,), rad/s, in the model's order.

        Returns:
            What became of it; `report` says why.

        """
        outcome = self._judge(velocities)
        self._count[outcome] += 1
        return outcome

    def _judge(self, velocities: Sequence[float] | Array) -> CommandOutcome:
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
        self._deadline_s = self.time_s + self.options.command_timeout_s
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
        self._target = np.zeros(self.model.dof)
        self._deadline_s = inf
        self._last_fault = fault

    def resume(self) -> None:
        """Obey commands again, from the next one on."""
        self._state = ArmState.READY

    def show_hand(self, hand: Array) -> None:
        """
        Say where the partner's wrist is; the figure follows at its own rate.

        Args:
            hand: (3,), m, in `world`; one that is not finite is left out.

        """
        if np.all(np.isfinite(hand)):
            self._hand = np.array(hand, dtype=float)

    def advance(self, period_s: float) -> None:
        """
        Let simulated time pass.

        Periods that are no whole number of steps add up without loss.

        Args:
            period_s: how long, s.

        Raises:
            UsageError: negative or not finite.

        """
        if not isfinite(period_s) or period_s < 0.0:
            raise UsageError(f'no arm can advance by {period_s} s')
        self._until_s += period_s
        remaining = round(self._until_s / self._time_step_s) - self._steps
        while remaining > 0:
            if self.time_s >= self._deadline_s - 1e-9:
                self._miss_command()
            to_deadline = (self._deadline_s - self.time_s) / self._time_step_s
            steps = min(remaining, STEPS_AT_ONCE, max(1, round(min(to_deadline, STEPS_AT_ONCE))))
            self._run(steps)
            remaining -= steps
        if self._hand is not None and self._figure_period_s and self.time_s >= self._figure_due_s:
            self.world.show_hand(self._hand)
            self._figure_due_s = self.time_s + self._figure_period_s - 0.5 * self._time_step_s

    def _miss_command(self) -> None:
        self._deadline_s = inf
        if not self.moving:
            return
        self._timeouts += 1
        fault = f'no command for {self.options.command_timeout_s:.3f} s'
        if self.options.resume_required:
            self.stop(fault)
        else:
            self._target = np.zeros(self.model.dof)
            self._last_fault = fault

    def _run(self, steps: int) -> None:
        """Make a few steps towards the target, then read the joints."""
        dt = self._time_step_s
        target = self._clear_of_end_stops(steps * dt)
        correction = self._gain * (self._reference - self._positions)
        velocities = np.array(self._interpolator.steps(target, dt, steps))
        for driven in (velocities + correction).tolist():
            self.world.drive(driven)
            self.world.step()
        self._reference = self._reference + dt * velocities.sum(axis=0)
        self._velocity = velocities[-1]
        self._steps += steps
        read, moving = self.world.read()
        self._positions, self._velocities = np.array(read), np.array(moving)

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

    def close(self) -> None:
        """Let PyBullet forget the arm's world."""
        self.world.close()

    def __enter__(self) -> SimulatedArm:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
