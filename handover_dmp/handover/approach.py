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
Approach of a hand that is not where the learnt movement expects it, without overrunning it.

While w_g of (8) is 0, the primitive ignores the hand: it moves as far as it was taught, through
a hand that is closer, and away from one on the other side. Two rules prevent this.

The goal takes over by time, (7), or by position, whichever gives the larger weight:

    w_g = ½[1 + erf(ξ/√2)], ξ = max((u − μ)/σ, ξ_near, ξ_astray),
    ξ_near = min((ρ − n)/(0.4ρ), (b − β)/(0.25β)),
    ξ_astray = (a − a_learnt − ε)/(0.25ε),

with the remaining distance n = |g − x₀| − |x − x₀|, the overshoot b = |y − x₀| − |g − x₀| of the
point y = x + (K_s/K)(f + x₀ − x) to which the shape leads (f is held after μ; both use the goal
in 0.1 s, if that is closer), and the relative distance to the goal in excess of that at the start,
a = |g − x|/|g − x₀| − 1. Once ξ_astray is above 0, it never falls, and grows by 40 per second.

The wrist approaches no faster than it can brake. For d = |g − x₀| − |x − x₀|, and for the distance
d = |g − x|, with the permitted overrun m:

    −ḋ ≤ V(d + m), V(l) = √(2a(l − l₀/2)), and λl for l < l₀ = a/λ²,

where a is a share of the acceleration limit. Braking with a maintains the bound; the rest of the
limit is reserved for motion of the hand. The speed approaches its bound at a limited rate, so
that it does not hit it.

The first rule brings the wrist smoothly to the hand, and the second holds whatever the first does.
If the hand is about as far away as in the demonstration, both have almost no effect.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import copysign, dist, exp, hypot, inf, log, sqrt
from typing import NamedTuple

from handover_dmp.common.arrays import Array, Vector
from handover_dmp.common.settings import defaults, dmp_setting
from handover_dmp.common.vectors import dot, minus, plus, scaled_by
from handover_dmp.dmp import DecoupledDmp, DmpState
import numpy as np

SETTLED_DEVIATIONS = 5.0
"""Standard deviations beyond which the weight is 0 or 1 to a millionth."""
NEAR_WIDTH = 0.4
BEYOND_WIDTH = 0.25
ASTRAY_WIDTH = 0.25
"""Standard deviations of the three, relative to their centres."""
FINAL_GAIN = 28.0
"""1/s; slope of the speed bound over the last part of the distance."""
CLOSING_GAIN = 30.0
"""1/s; rate at which the speed may approach its bound."""
ASTRAY_RATE = 40.0
"""1/s; rate at which the goal takes over once the wrist is astray."""
AHEAD_S = 0.1
"""Prediction time for an approaching hand, s."""
MIN_DISTANCE_M = 1e-6
"""Distances below this have no direction, m."""
MIN_SINE_SQUARED = 1e-6
"""Squared sine of the angle between two directions below which they are parallel."""
OPPOSED = -0.9
"""Cosine of the angle between two directions below which they are opposed."""


@dataclass(frozen=True)
class ApproachOptions:
    """Options for the approach of a hand that is not where it was in the demonstration."""

    enabled: bool = dmp_setting(
        'approach.enabled',
        'Whether the approach rules hold; if not, the movement follows (7) and (8) alone',
    )
    near_m: float = dmp_setting(
        'approach.near_m',
        'Remaining distance ρ at which the goal takes over, m',
        0.001,
        1.0,
    )
    shape_beyond_m: float = dmp_setting(
        'approach.shape_beyond_m',
        'Distance β beyond the goal to which the learnt shape must lead for the goal to take over '
        'at near_m, m',
        0.001,
        10.0,
    )
    astray: float = dmp_setting(
        'approach.astray',
        'Growth ε of the distance to the goal, beyond what was learnt, at which the goal takes '
        'over; as a fraction of the distance at the start',
        0.01,
        10.0,
    )
    beyond_m: float = dmp_setting(
        'approach.beyond_m', 'Maximum distance of the wrist beyond the goal, m', 0.0, 1.0
    )
    braking_share: float = dmp_setting(
        'approach.braking_share',
        'Share of the acceleration limit that braking before the goal may use; the rest is kept '
        'for motions of the hand',
        0.05,
        1.0,
    )
    stopping_limit: float = dmp_setting(
        'approach.stopping_limit',
        'Maximum acceleration of the wrist command when the wrist would otherwise overrun the '
        'goal, m/s²; values below acceleration_limit mean acceleration_limit',
        0.0,
        1000.0,
    )


