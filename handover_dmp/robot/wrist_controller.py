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
Joint velocities from a wrist command and the arm's joint states, or the reason for none.

It handles the inputs of the inverse kinematics in a running controller: joint states that are
reordered, incomplete or late, commands that stop, hands that are lost. Free of ROS.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import nan
from typing import NamedTuple

from handover_dmp.common.arrays import Array
from handover_dmp.robot.joint_states import all_finite, MeasuredArm
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.partner import Partner
from handover_dmp.robot.priority_ik import IkSolution, PriorityIk
from handover_dmp.robot.singularity import smallest_singular_value
from handover_dmp.robot.tasks import ik_setting, WristTarget
import numpy as np

STALLED = 0.03
"""Share of the wrist's speed below which the arm stops instead."""
CREEPING = 0.1
"""Share of the wrist's speed below which the arm stops after `MAX_CREEP_S`."""
MAX_CREEP_S = 0.3
GOES_ON = 0.2
"""Share of the wrist's speed that has to be possible before a stopped arm moves again."""
AT_EASE_S = 0.2
"""Time in which every joint can reach any speed, s."""
HELD_ROTATION = 1e-3
"""Norm of the difference of two rotation matrices below which they count as equal."""


@dataclass(frozen=True)
class WristControllerOptions:
    """Time-outs of the inputs."""

    joint_state_timeout_s: float = ik_setting(
        'joint_state_timeout_s',
        'Age of the joint states, by arrival, beyond which the arm brakes without feedback, s',
        0.005,
        10.0,
    )
    command_timeout_s: float = ik_setting(
        'command_timeout_s',
        'Age of the wrist command, by arrival, beyond which the arm brakes, s',
        0.005,
        10.0,
    )
    hand_timeout_s: float = ik_setting(
        'hand_timeout_s',
        'Age of the hand, by arrival, beyond which its position counts as unknown, s',
        0.005,
        10.0,
    )
    hold_distance_m: float = ik_setting(
        'hold_distance_m',
        'Distance to a standing target below which the wrist holds still, m',
        0.0,
        0.1,
    )


class JointCommand(NamedTuple):
    """
    Result of one period.

    Attributes:
        velocities: (n,), rad/s, in the model's order; None for no command.
        reason: why the arm brakes or is not commanded; empty in normal operation.
        solution: result of the inverse kinematics; None while braking or at rest.
        smallest_singular_value: smallest singular value of the Jacobian of the wrist's position,
            m; NaN if the joint positions are unknown.

    """

    velocities: Array | None
    reason: str
    solution: IkSolution | None = None
    smallest_singular_value: float = nan

    @property
    def speed_scale(self) -> float:
        """Share of the commanded speed that is possible: 0 while braking, 1 while at rest."""
        if self.solution is None:
            return 0.0 if self.reason else 1.0
        return self.solution.speed_scale

    def status_values(self, time_s: float) -> dict[str, float]:
        """
        Return the values of `/wrist/ik_status`.

        Args:
            time_s: time of the period, s.

        Returns:
            Name to value; while braking or at rest the residuals are 0.

        """
        found = self.solution
        return {
            'time_s': time_s,
            'speed_scale': self.speed_scale,
            'smallest_singular_value': self.smallest_singular_value,
            'position_residual': found.residuals['position'] if found else 0.0,
            'orientation_residual': found.residuals['orientation'] if found else 0.0,
            'active_limits': float(len(found.active_limits)) if found else 0.0,
        }


