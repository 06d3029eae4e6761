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
The handed-over object, as a rigid body of the world.

While the gripper is closed on it, a fixed joint connects it to the arm; a force sensor in the
wrist would measure the wrench of that joint. The gripper draws the object to a fixed position in
it, so errors do not accumulate over many handovers. The partner's hand is a spring on the object.
Without a holder the object falls to the floor, or onto the table from which it was picked up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from math import isfinite
from typing import Any, NamedTuple

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import UsageError
from handover_dmp.common.quiet_pybullet import pybullet
from handover_dmp.robot.velocity_driver import sim_setting
from handover_dmp.simulation.gripper_joint import GripperJoint
from handover_dmp.simulation.partner_grip import PartnerGrip, PartnerGripOptions
from handover_dmp.simulation.world import World
import numpy as np

LIGHTEST_KG = 0.01
"""Minimum mass for which the spring of the partner's hand is stable in steps of 1 ms, kg."""
HAND_TURNS = 30.0
"""Natural frequency, critically damped, with which the hand restores the orientation, rad/s."""
SEED = 0
"""Seed of the sensor's noise."""
TABLE_SIDE_M = 0.4
"""Side of the square table, m."""
LAID_DOWN_M = 0.03
"""Height over the table up to which a released object is laid down, m."""
FLOOR_M = 0.0
"""Height of the floor in `world`, m."""


class Holder(str, Enum):
    """Holder of the object; the values are those of `/object/holder`."""

    ROBOT = 'robot'
    PARTNER = 'partner'
    BOTH = 'both'
    TABLE = 'table'
    NOBODY = 'nobody'


HOLDERS = (Holder.ROBOT.value, Holder.PARTNER.value, Holder.TABLE.value)
"""Possible holders at the start."""


class Wrench(NamedTuple):
    """
    Wrench of the held object on the wrist.

    Attributes:
        force: (3,), N, in the axes of `world`.
        torque: (3,), about the wrist, Nm, in the same axes.

    """

    force: Array
    torque: Array


class ObjectState(NamedTuple):
    """
    State of an object at one time.

    Attributes:
        position: (3,), position of its centre, m.
        quaternion: (4,), x, y, z, w.
        holder: its holder.
        wrench: its wrench on the wrist.
        gripper_closed: whether the gripper is commanded to be closed.

    """

    position: Array
    quaternion: Array
    holder: Holder
    wrench: Wrench
    gripper_closed: bool


@dataclass(frozen=True)
class CarriedObjectOptions:
    """
    The handed-over object.

    Attributes:
        partner: options of the partner's hand.

    Raises:
        UsageError: mass, size, position or holder are invalid.

    """

    mass_kg: float = sim_setting(
        'object.mass_kg', 'Mass of the object, kg; 0: no object', 0.0, 50.0
    )
    size: Sequence[float] = sim_setting(
        'object.size', 'Size of the box that gives the inertia of the object, (3,), m'
    )
    position: Sequence[float] = sim_setting(
        'object.position',
        'Position of the centre of the object relative to the wrist that holds it at the start, '
        '(3,), m; mirrored if the partner holds it',
    )
    holder: str = sim_setting(
        'object.holder',
        'Holder of the object at the start: robot, partner or table',
        choices=('robot', 'partner', 'table'),
    )
    table: Sequence[float] = sim_setting(
        'object.table',
        'Position of the centre of the object on the table, if the table is its holder at the '
        'start, (3,), m',
    )
    reach_m: float = sim_setting(
        'object.reach_m',
        'Maximum distance from the wrist to the centre of an object that the gripper can grasp, m',
        0.001,
        5.0,
    )
    grip_s: float = sim_setting(
        'object.grip_s',
        'Time within which the closed gripper draws the object to its position in the gripper, s',
        0.01,
        60.0,
    )
    grip_speed: float = sim_setting(
        'object.grip_speed',
        'Maximum speed with which the gripper draws the object, m/s',
        0.001,
        5.0,
    )
    noise_n: float = sim_setting(
        'object.noise_n', 'Standard deviation of the force sensor on each axis, N', 0.0, 10.0
    )
    partner: PartnerGripOptions = field(default_factory=PartnerGripOptions)

    def __post_init__(self) -> None:
        """Check the values."""
        if self.mass_kg != 0.0 and not LIGHTEST_KG <= self.mass_kg < np.inf:
            raise UsageError(
                f'object.mass_kg is {self.mass_kg}: it must be 0, or at least {LIGHTEST_KG}'
            )
        if len(self.size) != 3 or not all(0.0 < side < np.inf for side in self.size):
            raise UsageError(f'object.size is {list(self.size)}: it must be three lengths above 0')
        for name, place in (('position', self.position), ('table', self.table)):
            if len(place) != 3 or not all(map(isfinite, place)):
                raise UsageError(f'object.{name} is {list(place)}: it must be three lengths')
        for name, value in (('grip_s', self.grip_s), ('grip_speed', self.grip_speed)):
            if not 0.0 < value < np.inf:
                raise UsageError(f'object.{name} is {value}: it must be positive')
        if self.holder not in HOLDERS:
            raise UsageError(f'object.holder is {self.holder!r}, not one of {", ".join(HOLDERS)}')

    @classmethod
    def between(
        cls,
        goal_offset: Sequence[float] | Array,
        mass_kg: float,
        pick_up: Sequence[float] | Array | None = None,
    ) -> CarriedObjectOptions:
        """
        Put an object in the robot's gripper, with its centre between the wrists at an exchange.

        Args:
            goal_offset: (3,), from the partner's wrist to the robot's at the exchange, m.
            mass_kg: mass, kg.
            pick_up: (3,), m, wrist position at which the robot picks the object up from a table;
                None: the robot holds it at the start.

        Returns:
            The object, otherwise as in `config/`.

        Raises:
            UsageError: the mass is invalid.

        """
        position = [-0.5 * float(part) for part in goal_offset]
        if pick_up is None:
            return cls(mass_kg=mass_kg, position=position)
        table = [float(at) + off for at, off in zip(pick_up, position, strict=True)]
        return cls(mass_kg=mass_kg, position=position, holder=Holder.TABLE.value, table=table)

    @property
    def parameters(self) -> dict[str, Any]:
        """Return the parameters of `robot_sim` for the object: name to value."""
        return {
            'object.mass_kg': float(self.mass_kg),
            'object.position': list(map(float, self.position)),
            'object.holder': self.holder,
            'object.table': list(map(float, self.table)),
        }

    @property
    def inertia(self) -> Array:
        """Return the inertia of the box about its axes, (3,), kg m²."""
        squares = np.square(self.size)
        inertia: Array = self.mass_kg / 12.0 * (squares.sum() - squares)
        return inertia


