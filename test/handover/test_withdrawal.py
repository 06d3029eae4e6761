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

"""The way back: smooth, bounded, walked with minimum jerk, and never through a loop."""

from __future__ import annotations

from math import dist

from handover_dmp.dmp import DecoupledDmp, DmpState, learn
from handover_dmp.handover.withdrawal import (
    Trace,
    Way,
    way_back,
    WayFollower,
    WithdrawalOptions,
)
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.interpolate import BSpline

PERIOD_S = 0.005
LIMIT = 20.0
COORDINATE = st.floats(-1.0, 1.0)
PLACE = st.tuples(COORDINATE, COORDINATE, COORDINATE)
PLACES = st.lists(PLACE, min_size=2, max_size=8)


def walked(way: Way, position: tuple[float, ...], velocity: tuple[float, ...]) -> np.ndarray:
    """Follow a way for as long as it takes; (n, 2, 3) positions and velocities."""
    follower, rows = WayFollower(way), [DmpState(position, velocity, 1.0, position)]
    while not follower.has_arrived(rows[-1]):
        rows.append(follower.step(rows[-1], PERIOD_S, 10.0, LIMIT))
        assert len(rows) * PERIOD_S < way.duration_s + 3.0
    return np.array([row[:2] for row in rows])


def test_a_straight_way_is_a_minimum_jerk_reach() -> None:
    """Flash and Hogan's polynomial, with the peak of its speed at the bound."""
    way = Way([(0.0, 0.0, 0.0), (0.6, 0.0, 0.3)], speed=0.3, acceleration=5.0)
    length = np.hypot(0.6, 0.3)
    assert way.duration_s == pytest.approx(1.875 * length / 0.3, rel=1e-3)
    for u in np.linspace(0.0, 1.0, 21):
        motion = way.at(u * way.duration_s)
        done = 10 * u**3 - 15 * u**4 + 6 * u**5
        assert np.allclose(motion.position, done * np.array([0.6, 0.0, 0.3]), atol=1e-9)


@settings(max_examples=6)
@given(PLACES)
def test_a_way_is_smooth_and_keeps_its_bounds(places: list[tuple[float, float, float]]) -> None:
    way = Way(places, speed=0.3, acceleration=5.0)
    assert np.allclose(way.at(0.0).position, places[0], atol=1e-9)
    assert np.allclose(way.at(way.duration_s).position, places[-1], atol=1e-9)
    times = np.linspace(0.0, way.duration_s, 2001)
    motions = [way.at(t) for t in times]
    positions, velocities, accelerations = (np.array(part) for part in zip(*motions, strict=True))
    # between the places at which it was checked it may be a little faster
    assert np.linalg.norm(velocities, axis=1).max() <= 0.3 * 1.05
    assert np.linalg.norm(accelerations, axis=1).max() <= 5.0 * 1.3
    step = times[1]
    assert np.allclose(np.gradient(positions, step, axis=0)[1:-1], velocities[1:-1], atol=0.02)
    assert np.abs(np.diff(velocities, axis=0)).max() <= 5.0 * 1.3 * step


def test_the_curve_is_the_uniform_cubic_b_spline_of_its_nodes() -> None:
    random = np.random.default_rng(3)
    nodes = [tuple(row) for row in random.uniform(-1.0, 1.0, (7, 3)).tolist()]
    way = Way(nodes, speed=1e6, acceleration=1e12, duration_s=6.0)
    padded = np.array(
        [2 * np.array(nodes[0]) - nodes[1], *nodes, 2 * np.array(nodes[-1]) - nodes[-2]]
    )
    spline = BSpline(np.arange(-3.0, 10.0), padded, 3)
    for time_s in np.linspace(0.0, 5.99, 50):
        assert np.allclose(way.at(time_s).position, spline(time_s), atol=1e-12)
        assert np.allclose(way.at(time_s).velocity, spline(time_s, 1), atol=1e-12)
        assert np.allclose(way.at(time_s).acceleration, spline(time_s, 2), atol=1e-12)


