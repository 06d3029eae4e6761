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

"""Measures of motions for which they are known in closed form."""

from __future__ import annotations

from math import log, pi

from handover_dmp.mocap.measures import (
    count_peaks,
    fluency,
    log_dimensionless_jerk,
    measure_motion,
    spectral_arc_length,
    synchrony,
)
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from numpy.typing import NDArray
import pytest
from scipy.integrate import trapezoid

Array = NDArray[np.float64]

RATE_HZ = 200.0


def minimum_jerk(duration_s: float, length_m: float) -> tuple[Array, Array]:
    times = np.arange(0.0, duration_s + 1e-9, 1.0 / RATE_HZ)
    u = times / times[-1]
    along = length_m * (10 * u**3 - 15 * u**4 + 6 * u**5)
    return times, np.outer(along, [2.0, -1.0, 2.0]) / 3.0


@given(st.floats(0.5, 3.0), st.floats(0.05, 1.5))
def test_a_minimum_jerk_reach(duration_s: float, length_m: float) -> None:
    """All of it follows from x = L(10u³ − 15u⁴ + 6u⁵)."""
    times, positions = minimum_jerk(duration_s, length_m)
    found = measure_motion(times, positions)
    assert found is not None
    assert found.path_m == pytest.approx(length_m)
    assert found.path_ratio == pytest.approx(1.0)
    assert found.peak_speed == pytest.approx(1.875 * length_m / times[-1], rel=2e-3)
    # 30u²(1 − u)² is a twentieth of its peak at u = ½(1 ± √(1 − √0.05))
    onset = 0.5 * (1.0 - np.sqrt(1.0 - np.sqrt(0.05)))
    assert found.time_to_peak_s == pytest.approx((0.5 - onset) * times[-1], abs=2 / RATE_HZ)
    assert found.duration_s == pytest.approx((1.0 - 2 * onset) * times[-1], abs=3 / RATE_HZ)
    assert found.peaks == 1
    assert found.log_dimensionless_jerk == pytest.approx(-log(204.8), abs=0.05)


def test_the_length_of_a_path_on_a_circle() -> None:
    times = np.linspace(0.0, 1.0, 401)
    angle = pi * times
    positions = 0.3 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    found = measure_motion(times, positions)
    assert found is not None
    assert found.path_m == pytest.approx(0.3 * pi, rel=1e-5)
    assert found.path_ratio == pytest.approx(pi / 2, rel=1e-5)
    assert found.log_dimensionless_jerk == pytest.approx(-log(pi**4), abs=1e-3)


def test_what_does_not_move_has_no_measures() -> None:
    assert measure_motion(np.arange(20) / 200.0, np.ones((20, 3))) is None
    assert measure_motion(np.arange(4) / 200.0, np.eye(4)[:, :3]) is None


def test_the_spectral_arc_length_of_a_bell_is_that_of_its_transform() -> None:
    """
    The transform of exp(−t²/2s²) is exp(−ω²s²/2), from which the arc follows by integration.

    Its cut-off, where 0.05 is left of the amplitude, lies below 10 Hz.
    """
    times = np.arange(-4.0, 4.0, 1.0 / RATE_HZ)
    width_s = 0.1
    end = np.sqrt(-2.0 * np.log(0.05)) / width_s
    omega = np.linspace(0.0, end, 200_001)
    slope = -omega * width_s**2 * np.exp(-0.5 * (omega * width_s) ** 2)
    expected = -trapezoid(np.sqrt((1.0 / end) ** 2 + slope**2), omega)
    found = spectral_arc_length(np.exp(-0.5 * (times / width_s) ** 2), RATE_HZ)
    assert found == pytest.approx(expected, rel=2e-3)


def test_smoothness_does_not_depend_on_size_and_falls_with_every_arrest() -> None:
    times, positions = minimum_jerk(1.0, 0.4)
    speed = np.linalg.norm(np.gradient(positions, 1.0 / RATE_HZ, axis=0), axis=1)
    once = spectral_arc_length(speed, RATE_HZ), log_dimensionless_jerk(times, positions)
    larger = (
        spectral_arc_length(3.0 * speed, RATE_HZ),
        log_dimensionless_jerk(2.0 * times, 3.0 * positions),
    )
    assert larger == pytest.approx(once)
    twice = np.concatenate([speed, speed])
    assert count_peaks(twice) == 2
    assert spectral_arc_length(twice, RATE_HZ) < once[0] - 0.2
    further = np.concatenate([positions, positions[-1] + positions[1:]])
    on = np.arange(len(further)) / RATE_HZ
    # twice the time, eightfold D³, and twice the integral
    assert log_dimensionless_jerk(on, further) == pytest.approx(once[1] - log(16), abs=0.1)


@given(st.integers(-60, 60), st.floats(0.3, 4.0))
def test_a_copy_that_is_late_is_as_late_as_that(late: int, size: float) -> None:
    times = np.arange(400) / RATE_HZ
    first = np.exp(-0.5 * ((times - 1.0) / 0.15) ** 2)
    second = size * np.exp(-0.5 * ((times - 1.0 - late / RATE_HZ) / 0.15) ** 2)
    found = synchrony(first, second, RATE_HZ)
    assert found is not None
    assert found.lag_s == pytest.approx(late / RATE_HZ)
    assert found.correlation == pytest.approx(1.0, abs=0.02)


def test_half_of_a_motion_in_common_correlates_as_its_integrals_say() -> None:
    """One bell against two: with A = ∫f and B = ∫f², the rest is means and variances over T."""
    count, width_s = 2000, 0.1
    times = np.arange(count) / RATE_HZ

    def bell(share: float) -> Array:
        return np.exp(-0.5 * ((times - share * times[-1]) / width_s) ** 2)

    found = synchrony(bell(0.5), bell(0.4) + bell(0.6), RATE_HZ)
    assert found is not None
    assert abs(found.lag_s) == pytest.approx(0.1 * times[-1], abs=1 / RATE_HZ)
    left_s = 0.9 * times[-1]
    area, power = width_s * np.sqrt(2 * pi) / left_s, width_s * np.sqrt(pi) / left_s
    covariance = power - 2 * area**2
    variances = (power - area**2) * (2 * power - 4 * area**2)
    assert found.correlation == pytest.approx(covariance / np.sqrt(variances), abs=1e-3)


def test_who_rests_has_no_synchrony() -> None:
    assert synchrony(np.ones(50), np.arange(50.0), RATE_HZ) is None


def test_the_fluency_of_a_session_that_was_written_down() -> None:
    """The person moves in 0–40 and 90–100, the robot in 50–80: each waits ten for the other."""
    person, robot = np.zeros(100), np.zeros(100)
    person[:40], person[90:], robot[50:80] = 1.0, 1.0, 1.0
    found = fluency(person, robot)
    assert found.person_idle == pytest.approx(0.5)
    assert found.robot_idle == pytest.approx(0.7)
    assert found.concurrent == 0.0
    assert found.functional_delay == pytest.approx(0.2)


def test_who_begins_before_the_other_is_done_has_a_negative_delay() -> None:
    person, robot = np.zeros(100), np.zeros(100)
    person[10:50], robot[40:70] = 1.0, 1.0
    found = fluency(person, robot)
    assert found.concurrent == pytest.approx(0.1)
    assert found.functional_delay == pytest.approx(-0.1)
