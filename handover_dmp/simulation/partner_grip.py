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
The partner's hand on the object: it takes an object held out to it, and releases a taken one.

The motion of the hand is prescribed. It is connected to the object by a spring with a damper,
slack at the moment of the grip, which becomes as stiff as a human arm within a short time. Within
the same time the hand takes over the weight. When the robot takes, it is the reverse: once the
gripper has closed, the hand gives up the weight, lets the object slide with the robot's pull, and
opens when the robot carries enough of the weight. A hand that is kept waiting for what it holds
pulls.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import UsageError
from handover_dmp.robot.velocity_driver import sim_setting
import numpy as np

FORGOTTEN_S = 0.02
"""Time without a new position after which the hand stands still, s."""
SMOOTHING_S = 0.03
"""Time constant of the velocity estimate if the velocity is not given, s."""
JUMP_SHARE = 0.4
"""Jump of the given position beyond which the hand glides to it, as a share of `slip_m`."""
GLIDE_SPEED = 1.0
"""Speed of the glide, m/s."""
ARRIVED_SHARE = 0.2
"""Distance at which the glide ends, as a share of `slip_m`."""
AWAY = 1.5
"""Distance, in units of reach, beyond which a hand that has let go may take again."""
PULL_SPEED = 0.03
"""Speed with which a pulling hand draws its end of the spring back, m/s."""
PULL_SHARE = 0.8
"""Maximum extension of the spring by a pull, as a share of that at which the object slips."""


@dataclass(frozen=True)
class PartnerGripOptions:
    """
    Options of the partner's hand.

    Raises:
        UsageError: a number is not positive.

    """

    reach_m: float = sim_setting(
        'partner.reach_m',
        'Maximum distance from the hand (the wrist) to the centre of an object that the partner '
        'can take, m',
        0.001,
        5.0,
    )
    speed: float = sim_setting(
        'partner.speed',
        'Maximum speed of the object relative to the hand at which the partner takes it, m/s',
        0.001,
        5.0,
    )
    reaction_s: float = sim_setting(
        'partner.reaction_s',
        'Reaction time of the partner, before taking an object in reach and before feeling the '
        "robot's grip, s",
        0.001,
        5.0,
    )
    grip_s: float = sim_setting(
        'partner.grip_s',
        "Time within which the partner's grip and share of the weight grow or fade, s",
        0.001,
        5.0,
    )
    stiffness: float = sim_setting(
        'partner.stiffness', "Stiffness of the partner's arm, N/m", 1.0, 10000.0
    )
    share: float = sim_setting(
        'partner.share',
        'Share of the weight that the robot must carry before the partner lets go',
        0.01,
        1.0,
    )
    pulls_after_s: float = sim_setting(
        'partner.pulls_after_s',
        'Time that the hand waits for what both hold before it pulls, s',
        0.001,
        60.0,
    )
    slip_m: float = sim_setting(
        'partner.slip_m',
        'Distance from the grasp at which the object slips out of the hand, m',
        0.001,
        1.0,
    )

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, value in vars(self).items():
            if not value > 0.0:
                raise UsageError(f'partner.{name} is {value}: it must be positive')


