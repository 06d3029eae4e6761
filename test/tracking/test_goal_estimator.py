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

"""The goal estimator: against a plain Kalman filter, its lag and noise, and hostile streams."""

from __future__ import annotations

import math

from handover_dmp.common.errors import UsageError
from handover_dmp.mocap import condition, synthesize
from handover_dmp.mocap.filtering import interpolate
from handover_dmp.tracking import GoalEstimator, HandFilter, SensorModel, Tracker
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

HERE = (0.3, -0.2, 1.0)


def feed(estimator, stamps, path):
    return [not estimator.update(stamp, path(stamp)) for stamp in stamps]


def straight(speed=0.5):
    return lambda time: (0.1 + speed * time, -0.2, 1.0 - 0.3 * speed * time)


def test_it_is_the_kalman_filter():
    """Against the textbook's matrices, 6 states, on uneven stamps."""
    random = np.random.default_rng(5)
    stamps = np.cumsum(random.uniform(0.003, 0.04, 120))
    path = 0.4 * np.sin(np.outer(stamps, [2.0, 3.0, 1.0])) + 1e-3 * random.standard_normal(
        (120, 3)
    )
    parameters = HandFilter(acceleration_noise=0.7)
    estimator = GoalEstimator(parameters, [Tracker(noise_m=0.002)])
    state = np.concatenate([path[0], np.zeros(3)])
    spread = np.diag([0.002**2] * 3 + [0.5**2] * 3)
    measure = np.hstack([np.eye(3), np.zeros((3, 3))])
    estimator.update(stamps[0], path[0])
    for k in range(1, 120):
        dt = stamps[k] - stamps[k - 1]
        move = np.block([[np.eye(3), dt * np.eye(3)], [np.zeros((3, 3)), np.eye(3)]])
        noise = 0.7**2 * np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(3))
        state, spread = move @ state, move @ spread @ move.T + noise
        innovation = measure @ spread @ measure.T + 0.002**2 * np.eye(3)
        gain = spread @ measure.T @ np.linalg.inv(innovation)
        state = state + gain @ (path[k] - measure @ state)
        spread = (np.eye(6) - gain @ measure) @ spread
        assert not estimator.update(stamps[k], path[k])
        estimate = estimator.estimate(stamps[k])
        np.testing.assert_allclose(estimate.position, state[:3], atol=1e-12)
        np.testing.assert_allclose(estimate.velocity, state[3:], atol=1e-10)
        assert estimate.stamp_s == stamps[k]


@pytest.mark.parametrize('rate_hz', [24.0, 60.0, 120.0, 200.0])
def test_no_lag_at_constant_speed(rate_hz):
    estimator = GoalEstimator()
    path = straight()
    feed(estimator, np.arange(0.0, 3.0, 1.0 / rate_hz), path)
    # Asked 40 ms later: the delay is made up for.
    estimate = estimator.estimate(3.04)
    np.testing.assert_allclose(estimate.position, path(3.04), atol=1e-4)
    np.testing.assert_allclose(estimate.velocity, (0.5, 0.0, -0.15), atol=1e-3)


@pytest.mark.parametrize(
    ('rate_hz', 'noise_gain', 'speed_noise'),
    [(200.0, 0.63, 0.037), (120.0, 0.73, 0.039), (60.0, 0.85, 0.041), (24.0, 0.96, 0.036)],
)
def test_noise_gain_is_the_documented_one(rate_hz, noise_gain, speed_noise):
    random = np.random.default_rng(0)
    estimator = GoalEstimator()
    positions, velocities = [], []
    for k in range(4000):
        estimator.update(k / rate_hz, 1e-3 * random.standard_normal(3))
        estimate = estimator.estimate(k / rate_hz)
        positions.append(estimate.position)
        velocities.append(estimate.velocity)
    assert np.std(positions[1000:]) / 1e-3 == pytest.approx(noise_gain, rel=0.06)
    assert np.std(velocities[1000:]) == pytest.approx(speed_noise, rel=0.06)


