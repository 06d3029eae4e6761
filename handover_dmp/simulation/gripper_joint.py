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
The gripper as a fixed joint that holds an object at a fixed position in it.

Closing fingers draw an object to their centre. Without that, its position in the gripper would
shift by a centimetre or two with each handover, until it was out of reach of the hand.
"""

from __future__ import annotations

from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.quaternions import exponential, logarithm
from handover_dmp.common.quiet_pybullet import pybullet
from handover_dmp.simulation.world import World
import numpy as np

JOINT_FORCE_N = 1e6
"""Maximum force of the joint, N; larger than any load, since a fixed joint does not yield."""
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
PEAK = 1.875
"""Peak speed of a minimum-jerk motion, relative to its mean."""


class GripperJoint:
    """A fixed joint between the last link of an arm and an object, while the gripper holds it."""

    def __init__(
        self, world: World, body: int, size_m: float, grip_s: float, speed: float
    ) -> None:
        """
        Begin with an open gripper.

        Args:
            world: world of the arm.
            body: number of the object in it.
            size_m: longest side of the object, m.
            grip_s: time in which the object is drawn to its position, s.
            speed: maximum speed of any point of the object meanwhile, m/s.

        """
        self._robot, self._link = world.robot, world.joints[-1]
        self._body = body
        self._radius_m = 0.5 * size_m
        self._grip_s, self._speed = grip_s, speed
        self._engine = world.engine
        self._joint: int | None = None
        self._away = np.zeros(3)
        self.hold_at(np.zeros(3))

    @property
    def holds(self) -> bool:
        """Whether it holds the object."""
        return self._joint is not None

    @property
    def place(self) -> Array:
        """Position at which the joint acts on the object, (3,), m, in `world`."""
        body = self._engine.getBasePositionAndOrientation(self._body)
        if not np.any(self._away):
            return np.array(body[0])
        return np.array(pybullet.multiplyTransforms(*body, self._away.tolist(), UPRIGHT)[0])

    def hold_at(self, position: Array) -> None:
        """
        Set the position of the object in the gripper.

        Args:
            position: (3,), m, its centre in `world`, upright, for the present pose of the arm.

        """
        into = pybullet.invertTransform(*self._flange())
        self._place = pybullet.multiplyTransforms(*into, position.tolist(), UPRIGHT)

    def take_hold(self) -> None:
        """Grasp the object at its present pose, and begin to draw it to its position."""
        body = self._engine.getBasePositionAndOrientation(self._body)
        into_object = pybullet.invertTransform(*body)
        held_at = pybullet.multiplyTransforms(*self._flange(), *self._place)
        away, turn = pybullet.multiplyTransforms(*into_object, *held_at)
        self._first_away, self._turned = np.array(away), np.array(logarithm(turn))
        self._away = self._first_away
        way_m = float(np.linalg.norm(away)) + self._radius_m * float(np.linalg.norm(self._turned))
        self._duration_s = max(self._grip_s, PEAK * way_m / self._speed)
        self._since_s = 0.0
        self._joint = int(
            self._engine.createConstraint(
                self._robot, self._link, self._body, -1, pybullet.JOINT_FIXED, [0, 0, 0],
                self._place[0], away, self._place[1], turn,
            )
        )  # fmt: skip
        self._engine.changeConstraint(self._joint, maxForce=JOINT_FORCE_N)

    def let_go(self) -> None:
        """Release the object."""
        joint, self._joint = self._joint, None
        self._away = np.zeros(3)
        if joint is not None:
            self._engine.removeConstraint(joint)

    def draw(self, time_step_s: float) -> None:
        """
        Continue to draw the object to its position.

        Args:
            time_step_s: length of the next step, s.

        """
        if self._joint is None or self._since_s >= self._duration_s:
            return
        self._since_s += time_step_s
        u = min(self._since_s / self._duration_s, 1.0)
        left = 1.0 - u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        self._away = left * self._first_away
        self._engine.changeConstraint(
            self._joint,
            self._away.tolist(),
            exponential((left * self._turned).tolist()),
            maxForce=JOINT_FORCE_N,
        )

    def transmitted(self) -> Array:
        """Return force and torque on the wrist in the last step, (6,), N and Nm; 0 if open."""
        if self._joint is None:
            return np.zeros(6)
        return np.array(self._engine.getConstraintState(self._joint))

    def _flange(self) -> tuple[Any, Any]:
        link = self._engine.getLinkState(self._robot, self._link, computeForwardKinematics=True)
        return link[0], link[1]
