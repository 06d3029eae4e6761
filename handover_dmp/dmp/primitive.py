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
The common part of the decoupled and the classical primitive: steps, rollouts, batches.

Both are τv̇ = (1 − w)K_s(f_w + x0 − x) + w[K(g − x) + K_v ġ] − Dv, τẋ = v, (8), with different
weights w over the phase. A step is that of `reference_step` or, unrolled, of `fast_step`; a
rollout computes all its intervals at once. All use the six numbers of `transition`, so they agree
to rounding.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil, inf, log, nan
from typing import TYPE_CHECKING, TypeVar

from handover_dmp.common.arrays import Array, read_only, ReadOnly, Vector
from handover_dmp.common.errors import DataError
from handover_dmp.dmp.basis import Basis, LAST_NODE, TABLE_RATE
from handover_dmp.dmp.fast_step import FastStep
from handover_dmp.dmp.intervals import Intervals
from handover_dmp.dmp.parameters import DmpParameters
from handover_dmp.dmp.posterior import WeightPosterior
from handover_dmp.dmp.reference_step import reference_step
from handover_dmp.dmp.state import DmpState, Rollout, SMALLEST_PHASE
from handover_dmp.dmp.transition import GAUSS_A, GAUSS_B, in_seconds, steady, varying
import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from handover_dmp.dmp.orientation import LearntTurn

Self = TypeVar('Self', bound='Primitive')

MAX_DURATION_S = 3600.0
# Longer steps, as a fraction of τ, are divided while the stiffness changes.
MAX_VARYING = 0.05
MAX_PARTS = 1000
ROUNDING = 1e-6
GAUSS_POINTS = np.array([[GAUSS_A], [GAUSS_B]])
_UNIT = np.array([[1.0], [0.0]])
_OPTIONAL = ('goal_offset', 'start_velocity')