class PartnerGrip:
    """
    A hand that may hold an object.

    Attributes:
        options: options of the hand.
        strength: strength of the grip, 0 (open) to 1.
        lift: share of the weight that the hand carries in addition to its spring, 0 to 1.

    """

    def __init__(self, mass_kg: float, gravity: float, options: PartnerGripOptions) -> None:
        """
        Take the object's mass.

        Args:
            mass_kg: mass, kg.
            gravity: gravity, m/s².
            options: options of the hand.

        """
        self.options = options
        self._mass_kg = mass_kg
        self._weight_n = mass_kg * gravity
        self._damping = 2.0 * sqrt(options.stiffness * mass_kg)
        self.reset()

    def reset(self) -> None:
        """Restart, open, with an unknown position."""
        self.strength = self.lift = 0.0
        self._hand: Array | None = None
        self._told = np.zeros(3)
        self._is_gliding = False
        self._velocity = np.zeros(3)
        self._anchor = np.zeros(3)
        self._age_s = 0.0
        self._is_closed = False
        self._gives = False
        self._is_sated = False
        self._since_s = 0.0

    @property
    def hand(self) -> Array | None:
        """Position of the hand, (3,), m; None before it is set."""
        return self._hand

    @property
    def holds(self) -> bool:
        """Whether the hand holds the object."""
        return self.strength > 0.0

    def hold(self, position: Array) -> None:
        """
        Begin with the object firmly in the hand.

        Args:
            position: (3,), position of its centre, m.

        """
        assert self._hand is not None
        self._grip(position)
        self.strength = self.lift = 1.0
        self._gives = True

    def set_hand(self, position: Array, velocity: Array | None) -> None:
        """
        Set position and velocity of the hand.

        Args:
            position: (3,), m.
            velocity: (3,), m/s; None: derived from the positions.

        """
        off_m = 0.0 if self._hand is None else float(np.linalg.norm(position - self._hand))
        share = ARRIVED_SHARE if self._is_gliding else JUMP_SHARE
        jumps = off_m > share * self.options.slip_m
        if jumps:
            velocity = np.zeros(3)
        else:
            velocity = self._speed_to(position) if velocity is None else velocity
            self._hand = position
        self._is_gliding, self._told = jumps, position
        self._velocity, self._age_s = velocity, 0.0

    def _speed_to(self, position: Array) -> Array:
        if self._hand is None or self._age_s == 0.0:
            return self._velocity
        share = self._age_s / (self._age_s + SMOOTHING_S)
        seen = (position - self._told) / self._age_s
        smoothed: Array = self._velocity + share * (seen - self._velocity)
        return smoothed

    def force(
        self, position: Array, velocity: Array, robot_lift_n: float | None, dt_s: float
    ) -> Array:
        """
        Advance by one step.

        Args:
            position: (3,), position of the object's centre, m.
            velocity: (3,), velocity of the same, m/s.
            robot_lift_n: upward force of the robot on the object, N; None: it does not hold the
                object.
            dt_s: length of the step, s.

        Returns:
            (3,), force of the hand on the object, N.

        """
        if self._hand is None:
            return np.zeros(3)
        if self._is_gliding:
            way = self._told - self._hand
            speed = min(GLIDE_SPEED, float(np.linalg.norm(way)) / dt_s)
            self._velocity = way * (speed / max(float(np.linalg.norm(way)), 1e-9))
            self._hand = self._hand + self._velocity * dt_s
        elif self._age_s < FORGOTTEN_S:
            self._hand = self._hand + self._velocity * dt_s
        else:
            self._velocity = np.zeros(3)
        self._age_s += dt_s
        self._decide(position, velocity, robot_lift_n, dt_s)
        step = dt_s / self.options.grip_s
        self.strength = _towards(self.strength, float(self._is_closed), step)
        bears = self._is_closed and not (self._gives and self._feels_robot(robot_lift_n))
        self.lift = _towards(self.lift, float(bears), step)
        if not self.holds:
            return np.zeros(3)
        if self._is_closed and not bears:
            # a giving hand is loose: the object slides in it when the robot pulls
            slid = dt_s / (dt_s + self.options.grip_s)
            self._anchor = self._anchor + slid * (position - self._hand - self._anchor)
        drawn = self._hand + self._anchor - position
        if self._is_closed and robot_lift_n is not None and self._is_kept_waiting:
            self._pull(PULL_SPEED * dt_s, float(np.linalg.norm(drawn)))
        if float(np.linalg.norm(drawn)) > self.options.slip_m:
            # the hand takes again what was torn out of it, if it can, but not what it lets go
            let_go = not self._is_closed
            self._open()
            self._is_sated = let_go
            self.strength = self.lift = 0.0
            return np.zeros(3)
        spring = self.options.stiffness * drawn + self._damping * (self._velocity - velocity)
        weight = np.array([0.0, 0.0, self.lift * self._weight_n])
        force: Array = self.strength * spring + weight
        return force

    def _decide(
        self, position: Array, velocity: Array, robot_lift_n: float | None, dt_s: float
    ) -> None:
        """Close on an object that is held out; open when the robot has taken it."""
        assert self._hand is not None
        if self._is_closed:
            if robot_lift_n is None:
                # if only the hand holds the object, it gives next
                self._gives, self._since_s = True, 0.0
                return
            self._since_s += dt_s
            if self._gives:
                has_enough = robot_lift_n > self.options.share * self._weight_n
                if self._feels_robot(robot_lift_n) and has_enough:
                    self._open()
            return
        apart = float(np.linalg.norm(position - self._hand))
        if apart > AWAY * self.options.reach_m:
            self._is_sated = False
        slow = float(np.linalg.norm(velocity - self._velocity)) < self.options.speed
        offered = apart < self.options.reach_m and slow and not self._is_sated
        self._since_s = self._since_s + dt_s if offered else 0.0
        if self._since_s >= self.options.reaction_s:
            self._grip(position)

    def _feels_robot(self, robot_lift_n: float | None) -> bool:
        return robot_lift_n is not None and self._since_s >= self.options.reaction_s

    @property
    def _is_kept_waiting(self) -> bool:
        return not self._gives and self._since_s > self.options.pulls_after_s

    def _pull(self, way_m: float, drawn_m: float) -> None:
        """Pull the object towards the hand."""
        length_m = float(np.linalg.norm(self._anchor))
        if drawn_m < PULL_SHARE * self.options.slip_m and length_m > way_m:
            self._anchor = self._anchor * (1.0 - way_m / length_m)

    def _grip(self, position: Array) -> None:
        assert self._hand is not None
        self._is_closed, self._gives, self._since_s = True, False, 0.0
        self._anchor = position - self._hand

    def _open(self) -> None:
        self._is_closed, self._gives, self._since_s = False, False, 0.0
        self._is_sated = True


def _towards(value: float, goal: float, step: float) -> float:
    return min(goal, value + step) if value < goal else max(goal, value - step)
