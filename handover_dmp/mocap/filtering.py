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
Resampling and zero-phase low-pass in one: a smoothing spline with a cut-off frequency.

The positions are fitted by a cubic spline x(t), its knots on the new samples, that minimises

    Σ_i |y_i − x(t_i)|² + λ ∫ |d³x/dt³|² dt .

For samples at a rate f_s its frequency response is 1 / (1 + (f / f_0)⁶) with λ = f_s / (2π f_0)⁶,
real and hence without phase: that of a third-order Butterworth filter run forwards and backwards
(H. Woltring, Adv. Eng. Software 8, 1986). Its advantages: stamps may be uneven and have any rate,
so that no interpolation precedes the filter; gaps are bridged with the least jerk; and the ends
need no invented samples. A motion of constant acceleration passes unchanged up to its last
sample, which matters because that sample becomes the goal.
"""

from __future__ import annotations

from dataclasses import replace
import math
from typing import TYPE_CHECKING

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.mocap.orientation import unit_orientations
from handover_dmp.mocap.trial import HandoverTrial, WristColumns
import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from scipy.interpolate import BSpline, CubicSpline

RATE_HZ = 200.0
CUTOFF_HZ = 6.0
_MAX_SAMPLES = 2_000_000
_DEGREE = 3
# The third differences of a cubic spline's coefficients are its third derivative.
_THIRD_DIFFERENCE = np.array([-1.0, 3.0, -3.0, 1.0])


def condition(
    trial: HandoverTrial, rate_hz: float = RATE_HZ, cutoff_hz: float | None = CUTOFF_HZ
) -> HandoverTrial:
    """
    Resample a trial evenly and low-pass it with zero phase, including orientations.

    Args:
        trial: as recorded, at any rate, stamps even or not.
        rate_hz: new sampling rate, Hz.
        cutoff_hz: frequency at which the amplitude has fallen to 1/√2, Hz; None: no low-pass,
            the curve passes through every sample.

    Returns:
        The trial at times t_0 + k / rate_hz, the last one at most 1 / rate_hz before its end; its
        way back likewise.

    Raises:
        DataError: rate or cut-off make no sense, or fewer than 10 samples would remain.

    """
    way_back = trial.way_back and condition(trial.way_back, rate_hz, cutoff_hz)
    smoothed = smooth_columns(WristColumns.of(trial), rate_hz, cutoff_hz)
    return replace(trial, way_back=way_back, **smoothed._asdict())


def smooth_columns(columns: WristColumns, rate_hz: float, cutoff_hz: float | None) -> WristColumns:
    """
    Resample the wrists of two people evenly, low-passed with zero phase.

    Args:
        columns: the recorded wrists.
        rate_hz: new sampling rate, Hz.
        cutoff_hz: as in `smooth`, Hz.

    Returns:
        The resampled wrists.

    Raises:
        DataError: as in `smooth`.

    """
    both = np.hstack([columns.partner, columns.demonstrator])
    times, positions, _ = smooth(columns.times, both, rate_hz, cutoff_hz)
    # by component and normalised again: the result does not depend on the choice of axes
    turned = (
        quaternions
        if quaternions is None
        else unit_orientations(smooth(columns.times, quaternions, rate_hz, cutoff_hz)[1])
        for quaternions in columns[3:]
    )
    return WristColumns(times, positions[:, :3], positions[:, 3:], *turned)


def smooth(
    times: ArrayLike,
    positions: ArrayLike,
    rate_hz: float = RATE_HZ,
    cutoff_hz: float | None = CUTOFF_HZ,
) -> tuple[Array, Array, Array]:
    """
    Resample positions evenly, low-passed with zero phase, and differentiate them.

    Args:
        times: (n,) s, strictly increasing, n >= 4.
        positions: (n, d) m.
        rate_hz: new sampling rate, Hz.
        cutoff_hz: frequency at which the amplitude has fallen to 1/√2, Hz; None: no low-pass,
            the curve passes through every sample.

    Returns:
        Times (m,) in s, positions (m, d) in m, and velocities (m, d) in m/s, which are the exact
        derivative of the fitted spline.

    Raises:
        DataError: rate or cut-off make no sense, or the result would be absurdly long.

    """
    stamps = np.asarray(times, dtype=np.float64)
    samples = np.asarray(positions, dtype=np.float64)
    if not (math.isfinite(rate_hz) and rate_hz > 0.0):
        raise DataError(f'cannot sample at {rate_hz:g} Hz')
    if cutoff_hz is not None and not 0.0 < cutoff_hz < rate_hz / 2:
        raise DataError(f'cannot low-pass at {cutoff_hz:g} Hz when sampling at {rate_hz:g} Hz')
    period = 1.0 / rate_hz
    elapsed = stamps - stamps[0]
    # A small tolerance for stamps that were rounded when they were written.
    intervals = math.floor(elapsed[-1] * rate_hz + 1e-6)
    if intervals > _MAX_SAMPLES:
        raise DataError(f'{elapsed[-1]:g} s at {rate_hz:g} Hz are more than can be held')
    spline: BSpline | CubicSpline
    if cutoff_hz is None:
        spline = interpolate(elapsed, samples)
    else:
        spline = _fit(elapsed, samples, period, cutoff_hz)
    new = np.minimum(np.arange(intervals + 1) * period, elapsed[-1])
    return stamps[0] + new, spline(new), spline.derivative()(new)


def interpolate(times: ArrayLike, positions: ArrayLike) -> CubicSpline:
    """
    Interpolate positions by a smooth curve, without filtering.

    Args:
        times: (n,) s, strictly increasing, n >= 4.
        positions: (n, d) m.

    Returns:
        The cubic spline; call it with a time within `times` to get (d,) m.

    """
    # imported here, because it takes half a second and a node that replays a trial needs none
    from scipy.interpolate import CubicSpline

    return CubicSpline(times, positions)


def velocities(times: ArrayLike, positions: ArrayLike) -> Array:
    """
    Differentiate smooth positions; use `condition` on others first.

    Args:
        times: (n,) s, strictly increasing, n >= 4.
        positions: (n, d) m.

    Returns:
        (n, d) m/s, the derivative of the interpolating cubic spline.

    """
    return np.asarray(interpolate(times, positions).derivative()(times))


def _fit(elapsed: Array, samples: Array, period: float, cutoff_hz: float) -> BSpline:
    from scipy.interpolate import BSpline
    from scipy.linalg import solveh_banded

    count = max(math.ceil(elapsed[-1] / period - 1e-6), 1) + _DEGREE
    knots = (np.arange(count + _DEGREE + 1) - _DEGREE) * period
    inside = np.clip(elapsed, 0.0, knots[count])
    design = BSpline.design_matrix(inside, knots, _DEGREE)
    half_power_hz = cutoff_hz / (math.sqrt(2.0) - 1.0) ** (1 / 6)
    rate = 1.0 / float(np.median(np.diff(elapsed)))
    penalty = rate / (2.0 * math.pi * half_power_hz) ** 6 / period**5
    # Normal equations in LAPACK's lower banded form: row k holds the k-th subdiagonal.
    gram = (design.T @ design).tocsr()
    bands = np.zeros((_DEGREE + 1, count))
    for k in range(_DEGREE + 1):
        bands[k, : count - k] = gram.diagonal(-k)
        products = _THIRD_DIFFERENCE[k:] * _THIRD_DIFFERENCE[: _DEGREE + 1 - k]
        for offset, product in enumerate(products):
            bands[k, offset: offset + count - _DEGREE] += penalty * product  # fmt: skip
    # A straight line passes unchanged; subtracting it reduces rounding errors.
    slope = (samples[-1] - samples[0]) / elapsed[-1]
    line = samples[0] + elapsed[:, None] * slope
    coefficients = solveh_banded(bands, design.T @ (samples - line), lower=True)
    greville = (np.arange(count) - 1.0) * period
    return BSpline(knots, coefficients + samples[0] + greville[:, None] * slope, _DEGREE)