@lru_cache(maxsize=8)
def learnt_detour(model: DecoupledDmp) -> float:
    """
    Return the excess of the learnt movement's distance to its end over that at its start.

    Args:
        model: the movement.

    Returns:
        The maximum, relative to the distance from start to end; at least 0.

    """
    places = model.rollout(np.linspace(0.0, model.duration_s, 101), model.goal).positions
    distances = np.linalg.norm(places - model.goal, axis=1)
    whole = max(float(np.linalg.norm(model.goal - model.start)), MIN_DISTANCE_M)
    return max(0.0, float(distances.max()) / whole - 1.0)


class Towards(NamedTuple):
    """
    Result of a step.

    Attributes:
        state: state at the end of the step.
        weight: goal weight w_g.
        astray: ξ_astray, for the next step: once astray, the wrist does not return to the shape
            that led it there.

    """

    state: DmpState
    weight: float
    astray: float


def step_towards(
    model: DecoupledDmp,
    state: DmpState,
    goal: Vector,
    goal_velocity: Vector,
    dt: float,
    phase_rate: float,
    options: ApproachOptions,
    astray: float = -inf,
    expected: tuple[Vector, Vector] | None = None,
) -> Towards:
    """
    Step (8) with the goal weight by time or by position.

    For a weight by position, the primitive is stepped at the time at which (7) has that weight,
    see `DecoupledDmp.step_as_late`.

    Args:
        model: the movement.
        state: state at the start of the step.
        goal: g, m.
        goal_velocity: ġ, m/s.
        dt: length of the step, s.
        phase_rate: speed of the phase, 1 as learnt.
        options: options of the approach.
        astray: ξ_astray of the previous step.
        expected: expected goal and its velocity, which attract the movement instead of goal and
            goal velocity; the weight by position still uses the latter.

    Returns:
        The result of the step.

    """
    parameters = model.parameters
    u = -log(state.phase) / parameters.alpha
    later = -inf
    if options.enabled:
        near = _near(model, state, goal, goal_velocity, u, options)
        astray = max(astray, _astray(model, state, goal, options))
        if astray > 0.0:
            astray += ASTRAY_RATE * dt
        deviations = max(near, astray)
        if deviations > -SETTLED_DEVIATIONS:
            later = parameters.mu + parameters.sigma * min(deviations, SETTLED_DEVIATIONS)
    target, target_velocity = expected or (goal, goal_velocity)
    if later <= u:
        after = model.step(state, target, target_velocity, dt, phase_rate)
        return Towards(after, float(model.goal_weight(after.phase)), astray)
    after = model.step_as_late(state, target, target_velocity, dt, phase_rate, later)
    weight = float(model.goal_weight(exp(-parameters.alpha * later)))
    return Towards(after, weight, astray)


def _near(
    model: DecoupledDmp,
    state: DmpState,
    goal: Vector,
    goal_velocity: Vector,
    u: float,
    options: ApproachOptions,
) -> float:
    position, start = state.position, state.start
    soon = plus(goal, scaled_by(goal_velocity, AHEAD_S))
    whole = min(dist(goal, start), dist(soon, start))
    left = whole - dist(position, start)
    near = (options.near_m - left) / (NEAR_WIDTH * options.near_m)
    if near <= -SETTLED_DEVIATIONS:
        return near
    share = model.shape_stiffness / model.parameters.stiffness
    # later, the shape is hardly determined by the demonstration, so y would be arbitrary
    shape = model.shape(min(u, model.parameters.mu))
    target = tuple(
        x + share * (f + x0 - x) for x, f, x0 in zip(position, shape, start, strict=True)
    )
    beyond = dist(target, start) - whole - options.shape_beyond_m
    return min(near, beyond / (BEYOND_WIDTH * options.shape_beyond_m))


def _astray(model: DecoupledDmp, state: DmpState, goal: Vector, options: ApproachOptions) -> float:
    whole = max(dist(goal, state.start), MIN_DISTANCE_M)
    further = dist(goal, state.position) / whole - 1.0
    allowed = learnt_detour(model) + options.astray
    return (further - allowed) / (ASTRAY_WIDTH * options.astray)


