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

"""Inverse kinematics of single poses, and the size of the reachable space."""

from __future__ import annotations

from typing import Any, Protocol

from handover_dmp.common.arrays import Array
from handover_dmp.robot.errors import UnreachableError
from handover_dmp.robot.limits import JointLimits
import numpy as np
import pinocchio as pin

TOLERANCE = 1e-6
POSTURE_WEIGHT = 0.02
ATTEMPTS = 12
POLISHING_STEPS = 20


class Arm(Protocol):
    """The part of an arm that inverse kinematics needs; `model.RobotModel` provides it."""

    @property
    def name(self) -> str:
        """Name of the robot."""
        ...

    @property
    def dof(self) -> int:
        """Return the number of joints, n."""
        ...

    @property
    def limits(self) -> JointLimits:
        """Limits of the joints."""
        ...

    @property
    def home(self) -> Array:
        """Home configuration, (n,), rad."""
        ...

    @property
    def shoulder(self) -> Array:
        """Centre of the reachable space, (3,), m."""
        ...

    @property
    def pinocchio_model(self) -> Any:
        """Return the chain of joints."""
        ...

    def wrist_pose(self, joint_positions: Array) -> tuple[Array, Array]:
        """Return position, (3,), m, and rotation, (3, 3), of the wrist in `world`."""
        ...

    def wrist_jacobian(self, joint_positions: Array) -> Array:
        """Return the Jacobian of the wrist, (6, n), linear above angular."""
        ...


def inverse_kinematics(
    model: Arm, position: Array, rotation: Array | None, q0: Array | None
) -> Array:
    """
    Solve the inverse kinematics for a pose, within the limits and close to a configuration.

    Each attempt minimises the squared pose error plus a small weight on the squared distance to
    `q0` (bounded least squares), and then removes the remaining pose error by Newton's method.
    Attempts after the first start at seeded random configurations.

    Args:
        model: the arm.
        position: (3,), m, in `world`.
        rotation: (3, 3), rotation of the wrist in `world`; None for any.
        q0: (n,), rad, the configuration to stay close to; None for `model.home`.

    Returns:
        Joint positions, (n,), rad.

    Raises:
        UnreachableError: no attempt came within 1e-6 m and 1e-6 rad.

    """
    near = np.array(model.home if q0 is None else q0, dtype=float)
    low = np.where(np.isfinite(model.limits.lower), model.limits.lower, near - 2.0 * np.pi)
    high = np.where(np.isfinite(model.limits.upper), model.limits.upper, near + 2.0 * np.pi)
    near = np.clip(near, low, high)
    goal = np.asarray(position, dtype=float)
    rng = np.random.default_rng(0)
    closest = np.inf
    for attempt in range(ATTEMPTS):
        start = near if attempt == 0 else rng.uniform(low, high)
        q = _near_pose(model, goal, rotation, near, start, low, high)
        q = _polished(model, goal, rotation, q, low, high)
        error = _pose_error(model, q, goal, rotation)
        closest = min(closest, float(np.linalg.norm(error[:3])))
        if np.linalg.norm(error[:3]) < TOLERANCE and np.linalg.norm(error[3:]) < TOLERANCE:
            return q
    if closest < TOLERANCE:
        raise UnreachableError(
            f'{model.name} can reach {_metres(goal)}, but not with that rotation of its wrist',
            0.0,
        )
    raise UnreachableError(
        f'{model.name} cannot reach {_metres(goal)} with its wrist: it is {closest:.3f} m too far',
        closest,
    )


def shoulder(model: Arm) -> Array:
    """
    Find the centre of the reachable space.

    Args:
        model: the arm.

    Returns:
        The point on the first joint's axis nearest to the second axis, (3,), m; the origin of the
        first joint if the two are parallel or there is only one.

    """
    pinocchio_model = model.pinocchio_model
    data = pinocchio_model.createData()
    jacobian = pin.computeJointJacobians(pinocchio_model, data, np.array(model.home))
    first: Array = data.oMi[1].translation.copy()
    if model.dof < 2:
        return first
    a, b = jacobian[3:, 0], jacobian[3:, 1]
    between = data.oMi[2].translation - first
    crossing = 1.0 - float(a @ b) ** 2
    if crossing < 1e-9 or not a.any() or not b.any():
        return first
    along = (float(a @ between) - float(a @ b) * float(b @ between)) / crossing
    point: Array = first + along * a
    return np.asarray(point)


def greatest_reach(model: Arm) -> float:
    """
    Find the maximum distance of the wrist from the shoulder.

    Args:
        model: the arm.

    Returns:
        The distance, m, the best of several local maxima within the position limits.

    """
    # imported here: it takes half a second, and the nodes load a model without it
    from scipy.optimize import minimize

    centre = model.shoulder
    low, high = model.limits.one_turn

    def cost(q: Array) -> tuple[float, Array]:
        position, _ = model.wrist_pose(q)
        jacobian = model.wrist_jacobian(q)[:3]
        arm = position - centre
        return -0.5 * float(arm @ arm), -(jacobian.T @ arm)

    rng = np.random.default_rng(0)
    starts = [np.clip(model.home, low, high), *rng.uniform(low, high, (7, model.dof))]
    bounds = list(zip(low, high, strict=True))
    best = max(
        -minimize(cost, start, jac=True, method='L-BFGS-B', bounds=bounds).fun for start in starts
    )
    return float(np.sqrt(2.0 * best))


def _pose_error(model: Arm, q: Array, goal: Array, rotation: Array | None) -> Array:
    """Return the pose error, (3,) or (6,), m and rad, in the axes of `world`."""
    position, current = model.wrist_pose(q)
    if rotation is None:
        return goal - position
    return np.concatenate([goal - position, current @ pin.log3(current.T @ rotation)])


def _near_pose(
    model: Arm,
    goal: Array,
    rotation: Array | None,
    near: Array,
    start: Array,
    low: Array,
    high: Array,
) -> Array:
    from scipy.optimize import least_squares

    rows = 3 if rotation is None else 6
    held = POSTURE_WEIGHT * np.eye(model.dof)

    def residual(q: Array) -> Array:
        error = _pose_error(model, q, goal, rotation)
        return np.concatenate([error, POSTURE_WEIGHT * (q - near)])

    def slope(q: Array) -> Array:
        return np.vstack([-model.wrist_jacobian(q)[:rows], held])

    inset = 1e-9 * (high - low)
    start = np.clip(start, low + inset, high - inset)
    found: Array = least_squares(residual, start, slope, bounds=(low, high), max_nfev=60).x
    return found


def _polished(
    model: Arm, goal: Array, rotation: Array | None, q: Array, low: Array, high: Array
) -> Array:
    rows = 3 if rotation is None else 6
    free = np.ones(model.dof, dtype=bool)
    for _ in range(POLISHING_STEPS):
        error = _pose_error(model, q, goal, rotation)
        if np.linalg.norm(error) < 1e-3 * TOLERANCE:
            break
        jacobian = model.wrist_jacobian(q)[:rows] * free
        step = np.linalg.lstsq(jacobian, error, rcond=1e-6)[0]
        step *= min(1.0, 0.3 / max(float(np.abs(step).max()), 1e-12))
        moved = q + step
        q = np.clip(moved, low, high)
        free &= q == moved
    return q


def _metres(point: Array) -> str:
    return '(' + ', '.join(f'{coordinate:.3f}' for coordinate in point) + ') m'