@dataclass(frozen=True, eq=False)
class Primitive(ReadOnly, ABC):
    """
    A learnt movement of d dimensions; immutable.

    Equal parameters give bitwise equal motions, however the object was made: every array is stored
    row by row, since linear algebra libraries sum other layouts in another order.

    Attributes:
        parameters: K, D and the others.
        duration_s: τ, s.
        start: x0 of the demonstration, m, (d,).
        goal: end of the demonstration, m, (d,).
        weights: w of (6), (m, d).
        basis: the m basis functions.
        goal_offset: end of the demonstration minus that of the partner, m, (d,): the vector from
            the partner's hand to the goal. Zeros unless given.
        start_velocity: velocity at the start of the demonstration, m/s, (d,). Zeros unless given.
        covariance: posterior of the weights, one per dimension; None if the regression has none.
        source: description of the data that it was learnt from.
        partner_path: mean path of the partner's hand in the demonstrations, each over its own
            duration, m, (n, d), evenly spaced in time; None if unknown.
        way_back: the learnt movement from the exchange to rest; its goal is the position of rest.
            None if the demonstrations have none.
        turn: the learnt rotation of the wrist; None if the demonstrations have no orientation.

    Raises:
        DataError: the shapes do not fit each other, or a number is not finite.

    """

    parameters: DmpParameters
    duration_s: float
    start: Array
    goal: Array
    weights: Array
    basis: Basis
    goal_offset: Array = field(default_factory=lambda: np.zeros(0))
    start_velocity: Array = field(default_factory=lambda: np.zeros(0))
    covariance: tuple[WeightPosterior, ...] | None = None
    source: str = ''
    partner_path: Array | None = None
    way_back: Primitive | None = None
    turn: LearntTurn | None = None
    # last step: its length, s; largest phase rate without division; step function; length in τ
    _prepared: tuple[float, float, FastStep | None, float] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the shapes and make the arrays read-only."""
        duration = float(self.duration_s)
        if not 0.0 < duration <= MAX_DURATION_S:
            raise DataError(
                f'duration is {duration:g} s; it must be above 0 and up to {MAX_DURATION_S:g}'
            )
        object.__setattr__(self, 'duration_s', duration)
        dimensions = np.size(self.start)
        for name, shape in (
            ('start', (dimensions,)),
            ('goal', (dimensions,)),
            ('goal_offset', (dimensions,)),
            ('start_velocity', (dimensions,)),
            ('weights', (self.basis.size, dimensions)),
        ):
            array = read_only(getattr(self, name))
            if array.size == 0 and name in _OPTIONAL:
                array = read_only(np.zeros(shape))
            if array.shape != shape:
                raise DataError(f'{name} has the shape {array.shape} instead of {shape}')
            if not np.isfinite(array).all():
                raise DataError(f'{name} holds a number that is not finite')
            object.__setattr__(self, name, array)
        if self.partner_path is not None:
            object.__setattr__(self, 'partner_path', _checked_path(self.partner_path, dimensions))
        if self.way_back is not None:
            if self.way_back.dimensions != dimensions:
                raise DataError('the way back must have the dimensions of the movement')
            if self.way_back.way_back is not None:
                raise DataError('the way back has a way back')
        if self.turn is not None and len(self.turn.weights) != self.basis.size:
            raise DataError(f'turn has {len(self.turn.weights)} weights, not {self.basis.size}')
        object.__setattr__(self, '_prepared', (nan, nan, None, nan))

    @property
    def dimensions(self) -> int:
        """Return the number of dimensions d."""
        return int(self.start.size)

    def __repr__(self) -> str:
        """Return a short description."""
        used = int(np.any(self.weights != 0.0, axis=1).sum())
        source = f', learnt from {self.source}' if self.source else ''
        return (
            f'{type(self).__name__}({self.dimensions} dimensions, {used} of {self.basis.size} '
            f'basis functions, {self.duration_s:.2f} s{source})'
        )

    def with_duration(self: Self, duration_s: float) -> Self:
        """
        Change τ. A state of the old movement remains valid: x and ẋ do not jump.

        Args:
            duration_s: new τ, s.

        Returns:
            The same movement with another duration.

        """
        return replace(self, duration_s=duration_s)

    def with_goal_offset(self: Self, offset: ArrayLike) -> Self:
        """
        Set the vector from the partner's hand to the goal.

        Args:
            offset: m, (d,).

        Returns:
            The same movement with this offset.

        """
        return replace(self, goal_offset=np.asarray(offset, dtype=float))

    def with_partner_path(self: Self, path: ArrayLike | None) -> Self:
        """
        Set the mean path of the partner's hand.

        Args:
            path: m, (n, d), evenly spaced over the duration; None: unknown.

        Returns:
            The same movement with this path.

        """
        return replace(self, partner_path=None if path is None else np.asarray(path, dtype=float))

    def with_way_back(self: Self, way_back: Primitive | None) -> Self:
        """
        Set the way back after the exchange.

        Args:
            way_back: the movement from the exchange to rest; None: unknown.

        Returns:
            The same movement with this way back.

        """
        return replace(self, way_back=way_back)

    def with_turn(self: Self, turn: LearntTurn | None) -> Self:
        """
        Set the rotation of the wrist.

        Args:
            turn: on the basis of this movement; None: unknown.

        Returns:
            The same movement with this turn.

        """
        return replace(self, turn=turn)

    def with_weights(
        self: Self, weights: ArrayLike, covariance: tuple[WeightPosterior, ...] | None = None
    ) -> Self:
        """
        Replace the learnt weights.

        Args:
            weights: w of (6), (m, d).
            covariance: posterior of the weights, one per dimension.

        Returns:
            The movement with these weights, otherwise unchanged.

        """
        return replace(self, weights=np.asarray(weights, dtype=float), covariance=covariance)

    @abstractmethod
    def goal_weight_at_time(self, u: Array) -> Array:
        """
        Return the goal weight w at times in units of τ.

        Args:
            u: −ln(s)/α, any shape.

        Returns:
            w, from 0 to 1, of the same shape.

        """

    @abstractmethod
    def goal_weight_at(self, u: float) -> float:
        """
        Return the goal weight w at one time.

        Args:
            u: −ln(s)/α.

        Returns:
            w, from 0 to 1.

        """

    @property
    def shape_stiffness(self) -> float:
        """K_s of (8)."""
        return self.parameters.shape_stiffness

    @property
    @abstractmethod
    def _settled(self) -> float:
        """Time, in units of τ, after which the goal weight is 1 to rounding."""

    @property
    @abstractmethod
    def _sharpest(self) -> float:
        """Time, in units of τ, over which the slope of the goal weight is nearly constant."""

    @property
    @abstractmethod
    def goal_velocity_gain(self) -> float:
        """K_v, s."""

    def _fast_step(self, h: float) -> FastStep | None:
        """Prepare the unrolled step for one length, in units of τ, if there is one."""
        return None

    def goal_weight(self, phase: float) -> float:
        """
        Return the goal weight w_g at one phase.

        Args:
            phase: s of (4), above 0 and at most 1.

        Returns:
            w_g, from 0 to 1.

        """
        return self.goal_weight_at(self.time_of(phase))

    def time_of(self, phase: float) -> float:
        """
        Convert phase to time, (4).

        Args:
            phase: s, above 0 and at most 1.

        Returns:
            u = −ln(s)/α, in units of τ.

        """
        return -log(max(phase, SMALLEST_PHASE)) / self.parameters.alpha

    def shape(self, u: float) -> Vector:
        """
        Return the forcing term f of (6) at one time.

        Args:
            u: −ln(s)/α, from 0.

        Returns:
            m, d floats; the last value beyond the end of the basis.

        """
        node = min(u * TABLE_RATE, LAST_NODE)
        index = int(node)
        value, slope = self.shape_rows[index]
        return tuple([f + (node - index) * df for f, df in zip(value, slope, strict=True)])

    def initial_state(
        self, position: Sequence[float] | None = None, velocity: Sequence[float] | None = None
    ) -> DmpState:
        """
        Return the state at the start.

        Args:
            position: x0, m, (d,); that of the demonstration if left out.
            velocity: ẋ, m/s, (d,); zero if left out.

        Returns:
            The state, with phase 1.

        """
        start = tuple(map(float, self.start if position is None else position))
        moving = tuple(map(float, np.zeros(self.dimensions) if velocity is None else velocity))
        if len(start) != self.dimensions or len(moving) != self.dimensions:
            raise DataError(f'position and velocity need {self.dimensions} numbers each')
        return DmpState(start, moving, 1.0, start)

    def step(
        self,
        state: DmpState,
        goal: Vector,
        goal_velocity: Vector,
        dt: float,
        phase_rate: float = 1.0,
    ) -> DmpState:
        """
        Make one step of (8), exact for any step length.

        Args:
            state: state at the start of the step.
            goal: g at the start of the step, m, d plain floats; NumPy's take five times as long.
            goal_velocity: ġ, m/s, d floats; the goal moves with it within the step.
            dt: length of the step, s, at least 0.
            phase_rate: speed of the phase, 1 as learnt, 0 stopped (phase stopping).

        Returns:
            The state at the end of the step.

        Raises:
            DataError: the step or the rate is negative or not finite.

        """
        known_dt, max_rate, fast, h = self._prepared
        if dt != known_dt:
            _, max_rate, fast, h = self._prepare(dt)
        if 0.0 <= phase_rate <= max_rate:
            if fast is not None:
                return fast(state, goal, goal_velocity, phase_rate)
            return reference_step(self, state, goal, goal_velocity, h, phase_rate)
        if not 0.0 <= phase_rate < inf:
            raise DataError(
                f'phase rate of a step is {phase_rate}; it must be finite and not negative'
            )
        done = 0.0
        for part in self._divide(self.time_of(state.phase), h, phase_rate):
            moved = tuple(g + done * v for g, v in zip(goal, goal_velocity, strict=True))
            state = reference_step(self, state, moved, goal_velocity, part, phase_rate)
            done += part * self.duration_s
        return state

    def rollout(
        self,
        times: ArrayLike,
        goals: ArrayLike,
        goal_velocities: ArrayLike | None = None,
        *,
        start: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        deviation: bool = False,
    ) -> Rollout:
        """
        Run from the start to the end.

        Args:
            times: s, (n,), increasing, with any spacing; the phase is 1 at the first.
            goals: g at these times, m, (n, d), or one goal for all, (d,).
            goal_velocities: ġ from each of these times to the next, m/s, (n, d); by default the
                differences of the goals, which is exact to second order.
            start: x0, m, (d,); that of the demonstration if left out.
            velocity: ẋ at the start, m/s, (d,); zero if left out.
            deviation: whether to compute the standard deviation from the posterior.

        Returns:
            The motion at these times. Between them the goal moves with its velocity, as in `step`.

        Raises:
            DataError: shapes or times do not fit, or the model has no posterior for the deviation.

        """
        stamps = _checked_times(times)
        targets, target_velocities = self._checked_goals(stamps, goals, goal_velocities)
        x0 = self.start if start is None else self._vector('start', start)
        u = (stamps - stamps[0]) / self.duration_s
        intervals = self._intervals(u, self._table)
        inputs = intervals.goal[:, :, None] * (targets[:-1] - x0)
        inputs += intervals.forcing
        inputs += intervals.goal_velocity[:, :, None] * target_velocities[:-1]
        path = intervals.run(
            inputs, None if velocity is None else self._vector('velocity', velocity)
        )
        return Rollout(
            stamps,
            path[:, :, 0].T + x0,
            path[:, :, 1].T,
            self.goal_weight_at_time(u),
            np.exp(-self.parameters.alpha * u),
            self._deviation(u) if deviation else None,
        )

    def rollout_batch(
        self,
        times: ArrayLike,
        goals: ArrayLike,
        goal_velocities: ArrayLike | None = None,
        starts: ArrayLike | None = None,
    ) -> tuple[Array, Array]:
        """
        Run many motions at once, each with its own goals.

        Args:
            times: s, (n,), increasing, the same for all.
            goals: g, m, (b, n, d).
            goal_velocities: ġ from each of these times to the next, m/s, (b, n, d); by default the
                differences of the goals, which takes a quarter less time.
            starts: x0, m, (b, d); that of the demonstration if left out.

        Returns:
            Positions, m, and velocities, m/s, (b, n, d) each; all start at rest. Time is the first
            axis in memory.

        Raises:
            DataError: shapes or times do not fit.

        """
        stamps = _checked_times(times)
        count = stamps.size
        targets = np.asarray(goals, dtype=float)
        if targets.ndim != 3 or targets.shape[1:] != (count, self.dimensions):
            raise DataError(
                f'goals have the shape {targets.shape} instead of (b, {count}, {self.dimensions})'
            )
        target_velocities = None
        if goal_velocities is not None:
            target_velocities = np.asarray(goal_velocities, dtype=float)
        x0 = np.broadcast_to(self.start, (len(targets), self.dimensions))
        if starts is not None:
            x0 = np.asarray(starts, dtype=float)
        wrong = target_velocities is not None and target_velocities.shape != targets.shape
        if wrong or x0.shape != targets[:, 0].shape:
            raise DataError('shapes of goals, goal velocities and starts do not fit each other')
        u = (stamps - stamps[0]) / self.duration_s
        intervals = self._intervals(u, self._table)
        return intervals.run_batch(targets, target_velocities, x0, np.diff(stamps))

    @cached_property
    def _table(self) -> Array:
        """Return value and slope of the forcing term in the cells of the basis' table."""
        return _with_slopes(self.basis.table(self.parameters.alpha) @ self.weights)

    @cached_property
    def shape_rows(self) -> list[tuple[Vector, Vector]]:
        """Value and slope of the forcing term in each cell of the table, m."""
        return [(tuple(value), tuple(slope)) for value, slope in self._table.tolist()]

    @cached_property
    def varies(self) -> bool:
        """Whether the stiffness changes during the motion."""
        return self.shape_stiffness != self.parameters.stiffness

    @cached_property
    def _longest(self) -> float:
        """Return the longest interval of phase, in units of τ, that one step may cover."""
        return min(self._sharpest, self.basis.narrowest(self.parameters.alpha))

    def _divide(self, u: float, h: float, phase_rate: float) -> list[float]:
        """Divide an interval so that goal weight and shape are smooth over each part."""
        if h <= 0.0 or phase_rate <= 0.0 or u >= self._settled:
            return [h]
        smooth = min(h, (self._settled - u) / phase_rate)
        parts = smooth * phase_rate / self._longest
        if self.varies:
            parts = max(parts, smooth / MAX_VARYING)
        count = max(1, ceil(min(parts, MAX_PARTS) - ROUNDING))
        rest = h - smooth
        if count == 1 and rest < self._longest:
            return [h]
        return [smooth / count] * count + ([rest] if rest > 0.0 else [])

    def _prepare(self, dt: float) -> tuple[float, float, FastStep | None, float]:
        """Prepare for steps of this length and keep the result."""
        if not 0.0 <= dt < inf:
            raise DataError(f'length of a step is {dt} s; it must be finite and not negative')
        dt = float(dt)
        h = dt / self.duration_s
        max_rate = self._longest * (1.0 + ROUNDING) / h if h > 0.0 else inf
        if self.varies and h > MAX_VARYING * (1.0 + ROUNDING):
            max_rate = 0.0
        prepared = (dt, max_rate, self._fast_step(h), h)
        object.__setattr__(self, '_prepared', prepared)
        return prepared

    def _intervals(self, u: Array, table: Array) -> Intervals:
        """
        Make the recursion between samples.

        Args:
            u: times from the start, in units of τ, (n,).
            table: values and slopes of shapes in the cells of the basis' table, (nodes, 2, e).

        Returns:
            The recursion over n − 1 intervals.

        """
        lengths = np.diff(u)
        begins, counts = u[:-1], None
        offsets = np.zeros(1)
        if lengths.size and lengths.max() > self._longest * (1.0 + ROUNDING):
            parts = [self._divide(b, h, 1.0) for b, h in zip(begins, lengths, strict=True)]
            counts = np.array([len(each) for each in parts])
            offsets = np.concatenate([np.cumsum([0.0, *each[:-1]]) for each in parts])
            begins = np.repeat(begins, counts) + offsets
            lengths = np.concatenate([np.array(each) for each in parts])
        k, tau = self.parameters.stiffness, self.duration_s
        points = GAUSS_POINTS * lengths
        at = begins + points
        weight = self.goal_weight_at_time(at)
        at *= TABLE_RATE
        np.minimum(at, LAST_NODE, out=at)
        index = at.astype(np.intp)
        at -= index
        cells = table[index]
        shape = cells[:, :, 1] * at[:, :, None]
        shape += cells[:, :, 0]

        free = (1.0 - weight) * self.shape_stiffness
        # columns: inputs of state, goal, goal velocity and shapes at the two points
        puts = np.empty((2, lengths.size, 3 + shape.shape[2]))
        pull = np.multiply(weight, k, out=puts[:, :, 1])
        np.add(free, pull, out=puts[:, :, 0])
        points += offsets
        points *= k * tau
        points += self.goal_velocity_gain
        np.multiply(weight, points, out=puts[:, :, 2])
        np.multiply(shape, free[:, :, None], out=puts[:, :, 3:])
        numbers = self._transitions(puts[:, :, 0], lengths)
        gains = numbers[2:].reshape(2, 2, -1)
        if gains.shape[2] == 1:
            flat = gains[:, :, 0] @ puts.reshape(2, -1)
            sums = flat.reshape(2, lengths.size, -1)
        else:
            sums = np.einsum('xpn,pnc->xnc', gains, puts)
        carry = np.empty((2, 2, lengths.size))
        np.subtract(_UNIT, sums[:, :, 0], out=carry[:, 0])
        carry[:, 1] = numbers[:2]
        intervals = Intervals(carry, sums[:, :, 1], sums[:, :, 2], sums[:, :, 3:])
        return intervals if counts is None else intervals.merged(counts)

    def _transitions(self, stiffness: Array, lengths: Array) -> Array:
        """Return the six numbers of `transition` for every interval, or once if all are alike."""
        k, damping = self.parameters.stiffness, self.parameters.effective_damping
        if self.varies:
            numbers = [
                varying(a, b, damping, h)
                for a, b, h in zip(*stiffness.tolist(), lengths.tolist(), strict=True)
            ]
        elif lengths.size and lengths.max() - lengths.min() <= 1e-12 * lengths[0]:
            numbers = [steady(k, damping, float(lengths.mean()))]
        else:
            numbers = [steady(k, damping, h) for h in lengths.tolist()]
        seconds = [in_seconds(each, self.duration_s) for each in numbers]
        table: Array = np.reshape(seconds, (-1, 6)).T
        return table

    def _deviation(self, u: Array) -> Array:
        """Propagate the posterior of the weights through the recursion, (n, d) m."""
        if self.covariance is None:
            raise DataError('this model has no posterior; learn it with the rvm regression')
        deviation = np.zeros((u.size, self.dimensions))
        activations = self.basis.table(self.parameters.alpha)
        for dimension, posterior in enumerate(self.covariance):
            intervals = self._intervals(u, _with_slopes(activations[:, posterior.active]))
            response = intervals.run(intervals.forcing)[:, :, 0].T
            variance = ((response @ posterior.matrix) * response).sum(axis=1)
            deviation[:, dimension] = np.sqrt(np.maximum(variance, 0.0))
        return deviation

    def _checked_goals(
        self, times: Array, goals: ArrayLike, velocities: ArrayLike | None
    ) -> tuple[Array, Array]:
        targets = np.asarray(goals, dtype=float)
        shape = (times.size, self.dimensions)
        fixed = targets.shape == shape[1:]
        if not fixed and targets.shape != shape:
            raise DataError(f'goals have the shape {targets.shape} instead of {shape}')
        if velocities is not None:
            moving = np.asarray(velocities, dtype=float)
            if moving.shape not in (shape, shape[1:]):
                raise DataError(f'goal velocities have the shape {moving.shape}, not {shape}')
            moving = np.broadcast_to(moving, shape)
        else:
            moving = np.zeros(shape) if fixed else _chords(times, targets)
        return np.broadcast_to(targets, shape), moving

    def _vector(self, name: str, values: ArrayLike) -> Array:
        vector = np.asarray(values, dtype=float)
        if vector.shape != (self.dimensions,):
            raise DataError(f'{name} has the shape {vector.shape}, not ({self.dimensions},)')
        return vector


