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
Calibration of a tracker, frame and delay, from one body that two sources saw.

The reference gives the pose of a body in the target frame (an arm the pose of its wrist, a
calibrated tracker that of a hand), and the tracker sees a marker on it:

    p(t_i - d) + R_w(t_i - d)·m = R·y_i + x ,

with p, R_w the position and rotation of the reference, y_i the position from the tracker with
stamp t_i, R, x the pose of the tracker's frame, d the delay of its stamps, and m the marker in the
axes of the body. First the best lag is searched (`lag_search`). Starting there, R (Kabsch), x, m
and d are estimated jointly by least squares, without poses more than four standard deviations off.
The intervals follow from the sandwich covariance of Newey and West (1987), since noise and faults
of a tracker are correlated in time.
"""

from __future__ import annotations

from dataclasses import dataclass
from warnings import catch_warnings, simplefilter

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.mocap.body_path import BodyPath
from handover_dmp.tracking.frames import Place
from handover_dmp.tracking.lag_search import LagSearch, search_lag
from handover_dmp.tracking.reference_path import ReferencePath
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import t as student

MIN_SPREAD_M = 0.02
"""Standard deviation along a direction below which a motion has no extent in it."""
MAX_TURN_DEG = 1.0
MAX_SHIFT_M = 0.01
MAX_DELAY_S = 0.02
"""A quantity with a larger 95 % interval, to either side, is not determined."""
MIN_TURN_RAD = 0.1
"""Standard deviation of the body's rotation below which the marker is not determined."""
OUTLIER = 4.0
"""Threshold in standard deviations of a pose."""
MAX_LEFT_OUT = 0.2
MAX_SCALE = 0.05
MISFIT = 0.35
"""Residual, relative to the motion, above which the paths are of different bodies."""
AMBIGUOUS_S = 0.1
AMBIGUOUS = 1.5
"""A lag this far off with an error within this factor of the best fits equally well."""
CORRELATED_S = 1.0
"""Time beyond which errors of poses count as independent, s."""
ROUNDS = 8


@dataclass(frozen=True, eq=False)
class Calibration:
    """
    Result of a calibration. Intervals are half-widths with 95 % probability.

    Attributes:
        position: (3,) m, position of the tracker's frame in that of the reference.
        position_interval_m: (3,).
        quaternion: (4,) x, y, z, w, from the tracker's axes to those of the reference.
        rotation_interval_deg: about the least certain axis.
        delay_s: delay of the tracker's stamps, by the reference's clock.
        delay_interval_s: its interval.
        marker: (3,) m, position of the marker in the axes of the reference's body.
        marker_interval_m: (3,); 0 along axes that were not estimated.
        marker_estimated: whether any of it was estimated.
        residual_m: root-mean-square distance of marker and pose, over the poses used.
        residual_95_m: 95th percentile of these distances.
        times: (n,) s, times of the tracker's poses on the reference's clock.
        expected: (n, 3) m, position of the marker according to the reference.
        seen: (n, 3) m, position of the marker seen by the tracker, in the reference's frame.
        counted: (n,) whether each pose is used.
        search: the search for the lag.
        undetermined: quantities that the motion does not determine: `rotation`, `position`,
            `delay`.
        warnings: warnings for the user.

    """

    position: Array
    position_interval_m: Array
    quaternion: Array
    rotation_interval_deg: float
    delay_s: float
    delay_interval_s: float
    marker: Array
    marker_interval_m: Array
    marker_estimated: bool
    residual_m: float
    residual_95_m: float
    times: Array
    expected: Array
    seen: Array
    counted: NDArray[np.bool_]
    search: LagSearch
    undetermined: tuple[str, ...]
    warnings: tuple[str, ...]


