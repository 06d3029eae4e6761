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

"""Near full stretch: a bound on the outward speed of the wrist, so that it comes to rest."""

from __future__ import annotations

import math

import eigenpy
from handover_dmp.common.arrays import Array
from handover_dmp.robot.model import RobotModel
import pinocchio as pin

_SOLVER = eigenpy.SelfAdjointEigenSolver(3)  # making one takes as long as solving


def smallest_singular_value(jacobian: Array) -> float:
    """
    Return the wrist speed in the worst direction for joint speeds of norm one.

    Args:
        jacobian: (3, n), Jacobian of the wrist's position.

    Returns:
        The smallest singular value, m.

    """
    _SOLVER.compute(jacobian.dot(jacobian.T))
    minimum: float = _SOLVER.eigenvalues()[0]
    return math.sqrt(minimum) if minimum > 0.0 else 0.0


def smallest_singular_direction(jacobian: Array) -> Array:
    """
    Return the direction in which the wrist moves least.

    Args:
        jacobian: (3, n), Jacobian of the wrist's position.

    Returns:
        The direction in space of the smallest singular value, (3,).

    """
    _SOLVER.compute(jacobian.dot(jacobian.T))
    direction: Array = _SOLVER.eigenvectors()[:, 0]
    return direction


def singular_slope(
    model: RobotModel, joint_positions: Array, linear: Array, direction: Array
) -> float:
    """
    Differentiate a singular value along the joint motion of its own direction.

    With u the singular direction in space and a = Jᵀu the joint motion, λ = σ² = uᵀJJᵀu changes by
    ∂λ/∂q · a = 2 uᵀJ̇a, where J̇ is the change of J while the joints move with a.

    Args:
        model: the arm.
        joint_positions: (n,), rad.
        linear: (3, n), Jacobian of the wrist's position.
        direction: (3,), u, of unit length.

    Returns:
        ∂λ/∂q · a, m³.

    """
    along = linear.T @ direction
    chain, data, wrist = model.pinocchio_model, model.pinocchio_data, model.wrist_frame_id
    pin.computeJointJacobiansTimeVariation(chain, data, joint_positions, along)
    change = pin.getFrameJacobianTimeVariation(chain, data, wrist, pin.LOCAL_WORLD_ALIGNED)
    return 2.0 * float(direction @ change[:3] @ along)


def limit_outward_speed(
    velocity: Array,
    direction: Array,
    singular_value: float,
    slope: float,
    minimum: float,
    rate: float,
) -> tuple[Array, bool]:
    """
    Limit the part of a wrist velocity that would stretch the arm out.

    Moving at speed r along u with minimum joint speeds, q̇ = Jᵀu·r/λ, changes the singular value
    σ by σ̇ = (∂λ/∂q · Jᵀu)·r / (2σ³). The speed is limited so that σ̇ ≥ −rate·(σ − minimum): the
    arm comes to rest at σ = `minimum` instead of oscillating about σ = 0. The other components,
    and every motion back, are unchanged, so the wrist still slides along the end of its reach.

    Args:
        velocity: (3,), velocity of the wrist, m/s.
        direction: (3,), u.
        singular_value: σ, m.
        slope: ∂λ/∂q · Jᵀu, see `singular_slope`, m³.
        minimum: σ at rest, m.
        rate: 1/s.

    Returns:
        The velocity, (3,), m/s, and whether it was limited.

    """
    speed = float(velocity @ direction)
    change = 0.5 * slope * speed
    fastest = -(max(singular_value, 1e-6) ** 3) * rate * max(singular_value - minimum, 0.0)
    if change >= fastest:
        return velocity, False
    return velocity + (fastest / change - 1.0) * speed * direction, True
