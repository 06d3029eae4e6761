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
A motion for the calibration of a tracker, and the joint commands that follow it.

Every joint swings about a configuration near the start, as a sum of two sines without a common
period. So the wrist moves in all directions, turns about all axes, and changes its speed all the
time, which determines the transform, the delay and the position of the marker. The motion begins
and ends at rest at the start.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from handover_dmp.common.arrays import Array
from handover_dmp.robot.collision import CollisionModel
from handover_dmp.robot.errors import UnreachableError
from handover_dmp.robot.limits import VelocityBox
from handover_dmp.robot.model import RobotModel
import numpy as np

SWING_RAD = 0.35
"""Maximum amplitude of a joint."""
SLOWEST_HZ = 0.05
"""Frequency of the first joint; the others are slightly faster, each by another amount."""
GOLDEN = 0.618033988749895
RAMP_S = 3.0
"""Time in which the amplitude rises at the start, and falls at the end."""
SHARE = 0.5
"""Share of the velocity and acceleration limits that the plan may use."""
BRAKING_SHARE = 0.25
CLEARANCE_M = 0.03
"""Clearance between links, if they have it at the start."""
INSET_RAD = 0.05
SAMPLE_S = 0.04
TRIED = 8
"""Number of phase sets; the one that moves the wrist farthest in every direction is used."""
SHRINK = 0.8
MIN_SWING = 0.2
"""Minimum scale of the amplitudes; smaller motions determine too little."""
GAIN = 2.0
"""Gain on the error of the joint positions, 1/s."""
ASTRAY_RAD = 0.2
"""Position error of a joint beyond which the arm does not follow."""


@dataclass(frozen=True, eq=False)
class CalibrationMotion:
    """
    Joint positions over time, from rest to rest.

    Attributes:
        start: (n,) rad, positions at both ends.
        centre: (n,) rad, centre of the oscillation.
        amplitudes: (n,) rad.
        frequencies_hz: (2, n).
        phases: (2, n) rad.
        duration_s: s.

    """

    start: Array
    centre: Array
    amplitudes: Array
    frequencies_hz: Array
    phases: Array
    duration_s: float

    def at(self, time_s: float) -> tuple[Array, Array]:
        """
        Return the desired joint positions and velocities.

        Args:
            time_s: time since the start, s.

        Returns:
            Positions, (n,) rad, and velocities, (n,) rad/s.

        """
        time_s = min(max(time_s, 0.0), self.duration_s)
        ramp_s = min(RAMP_S, self.duration_s / 2.0)
        near_s = min(time_s, self.duration_s - time_s)
        u = min(near_s / ramp_s, 1.0)
        swell = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        sign = 1.0 if time_s < self.duration_s / 2.0 else -1.0
        growth = sign * 30.0 * u * u * (1.0 - u) ** 2 / ramp_s
        turns = 2.0 * np.pi * self.frequencies_hz
        angles = turns * time_s + self.phases
        shares = np.array([[2.0], [1.0]]) / 3.0
        away = self.centre - self.start + self.amplitudes * (shares * np.sin(angles)).sum(axis=0)
        moving = self.amplitudes * (shares * turns * np.cos(angles)).sum(axis=0)
        return self.start + swell * away, growth * away + swell * moving


def plan_calibration_motion(
    model: RobotModel, start: Array, duration_s: float, wrist_speed: float
) -> CalibrationMotion:
    """
    Plan a motion within half of the limits, as large as the free space permits.

    Args:
        model: the arm.
        start: (n,) rad, the present positions, at rest.
        duration_s: duration of the motion, s.
        wrist_speed: maximum speed of the wrist, m/s.

    Returns:
        The motion.

    Raises:
        UnreachableError: there is not enough free space at this configuration.

    """
    collision = CollisionModel.of(model)
    clearance = min(CLEARANCE_M, collision.min_distance(start) - 1e-3)
    low, high = model.limits.one_turn
    low, high = low + INSET_RAD, high - INSET_RAD
    n = model.dof
    spacing = (1.0 + np.arange(2 * n) * GOLDEN) % 1.0
    frequencies = SLOWEST_HZ * (1.0 + 1.5 * np.array([spacing[:n], 1.0 + spacing[n:]]))
    random = np.random.default_rng(0)
    drawn = [2.0 * np.pi * random.random((2, n)) for _ in range(TRIED)]
    share = 1.0
    while share >= MIN_SWING:
        amplitudes = np.minimum(share * SWING_RAD, (high - low) / 2.0)
        centre = np.clip(start, low + amplitudes, high - amplitudes)
        motions = [
            CalibrationMotion(start, centre, amplitudes, frequencies, phases, duration_s)
            for phases in drawn
        ]
        for motion in sorted(motions, key=lambda motion: -_least_spread(model, motion)):
            pace = _pace(model, motion, wrist_speed)
            slower = replace(motion, frequencies_hz=frequencies * pace)
            if _pace(model, slower, wrist_speed) >= 1.0 and _has_room(
                slower, collision, clearance
            ):
                return slower
        share *= SHRINK
    raise UnreachableError(
        f'{model.name}: not enough free space here: links would come close to each other, or '
        'joints to their limits; move the arm to an open configuration first',
        0.0,
    )


