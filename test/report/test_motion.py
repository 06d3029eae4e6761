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

from handover_dmp.report.motion import Bell, bell_of, velocity
import numpy as np
import pytest


def test_velocity_of_a_polynomial_is_exact() -> None:
    times = np.arange(0.0, 1.0, 0.005)
    positions = np.stack([times**2, 3 * times, times**3], axis=1)
    even, found = velocity(times, positions)
    expected = np.stack([2 * even, np.full_like(even, 3.0), 3 * even**2], axis=1)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_velocity_of_uneven_and_noisy_samples() -> None:
    noise = np.random.default_rng(0)
    times = np.sort(noise.uniform(0.0, 2.0, 500))
    positions = np.sin(2 * times)[:, None] + noise.normal(0.0, 1e-4, (500, 1))
    even, found = velocity(times, positions)
    errors = np.abs(found[:, 0] - 2 * np.cos(2 * even))[20:-20]
    assert np.sqrt((errors**2).mean()) < 0.01


def test_too_little_has_no_velocity() -> None:
    assert len(velocity(np.array([0.0, 0.01]), np.zeros((2, 3)))[0]) == 0
    assert len(velocity(np.zeros(0), np.zeros((0, 3)))[0]) == 0


@pytest.mark.parametrize(('begin', 'duration', 'distance'), [(0.3, 1.2, 0.7), (1.0, 0.5, 0.1)])
def test_the_bell_of_a_bell_is_itself(begin: float, duration: float, distance: float) -> None:
    bell = Bell(begin, duration, distance)
    times = np.arange(0.0, 3.0, 0.005)
    speeds = bell.speed(times)
    assert speeds.max() == pytest.approx(bell.peak, rel=1e-3)
    assert speeds.sum() * 0.005 == pytest.approx(distance, rel=1e-4)
    found = bell_of(times, speeds)
    assert found is not None
    assert found.begin_s == pytest.approx(begin, abs=1e-4)
    assert found.duration_s == pytest.approx(duration, abs=1e-4)
    assert found.distance == pytest.approx(distance, rel=1e-4)


def test_the_bell_ends_when_the_reach_does() -> None:
    bell = Bell(0.3, 1.2, 0.7)
    times = np.arange(0.0, 4.0, 0.005)
    speeds = np.maximum(bell.speed(times), np.where(times > 1.2, 0.2, 0.0))
    found = bell_of(times, speeds, until_s=1.6)
    assert found is not None
    assert found.duration_s == pytest.approx(1.2, abs=0.1)


def test_nothing_moves() -> None:
    assert bell_of(np.arange(10.0), np.zeros(10)) is None
    assert bell_of(np.zeros(0), np.zeros(0), until_s=1.0) is None
