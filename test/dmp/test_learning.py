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

from __future__ import annotations

from handover_dmp.common.errors import DataError, UsageError
from handover_dmp.dmp import ClassicalDmp, DmpParameters, learn, learn_jointly, learn_mean
from handover_dmp.dmp.demonstration import demonstrate, mean_motion
import numpy as np
import pytest


def reproduction(model, times, path):
    """Largest error of a rollout to the goal it was learnt with, m."""
    rollout = model.rollout(times, model.goal, start=path[0], velocity=model.start_velocity)
    return np.abs(rollout.positions - path).max()


@pytest.mark.parametrize('formulation', ['stiff', 'printed'])
@pytest.mark.parametrize('motion', ['reach', 'swing'])
def test_fifty_basis_functions_reproduce_to_a_tenth_of_a_millimetre(motion, formulation, request):
    """`swing` starts and ends with speed, at the end against a goal that is at rest."""
    times, path = request.getfixturevalue(motion)
    parameters = DmpParameters(formulation=formulation)
    model = learn(times, path, parameters, regression='ridge', basis=50)
    assert reproduction(model, times, path) < (1e-4 if motion == 'reach' else 2e-4)


@pytest.mark.parametrize('motion', ['reach', 'swing'])
def test_sparse_learning_reproduces_with_few(motion, request):
    times, path = request.getfixturevalue(motion)
    model = learn(times, path)
    assert reproduction(model, times, path) < (5e-4 if motion == 'reach' else 2e-3)
    assert (np.count_nonzero(model.weights, axis=0) < 50).all()


def test_the_classical_primitive_reproduces_too(reach):
    model = learn(*reach, regression='ridge', basis=50, primitive=ClassicalDmp)
    assert isinstance(model, ClassicalDmp)
    assert reproduction(model, *reach) < 1e-3


@pytest.mark.parametrize(
    'changes',
    [
        {'stiffness': 50.0},
        {'stiffness': 1000.0, 'damping': 100.0},
        {'mu': 0.4, 'sigma': 0.15},
        {'mu': 1.5},
        {'phase_at_end': 0.2},
        {'phase_at_end': 1e-4},
    ],
)
def test_it_reproduces_with_other_parameters(changes, reach):
    times, path = reach
    model = learn(times, path, DmpParameters(**changes), regression='ridge', basis=100)
    # an early goal pulls the end of the motion, where no shape is left to hold against it
    limit = 3e-3 if changes.get('mu') == 0.4 else 3e-4
    assert reproduction(model, times, path) < limit


@pytest.mark.parametrize('regression', ['ridge', 'rvm'])
def test_uneven_stamps_and_few_samples_learn_the_same(swing, regression):
    times, path = swing
    even = learn(times, path, regression=regression)
    rng = np.random.default_rng(0)
    uneven = np.sort(rng.choice(np.arange(1, 300), 60, replace=False))
    chosen = np.concatenate([[0], uneven, [300]])
    other = learn(times[chosen] + 100.0, path[chosen], regression=regression)
    start = {'start': path[0], 'velocity': even.start_velocity}
    goal = path[-1] + 0.1
    difference = (
        even.rollout(times, goal, **start).positions
        - other.rollout(times, goal, **start).positions
    )
    assert np.abs(difference).max() < (2e-3 if regression == 'ridge' else 5e-3)


def test_start_goal_and_duration_are_those_of_the_demonstration(swing):
    times, path = swing
    model = learn(times + 5.0, path, source='a swing')
    assert model.duration_s == pytest.approx(1.2)
    assert model.start == pytest.approx(path[0])
    assert model.goal == pytest.approx(path[-1])
    assert model.start_velocity == pytest.approx([0.6, 0.6 / np.cosh(1.8) ** 2, 0.0], abs=1e-3)
    assert model.source == 'a swing'
    assert np.array_equal(model.goal_offset, np.zeros(3))


def test_the_mean_is_that_of_the_stretched_motions(reach):
    times, path = reach
    slow = (times * 1.4, path + 0.1)
    stamps, mean = mean_motion([(times, path), slow], 301)
    assert stamps[-1] == pytest.approx(1.5 * 1.2)
    assert np.abs(mean - (path + 0.05)).max() < 1e-6
    model = learn_mean([(times, path), slow], regression='ridge')
    assert reproduction(model, stamps, mean) < 1e-4