class SpeedBound(NamedTuple):
    """
    A bound on the velocity along one direction.

    Attributes:
        direction: unit vector.
        max_speed: bound on the velocity along it, m/s.

    """

    direction: Vector
    max_speed: float

    def excess(self, velocity: Vector) -> float:
        """
        Return by how much a velocity exceeds the bound.

        Args:
            velocity: m/s.

        Returns:
            m/s; negative within the bound.

        """
        return dot(velocity, self.direction) - self.max_speed


class Braking(NamedTuple):
    """
    The speed at which a wrist may approach a point where it has to stop.

    Attributes:
        deceleration: m/s².
        gain: 1/s; at the end the speed is proportional to the distance, since its root would
            fall too steeply.
        margin_m: maximum overrun, m.

    """

    deceleration: float
    gain: float
    margin_m: float

    def speed(self, left_m: float) -> float:
        """
        Return V of the module's equations.

        Args:
            left_m: distance to the point, m.

        Returns:
            The speed, m/s; negative beyond the margin, so that the wrist returns.

        """
        distance = abs(left_m + self.margin_m)
        linear = self.deceleration / self.gain**2
        if distance <= linear:
            return self.gain * (left_m + self.margin_m)
        speed = sqrt(2.0 * self.deceleration * (distance - 0.5 * linear))
        return copysign(speed, left_m + self.margin_m)

    def along_the_way(self, state: DmpState, goal: Vector, goal_velocity: Vector) -> SpeedBound:
        """
        Bound the velocity away from the start, up to the goal's distance from the start.

        Args:
            state: state of the primitive.
            goal: g, m.
            goal_velocity: ġ, m/s.

        Returns:
            The bound; `FREE` if the wrist is on the other side of its start.

        """
        gone, way = minus(state.position, state.start), minus(goal, state.start)
        far, whole = hypot(*gone), hypot(*way)
        if far < MIN_DISTANCE_M or dot(gone, way) <= 0.0:
            return FREE
        receding = dot(goal_velocity, way) / whole
        return SpeedBound(scaled_by(gone, 1.0 / far), receding + self.speed(whole - far))

    def straight(self, state: DmpState, goal: Vector, goal_velocity: Vector) -> SpeedBound:
        """
        Bound the velocity towards the goal, from any position.

        Args:
            state: state of the primitive.
            goal: g, m.
            goal_velocity: ġ, m/s.

        Returns:
            The bound; `FREE` at the goal itself.

        """
        between = minus(goal, state.position)
        distance = hypot(*between)
        if distance < MIN_DISTANCE_M:
            return FREE
        direction = scaled_by(between, 1.0 / distance)
        return SpeedBound(direction, dot(goal_velocity, direction) + self.speed(distance))


FREE = SpeedBound((0.0, 0.0, 0.0), inf)


def bounded(
    before: DmpState,
    after: DmpState,
    goal: Vector,
    goal_velocity: Vector,
    dt: float,
    acceleration_limit: float,
    options: ApproachOptions,
) -> DmpState:
    """
    Limit the change of the velocity, and the approach to a speed that can be braked.

    If both are impossible, as with a hand that stops abruptly, the acceleration limit is that for
    stopping. If that is not enough either, as after a jump of the hand, the limit is kept.

    Args:
        before: state at the start of the period.
        after: desired state at its end.
        goal: g at the start of the period, m.
        goal_velocity: ġ, m/s.
        dt: length of the period, s.
        acceleration_limit: m/s².
        options: options of the approach.

    Returns:
        The state at the end of the period; `after` itself if it satisfies all bounds.

    """
    max_change = acceleration_limit * dt
    bounds: list[SpeedBound] = []
    softly: list[SpeedBound] = []
    if options.enabled and dt > 0.0:
        braking = Braking(
            acceleration_limit * options.braking_share,
            min(FINAL_GAIN, 0.5 / dt),
            options.beyond_m,
        )
        bounds, softly = _speed_bounds(braking, before, after, goal, goal_velocity, dt)
    wanted = _within(after.velocity, softly)
    change = minus(wanted, before.velocity)
    if hypot(*change) <= max_change:
        if wanted is after.velocity:
            return after
    else:
        needed = minus(_within(before.velocity, bounds), before.velocity)
        max_needed = max(acceleration_limit, options.stopping_limit) * dt
        change = _shortened(needed, change, max_change, max_needed)
    velocity = plus(before.velocity, change)
    mean = plus(before.velocity, scaled_by(change, 0.5))
    position = plus(before.position, scaled_by(mean, dt))
    return after._replace(position=position, velocity=velocity)


