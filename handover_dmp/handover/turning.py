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

"""The orientation command of the wrist, for movements that have learnt the rotation."""

from __future__ import annotations

from math import hypot

from handover_dmp.common.quaternions import conjugate, logarithm, multiply, Quaternion, Turn
from handover_dmp.dmp import DecoupledDmp, OrientationPrimitive
from handover_dmp.dmp.orientation import NO_TURN, OrientationState

BRAKING = 20.0
"""Angular deceleration of the wrist while the hand is lost, rad/s²."""
BACK_SPEED = 1.0
"""Angular speed of the wrist when it turns back to its start, rad/s."""
BACK_ACCELERATION = 4.0
"""Angular acceleration for that, rad/s²."""
FOLLOWED_RAD = 0.2
"""Angle between wrist and command beyond which the wrist does not follow."""


class WristTurning:
    """The commanded orientation of the wrist, period by period; None if none was learnt."""

    def __init__(self) -> None:
        """Begin without a movement and without a measurement."""
        self._movement: DecoupledDmp | None = None
        self._primitive: OrientationPrimitive | None = None
        self._state: OrientationState | None = None
        self._measured: Quaternion | None = None
        self._goes_back = False

    def use(self, movement: DecoupledDmp) -> None:
        """
        Change the movement from the next step on.

        Args:
            movement: the movement.

        """
        if movement is not self._movement:
            self._movement = movement
            self._primitive = None if movement.turn is None else OrientationPrimitive(movement)
        if self._primitive is None:
            self._state = None

    @property
    def is_learnt(self) -> bool:
        """Whether the movement has learnt the rotation of the wrist."""
        return self._primitive is not None

    @property
    def orientation(self) -> Quaternion | None:
        """Commanded orientation, x, y, z, w; None if any orientation will do."""
        return None if self._state is None else self._state.orientation

    @property
    def angular_velocity(self) -> Turn:
        """Commanded angular velocity, rad/s."""
        return NO_TURN if self._state is None else self._state.angular_velocity

    def measure(self, orientation: Quaternion) -> None:
        """
        Process the measured orientation of the wrist.

        Args:
            orientation: unit quaternion x, y, z, w.

        """
        self._measured = orientation
        if self._state is None and self._primitive is not None:
            self._state = self._primitive.initial_state(orientation)

    def forget(self) -> None:
        """Hold the orientation of the next measurement."""
        self._state = None

    def start(self) -> None:
        """Begin the learnt rotation from the present orientation."""
        self._goes_back = False
        if self._primitive is None or self._measured is None:
            return
        held = self.orientation
        if held is None or self._is_off(held, self._measured):
            self._state = self._primitive.initial_state(self._measured)
        else:
            self._state = self._primitive.initial_state(held, self.angular_velocity)

    def follow(self, dt: float, phase_rate: float, goal_weight: float) -> None:
        """
        Step the rotation, together with a step of the position.

        Args:
            dt: length of the step, s.
            phase_rate: speed of the phase, 1 as learnt.
            goal_weight: goal weight of the position.

        """
        if self._primitive is not None and self._state is not None:
            self._state = self._primitive.step(
                self._state, dt, phase_rate, goal_weight=goal_weight
            )

    def rest(self, dt: float, *, back: bool = False) -> None:
        """
        Brake, or turn back to the orientation at the start of the handover.

        Args:
            dt: length of the step, s.
            back: whether to turn back, from now on until the next start.

        """
        if self._state is None:
            return
        self._goes_back |= back
        if self._goes_back:
            self._state = self._state.turned_back(dt, BACK_SPEED, BACK_ACCELERATION)
            return
        resting = self._state = self._state.braked(dt, BRAKING)
        moved = self._measured is not None and self._is_off(resting.orientation, self._measured)
        if moved and not any(resting.turned.velocity):
            # an external cause has turned the wrist: keep its present orientation
            self.forget()

    @staticmethod
    def _is_off(held: Quaternion, measured: Quaternion) -> bool:
        return hypot(*logarithm(multiply(held, conjugate(measured)))) > FOLLOWED_RAD