@pytest.mark.parametrize(
    ('rate_hz', 'lag_mm', 'speed_lag_ms'),
    [(200.0, 0.085, 13.1), (120.0, 0.094, 13.9), (60.0, 0.096, 14.7), (24.0, 0.070, 16.9)],
)
def test_lag_at_constant_acceleration_is_the_documented_one(rate_hz, lag_mm, speed_lag_ms):
    estimator = GoalEstimator()
    stamps = np.arange(0.0, 4.0, 1.0 / rate_hz)
    feed(estimator, stamps, lambda time: (0.5 * time**2, 0.0, 0.0))
    estimate = estimator.estimate(stamps[-1])
    assert 1e3 * (0.5 * stamps[-1] ** 2 - estimate.position[0]) == pytest.approx(lag_mm, rel=0.05)
    assert 1e3 * (stamps[-1] - estimate.velocity[0]) == pytest.approx(speed_lag_ms, rel=0.05)


@pytest.mark.parametrize(
    ('rate_hz', 'error_mm', 'newest_mm'),
    [(200.0, 2.0, 12.6), (120.0, 2.4, 14.0), (60.0, 2.9, 15.8), (24.0, 4.4, 21.5)],
)
def test_delay_is_made_up_for_as_documented(rate_hz, error_mm, newest_mm):
    errors, of_newest = [], []
    takes = [condition(trial) for trial in synthesize() if trial.direction == 'take']
    for seed, trial in enumerate(takes):
        truth = interpolate(trial.times, trial.partner)
        waiting = SensorModel(rate_hz, noise_m=5e-4, delay_s=0.03, seed=seed).observe_motion(
            trial.times, trial.partner
        )
        estimator = GoalEstimator()
        newest = None
        for now in np.arange(0.1, trial.times[-1], 0.005):
            while waiting and waiting[0].arrival_s <= now:
                _, stamp, newest = waiting.pop(0)
                assert not estimator.update(stamp, newest, now)
            errors.append(estimator.estimate(now).position - truth(now))
            of_newest.append(newest - truth(now))
    rms = [1e3 * np.sqrt(np.mean(np.sum(np.square(e), axis=1))) for e in (errors, of_newest)]
    assert rms == pytest.approx([error_mm, newest_mm], rel=0.05)


@given(st.permutations(range(12)))
@settings(max_examples=60, deadline=None)
def test_the_order_of_arrival_does_not_matter(order):
    """Within the limit of lateness; the first pose is what the others are put after."""
    path = straight()
    stamps = [0.2 + 0.005 * k for k in range(12)]
    in_order, mixed = GoalEstimator(), GoalEstimator()
    feed(in_order, [0.19, *stamps], path)
    assert all(feed(mixed, [0.19, *(stamps[k] for k in order)], path))
    assert mixed.estimate(0.3) == in_order.estimate(0.3)


def test_too_late_and_twice():
    estimator = GoalEstimator()
    feed(estimator, np.arange(0.0, 1.0, 0.005), straight())
    before = estimator.estimate(1.0)
    assert estimator.update(0.5, straight()(0.5))
    assert estimator.update(0.995, (0.0, 0.0, 0.5))
    assert estimator.update(0.990, straight()(0.990))
    assert estimator.estimate(1.0) == before
    assert estimator.rejected == {'late': 1, 'repeated': 2}
    assert estimator.accepted == 200


@pytest.mark.parametrize('distance_m', [0.15, 1.0, 50.0])
@pytest.mark.parametrize('rate_hz', [24.0, 200.0])
def test_a_jump_is_ignored(distance_m, rate_hz):
    estimator, spared = GoalEstimator(), GoalEstimator()
    path = straight()
    for k, stamp in enumerate(np.arange(0.0, 2.0, 1.0 / rate_hz)):
        if k % 7 == 5:
            x, y, z = path(stamp)
            assert estimator.update(stamp, (x, y + distance_m, z))
        else:
            assert not estimator.update(stamp, path(stamp))
            spared.update(stamp, path(stamp))
    assert estimator.estimate(2.0) == spared.estimate(2.0)


@pytest.mark.parametrize('rate_hz', [24.0, 60.0, 200.0])
def test_a_new_place_is_believed_after_many_poses_that_agree(rate_hz):
    estimator = GoalEstimator(HandFilter(reacquire_poses=50))
    feed(estimator, np.arange(100) / rate_hz, lambda _: HERE)
    start_s = 100 / rate_hz

    def there(time):
        return (2.0 + 0.5 * (time - start_s), -0.2, 1.0)

    stamps = start_s + np.arange(100) / rate_hz
    believed = feed(estimator, stamps, there)
    assert believed == [False] * 49 + [True] * 51
    assert estimator.rejected == {'outlier': 49}
    estimate = estimator.estimate(stamps[-1])
    np.testing.assert_allclose(estimate.position, there(stamps[-1]), atol=2e-3)
    np.testing.assert_allclose(estimate.velocity, (0.5, 0.0, 0.0), atol=0.02)


