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

"""Tasks that show the quality of an inverse kinematics, the same for ours and its peers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from handover_dmp.common.arrays import Array
from handover_dmp.robot.errors import UnreachableError
from handover_dmp.robot.model import RobotModel
import numpy as np

PERIOD_S = 0.005

Follower = Callable[[Array, Array, Array, Array], tuple[Array, float]]
"""(joint positions, last joint velocity, wrist position and velocity) to (joint velocity, s)."""


@dataclass(frozen=True, eq=False)
class Run:
    """
    The motion of an arm.

    Attributes:
        joints: (m + 1, n), rad, at the start of each period and at the end.
        velocities: (m, n), rad/s, of each period.
        wrist: (m + 1, 3), m, wrist positions.
        targets: (m + 1, 3), m, targets at the same times.
        scales: (m,), the speed scale of each period.

    """

    joints: Array
    velocities: Array
    wrist: Array
    targets: Array
    scales: Array

    @property
    def errors(self) -> Array:
        """Distances of the wrist to its target, (m + 1,), m."""
        return np.asarray(np.linalg.norm(self.wrist - self.targets, axis=1))

    def rms_jerk(self, last_s: float) -> float:
        """Return the root mean square jerk of all joints in the last seconds, rad/s³."""
        jerk = np.diff(self.velocities, n=2, axis=0) / PERIOD_S**2
        return float(np.sqrt(np.mean(jerk[-round(last_s / PERIOD_S):] ** 2)))  # fmt: skip

    def excess(self, model: RobotModel) -> dict[str, float]:
        """Return the largest use of each limit, 1 at the limit; for position, rad beyond it."""
        limits = model.limits
        changes = np.diff(self.velocities, axis=0, prepend=0.0) / PERIOD_S
        beyond = np.maximum(self.joints - limits.upper, limits.lower - self.joints)
        return {
            'position': float(beyond.max()),
            'acceleration': float((np.abs(changes) / limits.acceleration).max()),
        }


def follow(
    model: RobotModel,
    follower: Follower,
    start: Array,
    path: Callable[[float], tuple[Array, Array]],
    duration_s: float,
    *,
    phase_stopping: bool = False,
) -> Run:
    """
    Let an ideal arm, which executes every command exactly, follow a moving target.

    Args:
        model: the arm.
        follower: the inverse kinematics.
        start: (n,), rad, at rest.
        path: returns position and velocity of the target at a time.
        duration_s: duration of the run, s.
        phase_stopping: whether the target's clock runs at the rate of the speed scale.

    Returns:
        The motion.

    """
    q, velocity, clock, rate = start.copy(), np.zeros(model.dof), 0.0, 1.0
    joints, velocities, scales, targets = [q], [], [], [path(0.0)[0]]
    for _ in range(round(duration_s / PERIOD_S)):
        position, speed = path(clock)
        try:
            velocity, rate = follower(q, velocity, position, speed)
        except RuntimeError:
            velocity = np.zeros(model.dof)
        q = q + velocity * PERIOD_S
        clock += (rate if phase_stopping else 1.0) * PERIOD_S
        joints.append(q)
        velocities.append(velocity)
        scales.append(rate)
        targets.append(path(clock)[0])
    wrist = [model.wrist_pose(q)[0] for q in joints]
    return Run(*map(np.array, (joints, velocities, wrist, targets, scales)))


def minimum_jerk_path(
    start: Array, end: Array, duration_s: float, bulge: Array | None = None
) -> Callable[[float], tuple[Array, Array]]:
    """
    Make a point-to-point path with bell-shaped speed, straight or curved.

    Args:
        start: (3,), m.
        end: (3,), m.
        duration_s: duration of the motion, s; it rests at the end.
        bulge: (3,), m, offset of its middle from the straight line.

    Returns:
        Position and velocity at a time.

    """
    side = np.zeros(3) if bulge is None else bulge

    def path(time_s: float) -> tuple[Array, Array]:
        u = min(max(time_s / duration_s, 0.0), 1.0)
        share = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        rate = 30.0 * u * u * (1.0 - u) ** 2 / duration_s
        position = start + share * (end - start) + 4.0 * share * (1.0 - share) * side
        velocity = rate * ((end - start) + 4.0 * (1.0 - 2.0 * share) * side)
        return position, velocity

    return path


def limit_drives(
    model: RobotModel, distance: float = 0.25, duration_s: float = 2.0
) -> list[tuple[Array, Callable[[float], tuple[Array, Array]], str]]:
    """
    Make motions that drive each joint into its position limits.

    Each starts with the joint a little before a limit and moves the wrist in the direction in
    which that joint alone would move it, farther than the limit permits. Only motions with a joint
    configuration for every point of the path are kept, so that the inverse kinematics causes the
    whole error.

    Args:
        model: the arm.
        distance: length of the motion, m.
        duration_s: duration of the motion, s.

    Returns:
        Start configuration, path and name of each.

    """
    drives = []
    for joint in range(model.dof):
        for side, limit in ((1.0, model.limits.upper[joint]), (-1.0, model.limits.lower[joint])):
            if not np.isfinite(limit):
                continue
            start = model.home.copy()
            start[joint] = limit - 0.1 * side
            towards = side * model.wrist_jacobian(start)[:3, joint]
            if np.linalg.norm(towards) < 0.1:
                continue
            origin, _ = model.wrist_pose(start)
            end = origin + distance * towards / np.linalg.norm(towards)
            path = minimum_jerk_path(origin, end, duration_s)
            if _passable(model, start, path, duration_s):
                drives.append((start, path, f'{model.joint_names[joint]} {limit:+.2f} rad'))
    return drives


def _passable(
    model: RobotModel,
    start: Array,
    path: Callable[[float], tuple[Array, Array]],
    duration_s: float,
) -> bool:
    """Tell whether joint configurations exist along a path, continuous and far from singular."""
    q = start
    for time_s in np.linspace(0.0, duration_s, 41)[1:]:
        try:
            found = model.inverse(path(time_s)[0], q0=q)
        except UnreachableError:
            return False
        manipulability = np.linalg.svd(model.wrist_jacobian(found)[:3], compute_uv=False)[-1]
        if np.abs(found - q).max() > 0.5 or manipulability < 0.2:
            return False
        q = found
    return True
