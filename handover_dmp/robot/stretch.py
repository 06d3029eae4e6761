"""Near full stretch: how much the wrist may still speed outwards, so that it comes to rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def smallest_singular(jacobian: Array) -> tuple[float, Array]:
    """
    Find the direction in which the wrist moves least.

    Args:
        jacobian: (3, n), of the wrist's position.

    Returns:
        The smallest singular value, m (wrist speed for joint speeds of norm one), and its
        direction in space, (3,).

    """
    values, directions = np.linalg.eigh(jacobian @ jacobian.T)
    return max(float(values[0]), 0.0) ** 0.5, directions[:, 0]


def singular_gradient(linear: Array, angular: Array, direction: Array) -> Array:
    """
    Differentiate the square of a singular value with respect to the joints.

    With u the singular direction, λ = uᵀJJᵀu and ∂J_j/∂q_k = ω_min(j,k) × J_max(j,k) for a chain
    of single joints, ∂λ/∂q_k = 2 Σ_j u·(ω_min(j,k) × J_max(j,k)) a_j, where a = Jᵀu.

    Args:
        linear: (3, n), Jacobian of the wrist's position.
        angular: (3, n), Jacobian of its rotation.
        direction: (3,), u, of unit length.

    Returns:
        ∂λ/∂q, (n,), m² per rad.

    """
    x, y, z = direction
    turned = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) @ angular
    products = np.triu(turned.T @ linear)
    reach = linear.T @ direction
    gradient: Array = 2.0 * (products @ reach + products.T @ reach - products.diagonal() * reach)
    return gradient


def limit_outward_speed(
    velocity: Array,
    linear: Array,
    angular: Array,
    singular_value: float,
    direction: Array,
    least: float,
    rate: float,
) -> tuple[Array, bool]:
    """
    Slow the part of a wrist velocity that would stretch the arm out.

    Moving at speed r along u with the least joint speeds, q̇ = Jᵀu·r/λ, changes the singular
    value σ by σ̇ = (∂λ/∂q · a) r / (2σ³). The speed is cut so that σ̇ ≥ −rate·(σ − least): the arm
    comes to rest at σ = `least` instead of shaking about σ = 0. The rest of the velocity, and
    every motion back, stays as it is, so the wrist still slides along the end of its reach.

    Args:
        velocity: (3,), of the wrist, m/s.
        linear: (3, n), Jacobian of the wrist's position.
        angular: (3, n), Jacobian of its rotation.
        singular_value: σ, m.
        direction: (3,), u.
        least: σ at rest, m.
        rate: 1/s.

    Returns:
        The velocity, (3,), m/s, and whether it was cut.

    """
    speed = float(velocity @ direction)
    gradient = singular_gradient(linear, angular, direction)
    change = 0.5 * float(gradient @ (linear.T @ direction)) * speed
    floor = max(singular_value, 1e-6) ** 3 * rate * max(singular_value - least, 0.0)
    if change >= -floor:
        return velocity, False
    return velocity + (-floor / change - 1.0) * speed * direction, True
