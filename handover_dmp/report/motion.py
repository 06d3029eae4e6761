"""Velocities out of recorded positions, and the bell that an unhurried reach would have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import trapezoid
from scipy.signal import savgol_filter

Array = NDArray[np.float64]

RATE_HZ = 200.0
# long enough for the noise of a tracker (0.1 mm) to stay below 5 mm/s, short against a reach
WINDOW_S = 0.1
ORDER = 3
# where the speed passes this share of its peak, a reach begins and ends
ONSET = 0.05


def resample(times: Array, values: Array, at: Array) -> Array:
    """
    Interpolate linearly.

    Args:
        times: (n,) s, increasing.
        values: (n, d).
        at: (m,) s.

    Returns:
        (m, d), the first and the last value beyond the ends.

    """
    return np.column_stack([np.interp(at, times, column) for column in values.T])


def velocity(times: Array, positions: Array) -> tuple[Array, Array]:
    """
    Differentiate recorded positions: evenly resampled, by a local cubic (Savitzky-Golay).

    Args:
        times: (n,) s, increasing.
        positions: (n, d) m.

    Returns:
        (m,) s at 200 Hz, and (m, d) m/s; both empty where there is less than 0.1 s.

    """
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
        begin_s: when it begins, s.
        duration_s: how long it takes, s.
        distance: its length, m.

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
    Find the minimum-jerk reach that takes as long and goes as far.

    It begins and ends where the speed around its peak passes 5 % of it; where the bell itself does
    that, 6.8 % of its duration from either end, is accounted for.

    Args:
        times: (n,) s.
        speeds: (n,) m/s.
        until_s: when the reach is over at the latest, s; a hand that moves on takes the wrist
            along, and that is no reach any more.

    Returns:
        The bell; None where nothing moves.

    """
    if until_s is not None:
        times, speeds = times[times <= until_s], speeds[times <= until_s]
    if len(speeds) < 3 or speeds.max() < 1e-3:
        return None
    top = int(np.argmax(speeds))
    slow = speeds < ONSET * speeds[top]
    first = int(np.flatnonzero(slow[:top])[-1]) if slow[:top].any() else 0
    after = np.flatnonzero(slow[top:])
    last = top + int(after[0]) if len(after) else len(speeds) - 1
    distance = float(trapezoid(speeds[first : last + 1], times[first : last + 1]))
    u = np.linspace(0.0, 0.5, 5001)
    margin = float(np.interp(ONSET * 1.875, 30 * u**2 * (1 - u) ** 2, u))
    duration = (times[last] - times[first]) / (1 - 2 * margin)
    if duration <= 0 or distance <= 0:
        return None
    return Bell(float(times[first] - margin * duration), float(duration), distance)
