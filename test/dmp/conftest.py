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

"""A smooth demonstration, and (8) solved by somebody else."""

from __future__ import annotations

from collections.abc import Callable
from math import erf

from handover_dmp.dmp import ClassicalDmp
from handover_dmp.dmp.primitive import Primitive
import numpy as np
from numpy.typing import NDArray
import pytest
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
Motion = Callable[[float], Array]


def reach(samples: int = 301, duration_s: float = 1.5) -> tuple[Array, Array]:
    """Give a reach with a bow in it, at rest at both ends."""
    u = np.linspace(0.0, 1.0, samples)
    way = 10 * u**3 - 15 * u**4 + 6 * u**5
    path = np.outer(1 - way, [0.1, 0.2, 0.3]) + np.outer(way, [0.6, 0.0, 0.5])
    path[:, 2] += 0.1 * np.sin(np.pi * u) ** 2
    return u * duration_s, path


def swing(samples: int = 301, duration_s: float = 1.2) -> tuple[Array, Array]:
    """Give a motion that starts and ends with speed."""
    t = np.linspace(0.0, duration_s, samples)
    path = np.column_stack([0.3 * np.sin(2 * t) + 0.1, 0.2 * np.tanh(3 * (t - 0.6)), 0.2 * t**2])
    return t, path


def exact(
    model: Primitive,
    times: Array,
    goal: Motion,
    goal_velocity: Motion,
    start: Array,
    velocity: Array,
    phase_rate: float = 1.0,
) -> tuple[Array, Array]:
    """Solve (8), or (1a) for a classical primitive, by DOP853 from the printed equations."""
    p = model.parameters
    tau, k, d = model.duration_s, p.stiffness, p.damping or 2 * np.sqrt(p.stiffness)
    k_s = k if p.formulation == 'stiff' else 1.0
    k_v = p.goal_velocity_gain if p.goal_velocity_gain >= 0 else d * tau
    alpha = -np.log(p.phase_at_end)
    size = len(start)

    def derivative(t: float, y: Array) -> Array:
        x, v = y[:size], y[size:]
        u = t * phase_rate / tau
        s = np.exp(-alpha * u)
        psi = np.exp(-model.basis.sharpness * (s - model.basis.centres) ** 2)
        f = psi @ model.weights / psi.sum()
        if isinstance(model, ClassicalDmp):
            force = k * (goal(t) - x) - k * (goal(t) - start) * s + k * s * f
        else:
            w = 0.5 * (1 + erf((u - p.mu) / (p.sigma * np.sqrt(2))))
            force = (1 - w) * k_s * (f + start - x)
            force += w * (k * (goal(t) - x) + k_v * goal_velocity(t))
        return np.concatenate([v, force - d * v]) / tau

    solution = solve_ivp(
        derivative,
        (times[0], times[-1]),
        np.concatenate([start, tau * np.asarray(velocity)]),
        'DOP853',
        times,
        rtol=1e-12,
        atol=1e-12,
    )
    return solution.y[:size].T, solution.y[size:].T / tau


@pytest.fixture(scope='session', name='reach')
def reach_fixture() -> tuple[Array, Array]:
    return reach()


@pytest.fixture(scope='session', name='swing')
def swing_fixture() -> tuple[Array, Array]:
    return swing()


@pytest.fixture(scope='session', name='exact')
def exact_fixture() -> Callable[..., tuple[Array, Array]]:
    return exact