def _checked_path(given: ArrayLike, dimensions: int) -> Array:
    path = read_only(given)
    if path.ndim != 2 or len(path) < 2 or path.shape[1] != dimensions:
        raise DataError(
            f'partner_path has the shape {path.shape} instead of (n, {dimensions}), n at least 2'
        )
    if not np.isfinite(path).all():
        raise DataError('partner_path holds a number that is not finite')
    return path


def _chords(times: Array, values: Array) -> Array:
    """Return the velocities, (n, d), from each value to the next; zero after the last."""
    velocities: Array = np.diff(values, axis=0, append=values[-1:])
    velocities[:-1] /= np.diff(times)[:, None]
    return velocities


def _with_slopes(values: Array) -> Array:
    """Combine values at the nodes with the slopes of the next cells, (nodes, 2, e)."""
    table = np.zeros((len(values), 2, values.shape[1]))
    table[:, 0] = values
    np.subtract(values[1:], values[:-1], out=table[:-1, 1])
    return table


def _checked_times(times: ArrayLike) -> Array:
    stamps = np.asarray(times, dtype=float)
    if stamps.ndim != 1 or stamps.size == 0:
        raise DataError(f'times have the shape {stamps.shape} instead of (n,)')
    if not np.isfinite(stamps).all() or (np.diff(stamps) <= 0.0).any():
        raise DataError('times do not increase')
    return stamps
