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
The transition of the transformation system over one interval, while phase and goal move.

Relative to the position at the start of the interval, (8) is y'' = −k(θ)y − Dy' + U(θ), y(0) = 0,
where θ is time in units of τ. With the input U taken at the two Gauss-Legendre points a and b,
the end of the interval is

    y(h) = p₁₂ v + x_a U_a + x_b U_b,    v(h) = p₂₂ v + v_a U_a + v_b U_b.

For constant k these six numbers are exact for every input that is linear in θ, for any h. In the
formulation `printed`, k follows the goal weight, and they come from the fourth-order Magnus
expansion (Blanes et al., Phys. Rep. 470, 2009) of the same system. The error falls with h⁴.
"""

from __future__ import annotations

from functools import lru_cache
from math import cos, cosh, exp, sin, sinh, sqrt

Transition = tuple[float, float, float, float, float, float]

GAUSS_A = 0.5 - sqrt(3.0) / 6.0
GAUSS_B = 0.5 + sqrt(3.0) / 6.0
COMMUTATOR = sqrt(3.0) / 12.0
CONVERGING = 0.3  # largest part of the commutator in the expansion
SHORT = 1e-4  # below this h·√k the closed forms lose digits, and quadrature is exact to rounding


def propagator(squared: float, decay: float) -> tuple[float, float]:
    """
    Return e^−d·cosh z and e^−d·sinh(z)/z.

    Args:
        squared: z², negative if the system oscillates.
        decay: d, not below the real part of z.

    Returns:
        Both numbers.

    """
    if abs(squared) < 1e-4:
        even = 1.0 + squared / 2.0 * (1.0 + squared / 12.0 * (1.0 + squared / 30.0))
        odd = 1.0 + squared / 6.0 * (1.0 + squared / 20.0 * (1.0 + squared / 42.0))
        return exp(-decay) * even, exp(-decay) * odd
    root = sqrt(abs(squared))
    if squared < 0.0:
        return exp(-decay) * cos(root), exp(-decay) * sin(root) / root
    if root > 20.0:  # cosh and sinh are equal to rounding, and could overflow
        half = 0.5 * exp(root - decay)
        return half, half / root
    return exp(-decay) * cosh(root), exp(-decay) * sinh(root) / root


@lru_cache(maxsize=64)  # mostly one step length, but the phase may run at any rate
def steady(stiffness: float, damping: float, h: float) -> Transition:
    """
    Return the six numbers of an interval with constant stiffness; exact for U linear in θ.

    Args:
        stiffness: k.
        damping: D.
        h: length of the interval, in units of τ.

    Returns:
        p₁₂, p₂₂, x_a, x_b, v_a, v_b.

    """
    p11, p12, p22 = _impulse(stiffness, damping, h)
    if h * h * stiffness < SHORT * SHORT:
        # the points are symmetric: each is as far from the end as the other from the start
        _, late_x, late_v = _impulse(stiffness, damping, GAUSS_A * h)
        _, early_x, early_v = _impulse(stiffness, damping, GAUSS_B * h)
        half = 0.5 * h
        return p12, p22, half * early_x, half * late_x, half * early_v, half * late_v
    level = (1.0 - p11) / stiffness
    ramp = (h - p12 - damping * level) / stiffness
    a, b, span = GAUSS_A * h, GAUSS_B * h, (GAUSS_B - GAUSS_A) * h
    return (
        p12,
        p22,
        (b * level - ramp) / span,
        (ramp - a * level) / span,
        (b * p12 - level) / span,
        (level - a * p12) / span,
    )


def varying(stiffness_a: float, stiffness_b: float, damping: float, h: float) -> Transition:
    """
    Return the six numbers of an interval with varying stiffness; fourth order in h.

    If the interval is too long for the expansion to converge, the mean stiffness is used.

    Args:
        stiffness_a: k at the first Gauss point.
        stiffness_b: k at the second Gauss point.
        damping: D.
        h: length of the interval, in units of τ.

    Returns:
        p₁₂, p₂₂, x_a, x_b, v_a, v_b.

    """
    if stiffness_a == stiffness_b:
        return steady(stiffness_a, damping, h)
    mean = 0.5 * (stiffness_a + stiffness_b)
    bracket = COMMUTATOR * h * h
    change = bracket * (stiffness_b - stiffness_a)
    if abs(change) > CONVERGING * h * sqrt(mean):
        return steady(mean, damping, h)
    decay = damping * h / 2.0
    even, odd = propagator((damping * damping / 4.0 - mean) * h * h + change * change, decay)
    # the expansion is Ω = [[change, h], [lower, last]], whose trace is −hD
    lower, last = -h * mean - damping * change, -damping * h - change
    p11, p12 = even + odd * (decay + change), odd * h
    p21, p22 = odd * lower, even - odd * (decay + change)
    # Ω⁻¹(e^Ω − 1) carries the input
    determinant = change * last - h * lower
    f11 = (last * (p11 - 1.0) - h * p21) / determinant
    f12 = (last * p12 - h * (p22 - 1.0)) / determinant
    f21 = (change * p21 - lower * (p11 - 1.0)) / determinant
    f22 = (change * (p22 - 1.0) - lower * p12) / determinant
    first, second = h / 2.0 - damping * bracket, h / 2.0 + damping * bracket
    return (
        p12,
        p22,
        f11 * bracket + f12 * first,
        f12 * second - f11 * bracket,
        f21 * bracket + f22 * first,
        f22 * second - f21 * bracket,
    )


def in_seconds(transition: Transition, duration_s: float) -> Transition:
    """
    Convert the six numbers from v = τẋ to ẋ.

    Args:
        transition: the six numbers for v.
        duration_s: τ, s.

    Returns:
        The same for ẋ.

    """
    p12, p22, xa, xb, va, vb = transition
    return p12 * duration_s, p22, xa, xb, va / duration_s, vb / duration_s


def _impulse(stiffness: float, damping: float, h: float) -> tuple[float, float, float]:
    """Return p₁₁, p₁₂ and p₂₂ for constant stiffness."""
    decay = damping * h / 2.0
    even, odd = propagator((damping * damping / 4.0 - stiffness) * h * h, decay)
    return even + decay * odd, h * odd, even - decay * odd