def test_learning_jointly_from_copies_is_learning_from_one(reach):
    times, path = reach
    one = learn(times, path, regression='ridge')
    # another place, another pace, half of the samples: the same shape
    other = (times[::2] * 2.0, path[::2] + [0.3, -0.2, 0.1])
    both = learn_jointly([(times, path), other], regression='ridge')
    assert both.duration_s == pytest.approx(2.25)
    assert both.start == pytest.approx(path[0] + [0.15, -0.1, 0.05])
    goal = path[-1] + 0.05
    alone = one.rollout(times, goal, start=path[0]).positions
    together = both.with_duration(1.5).rollout(times, goal, start=path[0]).positions
    assert np.abs(alone - together).max() < 2e-4


def test_jointly_finds_the_shape_under_the_noise(reach):
    """Eight noisy motions bring the shape closer than one does."""
    times, path = reach
    rng = np.random.default_rng(1)
    wobbles = [
        (
            times,
            path + 0.01 * np.outer(np.sin(np.pi * times / 1.5 * k) ** 2, rng.standard_normal(3)),
        )
        for k in (1, 2, 3, 4, 5, 2, 3, 4)
    ]

    def off(model):
        rollout = model.rollout(times, path[-1], start=path[0])
        return np.abs(rollout.positions - path).max()

    assert off(learn_jointly(wobbles)) < np.mean([off(learn(*each)) for each in wobbles])


def test_the_deviation_is_that_of_weights_drawn_from_the_posterior(reach):
    times, path = reach
    rng = np.random.default_rng(2)
    model = learn(times, path + 2e-4 * rng.standard_normal(path.shape), basis=40)
    implied = model.rollout(times, model.goal, deviation=True).deviation
    draws = []
    for _ in range(300):
        weights = np.zeros_like(model.weights)
        for dimension, posterior in enumerate(model.covariance):
            active = posterior.active
            weights[active, dimension] = rng.multivariate_normal(
                model.weights[active, dimension], posterior.matrix, method='svd'
            )
        draws.append(model.with_weights(weights).rollout(times, model.goal).positions)
    drawn = np.std(draws, axis=0)
    assert np.abs(drawn - implied).max() < 0.2 * implied.max()
    assert implied.max() > 0.0
    with pytest.raises(DataError, match='posterior'):
        learn(times, path, regression='ridge').rollout(times, model.goal, deviation=True)


def test_derivatives_of_a_demonstration():
    rng = np.random.default_rng(0)
    times = np.sort(np.concatenate([[2.0, 4.0], rng.uniform(2.0, 4.0, 150)]))
    motion = demonstrate(times, np.sin(3 * times)[:, None], 101)
    at = 2.0 + 2.0 * motion.u
    assert motion.duration_s == pytest.approx(2.0)
    assert motion.velocity[:, 0] == pytest.approx(6.0 * np.cos(3 * at), abs=1e-3)
    assert motion.acceleration[:, 0] == pytest.approx(-36.0 * np.sin(3 * at), abs=0.1)


@pytest.mark.parametrize(
    ('times', 'path', 'fault'),
    [
        ([0, 1, 2], np.zeros((3, 3)), '3 samples'),
        ([0, 1, 1, 2], np.zeros((4, 3)), 'increase'),
        ([0, 1, 2, 3], np.full((4, 3), np.nan), 'finite'),
        ([0, 1, 2, 3], np.zeros((5, 3)), 'instead of'),
        ([0, 1, 2, 3], np.zeros(4), 'instead of'),
    ],
)
def test_what_cannot_be_learnt_from_is_refused(times, path, fault):
    with pytest.raises(DataError, match=fault):
        learn(times, path)


def test_wrong_requests_are_refused(reach):
    with pytest.raises(UsageError, match='regression'):
        learn(*reach, regression='lasso')
    with pytest.raises(UsageError, match='basis'):
        learn(*reach, basis=1)
    with pytest.raises(UsageError, match='widths'):
        learn(*reach, widths=[0.0])
    with pytest.raises(DataError, match='no demonstration'):
        learn_mean([])
    with pytest.raises(DataError, match='dimensions'):
        learn_jointly([reach, (reach[0], reach[1][:, :2])])


def test_a_motion_that_stands_still_is_learnt_as_one():
    times = np.linspace(0.0, 1.0, 50)
    for regression in ('rvm', 'ridge'):
        model = learn(times, np.full((50, 2), 0.3), regression=regression)
        assert model.rollout(times, model.goal).positions == pytest.approx(0.3)