def test_an_outlier_that_lasts_is_an_outlier():
    """However long ago the hand was seen by then; and the hand is believed when it is back."""
    estimator = GoalEstimator(HandFilter(reacquire_poses=1000))
    path = straight(0.2)
    feed(estimator, np.arange(0.0, 1.0, 0.005), path)

    def reflection(time):
        x, y, z = path(time)
        return (x, y + 1.0, z)

    assert not any(feed(estimator, np.arange(1.0, 5.0, 0.005), reflection))
    believed = feed(estimator, np.arange(5.0, 5.1, 0.005), path)
    assert believed == [False] * 2 + [True] * 18


def test_a_new_place_is_found_among_scattered_outliers():
    estimator = GoalEstimator(HandFilter(reacquire_poses=60))
    random = np.random.default_rng(2)
    feed(estimator, np.arange(0.0, 0.3, 0.005), lambda _: HERE)
    stamps = np.arange(1.0, 1.5, 0.005)
    believed = [
        not estimator.update(stamp, (7.0, 0.0, 1.0) if k % 3 else 5.0 * random.standard_normal(3))
        for k, stamp in enumerate(stamps)
    ]
    assert believed.index(True) == 89, 'two in three are of the new place'
    np.testing.assert_allclose(estimator.estimate(1.5).position, (7.0, 0.0, 1.0), atol=1e-6)


def test_a_first_pose_that_was_wrong_is_soon_forgotten():
    estimator = GoalEstimator()
    assert not estimator.update(0.0, (9.0, 9.0, 9.0))
    assert feed(estimator, [0.01, 0.02, 0.03, 0.04], lambda _: HERE) == [False, False, True, True]


def lost(how, stamp):
    """Give what a tracker may say that does not see the hand."""
    x, y, z = straight()(stamp)
    covariance = [0.0] * 36
    covariance[0] = -1.0
    huge = [0.0] * 36
    huge[7] = 1e3
    return {
        'nothing': None,
        'zeros': {'position': (0.0, -0.0, 0.0)},
        'NaN': {'position': (math.nan, y, z)},
        'infinity': {'position': (x, y, math.inf)},
        'norm 0': {'position': (x, y, z), 'orientation': (0.0, 0.0, 0.0, 0.0)},
        'NaN rotation': {'position': (x, y, z), 'orientation': (math.nan, 0.0, 0.0, 1.0)},
        'covariance -1': {'position': (x, y, z), 'covariance': covariance},
        'huge covariance': {'position': (x, y, z), 'covariance': huge},
    }[how]


@pytest.mark.parametrize(
    ('how', 'reason'),
    [
        ('nothing', None),
        ('zeros', 'zero'),
        ('NaN', 'not_finite'),
        ('infinity', 'not_finite'),
        ('norm 0', 'no_rotation'),
        ('NaN rotation', 'no_rotation'),
        ('covariance -1', 'uncertain'),
        ('huge covariance', 'uncertain'),
    ],
)
@pytest.mark.parametrize('loss_s', [0.05, 0.6, 5.0])
@pytest.mark.parametrize('rate_hz', [24.0, 200.0])
def test_lost_is_lost_and_what_a_hand_can_have_reached_is_believed_at_once(
    how, reason, loss_s, rate_hz
):
    estimator = GoalEstimator()
    path = straight()
    times = np.arange(0.0, 1.0, 1.0 / rate_hz)
    feed(estimator, times, path)
    losses = np.arange(times[-1], times[-1] + loss_s, 1.0 / rate_hz)[1:]
    for stamp in losses:
        pose = lost(how, stamp)
        if pose is not None:
            assert estimator.update(stamp, now_s=stamp, **pose) == reason
    assert estimator.rejected == ({reason: len(losses)} if reason else {})
    back = losses[-1] + 1.0 / rate_hz
    assert all(feed(estimator, back + np.arange(0.0, 0.5, 1.0 / rate_hz), path))