class CarriedObject:
    """
    An object in the world of an arm, held by the arm, the partner, both or nobody.

    Attributes:
        options: the object.

    """

    def __init__(self, world: World, options: CarriedObjectOptions) -> None:
        """
        Put the object into the world.

        Args:
            world: world of the arm.
            options: the object; its mass is not 0.

        """
        self.options = options
        self._engine = world.engine
        self._weight_n = options.mass_kg * -world.options.gravity
        self._grip = PartnerGrip(options.mass_kg, -world.options.gravity, options.partner)
        self._body = int(self._engine.createMultiBody(options.mass_kg, -1, -1, [0, 0, 0]))
        self._engine.changeDynamics(
            self._body,
            -1,
            localInertiaDiagonal=options.inertia.tolist(),
            linearDamping=0,
            angularDamping=0,
        )
        self._gripper = GripperJoint(
            world, self._body, max(options.size), options.grip_s, options.grip_speed
        )

    def reset(self, wrist: Array) -> None:
        """
        Restart, with the holder of the start.

        Args:
            wrist: (3,), m, wrist of the arm at rest.

        """
        self._gripper.let_go()
        self._grip.reset()
        self._gripper_closed = self.options.holder == Holder.ROBOT.value
        self._is_waiting = self.options.holder == Holder.PARTNER.value
        self._quaternion: Sequence[float] = (0.0, 0.0, 0.0, 1.0)
        self._felt = np.zeros(6)
        self._pull = np.zeros(3)
        self._random = np.random.default_rng(SEED)
        self.begin()
        held_at = wrist + self.options.position
        self._gripper.hold_at(held_at)
        has_table = self.options.holder == Holder.TABLE.value
        self._place(np.array(self.options.table) if has_table else held_at)
        if self._gripper_closed:
            self._gripper.take_hold()
            # the wrist carries the object even before the first step
            self._felt[2] = -self._weight_n

    def state(self, wrist: Array) -> ObjectState:
        """
        Return the state of the object.

        Args:
            wrist: (3,), present position of the wrist, m.

        Returns:
            Pose, holder, and wrench on the wrist.

        """
        return ObjectState(*self.pose, self.holder, self.wrench(wrist), self._gripper_closed)

    @property
    def holder(self) -> Holder:
        """Holder of the object."""
        partner = self._grip.holds or self._is_waiting
        if self._gripper.holds:
            return Holder.BOTH if partner else Holder.ROBOT
        if partner:
            return Holder.PARTNER
        return Holder.TABLE if self._is_on_table(self.pose[0]) else Holder.NOBODY

    @property
    def pose(self) -> tuple[Array, Array]:
        """Pose of the object: position, (3,), m, and quaternion x, y, z, w, (4,)."""
        position, quaternion = self._engine.getBasePositionAndOrientation(self._body)
        return np.array(position), np.array(quaternion)

    @property
    def velocity(self) -> Array:
        """Velocity of its centre, (3,), m/s."""
        return np.array(self._engine.getBaseVelocity(self._body)[0])

    def wrench(self, wrist: Array) -> Wrench:
        """
        Return the wrench on the wrist, mean since `begin`.

        Args:
            wrist: (3,), present position of the wrist, m.

        Returns:
            Force and torque; only noise if the gripper is empty.

        """
        mean = self._impulse / self._elapsed_s if self._elapsed_s > 0.0 else self._felt
        force, torque = mean[:3], mean[3:]
        lever = self._gripper.place - wrist
        return Wrench(force + self._noise, torque + np.cross(lever, force))

    def set_gripper(self, closed: bool, wrist: Array) -> None:
        """
        Close the gripper, on the object if that is within reach, or open it.

        Args:
            closed: whether to close it.
            wrist: (3,), m.

        """
        if closed == self._gripper_closed:
            return
        self._gripper_closed = closed
        if not closed:
            self._gripper.let_go()
            return
        near = float(np.linalg.norm(self.pose[0] - wrist)) <= self.options.reach_m
        if near and not self._is_waiting:
            self._gripper.take_hold()

    def set_partner_hand(self, position: Array, velocity: Array | None = None) -> None:
        """
        Set position and velocity of the partner's hand.

        Args:
            position: (3,), m; ignored if not finite.
            velocity: (3,), m/s; None: derived from the positions.

        """
        if not np.all(np.isfinite(position)):
            return
        if velocity is not None and not np.all(np.isfinite(velocity)):
            velocity = None
        self._grip.set_hand(np.array(position, dtype=float), velocity)
        if self._is_waiting:
            self._is_waiting = False
            self._place(np.array(position) - self.options.position)
            self._grip.hold(self.pose[0])

    @property
    def partner_force(self) -> Array:
        """Return the force of the partner's hand on the object, mean since `begin`, (3,), N."""
        return self._pulled / self._elapsed_s if self._elapsed_s > 0.0 else self._pull

    def begin(self) -> None:
        """Restart the averaging of forces."""
        self._impulse = np.zeros(6)
        self._pulled = np.zeros(3)
        self._noise = self._random.normal(0.0, self.options.noise_n, 3)
        self._elapsed_s = 0.0

    def push(self, time_step_s: float) -> None:
        """
        Apply the partner's hand in the next step.

        Args:
            time_step_s: its length, s.

        """
        self._pull = np.zeros(3)
        self._gripper.draw(time_step_s)
        if self._is_waiting:
            self._place(self.pose[0])
            return
        position, quaternion = self.pose
        linear, angular = self._engine.getBaseVelocity(self._body)
        lift_n = -float(self._felt[2]) if self._gripper.holds else None
        held = self._grip.holds
        force = self._grip.force(position, np.array(linear), lift_n, time_step_s)
        if self._grip.holds:
            if not held:
                self._quaternion = quaternion.tolist()
            self._pull = force
            self._apply(force, position, quaternion, np.array(angular))
        elif not self._gripper.holds:
            self._rest(position)

    def _apply(self, force: Array, position: Array, quaternion: Array, angular: Array) -> None:
        """Pull on the object, and restore its orientation at the grip."""
        self._engine.applyExternalForce(
            self._body, -1, force.tolist(), position.tolist(), pybullet.WORLD_FRAME
        )
        turn: Any = pybullet.getDifferenceQuaternion(quaternion.tolist(), self._quaternion)
        axis, angle = pybullet.getAxisAngleFromQuaternion(turn)
        angle = angle - 2.0 * np.pi if angle > np.pi else angle
        spring = HAND_TURNS**2 * angle * np.array(axis) - 2.0 * HAND_TURNS * angular
        rotation = np.array(pybullet.getMatrixFromQuaternion(quaternion.tolist())).reshape(3, 3)
        torque = rotation @ (self.options.inertia * (rotation.T @ spring))
        self._engine.applyExternalTorque(
            self._body, -1, (self._grip.strength * torque).tolist(), pybullet.WORLD_FRAME
        )

    def _is_on_table(self, position: Array) -> bool:
        """Return whether it is on the table or just above; a table exists if it began there."""
        if self.options.holder != Holder.TABLE.value:
            return False
        x, y, z = np.abs(position - self.options.table)
        return bool(max(x, y) <= 0.5 * TABLE_SIDE_M and z <= LAID_DOWN_M)

    def _rest(self, position: Array) -> None:
        """Stop the object at table and floor."""
        if self._is_on_table(position):
            height = float(self.options.table[2])
        else:
            height = FLOOR_M + 0.5 * min(self.options.size)
        if position[2] <= height and float(self.velocity[2]) <= 0.0:
            self._place(np.array([position[0], position[1], height]))

    def feel(self, time_step_s: float) -> None:
        """
        Add the wrench of the joint in the last step.

        Args:
            time_step_s: its length, s.

        """
        self._felt = self._gripper.transmitted()
        self._impulse += time_step_s * self._felt
        self._pulled += time_step_s * self._pull
        self._elapsed_s += time_step_s

    def _place(self, position: Array) -> None:
        """Put the object at a position, at rest."""
        quaternion = self.pose[1].tolist()
        self._engine.resetBasePositionAndOrientation(self._body, position.tolist(), quaternion)
        self._engine.resetBaseVelocity(self._body, [0, 0, 0], [0, 0, 0])