def calibrate(
    reference: BodyPath,
    tracker: BodyPath,
    *,
    max_delay_s: float = 2.0,
    marker: Place | None = None,
) -> Calibration:
    """
    Estimate frame and delay of a tracker.

    Args:
        reference: path of the body in the target frame.
        tracker: path of the same body from the tracker.
        max_delay_s: range of the search for the delay to either side of the difference of the
            recording times, s.
        marker: position of the marker in the axes of the body, m; by default it is estimated as
            far as the rotation determines it, and zero otherwise.

    Returns:
        The calibration, with intervals and warnings.

    Raises:
        DataError: the paths do not overlap, the body was at rest, or the paths are of different
            bodies.

    """
    known = ReferencePath(reference)
    search = search_lag(known, tracker, reference.delay_s - tracker.delay_s, max_delay_s)
    _refuse_other_metres(known, tracker, search)
    fit = _Fit(known, tracker, search, marker)
    fit.solve()
    return fit.judged()


def _refuse_other_metres(known: ReferencePath, tracker: BodyPath, search: LagSearch) -> None:
    """Refuse what no rigid transform can correct: a mirrored frame, other units of length."""
    places = known.positions(tracker.times[search.inside] - search.best_s)
    seen = tracker.positions[search.inside]
    spread = np.linalg.norm(places - places.mean(axis=0), axis=1)
    if np.sqrt(np.square(spread).mean()) < MIN_SPREAD_M:
        raise DataError(
            f'the body stays within {1e3 * spread.max():.0f} mm: move it for half a minute, '
            'in all directions'
        )
    ratio = float(spread.sum() / np.linalg.norm(seen - seen.mean(axis=0), axis=1).sum())
    plain = 10.0 ** round(np.log10(ratio))
    if abs(ratio - 1.0) > 0.5:
        hint = {0.001: ' (millimetres?)', 0.01: ' (centimetres?)'}.get(plain, '')
        raise DataError(
            f'{tracker.label}: the path is {1.0 / ratio:.4g} times as long as that of the '
            f'reference{hint}: positions must be in metres'
        )
    middle = seen.mean(axis=0)
    depths = np.linalg.svd(seen - middle, compute_uv=False) / np.sqrt(len(seen))
    if depths[2] > MIN_SPREAD_M and np.linalg.det(search.matrix) < -0.5:
        raise DataError(
            f'{tracker.label}: a mirror image of the reference: its frame is left-handed, or two '
            'of its axes are exchanged'
        )


