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
The step of (8) that runs 200 times per second: three dimensions, constant stiffness, unrolled.

It equals `reference_step` (a test compares the two), without loops and with all constants of one
step length computed beforehand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import erf, exp, log, nan, sqrt

from handover_dmp.common.arrays import Vector
from handover_dmp.dmp.basis import LAST_NODE, TABLE_RATE
from handover_dmp.dmp.parameters import DmpParameters
from handover_dmp.dmp.state import DmpState, SMALLEST_PHASE
from handover_dmp.dmp.transition import GAUSS_A, GAUSS_B, in_seconds, steady

FastStep = Callable[[DmpState, Vector, Vector, float], DmpState]

_new = tuple.__new__  # makes a named tuple faster than its own __new__


def fast_step(
    parameters: DmpParameters,
    duration_s: float,
    goal_velocity_gain: float,
    rows: Sequence[tuple[Vector, Vector]],
    h: float,
) -> FastStep:
    """
    Prepare a step function for one step length.

    Args:
        parameters: parameters of the primitive; its goal weight is (7).
        duration_s: τ, s.
        goal_velocity_gain: K_v, s.
        rows: value and slope of the forcing term in each cell of the table.
        h: length of the steps, in units of τ.

    Returns:
        The step as a function of state, goal, goal velocity and phase rate.

    """
    k, k_s, alpha = parameters.stiffness, parameters.shape_stiffness, parameters.alpha
    mu = parameters.mu * TABLE_RATE
    slope = 1.0 / (parameters.sigma * sqrt(2.0) * TABLE_RATE)
    scale = -TABLE_RATE / alpha
    goal_a = k * duration_s * GAUSS_A * h + goal_velocity_gain
    goal_b = k * duration_s * GAUSS_B * h + goal_velocity_gain
    numbers = steady(k, parameters.effective_damping, h)
    carry, keep, xa, xb, va, vb = in_seconds(numbers, duration_s)
    rate = decay = later_a = later_b = nan

    def step(state: DmpState, goal: Vector, goal_velocity: Vector, phase_rate: float) -> DmpState:
        nonlocal rate, decay, later_a, later_b
        if phase_rate != rate:
            rate = phase_rate
            decay = exp(-alpha * h * rate)
            later_a = GAUSS_A * h * rate * TABLE_RATE
            later_b = GAUSS_B * h * rate * TABLE_RATE
        (x, y, z), (vx, vy, vz), phase, start = state
        node = log(phase) * scale
        node_a = node + later_a
        node_b = node + later_b
        weight_a = 0.5 + 0.5 * erf((node_a - mu) * slope)
        weight_b = 0.5 + 0.5 * erf((node_b - mu) * slope)
        free_a = (1.0 - weight_a) * k_s
        free_b = (1.0 - weight_b) * k_s
        pull_a = weight_a * k
        pull_b = weight_b * k
        push_a = goal_a * weight_a
        push_b = goal_b * weight_b
        index = int(node_a) if node_a < LAST_NODE else LAST_NODE
        (fx, fy, fz), (dx, dy, dz) = rows[index]
        rest = node_a - index
        x0, y0, z0 = start
        gx, gy, gz = goal
        hx, hy, hz = goal_velocity
        x0 -= x
        y0 -= y
        z0 -= z
        gx -= x
        gy -= y
        gz -= z
        ax = free_a * (x0 + fx + rest * dx) + pull_a * gx + push_a * hx
        ay = free_a * (y0 + fy + rest * dy) + pull_a * gy + push_a * hy
        az = free_a * (z0 + fz + rest * dz) + pull_a * gz + push_a * hz
        index = int(node_b) if node_b < LAST_NODE else LAST_NODE
        (fx, fy, fz), (dx, dy, dz) = rows[index]
        rest = node_b - index
        bx = free_b * (x0 + fx + rest * dx) + pull_b * gx + push_b * hx
        by = free_b * (y0 + fy + rest * dy) + pull_b * gy + push_b * hy
        bz = free_b * (z0 + fz + rest * dz) + pull_b * gz + push_b * hz
        return _new(
            DmpState,
            (
                (
                    x + carry * vx + xa * ax + xb * bx,
                    y + carry * vy + xa * ay + xb * by,
                    z + carry * vz + xa * az + xb * bz,
                ),
                (
                    keep * vx + va * ax + vb * bx,
                    keep * vy + va * ay + vb * by,
                    keep * vz + va * az + vb * bz,
                ),
                phase * decay or SMALLEST_PHASE,
                start,
            ),
        )

    return step
