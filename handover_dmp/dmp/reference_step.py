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
The transformation system (8) over one interval: readable, and the reference for the fast forms.

`fast_step` unrolls it for three dimensions, `Primitive.rollout` computes all samples at once.
"""

from __future__ import annotations

from math import exp
from typing import TYPE_CHECKING

from handover_dmp.common.arrays import Vector
from handover_dmp.dmp.state import DmpState, SMALLEST_PHASE
from handover_dmp.dmp.transition import GAUSS_A, GAUSS_B, in_seconds, steady, varying

if TYPE_CHECKING:
    from handover_dmp.dmp.primitive import Primitive


def reference_step(
    model: Primitive,
    state: DmpState,
    goal: Vector,
    goal_velocity: Vector,
    h: float,
    phase_rate: float,
) -> DmpState:
    """
    Step τv̇ = (1 − w)K_s(f + x0 − x) + w[K(g − x) + K_v ġ] − Dv, τẋ = v, (8).

    Args:
        model: the primitive, of any dimension and formulation.
        state: state at the start of the interval.
        goal: g at the start of the interval, m, d floats.
        goal_velocity: ġ, m/s, d floats.
        h: length of the interval, in units of τ; goal weight and shape are smooth over it.
        phase_rate: speed of the phase, 1 as learnt.

    Returns:
        The state at the end of the interval.

    """
    position, velocity, phase, start = state
    k, k_s, tau = model.parameters.stiffness, model.shape_stiffness, model.duration_s
    u = model.time_of(phase)
    inputs, stiffness = [], []
    for theta in (GAUSS_A * h, GAUSS_B * h):
        at = u + phase_rate * theta
        weight = model.goal_weight_at(at)
        free, pull = (1.0 - weight) * k_s, weight * k
        # within the interval the goal moves by τθġ
        push = pull * tau * theta + weight * model.goal_velocity_gain
        inputs.append(
            [
                free * (x0 - x + f) + pull * (g - x) + push * g_dot
                for x0, x, f, g, g_dot in zip(
                    start, position, model.shape(at), goal, goal_velocity, strict=True
                )
            ]
        )
        stiffness.append(free + pull)
    damping = model.parameters.effective_damping
    k_a, k_b = stiffness
    numbers = varying(k_a, k_b, damping, h) if model.varies else steady(k, damping, h)
    carry, keep, xa, xb, va, vb = in_seconds(numbers, tau)
    rows = list(zip(position, velocity, *inputs, strict=True))
    return DmpState(
        tuple(x + carry * v + xa * a + xb * b for x, v, a, b in rows),
        tuple(keep * v + va * a + vb * b for _, v, a, b in rows),
        phase * exp(-model.parameters.alpha * h * phase_rate) or SMALLEST_PHASE,
        start,
    )
