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

"""Velocities from recorded positions, and the minimum-jerk profile of a reach."""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.common.arrays import Array
import numpy as np

RATE_HZ = 200.0
# long enough for the noise of a tracker (0.1 mm) to stay below 5 mm/s, short against a reach
WINDOW_S = 0.1
ORDER = 3
# a reach begins when the speed exceeds this share of its peak
ONSET = 0.05
MIN_SAMPLES = 10
MIN_SPEED = 1e-3


def resample(times: Array, values: Array, at: Array) -> Array:
    """
    Interpolate linearly.

    Args:
        times: (n,) s, increasing.
        values: (n, d).
        at: (m,) s.

    Returns:
        (m, d); beyond the ends, the first and the last value.

    """
    return np.column_stack([np.interp(at, times, column) for column in values.T])


def velocity(times: Array, positions: Array) -> tuple[Array, Array]:
    """
    Differentiate recorded positions: evenly resampled, by a local cubic (Savitzky-Golay).

    Args:
        times: (n,) s, increasing.
        positions: (n, d) m.

    Returns:
        (m,) s at 200 Hz, and (m, d) m/s; both empty if there is less than 0.1 s.

    """
    # imported here, because it takes a second and most callers do not need it
    from scipy.signal import savgol_filter

    window = round(WINDOW_S * RATE_HZ) | 1
    count = int((times[-1] - times[0]) * RATE_HZ) + 1 if len(times) else 0
    if count < window:
        return np.zeros(0), np.zeros((0, positions.shape[1]))
    even = times[0] + np.arange(count) / RATE_HZ
    found = savgol_filter(
        resample(times, positions, even), window, ORDER, deriv=1, delta=1 / RATE_HZ, axis=0
    )
    return even, np.asarray(found)


@dataclass(frozen=True)
class Bell:
    """
    Speed of a straight minimum-jerk reach (Flash and Hogan 1985).

    Attributes:
        begin_s: start of the reach, s.
        duration_s: duration, s.
        distance: length, m.

    """

    begin_s: float
    duration_s: float
    distance: float

    def speed(self, times: Array) -> Array:
        """Return the speed in m/s at times in s: d/T (30 u² − 60 u³ + 30 u⁴), u = t/T."""
        u = np.clip((times - self.begin_s) / self.duration_s, 0.0, 1.0)
        speed: Array = self.distance / self.duration_s * 30 * u**2 * (1 - u) ** 2
        return speed

    @property
    def peak(self) -> float:
        """Greatest speed, m/s: 15/8 d/T."""
        return 1.875 * self.distance / self.duration_s


def bell_of(times: Array, speeds: Array, until_s: float | None = None) -> Bell | None:
    """
    Fit the speed of a minimum-jerk reach to a measured one, by least squares.

    Args:
        times: (n,) s.
        speeds: (n,) m/s.
        until_s: latest end of the reach, s. Later motion does not count: a hand that moves on
            takes the wrist along.

    Returns:
        The fitted reach; None if nothing moves.

    """
    from scipy.optimize import least_squares

    if until_s is not None:
        times, speeds = times[times <= until_s], speeds[times <= until_s]
    if len(speeds) < MIN_SAMPLES or speeds.max() < MIN_SPEED:
        return None
    top = int(np.argmax(speeds))
    slow = np.flatnonzero(speeds[:top] < ONSET * speeds[top])
    half_s = float(times[top] - times[slow[-1] if len(slow) else 0]) or 1.0 / RATE_HZ
    first = (times[top] - half_s, 2 * half_s, speeds[top] * 2 * half_s / 1.875)

    def miss(parameters: Array) -> Array:
        return Bell(*parameters).speed(times) - speeds

    found = least_squares(
        miss, first, bounds=([-np.inf, 1.0 / RATE_HZ, 0.0], np.inf), x_scale=np.abs(first) + 0.1
    )
    return Bell(*(float(one) for one in found.x))
