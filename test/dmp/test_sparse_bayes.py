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

"""The relevance vector machine, against scikit-learn's ARD and against ridge."""

from __future__ import annotations

import inspect

from handover_dmp.dmp import sparse_bayes as module
from handover_dmp.dmp.basis import equally_spaced
from handover_dmp.dmp.learning import WIDTHS
from handover_dmp.dmp.sparse_bayes import sparse_bayes
import numpy as np
import pytest

ALPHA = -np.log(0.01)
U = np.linspace(0.0, 1.0, 301)
SHAPES = {
    'wave': np.sin(7 * U) * np.exp(-U) + 0.5 * U,
    'two bumps': np.exp(-(((U - 0.3) / 0.07) ** 2)) + 0.5 * np.exp(-(((U - 0.6) / 0.1) ** 2)),
    'reach': 10 * U**3 - 15 * U**4 + 6 * U**5 + 0.2 * np.sin(np.pi * U) ** 2,
}


def noisy(shape, seed, level=0.02):
    truth = SHAPES[shape]
    noise = level * np.ptp(truth) * np.random.default_rng(seed).standard_normal(truth.size)
    return truth, truth + noise


def candidates(widths=WIDTHS['rvm']):
    return equally_spaced(100, ALPHA, widths).activations(np.exp(-ALPHA * U))


def error(fit, truth):
    return np.sqrt(np.mean((fit - truth) ** 2))


@pytest.mark.parametrize('seed', range(3))
@pytest.mark.parametrize('shape', SHAPES)
def test_it_is_sparse_and_no_worse_than_ridge(shape, seed):
    truth, target = noisy(shape, seed)
    design = candidates()
    result = sparse_bayes(design, target)
    assert 0 < result.active.size <= 20
    plain = candidates(())
    ridge = min(
        error(
            plain @ np.linalg.solve(plain.T @ plain + penalty * np.eye(100), plain.T @ target),
            truth,
        )
        for penalty in 10.0 ** np.arange(-6, 3)
    )
    assert error(design[:, result.active] @ result.mean, truth) < 1.1 * ridge


@pytest.mark.parametrize('shape', SHAPES)
def test_it_is_as_good_as_ard_and_sparser(shape):
    from sklearn.linear_model import ARDRegression

    truth, target = noisy(shape, 7)
    design = candidates()
    peer = ARDRegression(fit_intercept=False).fit(design, target)
    result = sparse_bayes(design, target)
    ours = error(design[:, result.active] @ result.mean, truth)
    assert ours < 1.25 * error(peer.predict(design), truth)
    assert result.active.size <= np.count_nonzero(np.abs(peer.coef_) > 1e-8)


@pytest.mark.parametrize('level', [0.005, 0.02, 0.1])
def test_the_noise_is_found(level):
    truth, target = noisy('wave', 1, level)
    assert sparse_bayes(candidates(), target).noise == pytest.approx(
        level * np.ptp(truth), rel=0.15
    )


def test_the_posterior_is_the_one_of_its_own_noise_and_prior():
    """Refit the chosen columns alone: the mean solves the normal equations, shrunk by 1/α."""
    _, target = noisy('two bumps', 2)
    design = candidates()
    result = sparse_bayes(design, target)
    chosen = design[:, result.active]
    precision = np.linalg.inv(result.covariance)
    prior = precision - chosen.T @ chosen / result.noise**2
    off = prior - np.diag(np.diag(prior))
    assert np.abs(off).max() < 1e-5 * np.abs(precision).max()
    assert (np.diag(prior) > 0.0).all()
    mean = result.covariance @ chosen.T @ target / result.noise**2
    assert result.mean == pytest.approx(mean, rel=1e-5, abs=1e-8)


def test_the_deviation_covers_the_error():
    """Over many data sets, the truth lies within two standard deviations nearly always."""
    design = candidates()
    inside = []
    for seed in range(20):
        truth, target = noisy('reach', seed)
        result = sparse_bayes(design, target)
        chosen = design[:, result.active]
        deviation = np.sqrt(np.einsum('ij,jk,ik->i', chosen, result.covariance, chosen))
        inside.append(np.abs(chosen @ result.mean - truth) < 2.0 * deviation)
    assert 0.75 < np.mean(inside) <= 1.0


def test_rows_of_unequal_noise_count_by_their_weight():
    """Half of the rows are ten times noisier; weighted, they do little harm."""
    truth = SHAPES['wave']
    scale = np.where(np.arange(301) % 2, 10.0, 1.0)
    target = truth + 0.02 * scale * np.random.default_rng(5).standard_normal(301)
    design = candidates()
    blind = sparse_bayes(design, target)
    weighted = sparse_bayes(design / scale[:, None], target / scale)
    assert error(design[:, weighted.active] @ weighted.mean, truth) < 0.6 * error(
        design[:, blind.active] @ blind.mean, truth
    )
    assert weighted.noise == pytest.approx(0.02, rel=0.2)


def test_rows_told_to_be_copies_do_not_add_certainty():
    _, target = noisy('wave', 3)
    design = candidates()
    once = sparse_bayes(design, target)
    thrice = sparse_bayes(np.tile(design, (3, 1)), np.tile(target, 3), information=1 / 3)
    assert np.array_equal(once.active, thrice.active)
    assert thrice.mean == pytest.approx(once.mean, rel=1e-5)
    assert thrice.noise == pytest.approx(once.noise, rel=1e-5)


@pytest.mark.parametrize('count', [300, 800])
def test_far_more_candidates_than_needed_do_no_harm(count):
    design = equally_spaced(count, ALPHA, WIDTHS['rvm']).activations(np.exp(-ALPHA * U))
    for level in (0.0, 1e-6, 0.02):
        truth, target = noisy('reach', 0, level)
        result = sparse_bayes(design, target)
        assert np.isfinite(result.covariance).all()
        assert error(design[:, result.active] @ result.mean, truth) < 0.5 * level + 1e-3


def test_nothing_to_explain_and_nothing_to_explain_it_with():
    assert sparse_bayes(candidates(), np.zeros(301)).active.size == 0
    assert sparse_bayes(np.zeros((301, 4)), SHAPES['wave']).active.size == 0


def test_two_equal_columns_are_one():
    column = SHAPES['wave'][:, None]
    result = sparse_bayes(np.hstack([column, column]), 2.0 * column[:, 0])
    assert result.active.size == 1
    assert result.mean == pytest.approx([2.0], rel=1e-6)


def test_what_adds_nothing_to_the_last_bit_is_passed_by():
    """S of (24) is exactly 0 where a candidate lies in the span of the active ones."""
    gram = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    search = module._Search(gram, np.array([2.0, 2.0, 3.0]), 10.0, 20.0)
    search.beta, search.covariance = 1.0, np.ones((1, 1))
    with np.errstate(all='raise'):
        assert search.improve()
    assert sorted(search.active) == [0, 2]


def test_it_stays_short():
    lines = inspect.getsource(module).splitlines()
    assert len([line for line in lines if not line.startswith('#')]) <= 155
