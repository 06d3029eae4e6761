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

"""The basis functions of the forcing term (3), (6): normalised Gaussians over the phase."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

from handover_dmp.common.arrays import Array, read_only, ReadOnly
import numpy as np

TABLE_RATE = 4096  # nodes of the table per τ: error below a micrometre at usual stiffness
TABLE_END = 2.0  # in units of τ; the forcing term is constant from there on
LAST_NODE = round(TABLE_RATE * TABLE_END)
NARROWEST = 0.0025  # in units of τ; narrower bumps are not resolved


@dataclass(frozen=True, eq=False)
class Basis(ReadOnly):
    """
    A set of m Gaussians ψ_i = exp(−h_i(s − c_i)²), each divided by the sum of all.

    Attributes:
        centres: c_i, phase, (m,).
        sharpness: h_i, (m,).

    """

    centres: Array
    sharpness: Array
    _tables: dict[float, Array] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for name in ('centres', 'sharpness'):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def __repr__(self) -> str:
        """Return a short description."""
        return f'Basis({self.size} functions)'

    @property
    def size(self) -> int:
        """Return the number m of basis functions."""
        return self.centres.size

    def activations(self, phase: Array) -> Array:
        """
        Evaluate ψ_i / Σψ_j.

        Args:
            phase: s, (n,).

        Returns:
            Activations, (n, m); each row sums to one, even far from every centre.

        """
        exponent = phase[:, None] - self.centres
        exponent *= exponent
        exponent *= -self.sharpness
        exponent -= exponent.max(axis=1, keepdims=True)
        psi: Array = np.exp(exponent, out=exponent)
        psi /= psi.sum(axis=1, keepdims=True)
        return psi

    def narrowest(self, alpha: float) -> float:
        """
        Return the shortest time over which the forcing term can change.

        Args:
            alpha: decay rate of the phase (4).

        Returns:
            Half width of the narrowest Gaussian, in units of τ.

        """
        widths = 1.0 / (np.sqrt(self.sharpness) * alpha * self.centres)
        return max(float(widths.min()), NARROWEST)

    def table(self, alpha: float) -> Array:
        """
        Return the activations on a fine grid in time; computed once.

        Args:
            alpha: decay rate of the phase (4).

        Returns:
            Activations at u = 0, 1/TABLE_RATE, …, TABLE_END, (nodes, m).

        """
        if alpha not in self._tables:
            u = np.arange(LAST_NODE + 1) / TABLE_RATE
            self._tables[alpha] = self.activations(np.exp(-alpha * u))
        return self._tables[alpha]


@lru_cache(maxsize=16)
def equally_spaced(count: int, alpha: float, widths: tuple[float, ...] = ()) -> Basis:
    """
    Spread Gaussians so that their centres are equally spaced in time.

    With several widths, each gets two thirds of the number of the previous one.

    Args:
        count: number of basis functions, at least 2 for each width.
        alpha: decay rate of the phase (4).
        widths: distance from the centre at which the Gaussians of each kind fall to 1/e, in
            units of τ; at least the distance of the centres, which is the default.

    Returns:
        The basis functions; for each width, the first is at the start and the last at τ.

    """
    kinds = widths or (0.0,)
    shares = (2.0 / 3.0) ** np.arange(len(kinds))
    sizes = np.maximum(np.round(count * shares / shares.sum()).astype(int), 2)
    sizes[0] = count - sizes[1:].sum()
    centres = [np.exp(-alpha * np.linspace(0.0, 1.0, size)) for size in sizes]
    reach = [
        np.maximum(-np.diff(each, append=each[-1] ** 2 / each[-2]), alpha * width * each)
        for each, width in zip(centres, kinds, strict=True)
    ]
    return Basis(np.concatenate(centres), 1.0 / np.concatenate(reach) ** 2)
