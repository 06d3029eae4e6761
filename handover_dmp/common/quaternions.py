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
Unit quaternions x, y, z, w with exponential and logarithm, single and in arrays.

A *turn* is a rotation vector: its direction is the axis, its length the angle in rad. q and −q are
the same rotation, and all functions treat them alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, pi, sin, sqrt

from handover_dmp.common.arrays import Array
import numpy as np
from numpy.typing import ArrayLike

Quaternion = tuple[float, float, float, float]
Turn = tuple[float, float, float]

IDENTITY: Quaternion = (0.0, 0.0, 0.0, 1.0)
SMALL = 1e-4
"""Angle below which series are used, which are exact to rounding, rad."""


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """
    Compose two rotations.

    Args:
        a: second rotation.
        b: first rotation.

    Returns:
        a ⊗ b.

    """
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def conjugate(q: Quaternion) -> Quaternion:
    """
    Invert a rotation.

    Args:
        q: of norm 1.

    Returns:
        Its inverse.

    """
    return -q[0], -q[1], -q[2], q[3]


def normalized(q: Sequence[float]) -> Quaternion:
    """
    Normalise a quaternion.

    Args:
        q: x, y, z, w, not all 0.

    Returns:
        The same rotation.

    """
    x, y, z, w = q
    norm = hypot(x, y, z, w)
    return x / norm, y / norm, z / norm, w / norm


def exponential(turn: Sequence[float]) -> Quaternion:
    """
    Return the rotation of a turn.

    Args:
        turn: axis times angle, rad.

    Returns:
        The unit quaternion.

    """
    x, y, z = turn
    angle = hypot(x, y, z)
    share = 0.5 - angle * angle / 48.0 if angle < SMALL else sin(0.5 * angle) / angle
    return share * x, share * y, share * z, cos(0.5 * angle)


def logarithm(q: Quaternion) -> Turn:
    """
    Return the shortest turn of a rotation.

    Args:
        q: of norm 1; −q gives the same.

    Returns:
        Axis times angle, 0 to π rad.

    """
    x, y, z, w = q if q[3] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])
    sine = hypot(x, y, z)
    share = 2.0 - 2.0 / 3.0 * sine * sine if sine < SMALL else 2.0 * atan2(sine, w) / sine
    return share * x, share * y, share * z


def nearest_turn(turn: Turn, other: Sequence[float]) -> Turn:
    """
    Return the equivalent turn that is nearest to another turn.

    Args:
        turn: axis times angle, rad.
        other: the other turn, rad.

    Returns:
        The turn, changed by whole revolutions.

    """
    angle = hypot(*turn)
    if angle < SMALL:
        axis_length = hypot(*other)
        if axis_length < pi:
            return turn
        # about the axis of the other, since this one has no axis
        whole = 2.0 * pi * round(axis_length / (2.0 * pi)) / axis_length
        x, y, z = other
        return turn[0] + whole * x, turn[1] + whole * y, turn[2] + whole * z
    x, y, z = (part / angle for part in turn)
    along = x * other[0] + y * other[1] + z * other[2]
    length = angle + 2.0 * pi * round((along - angle) / (2.0 * pi))
    return length * x, length * y, length * z


def angular_velocity(turn: Sequence[float], rate: Sequence[float]) -> Turn:
    """
    Convert the rate of a turn to an angular velocity: ω = J(r)ṙ, J the left Jacobian.

    Args:
        turn: r, from the first orientation, rad.
        rate: ṙ, rad/s.

    Returns:
        ω, rad/s, in the axes of the turn.

    """
    x, y, z = turn
    square = x * x + y * y + z * z
    angle = sqrt(square)
    if angle < SMALL:
        first, second = 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    else:
        first = (1.0 - cos(angle)) / square
        second = (angle - sin(angle)) / (square * angle)
    return _twisted(turn, rate, first, second)


def turn_rate(turn: Sequence[float], velocity: Sequence[float]) -> Turn:
    """
    Convert an angular velocity to the rate of a turn: ṙ = J(r)⁻¹ω.

    Args:
        turn: r, from the first orientation, rad; its angle below 2π.
        velocity: ω, rad/s.

    Returns:
        ṙ, rad/s.

    """
    x, y, z = turn
    square = x * x + y * y + z * z
    angle = sqrt(square)
    if angle < SMALL:
        second = 1.0 / 12.0 + square / 720.0
    else:
        half = 0.5 * angle
        second = (1.0 - half * cos(half) / sin(half)) / square
    return _twisted(turn, velocity, -0.5, second)


