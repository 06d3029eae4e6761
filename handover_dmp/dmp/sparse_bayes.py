"""
Sparse Bayesian regression, the relevance vector machine, over any set of candidates.

M. E. Tipping, A. C. Faul, "Fast Marginal Likelihood Maximisation for Sparse Bayesian Models",
AISTATS 2003. The names s, q, S, Q are theirs, (22) to (32) there; β is the precision of the noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotri

Array = NDArray[np.float64]

LEAST_GAIN = 1e-3  # in the logarithm of the evidence; smaller steps end the search
LEAST_CHANGE = 1e-2  # of ln β
MOST_STEPS = 2000
LEAST_NOISE = 1e-10  # variance of the noise relative to the mean square of the target
LEAST_NORM = 1e-6  # of a candidate's column, relative to the largest


@dataclass(frozen=True, eq=False)
class SparseWeights:
    """
    Posterior of the weights that the evidence keeps.

    Attributes:
        active: indices of their columns, rising, (k,).
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

    Maximises the marginal likelihood of target = design·w + noise, w_i ~ N(0, 1/α_i), by adding,
    re-estimating or deleting the one candidate that gains most, and with it the noise. For rows
    of unequal noise, multiply row and target by the inverse of its standard deviation.

    Args:
        design: candidates' columns, (n, m).
        target: (n,).
        information: how many independent samples a row stands for, at most 1.

    Returns:
        Weights, their covariance, and the noise.

    """
    power = float(target @ target) / target.size
    norms = np.sqrt(np.einsum('ij,ij->j', design, design))
    usable = np.flatnonzero(norms > LEAST_NORM * norms.max(initial=0.0))
    if power == 0.0 or usable.size == 0:
        return SparseWeights(np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 0)), 0.0)
    unit = design[:, usable] / norms[usable]
    gram = information * (unit.T @ unit)
    projection = information * (unit.T @ target)
    search = _Search(
        gram, projection, information * target.size, information * power * target.size
    )
    while search.steps < MOST_STEPS and search.improve():
        pass
    order = np.argsort(search.active)
    scale = 1.0 / norms[usable[search.active][order]]
    return SparseWeights(
        usable[search.active][order],
        search.mean[order] * scale,
        search.covariance[np.ix_(order, order)] * np.outer(scale, scale),
        search.beta**-0.5,
    )


class _Search:
    """The set of active candidates, their α, and β; candidates' columns have norm 1."""

    def __init__(self, gram: Array, projection: Array, samples: float, power: float) -> None:
        self.gram, self.projection = gram, projection
        self.samples, self.power = samples, power
        self.least_variance = LEAST_NOISE * power / samples
        self.diagonal = gram.diagonal().copy()
        self.alpha = np.full(projection.size, np.inf)
        self.beta = 10.0 * samples / power
        self.steps = 0
        first = int(np.argmax(projection**2 / self.diagonal))
        explained = projection[first] ** 2 / self.diagonal[first]
        self.alpha[first] = self.diagonal[first] / max(
            explained - 1.0 / self.beta, 1e-3 * explained
        )
        self.active = np.array([first])
        self._solve()

    def improve(self) -> bool:
        """Take the step that gains most; tell whether another one is worth while."""
        self.steps += 1
        alpha, beta, active = self.alpha, self.beta, self.active
        columns = self.gram[:, active]
        weighted = beta * (columns @ self.covariance)
        sparsity = beta * (self.diagonal - np.einsum('ij,ij->i', weighted, columns))
        quality = beta * (self.projection - columns @ self.mean)
        squared = quality * quality
        small_s, small_q = sparsity.copy(), quality.copy()
        factor = alpha[active] / (alpha[active] - sparsity[active])
        small_s[active] *= factor
        small_q[active] *= factor
        theta = small_q * small_q - small_s

        gain = np.full(alpha.size, -np.inf)
        new = np.isinf(alpha) & (theta > 0.0)
        ratio = squared[new] / sparsity[new]
        gain[new] = ratio - 1.0 - np.log(ratio)
        better = active[theta[active] > 0.0]
        change = theta[better] / small_s[better] ** 2 - 1.0 / alpha[better]
        # (32): change is 1/α_new − 1/α
        gain[better] = squared[better] * change / (1.0 + sparsity[better] * change) - np.log1p(
            sparsity[better] * change
        )
        worse = active[theta[active] <= 0.0]
        if active.size > 1 and worse.size:
            left = sparsity[worse] - alpha[worse]
            gain[worse] = squared[worse] / left - np.log1p(-sparsity[worse] / alpha[worse])
        best = int(np.argmax(gain))
        if gain[best] > LEAST_GAIN:
            held = np.isfinite(alpha[best])
            if theta[best] > 0.0:
                alpha[best] = small_s[best] ** 2 / theta[best]
                if not held:
                    self.active = np.append(active, best)
            else:
                alpha[best] = np.inf
                self.active = active[active != best]
        self._solve()
        self.beta = self._noise_precision()
        settled = abs(np.log(self.beta / beta)) < LEAST_CHANGE
        self._solve()
        return bool(gain[best] > LEAST_GAIN or not settled)

    def _noise_precision(self) -> float:
        """Re-estimate β: samples less well determined weights, over the squared residual."""
        active, mean = self.active, self.mean
        residual = self.power - 2.0 * mean @ self.projection[active]
        residual += mean @ self.gram[np.ix_(active, active)] @ mean
        determined = active.size - self.alpha[active] @ self.covariance.diagonal()
        variance = residual / max(self.samples - determined, 1.0)
        return 1.0 / max(float(variance), self.least_variance)

    def _solve(self) -> None:
        """Work out mean and covariance of the active weights."""
        active = self.active
        precision = self.beta * self.gram[np.ix_(active, active)]
        precision[np.diag_indices_from(precision)] += self.alpha[active]
        factor, _ = dpotrf(precision, lower=1)
        inverse, _ = dpotri(factor, lower=1)
        self.covariance = np.tril(inverse) + np.tril(inverse, -1).T
        self.mean = self.beta * (self.covariance @ self.projection[active])
