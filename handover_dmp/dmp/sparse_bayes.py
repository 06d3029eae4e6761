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
Sparse Bayesian regression, the relevance vector machine, over any set of candidates.

M. E. Tipping, A. C. Faul, "Fast Marginal Likelihood Maximisation for Sparse Bayesian Models",
AISTATS 2003. The names s, q, S, Q and the numbers of equations are theirs; β is the precision of
the noise.
"""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.common.arrays import Array
import numpy as np
from numpy.typing import NDArray

MIN_GAIN = 1e-2  # gain in log evidence below which the search ends
MIN_CHANGE = 1e-2  # change of ln β below which it is converged
MAX_STEPS = 1000
MIN_NOISE = 1e-9  # variance of the noise relative to the mean square of the target
ROUNDING = 1e-12
# A candidate is not added if the active ones leave less than this of its squared norm.
ALIGNED = 1e-8
MIN_NORM = 1e-7  # minimum norm of a candidate's column, relative to the largest


@dataclass(frozen=True, eq=False)
class SparseWeights:
    """
    Posterior of the weights that remain.

    Attributes:
        active: indices of their columns, increasing, (k,).
        mean: their mean, (k,).
        covariance: their covariance, (k, k).
        noise: standard deviation of the noise of a row, in units of the target.

    """

    active: NDArray[np.int64]
    mean: Array
    covariance: Array
    noise: float


def sparse_bayes(design: Array, target: Array, *, information: float = 1.0) -> SparseWeights:
    """
    Find the few columns that explain the target, and their weights.

    Maximises the marginal likelihood of target = design·w + noise, w_i ~ N(0, 1/α_i). Each step
    adds, re-estimates or deletes the candidate with the largest gain, and re-estimates the noise.
    For rows of unequal noise, divide row and target by its standard deviation.

    Args:
        design: columns of the candidates, (n, m).
        target: (n,).
        information: number of independent samples per row, at most 1.

    Returns:
        Weights, their covariance, and the noise.

    """
    power = information * float(target @ target)
    norms = np.sqrt(np.einsum('ij,ij->j', design, design) * information)
    usable = np.flatnonzero(norms > MIN_NORM * norms.max(initial=0.0))
    if power == 0.0 or usable.size == 0:
        return SparseWeights(np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 0)), 0.0)
    scale = 1.0 / norms[usable]
    columns = design[:, usable]
    gram = (columns.T @ columns) * np.outer(scale, scale) * information
    projection = (target @ columns) * scale * information
    search = _Search(gram, projection, information * target.size, power)
    for _ in range(MAX_STEPS):
        if not search.improve():
            break
    order = np.argsort(search.active)
    active = search.active[order]
    return SparseWeights(
        usable[active],
        search.mean[order] * scale[active],
        search.covariance[np.ix_(order, order)] * np.outer(scale[active], scale[active]),
        search.beta**-0.5,
    )


class _Search:
    """The active candidates, their 1/α_i, and β; all columns have norm 1."""

    def __init__(self, gram: Array, projection: Array, samples: float, power: float) -> None:
        self.gram, self.projection = gram, projection
        self.samples, self.power = samples, power
        self.spread = np.zeros(projection.size)  # 1/α, 0 if not active
        self.beta = 10.0 * samples / power
        first = int(np.argmax(np.abs(projection)))
        self.spread[first] = projection[first] ** 2
        self.active = np.array([first])
        self._solve()

    def improve(self) -> bool:
        """Take the step with the largest gain; return whether another one is worthwhile."""
        spread, beta = self.spread, self.beta
        rows = self.gram[self.active]
        sparsity = beta - beta * beta * np.einsum('ij,ij->j', self.covariance @ rows, rows)
        quality = beta * (self.projection - self.mean @ rows)
        # (23): s and q from S and Q, without the candidate itself if it is active
        factor = 1.0 / np.maximum(1.0 - spread * sparsity, ROUNDING)
        small_s = sparsity * factor
        theta = (quality * factor) ** 2 - small_s
        # (20), and 0 if the evidence is larger without it
        squared = small_s * small_s
        # S can be exactly 0 for a candidate in the span of the active ones: no gain
        told = (theta > 0.0) & (squared > 0.0)
        better = np.divide(theta, squared, out=np.zeros_like(theta), where=told)
        # (32), which is (27) if the candidate was not active and (37) if it is deleted
        change = better - spread
        growth = np.maximum(sparsity * change, ROUNDING - 1.0)
        gain = quality * quality * change / (1.0 + growth) - np.log1p(growth)
        gain[(spread == 0.0) & (sparsity < ALIGNED * beta)] = 0.0
        if self.active.size == 1 and better[self.active[0]] == 0.0:
            gain[self.active[0]] = 0.0
        best = int(np.argmax(gain))
        gained = gain[best] > MIN_GAIN
        if gained:
            if spread[best] == 0.0:
                self.active = np.append(self.active, best)
            elif better[best] == 0.0:
                self.active = self.active[self.active != best]
            spread[best] = better[best]
            self._solve()
        self.beta = self._noise_precision()
        self._solve()
        return bool(gained) or abs(np.log(self.beta / beta)) > MIN_CHANGE

    def _noise_precision(self) -> float:
        """Re-estimate β: samples minus well-determined weights, over the squared residual."""
        active, mean = self.active, self.mean
        determined = active.size - self.covariance.diagonal() @ (1.0 / self.spread[active])
        # (βG + 1/spread)·mean = β·projection saves the product with G
        fitted = self.projection[active] - mean / (self.beta * self.spread[active])
        residual = self.power + mean @ (fitted - 2.0 * self.projection[active])
        variance = residual / max(self.samples - determined, 1.0)
        return 1.0 / max(float(variance), MIN_NOISE * self.power / self.samples)

    def _solve(self) -> None:
        """Compute mean and covariance of the active weights, (22)."""
        from scipy.linalg.lapack import dpotrf, dpotri

        active = self.active
        precision = self.gram[active[:, None], active]
        precision *= self.beta
        precision.flat[:: active.size + 1] += 1.0 / self.spread[active]
        inverse, _ = dpotri(dpotrf(precision, lower=1)[0], lower=1)
        self.covariance = inverse + inverse.T
        self.covariance.flat[:: active.size + 1] *= 0.5
        self.mean = self.beta * (self.covariance @ self.projection[active])