class _Fit:
    """The joint least squares: rotation (3), shift of the middle (3), delay, marker (0 to 3)."""

    def __init__(
        self, known: ReferencePath, tracker: BodyPath, search: LagSearch, marker: Place | None
    ) -> None:
        self._known, self._tracker, self._search = known, tracker, search
        inside = search.inside
        self._middle = tracker.positions[inside].mean(axis=0)
        self._given = np.zeros(3) if marker is None else np.array(marker, dtype=float)
        self._axes = _turned_axes(known, tracker.times[inside] - search.best_s)
        if marker is not None:
            self._axes = self._axes[:, :0]
        self._asked = marker is None
        self.delay_s = search.best_s
        self.offset = np.zeros(self._axes.shape[1])
        self.inside = np.zeros(len(tracker.times), dtype=bool)
        self.inside[inside] = True
        self._start(inside)

    def _start(self, inside: NDArray[np.intp]) -> None:
        """Alternate a few times: rotation by Kabsch, marker by linear least squares."""
        at = self._tracker.times[inside] - self.delay_s
        places, turns = self._known.positions(at), self._known.rotations(at)
        seen = self._tracker.positions[inside] - self._middle
        for _ in range(ROUNDS):
            marked = places + turns @ self.marker
            shift = marked.mean(axis=0)
            off = seen - seen.mean(axis=0)
            with catch_warnings():
                # a motion along a line leaves it undetermined, which is reported later
                simplefilter('ignore', UserWarning)
                self.turn = Rotation.align_vectors(marked - shift, off)[0]
            self.shift = shift - self.turn.apply(seen.mean(axis=0))
            if not len(self.offset):
                break
            left = self.turn.apply(seen) - places - turns @ self._given
            design = turns @ self._axes
            design = design - design.mean(axis=0)
            self.offset = np.linalg.lstsq(
                design.reshape(-1, len(self.offset)),
                (left - left.mean(axis=0)).ravel(),
                rcond=None,
            )[0]

    @property
    def marker(self) -> Array:
        return np.asarray(self._given + self._axes @ self.offset)

    def solve(self) -> None:
        """Solve repeatedly, without outliers, until the set of outliers does not change."""
        for _ in range(ROUNDS):
            self._least_squares()
            off = self._residuals(np.zeros(self._size), slice(None))
            valid = self._known.known(self._tracker.times - self.delay_s)
            # the median of the length of a vector with three normal parts is 1.538
            deviation = float(np.median(np.linalg.norm(off[valid & self.inside], axis=1))) / 1.538
            inside = valid & (np.linalg.norm(off, axis=1) <= OUTLIER * deviation + 1e-9)
            if np.array_equal(inside, self.inside):
                break
            self.inside = inside
        else:
            self._least_squares()

    @property
    def _size(self) -> int:
        return 7 + len(self.offset)

    def _residuals(self, change: Array, rows: NDArray[np.bool_] | slice) -> Array:
        """Return the marker by the reference minus the seen position, (n, 3) m."""
        at = self._tracker.times[rows] - self.delay_s - change[6]
        marker = self._given + self._axes @ (self.offset + change[7:])
        expected = self._known.positions(at) + self._known.rotations(at) @ marker
        turn = Rotation.from_rotvec(change[:3]) * self.turn
        seen = turn.apply(self._tracker.positions[rows] - self._middle)
        return np.asarray(expected - seen - self.shift - change[3:6])

    def _jacobian(self, change: Array, rows: NDArray[np.bool_]) -> Array:
        """Return the derivatives of the residuals, (n, 3, size)."""
        step_s = 1e-3
        at = self._tracker.times[rows] - self.delay_s - change[6]
        marker = self._given + self._axes @ (self.offset + change[7:])
        turns = self._known.rotations(at)
        swing = self._known.rotations(at - step_s) - self._known.rotations(at + step_s)
        turn = Rotation.from_rotvec(change[:3]) * self.turn
        jacobian = np.zeros((len(at), 3, self._size))
        jacobian[:, :, :3] = _levers(turn.apply(self._tracker.positions[rows] - self._middle))
        jacobian[:, range(3), range(3, 6)] = -1.0
        jacobian[:, :, 6] = -self._known.velocities(at) + swing @ marker / (2.0 * step_s)
        jacobian[:, :, 7:] = turns @ self._axes
        return jacobian

    def _least_squares(self) -> None:
        found = least_squares(
            lambda change: self._residuals(change, self.inside).ravel(),
            np.zeros(self._size),
            lambda change: self._jacobian(change, self.inside).reshape(-1, self._size),
            x_scale='jac',
        ).x
        self.turn = Rotation.from_rotvec(found[:3]) * self.turn
        self.shift = self.shift + found[3:6]
        self.delay_s += float(found[6])
        self.offset = self.offset + found[7:]

    def judged(self) -> Calibration:
        """Assemble the result, with the undetermined quantities."""
        tracker, rows = self._tracker, self.inside
        times = tracker.times - self.delay_s
        valid = self._known.known(times)
        off = self._residuals(np.zeros(self._size), rows)
        lengths = np.linalg.norm(off, axis=1)
        covariance, factor = self._covariance(off)
        rotated_middle = self.turn.apply(self._middle)
        # x = shift - R·middle, so a change of the rotation moves it by middle × turn
        to_origin = np.hstack([_levers(rotated_middle), np.eye(3)])
        origin = to_origin @ covariance[:6, :6] @ to_origin.T
        axes = self._axes
        expected = self._known.positions(times) + self._known.rotations(times) @ self.marker
        seen = self.turn.apply(tracker.positions - self._middle) + self.shift
        turn_deg = np.rad2deg(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1]))
        undetermined, warnings = self._verdict(
            expected[rows], seen[rows], off, factor * np.sqrt(np.diag(covariance)), valid
        )
        return Calibration(
            position=self.shift - rotated_middle,
            position_interval_m=factor * np.sqrt(np.maximum(np.diag(origin), 0.0)),
            quaternion=self.turn.as_quat(),
            rotation_interval_deg=float(factor * turn_deg),
            delay_s=self.delay_s,
            delay_interval_s=float(factor * np.sqrt(covariance[6, 6])),
            marker=self.marker,
            marker_interval_m=factor
            * np.sqrt(np.maximum(np.diag(axes @ covariance[7:, 7:] @ axes.T), 0.0)),
            marker_estimated=bool(len(self.offset)),
            residual_m=float(np.sqrt(np.square(lengths).mean())),
            residual_95_m=float(np.quantile(lengths, 0.95)),
            times=times[valid],
            expected=expected[valid],
            seen=seen[valid],
            counted=rows[valid],
            search=self._search,
            undetermined=undetermined,
            warnings=warnings,
        )

    def _covariance(self, off: Array) -> tuple[Array, float]:
        """Return the covariance of all unknowns, and the factor of a 95 % interval."""
        jacobian = self._jacobian(np.zeros(self._size), self.inside)
        flat = jacobian.reshape(-1, self._size)
        scale = np.maximum(np.linalg.norm(flat, axis=0), 1e-12)
        values, vectors = np.linalg.eigh((flat / scale).T @ (flat / scale))
        values = np.maximum(values, 1e-12)
        inverse = (vectors / values) @ vectors.T
        scores = np.einsum('nij,ni->nj', jacobian, off) / scale
        times = self._tracker.times[self.inside]
        period_s = float(np.median(np.diff(times)))
        lags = min(int(CORRELATED_S / period_s), len(scores) // 4)
        middle = scores.T @ scores
        for lag in range(1, lags + 1):
            product = scores[lag:].T @ scores[:-lag]
            middle += (1.0 - lag / (lags + 1)) * (product + product.T)
        count = len(scores)
        middle *= count / (count - self._size / 3.0)
        # not less than the covariance for independent errors
        plain = float(np.square(off).sum()) / (3 * count - self._size) * inverse
        strengths, axes = np.linalg.eigh(middle)
        # as a product with itself: rounding would make variances of what is undetermined negative
        root = inverse @ axes * np.sqrt(np.maximum(strengths, 0.0))
        robust = root @ root.T
        short = np.diag(robust) < np.diag(plain)
        covariance = plain if short.all() else robust
        grown = np.sqrt(np.maximum(np.diag(plain) / np.maximum(np.diag(covariance), 1e-300), 1.0))
        covariance = covariance * np.outer(grown, grown) / np.outer(scale, scale)
        duration_s = float(times[-1] - times[0])
        factor = float(student.ppf(0.975, max(duration_s / CORRELATED_S, 2.0)))
        return covariance, factor

    def _verdict(
        self,
        expected: Array,
        seen: Array,
        off: Array,
        intervals: Array,
        valid: NDArray[np.bool_],
    ) -> tuple[tuple[str, ...], tuple[str, ...]]:
        undetermined: list[str] = []
        warnings: list[str] = []
        deviation = float(np.sqrt(np.square(off).mean()))
        spreads, directions = _spreads(expected, seen)
        if np.sqrt(3.0) * deviation > MISFIT * float(np.linalg.norm(spreads)):
            raise DataError(
                f'{self._tracker.label}: the best transform and delay leave '
                f'{1e3 * np.sqrt(3.0) * deviation:.0f} mm to the reference: check that both are '
                'of one body, and that --max-delay exceeds the delay'
            )
        if spreads[1] < MIN_SPREAD_M:
            undetermined.append('rotation')
            line = ', '.join(f'{x:.2f}' for x in directions[0])
            warnings.append(
                f'the whole motion is on a line, along ({line}): the rotation about it is not '
                'determined; move in two more directions'
            )
        elif np.rad2deg(intervals[:3].max()) > MAX_TURN_DEG:
            undetermined.append('rotation')
            warnings.append(
                f'the rotation is uncertain by {np.rad2deg(intervals[:3].max()):.1f}°: move '
                'farther, longer, at changing speeds'
            )
        if intervals[3:6].max() > MAX_SHIFT_M:
            undetermined.append('position')
            warnings.append(
                f'the position is uncertain by {1e3 * intervals[3:6].max():.0f} mm: move farther '
                'and longer'
            )
        warnings += self._delay_verdict(intervals[6], undetermined)
        warnings += self._marker_verdict(intervals[7:])
        left_out = 1.0 - self.inside.sum() / max(int(valid.sum()), 1)
        if left_out > MAX_LEFT_OUT:
            warnings.append(f'{left_out:.0%} of the poses are outliers and were left out')
        return tuple(undetermined), tuple(warnings)

    def _delay_verdict(self, interval_s: float, undetermined: list[str]) -> list[str]:
        search = self._search
        far = np.abs(search.lags - self.delay_s) > AMBIGUOUS_S
        rival = int(np.where(far, search.errors, np.inf).argmin())
        best = float(search.errors.min())
        if min(abs(self.delay_s - end) for end in search.lags[[0, -1]]) < AMBIGUOUS_S:
            undetermined.append('delay')
            return [
                f'the delay of {self.delay_s:.3f} s is at the end of the search range: increase '
                '--max-delay'
            ]
        if far[rival] and search.errors[rival] < AMBIGUOUS * best + 1e-9:
            undetermined.append('delay')
            if 'rotation' not in undetermined:
                undetermined.append('rotation')
            return [
                f'a delay of {search.lags[rival]:.2f} s fits about as well as one of '
                f'{self.delay_s:.2f} s, with another rotation: the motion repeats itself; move at '
                'changing speeds'
            ]
        if interval_s > MAX_DELAY_S:
            undetermined.append('delay')
            return [f'the delay is uncertain by {1e3 * interval_s:.0f} ms: move faster']
        return []

    def _marker_verdict(self, intervals: Array) -> list[str]:
        if not self._asked:
            return []
        if not len(self.offset):
            return [
                'the body was not turned (or its rotation was not recorded), so the position of '
                'the marker is not determined: assumed to be at the origin of the body'
            ]
        warnings = []
        if len(self.offset) < 3:
            free = np.linalg.svd(self._axes)[0][:, len(self.offset):]  # fmt: skip
            along = ' and '.join(
                '(' + ', '.join(f'{x:.2f}' for x in axis) + ')' for axis in free.T
            )
            warnings.append(
                'the body was turned about too few axes to determine the marker along '
                f'{along} of its axes: assumed to be 0'
            )
        if intervals.max() > MAX_SHIFT_M:
            warnings.append(
                f'the position of the marker is uncertain by {1e3 * intervals.max():.0f} mm: turn '
                'the body farther, about two axes'
            )
        return warnings


def _levers(places: Array) -> Array:
    """Return the matrices (..., 3, 3) of the cross products with vectors (..., 3)."""
    return np.cross(np.eye(3), places[..., None, :])


def _turned_axes(known: ReferencePath, times: Array) -> Array:
    """Return the axes of the body along which the marker is determined, (3, k)."""
    if not known.turns:
        return np.zeros((3, 0))
    turns = known.rotations(times)
    off = turns - turns.mean(axis=0)
    values, vectors = np.linalg.eigh(np.einsum('nij,nik->jk', off, off) / len(off))
    return np.asarray(vectors[:, values > MIN_TURN_RAD**2])


def _spreads(expected: Array, seen: Array) -> tuple[Array, Array]:
    """
    Return the spreads of the motion, and their directions.

    They use both paths, so independent noise does not count as motion.
    """
    product = (expected - expected.mean(axis=0)).T @ (seen - seen.mean(axis=0)) / len(seen)
    values, vectors = np.linalg.eigh((product + product.T) / 2.0)
    return np.sqrt(np.maximum(values[::-1], 0.0)), vectors[:, ::-1].T
