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

"""Sparse Bayesian learning: time, sparsity and error, compared with ARD and ridge."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from statistics import median

from handover_dmp.bench.measurement import Measurement, time_call
from handover_dmp.common.arrays import Array
from handover_dmp.dmp.basis import equally_spaced
from handover_dmp.dmp.learning import WIDTHS
from handover_dmp.dmp.sparse_bayes import sparse_bayes
import numpy as np

SAMPLES = 301
CANDIDATES = 100
NOISE = 0.02  # share of the range of the target
SEEDS = 7
PEER, RIDGE = 'ARDRegression', 'ridge'


def run(progress: Callable[[str], None]) -> list[Measurement]:
    """
    Measure.

    Args:
        progress: called with the name of each measurement.

    Returns:
        The figures.

    """
    design, ridge_design, truth, targets = _problem()
    progress('sparse learning')
    results = [sparse_bayes(design, target) for target in targets]
    seconds = median(
        time_call(partial(sparse_bayes, design, target), rounds=9) for target in targets
    )
    errors = [_error(design[:, result.active] @ result.mean, truth) for result in results]
    progress('peers')
    fits = [_ridge(ridge_design, target, truth) for target in targets]
    peer_seconds: dict[str, float] = {}
    peer_counts: dict[str, float] = {}
    peer_errors: dict[str, float] = {RIDGE: median(fits)}
    note = ''
    try:
        from sklearn.linear_model import ARDRegression
    except ImportError:
        note = 'not installed: scikit-learn'
    else:
        peer = ARDRegression(fit_intercept=False)
        peer_seconds[PEER] = 1e3 * time_call(lambda: peer.fit(design, targets[0]), rounds=5)
        fitted = peer.fit(design, targets[0])
        peer_counts[PEER] = float(np.count_nonzero(np.abs(fitted.coef_) > 1e-8))
        peer_errors[PEER] = _error(fitted.predict(design), truth)
    what = f'{SAMPLES} samples, {CANDIDATES} candidates, 2 % noise'
    return [
        Measurement(
            f'sparse learning of one dimension, {what}',
            1e3 * seconds,
            'ms',
            target=10.0,
            peers=peer_seconds,
            note=note,
        ),
        Measurement(
            f'vectors kept, {what}',
            float(max(result.active.size for result in results)),
            'vectors',
            target=20.0,
            peers=peer_counts,
            note=note,
        ),
        Measurement(
            f'error of the fit, relative to the range, {what}',
            median(errors),
            '',
            target=1.1 * peer_errors[RIDGE],
            peers=peer_errors,
            note=f'ridge with the penalty that suits the truth best{"; " + note if note else ""}',
        ),
    ]


def _problem() -> tuple[Array, Array, Array, list[Array]]:
    alpha = float(-np.log(0.01))
    u = np.linspace(0.0, 1.0, SAMPLES)
    phase = np.exp(-alpha * u)
    truth = np.sin(7 * u) * np.exp(-u) + 0.5 * u
    truth /= np.ptp(truth)
    targets = [
        truth + NOISE * np.random.default_rng(seed).standard_normal(SAMPLES)
        for seed in range(SEEDS)
    ]
    return (
        equally_spaced(CANDIDATES, alpha, WIDTHS['rvm']).activations(phase),
        equally_spaced(CANDIDATES, alpha).activations(phase),
        truth,
        targets,
    )


def _ridge(design: Array, target: Array, truth: Array) -> float:
    gram, projection = design.T @ design, design.T @ target
    return min(
        _error(design @ np.linalg.solve(gram + penalty * np.eye(len(gram)), projection), truth)
        for penalty in 10.0 ** np.arange(-6, 3)
    )


def _error(fit: Array, truth: Array) -> float:
    return float(np.sqrt(np.mean((fit - truth) ** 2)))