def wrist_box(model: RobotModel, motion: CalibrationMotion) -> Array:
    """
    Return the box in which the wrist moves.

    Args:
        model: the arm.
        motion: motion of its joints.

    Returns:
        (2, 3) m, the smallest and the largest coordinates.

    """
    places = [model.wrist_pose(motion.at(t)[0])[0] for t in _sampled(motion)]
    return np.array([np.min(places, axis=0), np.max(places, axis=0)])


def _sampled(motion: CalibrationMotion) -> Array:
    return np.arange(0.0, motion.duration_s, SAMPLE_S)


def _pace(model: RobotModel, motion: CalibrationMotion, wrist_speed: float) -> float:
    """Return the factor by which the motion must be slowed down; 1 if it need not."""
    times = _sampled(motion)
    states = [motion.at(t) for t in times]
    moving = np.array([velocity for _, velocity in states])
    places = np.array([model.wrist_pose(position)[0] for position, _ in states])
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / SAMPLE_S
    accelerations = np.abs(np.diff(moving, axis=0)) / SAMPLE_S
    limits = model.limits
    used = max(
        float((np.abs(moving) / (SHARE * limits.velocity)).max()),
        float(np.sqrt((accelerations / (SHARE * limits.acceleration)).max())),
        float(speeds.max()) / wrist_speed,
    )
    return min(1.0, 0.95 / used) if used > 1.0 else 1.0


def _least_spread(model: RobotModel, motion: CalibrationMotion) -> float:
    """Return the spread of the wrist in the direction of the smallest motion, m."""
    places = np.array([model.wrist_pose(motion.at(t)[0])[0] for t in _sampled(motion)[::3]])
    off = places - places.mean(axis=0)
    return float(np.linalg.svd(off, compute_uv=False)[-1] / np.sqrt(len(places)))


def _has_room(motion: CalibrationMotion, collision: CollisionModel, clearance: float) -> bool:
    return all(collision.min_distance(motion.at(t)[0]) >= clearance for t in _sampled(motion)[::5])


class MotionFollower:
    """Joint velocities, within the limits, that make an arm follow a motion."""

    def __init__(self, model: RobotModel, motion: CalibrationMotion) -> None:
        """
        Take the motion; the arm is at rest at its start.

        Args:
            model: the arm.
            motion: the motion to follow.

        """
        self._box = VelocityBox(model.limits, BRAKING_SHARE)
        self._motion = motion
        self._velocity = np.zeros(model.dof)

    @property
    def resting(self) -> bool:
        """Whether the commanded velocities are zero."""
        return not self._velocity.any()

    def follow(self, time_s: float, positions: Array, dt: float) -> tuple[Array, str]:
        """
        Advance by one period.

        Args:
            time_s: time since the start of the motion, s.
            positions: (n,) rad, measured.
            dt: length of the period, s.

        Returns:
            Joint velocities, (n,) rad/s, and the fault, empty if there is none.

        """
        wanted, moving = self._motion.at(time_s)
        error = wanted - positions
        if np.abs(error).max() > ASTRAY_RAD:
            return self.brake(positions, dt), (
                f'the arm does not follow its commands: a joint is {np.abs(error).max():.2f} '
                'rad off'
            )
        low, high = self._box.bounds(positions, self._velocity, dt)
        self._velocity = np.minimum(np.maximum(moving + GAIN * error, low), high)
        return self._velocity, ''

    def brake(self, positions: Array, dt: float) -> Array:
        """
        Brake within the limits.

        Args:
            positions: (n,) rad, last measured.
            dt: length of the period, s.

        Returns:
            Joint velocities, (n,) rad/s.

        """
        self._velocity = self._box.brake(positions, self._velocity, dt)
        return self._velocity