class WristController(MeasuredArm):
    """Makes an arm follow wrist commands by priority inverse kinematics, while it is safe."""

    def __init__(
        self,
        model: RobotModel,
        ik: PriorityIk,
        options: WristControllerOptions | None = None,
        *,
        joint_prefix: str = '',
    ) -> None:
        """
        Take the arm and its inverse kinematics.

        Args:
            model: the arm.
            ik: its inverse kinematics.
            options: the time-outs.
            joint_prefix: prefix of the driver's joint names.

        """
        super().__init__(model, joint_prefix)
        self.ik = ik
        self.options = options or WristControllerOptions()
        self.reset()

    def reset(self) -> None:
        """Forget every input."""
        self._forget_joint_states()
        self._commanded: Array | None = None
        self._target: WristTarget | None = None
        self._target_arrival_s = float('-inf')
        self._stalled = False
        self._creeps_s = 0.0
        self._hand: Partner | None = None
        self._hand_arrival_s = float('-inf')
        self._hand_timeout_s = 0.0
        self._elbow: Array | None = None
        self._elbow_arrival_s = float('-inf')

    @property
    def positions(self) -> Array | None:
        """Joint positions, (n,), rad, in the model's order; None before the first valid ones."""
        return self._positions

    def ages_s(self, now_s: float) -> dict[str, float]:
        """
        Return the ages of the inputs.

        Args:
            now_s: the time, s, on the clock of the arrivals.

        Returns:
            Name to age, s; infinite for an input that never arrived.

        """
        return {
            'joint states': now_s - self._joint_arrival_s,
            'wrist command': now_s - self._target_arrival_s,
            'hand': now_s - self._hand_arrival_s,
        }

    def set_target(self, target: WristTarget, arrival_s: float) -> bool:
        """
        Process a wrist command.

        Args:
            target: pose and twist of the wrist, in `world`.
            arrival_s: time of arrival, s.

        Returns:
            Whether it was used; it is ignored if not finite.

        """
        parts = (target.position, target.velocity, target.rotation, target.angular_velocity)
        if not all(all_finite(part) for part in parts if part is not None):
            return False
        self._target = target
        self._target_arrival_s = arrival_s
        return True

    def set_hand(self, hand: Partner, arrival_s: float, timeout_s: float = 0.0) -> None:
        """
        Process the partner's hand, for separation and for the task `point`.

        Args:
            hand: its position, and its velocity if known.
            arrival_s: time of arrival, s.
            timeout_s: age up to which no newer one is expected, s, if larger than
                `hand_timeout_s`.

        """
        if all_finite(hand.position) and all_finite(hand.velocity):
            self._hand = hand
            self._hand_arrival_s = arrival_s
            self._hand_timeout_s = timeout_s

    def set_elbow(self, position: Array, arrival_s: float) -> bool:
        """
        Process the position of the partner's elbow, for keeping away from the forearm.

        Args:
            position: (3,), m, in `world`.
            arrival_s: time of arrival, s; it is ignored after `hand_timeout_s`.

        Returns:
            Whether it was used; it is ignored if not finite.

        """
        if not all_finite(position):
            return False
        self._elbow, self._elbow_arrival_s = position, arrival_s
        return True

    def _partner(self, now_s: float) -> Partner | None:
        """Return the presently known state of the partner."""
        timeout_s = max(self.options.hand_timeout_s, self._hand_timeout_s)
        if self._hand is None or now_s - self._hand_arrival_s > timeout_s:
            return None
        if self._elbow is None or now_s - self._elbow_arrival_s > self.options.hand_timeout_s:
            return self._hand
        return replace(self._hand, elbow=self._elbow)

    def update(self, now_s: float, dt: float) -> JointCommand:
        """
        Advance by one period.

        Args:
            now_s: the time, s, on the clock of the arrivals.
            dt: time until the next call, s.

        Returns:
            Joint velocities, or the reason for none.

        """
        if fault := self._joint_state_fault(now_s, self.options.joint_state_timeout_s):
            return self.stop(fault, dt)
        if self._commanded is None:
            self._commanded = self._measured_velocities
        if self._target is None:
            return self._brake('no wrist command yet', dt)
        age = now_s - self._target_arrival_s
        if age > self.options.command_timeout_s:
            return self._brake(f'wrist command is {age:.3f} s old', dt)
        hand = self._partner(now_s)
        if self._holds(self._target):
            return self._brake('', dt)
        solution = self.ik.solve(self._measured, self._commanded, self._target, dt, hand=hand)
        self._stalled = self._stalls(solution.speed_scale, self._target, hand, dt)
        if self._stalled:
            return self._brake('wrist command out of reach: singularity or limit', dt)
        self._commanded = solution.joint_velocity
        return JointCommand(
            solution.joint_velocity, '', solution, solution.smallest_singular_value
        )

    def stop(self, reason: str, dt: float) -> JointCommand:
        """
        Brake from the last command without feedback; then command nothing.

        A velocity controller keeps its last command, so the last one is zero.

        Args:
            reason: the reason.
            dt: time until the next call, s.

        Returns:
            Decreasing joint velocities; None once they have been zero.

        """
        if self._commanded is None or not self._commanded.any():
            self._commanded = None
            return JointCommand(None, reason)
        maximum = self.model.limits.acceleration * dt
        self._commanded = self._commanded - np.clip(self._commanded, -maximum, maximum)
        return JointCommand(self._commanded, reason)

    def _holds(self, target: WristTarget) -> bool:
        """Whether the wrist is commanded to stay where it is; then no joint moves."""
        turning = target.angular_velocity
        if any(target.velocity.tolist()) or (turning is not None and any(turning.tolist())):
            return False
        place, rotation = self.model.wrist_pose(self._measured)
        turned = self.ik.stack.off(rotation, target.rotation)
        near = float(np.linalg.norm(place - target.position)) < self.options.hold_distance_m
        return near and turned < HELD_ROTATION

    def _stalls(
        self, speed_scale: float, target: WristTarget, hand: Partner | None, dt: float
    ) -> bool:
        """
        Return whether the wrist can hardly approach the target.

        Near a singularity or a limit the joints would move fast for almost no motion of the wrist,
        so the arm stops instead: at once if the acceleration limits are not the reason, otherwise
        after `MAX_CREEP_S`. It moves again once a fair share of the speed is possible.
        """
        slowest = self.ik.stack.slowest
        self._creeps_s = self._creeps_s + dt if speed_scale < CREEPING * slowest else 0.0
        crept = self._creeps_s > MAX_CREEP_S
        if not (self._stalled or crept or speed_scale < STALLED):
            return False
        positions = self._measured
        at_ease = self.ik.solve(positions, np.zeros(len(positions)), target, AT_EASE_S, hand=hand)
        if self._stalled:
            return at_ease.speed_scale < GOES_ON * slowest
        return crept or at_ease.speed_scale < STALLED

    def _brake(self, reason: str, dt: float) -> JointCommand:
        assert self._commanded is not None
        positions = self._measured
        self._commanded = self.ik.brake(positions, self._commanded, dt)
        singular_value = smallest_singular_value(self.model.wrist_jacobian(positions)[:3])
        return JointCommand(self._commanded, reason, smallest_singular_value=singular_value)