@settings(max_examples=6)
@given(PLACES, st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)))
def test_is_walked_within_the_limit_whatever_the_velocity_at_its_beginning(
    places: list[tuple[float, float, float]], velocity: tuple[float, float, float]
) -> None:
    way = Way(places, speed=0.3, acceleration=5.0)
    rows = walked(way, places[0], velocity)
    change = np.linalg.norm(np.diff(rows[:, 1], axis=0), axis=1)
    assert change.max() <= LIMIT * PERIOD_S * (1 + 1e-9)
    assert dist(rows[-1, 0], places[-1]) < 1e-3


def test_a_trace_has_no_loops_and_leads_to_where_it_began() -> None:
    trace = Trace((0.0, 0.0, 0.0))
    for x in np.arange(0.0, 0.3, 0.002):
        trace.add((x, 0.0, 0.0))
    for turn in np.linspace(0.0, 2 * np.pi, 200):
        trace.add((0.298, 0.05 - 0.05 * np.cos(turn), 0.05 * np.sin(turn)))
    back = np.array(trace.back_from((0.3, 0.0, 0.0)))
    assert np.abs(back[:, 1:]).max() < 0.006
    assert tuple(back[-1]) == (0.0, 0.0, 0.0)


def test_a_learnt_way_back_is_followed_from_elsewhere_to_home() -> None:
    times = np.arange(0.0, 1.0001, 0.005)
    done = 10 * times**3 - 15 * times**4 + 6 * times**5
    bow = np.sin(np.pi * done)
    back = np.stack([0.6 - 0.6 * done, 0.15 * bow, 0.0 * done], axis=1)
    learnt = learn(times, back, regression='ridge', primitive=DecoupledDmp)
    trace = Trace((0.01, 0.02, 0.0))
    for x in np.arange(0.0, 0.62, 0.005):
        trace.add((x + 0.01, 0.02, 0.0))
    start = (0.62, 0.03, 0.0)
    way = way_back(trace, start, WithdrawalOptions(), LIMIT, learnt)
    assert way is not None
    places = np.array([way.at(t).position for t in np.linspace(0.0, way.duration_s, 400)])
    assert np.allclose(places[0], start)
    assert np.allclose(places[-1], trace.start)
    # bowed as it was taught, where the way that the arm came is straight
    assert places[:, 1].max() > 0.12
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / (way.duration_s / 399)
    assert speeds.max() <= WithdrawalOptions().speed * 1.02


def test_stands_on_its_way_as_long_as_it_is_told_to() -> None:
    way = Way([(0.0, 0.0, 0.0), (0.6, 0.0, 0.0)], speed=0.3, acceleration=5.0)
    follower = WayFollower(way)
    origin = (0.0, 0.0, 0.0)
    command = DmpState(origin, origin, 1.0, origin)
    for _ in range(300):
        command = follower.step(command, PERIOD_S, 10.0, LIMIT)
    begun = command.position
    for _ in range(200):
        command = follower.step(command, PERIOD_S, 0.0, LIMIT)
    assert dist(begun, command.position) < 0.01
    assert np.linalg.norm(command.velocity) < 1e-6
    halted = command.position
    for _ in range(20):
        command = follower.step(command, PERIOD_S, 0.0, LIMIT)
    assert dist(halted, command.position) < 1e-7


def test_leads_nearer_only_where_it_does() -> None:
    way = Way([(0.0, 0.0, 0.0), (0.6, 0.0, 0.0)], speed=0.3, acceleration=5.0)
    half = 0.5 * way.duration_s
    assert not way.leads_nearer(half, (0.0, 0.0, 0.0))
    assert way.leads_nearer(half, (0.6, 0.0, 0.0))
    assert way.leads_nearer(0.0, (0.3, 0.0, 0.0))
    assert not way.leads_nearer(half, (0.2, 0.3, 0.0))