def test_a_covariance_that_is_known_or_not_told_is_no_reason():
    estimator = GoalEstimator()
    for k, variance in enumerate((0.0, 1e-6, 0.03)):
        covariance = np.diag([variance] * 6).ravel().tolist()
        assert not estimator.update(0.01 * k, HERE, covariance=covariance)


@pytest.mark.parametrize('refuse', [False, True])
def test_a_frozen_pose_is_told_and_refused_where_that_is_wanted(refuse):
    estimator = GoalEstimator(HandFilter(frozen_s=0.3, refuse_frozen=refuse))
    path = straight()
    feed(estimator, np.arange(0.0, 1.0, 0.01), path)
    assert estimator.unchanged_s == 0.0
    stuck = feed(estimator, np.arange(1.0, 2.0, 0.01), lambda _: path(0.99))
    assert estimator.unchanged_s == pytest.approx(1.0)
    assert stuck.count(False) == (71 if refuse else 0)
    assert estimator.rejected == ({'frozen': 71} if refuse else {})
    assert not estimator.update(2.0, path(1.0))
    assert estimator.unchanged_s == 0.0


def test_one_far_pose_after_a_silence_does_not_shut_out_the_hand():
    estimator = GoalEstimator()
    feed(estimator, np.arange(0.0, 1.0, 0.01), lambda _: HERE)
    assert not estimator.update(1.3, (0.3, 0.5, 1.0))
    assert all(feed(estimator, np.arange(1.31, 1.5, 0.01), lambda _: HERE))


def test_scattered_outliers_are_never_believed():
    estimator = GoalEstimator()
    random = np.random.default_rng(0)
    feed(estimator, np.arange(0.0, 1.0, 0.01), lambda _: HERE)
    assert not any(
        feed(estimator, np.arange(1.0, 3.0, 0.01), lambda _: 5.0 * random.standard_normal(3))
    )
    np.testing.assert_allclose(estimator.estimate(3.0).position, HERE, atol=1e-6)


def test_two_hands_in_turn_neither_mix_nor_lock_out():
    there = (1.3, -0.2, 1.0)
    estimator = GoalEstimator()
    feed(estimator, np.arange(0.0, 1.0, 0.01), lambda _: HERE)
    for k in range(100):
        assert not estimator.update(1.0 + 0.02 * k, HERE)
        assert estimator.update(1.01 + 0.02 * k, there)
    # After a silence neither is known any more: one of them is taken, and kept.
    for k in range(100):
        believed = {
            HERE: not estimator.update(9.0 + 0.02 * k, HERE),
            there: not estimator.update(9.01 + 0.02 * k, there),
        }
        if k > 10:
            assert sum(believed.values()) == 1
    place = next(place for place in believed if believed[place])
    np.testing.assert_allclose(estimator.estimate(11.0).position, place, atol=1e-6)


@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf, 1e300])
def test_no_pose_that_is_not_finite_enters(value):
    estimator = GoalEstimator()
    feed(estimator, np.arange(0.0, 1.0, 0.005), straight())
    before = estimator.estimate(1.0)
    for place in ((value, 0.0, 1.0), (0.0, value, 1.0), (0.0, 0.0, value), (value, -value, 1.0)):
        assert estimator.update(1.0, place)
    if not math.isfinite(value):
        assert estimator.update(value, straight()(1.0))
        assert estimator.rejected == {'not_finite': 5}
    assert estimator.estimate(1.0) == before
    assert not estimator.update(1.0, straight()(1.0))


def test_stamps_from_the_future():
    estimator = GoalEstimator()
    path = straight()
    feed(estimator, np.arange(0.0, 1.0, 0.005), path)
    # With the clock told, for certain.
    assert estimator.update(1.1, path(1.1), now_s=1.0)
    assert estimator.rejected['future'] == 1
    # Without it, one stamp far ahead does not shut out those that follow.
    assert not estimator.update(1000.0, path(1.0))
    assert all(feed(estimator, np.arange(1.0, 1.2, 0.005), path))