def rollout_towards(
    model: DecoupledDmp,
    times: Array,
    goals: Array,
    goal_velocities: Array,
    start: Array,
    options: ApproachOptions | None = None,
) -> tuple[Array, Array]:
    """
    Compute the wrist command of a movement against a recorded hand.

    Args:
        model: the movement.
        times: s, (n,), increasing.
        goals: g at these times, m, (n, 3).
        goal_velocities: ġ, m/s, (n, 3).
        start: x₀, m, (3,).
        options: options of the approach; those of `config/` if left out.

    Returns:
        Positions, m, and velocities, m/s, (n, 3) each.

    """
    options = options or ApproachOptions()
    limit = defaults('dmp')['acceleration_limit']
    state = model.initial_state(start.tolist())
    states, astray = [state], -inf
    lengths = np.diff(times).tolist()
    hands = zip(map(tuple, goals.tolist()), map(tuple, goal_velocities.tolist()), strict=True)
    for dt, (goal, velocity) in zip(lengths, hands, strict=False):
        ahead, _, astray = step_towards(model, state, goal, velocity, dt, 1.0, options, astray)
        state = bounded(state, ahead, goal, velocity, dt, limit, options)
        states.append(state)
    return np.array([each.position for each in states]), np.array(
        [each.velocity for each in states]
    )


def _speed_bounds(
    braking: Braking,
    before: DmpState,
    after: DmpState,
    goal: Vector,
    goal_velocity: Vector,
    dt: float,
) -> tuple[list[SpeedBound], list[SpeedBound]]:
    """Return the bounds at the end of the period, and those of the rate limit on the approach."""
    moved = plus(goal, scaled_by(goal_velocity, dt))
    kept = max(0.0, 1.0 - CLOSING_GAIN * dt)
    bounds, softly = [], []
    for bound in (braking.along_the_way, braking.straight):
        end = bound(after, moved, goal_velocity)
        if end.max_speed == inf:
            continue
        begin = bound(before, goal, goal_velocity)
        left = 0.0 if begin.max_speed == inf else max(0.0, -begin.excess(before.velocity))
        bounds.append(end)
        softly.append(SpeedBound(end.direction, end.max_speed - kept * left))
    return bounds, softly


def _within(velocity: Vector, bounds: list[SpeedBound]) -> Vector:
    """
    Return the nearest velocity that satisfies at most two bounds; itself if it does.

    If they contradict each other, as beyond the goal, the first one counts.
    """
    broken = [bound for bound in bounds if bound.excess(velocity) > 0.0]
    if not broken:
        return velocity
    for bound in broken:
        nearest = plus(velocity, scaled_by(bound.direction, -bound.excess(velocity)))
        if all(other is bound or other.excess(nearest) <= 0.0 for other in bounds):
            return nearest
    first, second = bounds
    alike = dot(first.direction, second.direction)
    if alike < OPPOSED:
        return plus(velocity, scaled_by(first.direction, -max(0.0, first.excess(velocity))))
    apart = max(1.0 - alike * alike, MIN_SINE_SQUARED)
    over_first, over_second = first.excess(velocity), second.excess(velocity)
    less = scaled_by(first.direction, -(over_first - alike * over_second) / apart)
    lesser = scaled_by(second.direction, -(over_second - alike * over_first) / apart)
    return plus(velocity, plus(less, lesser))


def _shortened(needed: Vector, wanted: Vector, max_size: float, max_needed: float) -> Vector:
    """Move from the needed change towards the wanted one, as far as the limit permits."""
    size = hypot(*needed)
    if size > max_size:
        return scaled_by(needed, min(1.0, max_needed / size))
    further = minus(wanted, needed)
    a, b, c = dot(further, further), dot(needed, further), size * size - max_size * max_size
    return plus(needed, scaled_by(further, (sqrt(b * b - a * c) - b) / a))
