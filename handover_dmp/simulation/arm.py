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
The simulated arm behind the functions of a real driver: checks, interpolation, watchdog.

For any input, it respects the limits of position, velocity, acceleration and jerk. It only knows
simulated time, so the same commands at the same times give bitwise the same motion.
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

# Maximum number of steps between readings of the joints and updates of the bounds.
STEPS_AT_ONCE = 5
STILL_RAD_S = 1e-6
STILL_RAD = 1e-6


class SimulatedArm(Closing):
    """A robot in PyBullet that takes joint velocities, like a velocity-controlled real arm."""

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
        Load the arm into a world of its own, at rest in its home configuration.

        Args:
            model: the robot.
            figure: the human partner; None: no partner.
            options: conditions under which it stops by itself.
            world_options: options of the physics.
            carried: the handed-over object; None, or without a mass: no object.

        Raises:
            DataError: PyBullet cannot read the URDF, or reads another robot from it.
            ModelMismatchError: its robot differs from that of Pinocchio.

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
        Restart: at rest in a configuration, at time zero, ready, with an empty report.

        Args:
            positions: (n,), rad; None: the model's home configuration.

        Raises:
            UsageError: the length is wrong, or a number is not finite or beyond the limits.

        """
        home = self.model.home if positions is None else np.array(positions, dtype=float)
        if home.shape != (self.model.dof,) or not np.all(np.isfinite(home)):
            raise UsageError(
                f'a configuration of {self.model.name} needs {self.model.dof} finite numbers'
            )
        if not self.model.limits.inside(home, 1e-9):
            raise UsageError(f'the configuration is beyond the joint limits of {self.model.name}')
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
        """Measured joint positions, (n,), rad, in the model's order."""
        return self._positions

    @property
    def joint_velocities(self) -> Array:
        """Measured joint velocities, (n,), rad/s, in the model's order."""
        return self._velocities

    @property
    def reference_positions(self) -> Array:
        """Return the reference of the motors, the integrated commands, (n,), rad."""
        return self._driver.reference

    @property
    def moving(self) -> bool:
        """Whether the arm moves or is commanded to move."""
        return self._driver.moving

    @property
    def report(self) -> ArmReport:
        """Report on the commands since the last reset."""
        return self._driver.report

    @property
    def carries(self) -> bool:
        """Whether there is an object to be handed over."""
        return self._carried is not None

    @property
    def wrench(self) -> Wrench:
        """Return the wrench of the held object on the wrist, mean of the last `advance`."""
        if self._carried is None:
            return Wrench(np.zeros(3), np.zeros(3))
        return self._carried.wrench(self._wrist())

    @property
    def partner_force(self) -> Array:
        """Return the force of the partner's hand on the object, mean of the last `advance`, N."""
        return np.zeros(3) if self._carried is None else self._carried.partner_force

    @property
    def object_state(self) -> ObjectState | None:
        """State of the object; None if there is none."""
        return None if self._carried is None else self._carried.state(self._wrist())

    @property
    def object_pose(self) -> tuple[Array, Array]:
        """
        Pose of the object: position, (3,), m, and quaternion x, y, z, w, (4,).

        Raises:
            UsageError: there is no object.

        """
        if self._carried is None:
            raise UsageError('there is no object in this world')
        return self._carried.pose

    @property
    def holder(self) -> Holder:
        """Holder of the object; nobody if there is none."""
        return Holder.NOBODY if self._carried is None else self._carried.holder

    def set_gripper(self, closed: bool) -> None:
        """
        Close the gripper, on the object if that is within reach, or open it.

        Args:
            closed: whether to close it.

        """
        if self._carried is not None:
            self._carried.set_gripper(closed, self._wrist())

    def set_partner_hand(
        self, position: Sequence[float] | Array, velocity: Sequence[float] | Array | None = None
    ) -> None:
        """
        Set position and velocity of the partner's hand that takes and gives the object.

        Args:
            position: (3,), position of the wrist, m, in `world`; ignored if not finite.
            velocity: (3,), m/s; None: derived from the positions.

        """
        if self._carried is not None:
            speed = None if velocity is None else np.array(velocity, dtype=float)
            self._carried.set_partner_hand(np.array(position, dtype=float), speed)

    def command(self, velocities: Sequence[float] | Array) -> CommandOutcome:
        """
        Process a joint velocity command; nothing moves before the next `advance`.

        A refused or ignored command does not reset the watchdog.

        Args:
            velocities: (n,), rad/s, in the model's order.

        Returns:
            The outcome; `report` gives the reason.

        """
        return self._driver.command(velocities, self.time_s)

    def stop(self, fault: str = 'stopped on request') -> None:
        """
        Brake within the limits and stay stopped until `resume`.

        Args:
            fault: the reason, for the report.

        """
        self._driver.stop(fault)

    def resume(self) -> None:
        """Follow commands again, from the next one on."""
        self._driver.resume()

    def show_hand(self, hand: Array) -> None:
        """
        Set the position of the partner's wrist; the figure follows at its own rate.

        Args:
            hand: (3,), m, in `world`; ignored if not finite.

        """
        if np.all(np.isfinite(hand)):
            self._hand = np.array(hand, dtype=float)

    @property
    def rests(self) -> bool:
        """Whether the arm stands, without a command and without an object in its gripper."""
        return (
            self._carried is None
            and not self._driver.moving
            and not self._figure_period_s
            and float(np.abs(self._velocities).max()) < STILL_RAD_S
            and float(np.abs(self._driver.reference - self._positions).max()) < STILL_RAD
        )

    def wait(self, period_s: float) -> None:
        """
        Advance the time of a resting arm without simulating it.

        Args:
            period_s: the time, s.

        """
        self._until_s += period_s
        self._steps = round(self._until_s / self._time_step_s)

    def advance(self, period_s: float, excused_s: float = 0.0) -> None:
        """
        Advance simulated time.

        Fractions of a time step accumulate without loss.

        Args:
            period_s: the period, s.
            excused_s: part of it in which no command could arrive, s, e.g. a jump of a clock.

        Raises:
            UsageError: the period is negative or not finite.

        """
        if not isfinite(period_s) or period_s < 0.0:
            raise UsageError(f'period {period_s} s is negative or not finite')
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
        """Make a few steps towards the target, and then read the joints."""
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
        """Delete the arm's world from PyBullet."""
        self.world.close()