def rotated(q: Quaternion, vector: Sequence[float]) -> Turn:
    """
    Rotate a vector.

    Args:
        q: of norm 1.
        vector: (3,).

    Returns:
        The rotated vector, (3,).

    """
    x, y, z, w = q
    a, b, c = vector
    u, v, t = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return (
        a + w * u + y * t - z * v,
        b + w * v + z * u - x * t,
        c + w * t + x * v - y * u,
    )


def _twisted(turn: Sequence[float], vector: Sequence[float], first: float, second: float) -> Turn:
    """Return v + first·(r × v) + second·(r × (r × v))."""
    x, y, z = turn
    a, b, c = vector
    u, v, w = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        a + first * u + second * (y * w - z * v),
        b + first * v + second * (z * u - x * w),
        c + first * w + second * (x * v - y * u),
    )


def to_matrix(q: Sequence[float]) -> Array:
    """
    Return the rotation matrix of a quaternion.

    Args:
        q: of norm 1.

    Returns:
        (3, 3).

    """
    x, y, z, w = q
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def from_matrices(matrices: ArrayLike) -> Array:
    """
    Return the quaternions of rotation matrices.

    Args:
        matrices: (..., 3, 3); invalid rotations give NaN.

    Returns:
        (..., 4), of norm 1.

    """
    m = np.asarray(matrices, dtype=np.float64)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    a, b, c = (
        (m[..., 2, 1], m[..., 1, 2]),
        (m[..., 0, 2], m[..., 2, 0]),
        (m[..., 1, 0], m[..., 0, 1]),
    )
    dx, dy, dz = a[0] - a[1], b[0] - b[1], c[0] - c[1]
    sx, sy, sz = a[0] + a[1], b[0] + b[1], c[0] + c[1]
    # each row is the quaternion times four times one of its elements; the largest is safe
    rows = np.stack(
        [
            np.stack([1.0 + xx - yy - zz, sz, sy, dx], axis=-1),
            np.stack([sz, 1.0 - xx + yy - zz, sx, dy], axis=-1),
            np.stack([sy, sx, 1.0 - xx - yy + zz, dz], axis=-1),
            np.stack([dx, dy, dz, 1.0 + xx + yy + zz], axis=-1),
        ],
        axis=-2,
    )
    with np.errstate(invalid='ignore', divide='ignore'):
        gram = np.einsum('...ji,...jk->...ik', m, m) - np.eye(3)
        wrong = ~(np.abs(gram).max(axis=(-1, -2)) < 0.02) | ~(np.linalg.det(m) > 0.0)
        best = np.argmax(np.einsum('...ii->...i', rows), axis=-1)
        chosen = np.take_along_axis(rows, best[..., None, None], axis=-2)[..., 0, :]
        chosen = chosen / np.linalg.norm(chosen, axis=-1, keepdims=True)
    quaternions: Array = np.where(wrong[..., None], np.nan, chosen)
    return quaternions


def multiply_all(a: ArrayLike, b: ArrayLike) -> Array:
    """
    Compose arrays of rotations.

    Args:
        a: second rotations, (n, 4) or (4,).
        b: first rotations, (n, 4) or (4,).

    Returns:
        a ⊗ b, (n, 4) or (4,).

    """
    first, second = np.asarray(a, dtype=float).T, np.asarray(b, dtype=float).T
    product: Array = np.array(multiply(tuple(first), tuple(second))).T
    return product


def with_continuous_signs(quaternions: ArrayLike) -> Array:
    """
    Choose the sign of each quaternion so that it is nearest to the one before.

    Args:
        quaternions: (n, 4).

    Returns:
        The same rotations; the first with w of at least 0.

    """
    given = np.array(quaternions, dtype=np.float64)
    if not len(given):
        return given
    flips = np.einsum('ij,ij->i', given[1:], given[:-1]) < 0.0
    signs = np.where(np.cumsum(np.concatenate([[given[0, 3] < 0.0], flips])) % 2, -1.0, 1.0)
    return given * signs[:, None]


def turns_from_start(quaternions: ArrayLike) -> Array:
    """
    Return the turns of a body since its first orientation: Log(qᵢ ⊗ q₀⁻¹), without jumps.

    Args:
        quaternions: (n, 4), of norm 1.

    Returns:
        (n, 3) rad, in the axes of the room; the first is 0.

    """
    path = [normalized(row) for row in np.asarray(quaternions, dtype=float).tolist()]
    back = conjugate(path[0])
    turns = [(0.0, 0.0, 0.0)]
    for q in path[1:]:
        turns.append(nearest_turn(logarithm(multiply(q, back)), turns[-1]))
    return np.array(turns)
