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
from math import isfinite

from handover_dmp.common.arrays import Array
from handover_dmp.common.closing import Closing
from handover_dmp.common.errors import DataError, UsageError
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.velocity_driver import (
    ArmOptions,
    ArmReport,
    CommandOutcome,
    VelocityDriver,
)
from handover_dmp.simulation.carried_object import (
    CarriedObject,
    CarriedObjectOptions,
    Holder,
    ObjectState,
    Wrench,
)
from handover_dmp.simulation.partner_figure import PartnerFigure
from handover_dmp.simulation.self_check import check_models
from handover_dmp.simulation.world import World, WorldOptions
import numpy as np

# The longest time, in steps, for which the joints are not read and the bounds not renewed.
STEPS_AT_ONCE = 5
STILL_RAD_S = 1e-6
STILL_RAD = 1e-6


class SimulatedArm(Closing):
    """A robot in PyBullet that takes joint velocities, as a velocity-controlled real arm does."""

    def __init__(
        self,
        model: RobotModel,
        *,
        figure: PartnerFigure | None = None,
        options: ArmOptions | None = None,
        world_options: WorldOptions | None = None,
        carried: CarriedObjectOptions | None = None,
    ) -> None:
        """
        Load the arm into a world of its own, at rest in its home posture.

        Args:
            model: the robot.
            figure: the human partner; None: nobody.
            options: when it stops by itself.
            world_options: how its world is stepped.
            carried: what is handed over; None, or without a mass: nothing.

        Raises:
            DataError: PyBullet cannot read the URDF, or finds another robot in it.
            ModelMismatchError: it has another robot than Pinocchio.

        """
        self.model = model
        self.world = World(model, figure=figure, options=world_options)
        try:
            check_models(model, self.world)
        except DataError:
            self.close()
            raise
        self._time_step_s = self.world.options.time_step_s
        self._gain = self.world.options.tracking_gain
        self._figure_period_s = 1.0 / figure.options.update_rate_hz if figure is not None else 0.0
        self._driver = VelocityDriver(model, options)
        self._carried: CarriedObject | None = None
        if carried is not None and carried.mass_kg > 0.0:
            self._carried = CarriedObject(self.world, carried)
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
        self._driver.reset(home)
        self._positions, self._velocities = np.array(home), np.zeros(self.model.dof)
        self._steps = 0
        self._until_s = 0.0
        self._hand: Array | None = None
        self._figure_due_s = 0.0
        if self._carried is not None:
            self._carried.reset(self._wrist())

    def _wrist(self) -> Array:
        return self.model.wrist_pose(self._positions)[0]

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
        return self._driver.reference

    @property
    def moving(self) -> bool:
        """Whether the arm moves or has been told to."""
        return self._driver.moving

    @property
    def report(self) -> ArmReport:
        """Tell what the arm has to say about its commands since the last reset."""
        return self._driver.report

    @property
    def carries(self) -> bool:
        """Whether there is an object to be handed over."""
        return self._carried is not None

    @property
    def wrench(self) -> Wrench:
        """Return what acts on the wrist from what it holds, as the mean of the last `advance`."""
        if self._carried is None:
            return Wrench(np.zeros(3), np.zeros(3))
        return self._carried.wrench(self._wrist())

    @property
    def partner_force(self) -> Array:
        """Return what the partner's hand does to the object, mean of the last `advance`, N."""
        return np.zeros(3) if self._carried is None else self._carried.partner_force

    @property
    def object_state(self) -> ObjectState | None:
        """All that is known of the object; None where there is none."""
        return None if self._carried is None else self._carried.state(self._wrist())

    @property
    def object_pose(self) -> tuple[Array, Array]:
        """
        Where the object is: (3,), m, and its quaternion x, y, z, w, (4,).

        Raises:
            UsageError: there is none.

        """
        if self._carried is None:
            raise UsageError('there is no object in this world')
        return self._carried.pose

    @property
    def holder(self) -> Holder:
        """Who has the object; nobody where there is none."""
        return Holder.NOBODY if self._carried is None else self._carried.holder

    def set_gripper(self, closed: bool) -> None:
        """
        Close the gripper, on the object where that is within reach, or open it.

        Args:
            closed: which.

        """
        if self._carried is not None:
            self._carried.set_gripper(closed, self._wrist())

    def set_partner_hand(
        self, position: Sequence[float] | Array, velocity: Sequence[float] | Array | None = None
    ) -> None:
        """
        Say where the partner's hand is that takes and gives the object.

        Args:
            position: (3,), of the wrist, m, in `world`; one that is not finite is left out.
            velocity: (3,), m/s; None: found from the positions.

        """
        if self._carried is not None:
            speed = None if velocity is None else np.array(velocity, dtype=float)
            self._carried.set_partner_hand(np.array(position, dtype=float), speed)

    def command(self, velocities: Sequence[float] | Array) -> CommandOutcome:
        """
        Say what the joints are to do from now on; nothing moves before the next `advance`.

        A command that is refused or ignored does not count as a sign of life.

        Args:
            velocities: (n,), rad/s, in the model's order.

        Returns:
            What became of it; `report` says why.

        """
        return self._driver.command(velocities, self.time_s)

    def stop(self, fault: str = 'stopped on request') -> None:
        """
        Brake within the limits and stay so until `resume`.

        Args:
            fault: why, for the report.

        """
        self._driver.stop(fault)

    def resume(self) -> None:
        """Obey commands again, from the next one on."""
        self._driver.resume()

    def show_hand(self, hand: Array) -> None:
        """
        Say where the partner's wrist is; the figure follows at its own rate.

        Args:
            hand: (3,), m, in `world`; one that is not finite is left out.

        """
        if np.all(np.isfinite(hand)):
            self._hand = np.array(hand, dtype=float)

    @property
    def rests(self) -> bool:
        """Whether the arm stands, with nothing to do and nothing in its hand."""
        return (
            self._carried is None
            and not self._driver.moving
            and not self._figure_period_s
            and float(np.abs(self._velocities).max()) < STILL_RAD_S
            and float(np.abs(self._driver.reference - self._positions).max()) < STILL_RAD
        )

    def wait(self, period_s: float) -> None:
        """
        Let simulated time pass for an arm that rests, without the work of simulating that.

        Args:
            period_s: how long, s.

        """
        self._until_s += period_s
        self._steps = round(self._until_s / self._time_step_s)

    def advance(self, period_s: float, excused_s: float = 0.0) -> None:
        """
        Let simulated time pass.

        Periods that are no whole number of steps add up without loss.

        Args:
            period_s: how long, s.
            excused_s: how much of it no command could come in, s, as within a jump of a clock.

        Raises:
            UsageError: negative or not finite.

        """
        if not isfinite(period_s) or period_s < 0.0:
            raise UsageError(f'no arm can advance by {period_s} s')
        self._until_s += period_s
        self._driver.excuse(excused_s)
        if self._carried is not None:
            self._carried.begin()
        remaining = round(self._until_s / self._time_step_s) - self._steps
        while remaining > 0:
            self._driver.watch(self.time_s)
            to_deadline = (self._driver.deadline_s - self.time_s) / self._time_step_s
            steps = min(remaining, STEPS_AT_ONCE, max(1, round(min(to_deadline, STEPS_AT_ONCE))))
            self._run(steps)
            remaining -= steps
        if self._hand is not None and self._figure_period_s and self.time_s >= self._figure_due_s:
            self.world.show_hand(self._hand)
            self._figure_due_s = self.time_s + self._figure_period_s - 0.5 * self._time_step_s

    def _run(self, steps: int) -> None:
        """Make a few steps towards the target, then read the joints."""
        correction = self._gain * (self._driver.reference - self._positions)
        for velocities in self._driver.steps(self._time_step_s, steps):
            self.world.drive((velocities + correction).tolist())
            if self._carried is None:
                self.world.step()
            else:
                self._carried.push(self._time_step_s)
                self.world.step()
                self._carried.feel(self._time_step_s)
        self._steps += steps
        read, moving = self.world.read()
        self._positions, self._velocities = np.array(read), np.array(moving)

    def close(self) -> None:
        """Let PyBullet forget the arm's world."""
        self.world.close()