def test_a_clock_that_was_set_back_and_a_long_silence():
    estimator = GoalEstimator()
    feed(estimator, np.arange(100.0, 101.0, 0.01), lambda _: HERE)
    believed = feed(estimator, np.arange(0.0, 3.0, 0.01), lambda _: HERE)
    assert believed.index(True) == 199
    assert all(feed(estimator, np.arange(50.0, 51.0, 0.01), lambda _: (3.0, 0.0, 1.0)))


def test_a_drop_out_is_bridged():
    estimator = GoalEstimator()
    path = straight(1.0)
    feed(estimator, np.arange(0.0, 1.0, 0.005), path)
    assert not estimator.update(1.3, path(1.3))
    np.testing.assert_allclose(estimator.estimate(1.3).position, path(1.3), atol=1e-3)


def test_prediction_ends_in_a_calm_halt():
    estimator = GoalEstimator(HandFilter(prediction_limit_s=0.2))
    path = straight(1.0)
    feed(estimator, np.arange(0.0, 1.0, 0.005), path)
    last = 0.995
    asked = last + np.arange(-0.3, 1.0, 0.001)
    estimates = [estimator.estimate(time) for time in asked]
    x = np.array([estimate.position[0] for estimate in estimates])
    speed = np.array([estimate.velocity[0] for estimate in estimates])
    inside = np.abs(asked - last) < 0.2
    np.testing.assert_allclose(x[inside], 0.1 + asked[inside], atol=1e-3)
    # Position is the integral of the speed, and both are continuous.
    ahead = asked > last - 0.2
    integral = np.cumsum(0.5 * (speed[ahead][1:] + speed[ahead][:-1])) * 0.001
    np.testing.assert_allclose(x[ahead][1:] - x[ahead][0], integral, atol=1e-5)
    assert np.abs(np.diff(speed)).max() < 0.006
    assert speed[-1] == 0.0
    assert x[-1] - path(last)[0] == pytest.approx(0.3, abs=2e-3)
    assert estimator.estimate(math.inf).velocity == (0.0, 0.0, 0.0)


def test_stamps_that_come_late_by_a_known_delay():
    path = straight()
    estimator = GoalEstimator(trackers=[Tracker(delay_s=0.03)])
    for stamp in np.arange(0.0, 1.0, 0.005):
        estimator.update(stamp + 0.03, path(stamp), stamp + 0.03)
    estimate = estimator.estimate(1.0)
    np.testing.assert_allclose(estimate.position, path(1.0), atol=1e-3)
    assert estimate.stamp_s == pytest.approx(0.995)


def test_nothing_known_and_forgetting():
    estimator = GoalEstimator()
    assert estimator.estimate(0.0) is None
    assert not estimator.update(1.0, HERE)
    assert estimator.estimate(1.0).position == HERE
    assert estimator.estimate(1.0).velocity == (0.0, 0.0, 0.0)
    estimator.reset()
    assert estimator.estimate(1.0) is None
    assert estimator.accepted == 1, 'counts go on'
    assert not estimator.update(0.0, (9.0, 9.0, 9.0))


@given(
    st.lists(
        st.tuples(
            st.floats() | st.floats(0.0, 2.0),
            st.tuples(*[st.floats() | st.floats(-2.0, 2.0)] * 3),
            st.none() | st.floats(),
        ),
        max_size=60,
    )
)
@settings(max_examples=60, deadline=None)
def test_any_stream_gives_finite_answers(stream):
    estimator = GoalEstimator()
    for stamp, place, now in stream:
        assert isinstance(estimator.update(stamp, place, now), str)
        estimate = estimator.estimate(1.0)
        if estimate is not None:
            assert all(map(math.isfinite, (*estimate.position, *estimate.velocity)))
            assert max(map(abs, estimate.position)) < 1e4
    assert estimator.accepted + estimator.rejected.total() == len(stream)


def test_the_work_of_an_update_is_bounded():
    estimator = GoalEstimator()
    for k in range(10_000):
        estimator.update(1e-6 * k, HERE)
    assert len(estimator._track.poses) <= 32


@pytest.mark.parametrize(
    'wrong',
    [
        {'acceleration_noise': 0.0},
        {'hand_speed': math.nan},
        {'reacquire_poses': 0},
        {'lost_s': math.inf},
        {'outlier_distance_m': 0.0},
    ],
)
def test_parameters_out_of_range(wrong):
    with pytest.raises(UsageError, match='hand_filter.' + next(iter(wrong))):
        HandFilter(**wrong)
