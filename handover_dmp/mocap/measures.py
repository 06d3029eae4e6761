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

"""
Measures of one motion, and of two together, as reported by studies of handovers.

docs/method.md has the formulas and their sources.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import ceil, inf, log, log2

from handover_dmp.common.arrays import Array
from handover_dmp.mocap.filtering import velocities
import numpy as np
from numpy.typing import NDArray

ONSET = 0.05
"""A motion lasts while its speed is above this share of its peak."""
PEAK_PROMINENCE = 0.05
"""Least prominence of a speed peak, as a share of the greatest peak."""
SPARC_CUTOFF_HZ = 10.0
SPARC_THRESHOLD = 0.05
SPARC_PADDING = 4
"""Constants published with the measure (Balasubramanian et al. 2015): highest frequency, Hz, least
share of the amplitude, and refinement of the spectrum in powers of two."""
MAX_LAG_SHARE = 0.5
"""Largest shift between two hands, as a share of the time."""
ACTIVE_SPEED = 0.05
"""Below this speed a person or robot is idle, m/s."""
MIN_SAMPLES = 10
MIN_LENGTH_M = 1e-6
MIN_SCALE = 1e-12
ROUNDING = 1e-12


@dataclass(frozen=True)
class MotionMeasures:
    """
    Measures of one motion.

    Attributes:
        path_m: length of the path, m.
        path_ratio: path length over the straight line from start to end; infinite if these
            coincide.
        peak_speed: peak speed, m/s.
        time_to_peak_s: time from the onset to the peak speed, s.
        duration_s: time from the onset to the end of the motion, s.
        peaks: number of peaks of the speed.
        spectral_arc_length: of the speed, from −1.6 for a smooth reach downwards (Balasubramanian
            et al. 2015).
        log_dimensionless_jerk: −ln(D³/v_peak² ∫‖x⃛‖² dt) (Hogan and Sternad 2009); greater is
            smoother.

    """

    path_m: float
    path_ratio: float
    peak_speed: float
    time_to_peak_s: float
    duration_s: float
    peaks: int
    spectral_arc_length: float
    log_dimensionless_jerk: float


@dataclass(frozen=True)
class Synchrony:
    """
    Synchrony of two motions.

    Attributes:
        lag_s: lag of the second speed behind the first, s; negative: it leads.
        correlation: correlation of the two speeds at that lag, −1 to 1.

    """

    lag_s: float
    correlation: float


@dataclass(frozen=True)
class Fluency:
    """
    Fluency measures, as shares of the time (Hoffman 2019).

    Attributes:
        person_idle: share in which the person does not move.
        robot_idle: share in which the robot does not move.
        concurrent: share in which both move.
        functional_delay: share between the end of one agent's motion and the start of the
            other's; overlaps at such a change count as negative.

    """

    person_idle: float
    robot_idle: float
    concurrent: float
    functional_delay: float


def measure_motion(times: Array, positions: Array) -> MotionMeasures | None:
    """
    Measure one motion.

    Args:
        times: (n,) s, evenly spaced.
        positions: (n, 3) m, smooth (low-passed if measured).

    Returns:
        The measures; None if nothing moves, or if there are fewer than 10 samples.

    """
    if len(times) < MIN_SAMPLES:
        return None
    dt = float(times[-1] - times[0]) / (len(times) - 1)
    speed = np.linalg.norm(velocities(times, positions), axis=1)
    path_m = float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())
    if path_m < MIN_LENGTH_M:
        return None
    moving = np.flatnonzero(speed >= ONSET * speed.max())
    onset, end = int(moving[0]), int(moving[-1])
    straight_m = float(np.linalg.norm(positions[-1] - positions[0]))
    return MotionMeasures(
        path_m=path_m,
        path_ratio=path_m / straight_m if straight_m >= MIN_LENGTH_M else inf,
        peak_speed=float(speed.max()),
        time_to_peak_s=(int(speed.argmax()) - onset) * dt,
        duration_s=(end - onset) * dt,
        peaks=count_peaks(speed),
        spectral_arc_length=spectral_arc_length(speed, 1.0 / dt),
        log_dimensionless_jerk=log_dimensionless_jerk(times, positions),
    )


def count_peaks(speed: Array) -> int:
    """
    Count the peaks of a speed.

    Args:
        speed: (n,) m/s.

    Returns:
        Number of peaks with a prominence of at least a twentieth of the greatest peak; ends are
        no peaks.

    """
    from scipy.signal import find_peaks

    padded = np.concatenate([[0.0], speed, [0.0]])
    found, _ = find_peaks(padded, prominence=PEAK_PROMINENCE * float(speed.max()))
    return len(found)


def spectral_arc_length(speed: Array, rate_hz: float) -> float:
    """
    Measure the smoothness of a speed by the length of its spectrum.

    SPARC = −∫₀^ωc √((1/ωc)² + (dV̂/dω)²) dω with V̂(ω) = V(ω)/V(0) the normalised amplitude of
    the speed's spectrum, and ωc the greatest frequency up to 10 Hz at which V̂ is at least 0.05.

    Source: Balasubramanian, Melendez-Calderon, Roby-Brami and Burdet, On the analysis of movement
    smoothness, J. NeuroEng. Rehabil. 12:112, 2015.

    Args:
        speed: (n,) m/s.
        rate_hz: sampling rate, Hz.

    Returns:
        A value below 0; nearer to 0 is smoother.

    """
    length = 2 ** (ceil(log2(len(speed))) + SPARC_PADDING)
    amplitudes = np.abs(np.fft.rfft(speed, length))
    amplitudes /= amplitudes.max()
    frequencies = np.fft.rfftfreq(length, 1.0 / rate_hz)
    below = frequencies <= SPARC_CUTOFF_HZ
    last = int(np.flatnonzero(below & (amplitudes >= SPARC_THRESHOLD))[-1])
    amplitudes, frequencies = amplitudes[: last + 1], frequencies[: last + 1]
    steps = np.diff(frequencies) / max(float(frequencies[-1]), 1e-12)
    return -float(np.hypot(steps, np.diff(amplitudes)).sum())


def log_dimensionless_jerk(times: Array, positions: Array) -> float:
    """
    Measure the smoothness of a motion by its dimensionless jerk.

    LDLJ = −ln(D³/v_peak² ∫‖x⃛‖² dt), D the duration. A straight minimum-jerk reach has
    −ln(204.8) = −5.32, the best value from rest to rest.

    Source: Hogan and Sternad, Sensitivity of smoothness measures to movement duration, amplitude,
    and arrests, J. Motor Behav. 41(6), 2009.

    Args:
        times: (n,) s.
        positions: (n, 3) m, smooth.

    Returns:
        The measure; greater is smoother.

    """
    from scipy.integrate import trapezoid
    from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(times, positions, k=5)
    squared = (spline.derivative(3)(times) ** 2).sum(axis=1)
    peak = float(np.linalg.norm(spline.derivative()(times), axis=1).max())
    duration_s = float(times[-1] - times[0])
    return -log(duration_s**3 / peak**2 * float(trapezoid(squared, times)))


def synchrony(first: Array, second: Array, rate_hz: float) -> Synchrony | None:
    """
    Find the lag of one speed behind another.

    Args:
        first: (n,) m/s.
        second: (n,) m/s, at the same times.
        rate_hz: sampling rate, Hz.

    Returns:
        The lag with the largest correlation over the common time, up to half of it; None if one
        speed is constant, or never that of a motion (`ACTIVE_SPEED`).

    """
    if min(first.max(initial=0.0), second.max(initial=0.0)) < ACTIVE_SPEED:
        return None
    count = len(first)
    reach = int(MAX_LAG_SHARE * count)
    lags = np.arange(-reach, reach + 1)
    common = count - np.abs(lags)

    def sums(values: Array, starts: Array) -> Array:
        """Add up the common part of one speed for each lag."""
        total = np.concatenate([[0.0], np.cumsum(values)])
        return np.asarray(total[starts + common] - total[starts])

    first, second = first - first.mean(), second - second.mean()
    parts = (first, np.maximum(0, -lags)), (second, np.maximum(0, lags))
    means = [sums(speed, starts) / common for speed, starts in parts]
    squares = [sums(speed**2, starts) for speed, starts in parts]
    spreads = [square - common * mean**2 for square, mean in zip(squares, means, strict=True)]
    # what is left of a constant speed is rounding
    varied = [
        np.where(spread > ROUNDING * square, spread, 0.0)
        for spread, square in zip(spreads, squares, strict=True)
    ]
    scale = np.sqrt(varied[0] * varied[1])
    product = np.correlate(second, first, 'full')[count - 1 + lags] - common * means[0] * means[1]
    varies = scale > MIN_SCALE
    if not varies.any():
        return None
    correlation = np.where(varies, product / np.where(varies, scale, 1.0), -np.inf)
    best = int(correlation.argmax())
    return Synchrony(float(lags[best] / rate_hz), float(correlation[best]))


def fluency(person_speed: Array, robot_speed: Array) -> Fluency:
    """
    Measure the fluency of two motions.

    Source: Hoffman, Evaluating fluency in human-robot collaboration, IEEE Trans. Human-Machine
    Systems 49(3), 2019. A person or robot is active while hand or wrist is faster than 0.05 m/s.

    Args:
        person_speed: (n,) m/s, evenly spaced in time.
        robot_speed: (n,) m/s, at the same times.

    Returns:
        Shares of the time.

    """
    return fluency_of(person_speed > ACTIVE_SPEED, robot_speed > ACTIVE_SPEED)


def fluency_of(person: NDArray[np.bool_], robot: NDArray[np.bool_]) -> Fluency:
    """
    Find the shares of the time in which person, robot and both were active.

    Args:
        person: (n,) whether the person was active, evenly spaced in time.
        robot: (n,) whether the robot was active, at the same times.

    Returns:
        Shares of the time.

    """
    return Fluency(
        person_idle=float((~person).mean()),
        robot_idle=float((~robot).mean()),
        concurrent=float((person & robot).mean()),
        functional_delay=(_delay(person, robot) + _delay(robot, person)) / len(person),
    )


def _delay(first: NDArray[np.bool_], second: NDArray[np.bool_]) -> int:
    """Count the samples from each end of the first's motion to the start of the second's."""
    total = 0
    answers = _begins(second)
    ends = _begins(~first)
    starts = _begins(first)
    for end, after in pairwise([*ends, len(first)]):
        # from the start of this motion to the end of the next one
        begun = starts[starts < end].max(initial=-1)
        found = answers[(answers > begun) & (answers <= after)]
        if len(found):
            total += int(found[0] - end)
    return total


def _begins(active: NDArray[np.bool_]) -> NDArray[np.int_]:
    """Find where each activity begins, except one that is active from the start."""
    return np.flatnonzero(~active[:-1] & active[1:]) + 1
