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
A motion that shows a tracker all that it can be calibrated with, and the commands that make it.

Every joint swings about a posture near the one it starts from, as a sum of two sines whose
frequencies have no common period: the wrist comes by in all directions, turned about all axes, at
ever-changing speeds, so that transform, delay and the place of the marker can all be told. It
begins and ends at rest where the arm was.
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
"""Greatest amplitude of a joint."""
SLOWEST_HZ = 0.05
"""Of the first joint; the others are a little faster, each by another amount."""
GOLDEN = 0.618033988749895
RAMP_S = 3.0
"""In which the motion swells, and dies away."""
SHARE = 0.5
"""Of the limits of velocity and acceleration, which the plan keeps to."""
BRAKING_SHARE = 0.25
CLEARANCE_M = 0.03
"""That the links keep from each other, where they have it at the start."""
INSET_RAD = 0.05
SAMPLE_S = 0.04
TRIED = 8
"""Sets of phases, of which the one is taken that moves the wrist farthest in every direction."""
SHRINK = 0.8
MIN_SWING = 0.2
"""Of the amplitudes; with less, the motion tells too little."""
GAIN = 2.0
"""1/s, on the error of the joint positions."""
ASTRAY_RAD = 0.2
"""An arm that is so far from where it should be does not follow."""


@dataclass(frozen=True, eq=False)
class CalibrationMotion:
    """
    Joint positions over time, from rest to rest.

    Attributes:
        start: (n,) rad, at both ends.
        centre: (n,) rad, that the joints swing about.
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
        Tell where the joints are to be.

        Args:
            time_s: since the start, s.

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
    Plan a motion within half of the limits, as wide as the arm has room for.

    Args:
        model: the arm.
        start: (n,) rad, where it is, at rest.
        duration_s: of the motion, s.
        wrist_speed: that the wrist keeps to, m/s.

    Returns:
        The motion.

    Raises:
        UnreachableError: from this posture there is no room for one.

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
        f'{model.name}: no room to move about from here without its links coming near each other '
        'or running into the end of a joint: bring it to an open posture first',
        0.0,
    )


def wrist_box(model: RobotModel, motion: CalibrationMotion) -> Array:
    """
    Tell the space that the wrist needs.

    Args:
        model: the arm.
        motion: of its joints.

    Returns:
        (2, 3) m, the least and the greatest coordinates.

    """
    places = [model.wrist_pose(motion.at(t)[0])[0] for t in _sampled(motion)]
    return np.array([np.min(places, axis=0), np.max(places, axis=0)])


def _sampled(motion: CalibrationMotion) -> Array:
    return np.arange(0.0, motion.duration_s, SAMPLE_S)


def _pace(model: RobotModel, motion: CalibrationMotion, wrist_speed: float) -> float:
    """Tell by what factor the motion has to be slowed down; 1 if it need not."""
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
    """Tell how far the wrist moves in the direction in which it moves least, m."""
    places = np.array([model.wrist_pose(motion.at(t)[0])[0] for t in _sampled(motion)[::3]])
    off = places - places.mean(axis=0)
    return float(np.linalg.svd(off, compute_uv=False)[-1] / np.sqrt(len(places)))


def _has_room(motion: CalibrationMotion, collision: CollisionModel, clearance: float) -> bool:
    return all(collision.min_distance(motion.at(t)[0]) >= clearance for t in _sampled(motion)[::5])


class MotionFollower:
    """Joint velocities that make an arm follow a motion, whatever it does within its limits."""

    def __init__(self, model: RobotModel, motion: CalibrationMotion) -> None:
        """
        Take the motion; the arm is at rest at its start.

        Args:
            model: the arm.
            motion: to follow.

        """
        self._box = VelocityBox(model.limits, BRAKING_SHARE)
        self._motion = motion
        self._velocity = np.zeros(model.dof)

    @property
    def resting(self) -> bool:
        """Whether the arm has been told to stand."""
        return not self._velocity.any()

    def follow(self, time_s: float, positions: Array, dt: float) -> tuple[Array, str]:
        """
        Go on.

        Args:
            time_s: since the start of the motion, s.
            positions: (n,) rad, as measured.
            dt: length of the period, s.

        Returns:
            Joint velocities, (n,) rad/s, and what is wrong, or nothing.

        """
        wanted, moving = self._motion.at(time_s)
        error = wanted - positions
        if np.abs(error).max() > ASTRAY_RAD:
            return self.brake(positions, dt), (
                f'the arm is {np.abs(error).max():.2f} rad from where it should be: it does not '
                'follow its commands'
            )
        low, high = self._box.bounds(positions, self._velocity, dt)
        self._velocity = np.minimum(np.maximum(moving + GAIN * error, low), high)
        return self._velocity, ''

    def brake(self, positions: Array, dt: float) -> Array:
        """
        Come to rest within the limits.

        Args:
            positions: (n,) rad, as measured last.
            dt: length of the period, s.

        Returns:
            Joint velocities, (n,) rad/s.

        """
        self._velocity = self._box.brake(positions, self._velocity, dt)
        return self._velocity
