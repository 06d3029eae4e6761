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
The partner model: the expected meeting point, and the lead of the partner over its usual time.

The primitive reacts to the hand late and has no model of how hands move. This model supplies its
inputs, and uses the mean path m₁(u) of the hand in the demonstrations. In each period, with the
hand p and its velocity ṗ, u the time since the start in units of τ:

    y = (p − p(0))·ê = (1 + a)π(u + e) + noise,                                  (P1)
    m = m₁(u + e), n = |p − m − (x₀ − m₂(0))|, ρ = clip((n_max − n)/n_width, 0, 1),  (P2)
    q = ρ·½[1 − erf((φ − φ_q)/(σ_q√2))],                                        (P3)
    ĝ = p + o + q(m₁(1) − m), its velocity ṗ − q·m₁′(u + e)/τ,                  (P4)
    r = clip(1 + (ρ·c·e − δ)·τ/T, 0, r_max), δ the present lead of the phase.   (P5)

An extended Kalman filter estimates the partner's lead e, in units of τ, and the relative excess a
of its distance, from (P1), where π is the mean path along the line ê from start to end of m₁. By
(P2), the plain primitive is used for a hand unlike the demonstrations. The primitive is attracted
to ĝ, the hand plus the rest of its expected path, and to the hand itself once the phase passes
φ_q. The phase follows the lead of the partner by the share c, as people do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import dist, erf, log, sqrt
from typing import NamedTuple

from handover_dmp.common.arrays import Array, Vector
from handover_dmp.common.errors import DataError
from handover_dmp.common.settings import check_settings, dmp_setting
from handover_dmp.dmp import DecoupledDmp, DmpState, relearn
from handover_dmp.dmp.state import Rollout
import numpy as np

PARTNER_MODEL = ('auto', 'off')
"""Used if the movement has a partner path, or never."""
MIN_LENGTH_M = 0.05
"""Length of the partner path below which the amplitude is not estimated, m."""
MAX_LEAD = 2.0
"""Maximum lead or lag, in units of τ."""
MIN_AMPLITUDE, MAX_AMPLITUDE = -0.8, 1.0
"""Bounds of the relative excess of the hand's distance."""
RETURN_GAIN = 4.0
"""Weight of a hand that turns back, relative to a deviation aside."""
MIN_WAY_M = 1e-6
"""Length below which a mean path has no direction, m."""


@dataclass(frozen=True)
class PartnerOptions:
    """Constants of the partner model; distances and times of people, not of the robot."""

    mu: float = dmp_setting(
        'partner.mu',
        'Centre of the goal weight (7) with the partner model, in units of τ',
        0.0,
        2.0,
    )
    sigma: float = dmp_setting(
        'partner.sigma',
        'Width of the goal weight (7) with the partner model, in units of τ; wider than without, '
        'since the expected goal is steady enough to be followed early',
        0.0001,
        2.0,
    )
    lead_deviation: float = dmp_setting(
        'partner.lead_deviation',
        'Standard deviation of the lead e before the hand is seen, in units of τ',
        0.0,
        1.0,
    )
    lead_drift: float = dmp_setting(
        'partner.lead_drift',
        'Standard deviation of the change of the lead e over one τ, in units of τ',
        0.0,
        10.0,
    )
    reach_deviation_m: float = dmp_setting(
        'partner.reach_deviation_m',
        "Standard deviation of the length of the hand's path, m",
        0.0,
        1.0,
    )
    noise_m: float = dmp_setting(
        'partner.noise_m',
        'Standard deviation of the hand about its mean path, m',
        0.0001,
        1.0,
    )
    noise_time_s: float = dmp_setting(
        'partner.noise_time_s', 'Correlation time of that deviation, s', 0.001, 10.0
    )
    trust_within_m: float = dmp_setting(
        'partner.trust_within_m',
        'Deviation of the hand from where it is expected beyond which the trust is 0, m',
        0.0,
        10.0,
    )
    trust_width_m: float = dmp_setting(
        'partner.trust_width_m',
        'Range of that deviation over which the trust falls from 1 to 0, m',
        0.001,
        10.0,
    )
    release: float = dmp_setting(
        'partner.release',
        'Phase time φ_q at which the expected goal gives way to the hand, in units of τ',
        0.0,
        1.0,
    )
    release_width: float = dmp_setting(
        'partner.release_width', 'Width σ_q of that transition, in units of τ', 0.001, 1.0
    )
    following: float = dmp_setting(
        'partner.following',
        "Share c of the partner's lead that the phase follows",
        0.0,
        0.9,
    )
    following_time_s: float = dmp_setting(
        'partner.following_time_s',
        'Time T within which the phase follows the lead, s',
        0.001,
        10.0,
    )
    max_phase_rate: float = dmp_setting(
        'partner.max_phase_rate', 'Maximum phase rate r_max', 1.0, 3.0
    )

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_settings(self, DataError, 'partner.')


def check_partner_model(word: str) -> None:
    """
    Check the option `partner_model`.

    Args:
        word: the given value.

    Raises:
        DataError: the value is unknown.

    """
    if word not in PARTNER_MODEL:
        raise DataError(f'partner_model is {word!r}, not one of {", ".join(PARTNER_MODEL)}')


class Expectation(NamedTuple):
    """
    Output of the partner model in one period.

    Attributes:
        goal: expected goal ĝ, m.
        goal_velocity: its velocity, m/s.
        phase_rate: r, speed of the phase.
        trust: ρ, from 0 (the model is not used) to 1.
        lead: e, lead of the partner over its usual time, in units of τ.

    """

    goal: Vector
    goal_velocity: Vector
    phase_rate: float
    trust: float
    lead: float


def with_goal_weight_of(model: DecoupledDmp, options: PartnerOptions) -> DecoupledDmp:
    """
    Relearn a movement for the goal weight of the partner model.

    Args:
        model: the movement.
        options: constants, of which μ and σ are used.

    Returns:
        The same movement with these; `model` itself if it has them.

    """
    return relearn(model, mu=options.mu, sigma=options.sigma)


class PartnerModel:
    """The partner model of one handover; each handover needs a new one."""

    def __init__(self, model: DecoupledDmp, options: PartnerOptions | None = None) -> None:
        """
        Take the partner path of a movement.

        Args:
            model: a movement of three dimensions with a partner path.
            options: the constants; those of `config/` if left out.

        Raises:
            DataError: the movement has no partner path.

        """
        if model.partner_path is None or model.dimensions != 3:
            raise DataError('the model has no path of the partner in three dimensions')
        self.options = options or PartnerOptions()
        self._rows, self._direction, length, self._learnt_return = _tables(model)
        self._duration_s = model.duration_s
        self._alpha = model.parameters.alpha
        self._offset: Vector = tuple(model.goal_offset.tolist())
        self._learnt_start: Vector = tuple(model.start.tolist())
        self._first: Vector | None = None
        self._stray_at_first = 0.0
        self._farthest = 0.0
        self._return = 0.0
        self._time = 0.0
        self._ahead = 0.0
        self._lead = self._amplitude = 0.0
        self._lead_variance = self.options.lead_deviation**2
        self._covariance = 0.0
        reach = self.options.reach_deviation_m / max(length, MIN_LENGTH_M)
        self._amplitude_variance = reach**2

    def wait(self, dt: float) -> None:
        """
        Advance without a hand: it is assumed to move on unseen, while the phase stands still.

        Before the hand is first seen, time does not advance.

        Args:
            dt: length of the period, s.

        """
        if self._first is not None:
            u = dt / self._duration_s
            self._time += u
            self._lead_variance += self.options.lead_drift**2 * u

    def expect(
        self,
        hand: Vector,
        hand_velocity: Vector,
        state: DmpState,
        dt: float,
        phase_rate: float = 1.0,
    ) -> Expectation:
        """
        Process the hand, and return the expectation for the next period.

        Args:
            hand: p, m; the first one is its start.
            hand_velocity: ṗ, m/s.
            state: state of the primitive at the start of the period.
            dt: length of the period, s.
            phase_rate: maximum speed of the phase that the arm permits, 0 to 1.

        Returns:
            The expected goal, and the phase rate if the arm permits it.

        """
        options, tau = self.options, self._duration_s
        if self._first is None:
            self._first = hand
            self._stray_at_first = self._stray(hand, self._rows[0][0], state.start)
        if dt > 0.0:
            self._update(hand, dt)
        at, slope = self._mean(self._time + self._lead)
        px, py, pz = hand
        mx, my, mz, _ = at
        stray = max(self._stray(hand, at, state.start), self._stray_at_first)
        stray += RETURN_GAIN * max(0.0, self._return - self._learnt_return)
        trust = min(max((options.trust_within_m - stray) / options.trust_width_m, 0.0), 1.0)
        late = (-log(state.phase) / self._alpha - options.release) / options.release_width
        kept = trust * (0.5 - 0.5 * erf(late / sqrt(2.0)))
        ex, ey, ez, _ = self._rows[-1][0]
        ox, oy, oz = self._offset
        vx, vy, vz = hand_velocity
        sx, sy, sz, _ = slope
        falling = kept / tau
        away = trust * options.following * self._lead - self._ahead
        rate = 1.0 + away * tau / max(options.following_time_s, dt)
        rate = min(max(rate, 0.0), options.max_phase_rate)
        self._time += dt / tau
        self._ahead += (rate - 1.0) * phase_rate * dt / tau
        return Expectation(
            (
                px + ox + kept * (ex - mx),
                py + oy + kept * (ey - my),
                pz + oz + kept * (ez - mz),
            ),
            (vx - falling * sx, vy - falling * sy, vz - falling * sz),
            rate,
            trust,
            self._lead,
        )

    def _stray(self, hand: Vector, mean: Sequence[float], start: Vector) -> float:
        """Return the deviation of a hand from its mean path, relative to the wrist's start."""
        (px, py, pz), (sx, sy, sz), (lx, ly, lz) = hand, start, self._learnt_start
        mx, my, mz, _ = mean
        return dist((px - mx, py - my, pz - mz), (sx - lx, sy - ly, sz - lz))

    def _update(self, hand: Vector, dt: float) -> None:
        """Update the filter with the distance of the hand, (P1)."""
        options = self.options
        assert self._first is not None
        u = dt / self._duration_s
        self._lead_variance += options.lead_drift**2 * u
        (ex, ey, ez), (x0, y0, z0) = self._direction, self._first
        x, y, z = hand
        way = (x - x0) * ex + (y - y0) * ey + (z - z0) * ez
        self._farthest = max(self._farthest, way)
        self._return = self._farthest - way
        at, slope = self._mean(self._time + self._lead)
        usual, speed = at[3], slope[3]
        by_lead, by_amplitude = (1.0 + self._amplitude) * speed, usual
        p_ee, p_ea, p_aa = self._lead_variance, self._covariance, self._amplitude_variance
        to_lead = p_ee * by_lead + p_ea * by_amplitude
        to_amplitude = p_ea * by_lead + p_aa * by_amplitude
        noise = options.noise_time_s * options.noise_m**2 / dt
        share = 1.0 / (by_lead * to_lead + by_amplitude * to_amplitude + noise)
        surprise = (way - (1.0 + self._amplitude) * usual) * share
        lead, amplitude = (
            self._lead + to_lead * surprise,
            self._amplitude + to_amplitude * surprise,
        )
        self._lead = min(max(lead, -MAX_LEAD), MAX_LEAD)
        self._amplitude = min(max(amplitude, MIN_AMPLITUDE), MAX_AMPLITUDE)
        self._lead_variance = p_ee - to_lead * to_lead * share
        self._covariance = p_ea - to_lead * to_amplitude * share
        self._amplitude_variance = p_aa - to_amplitude * to_amplitude * share

    def _mean(self, u: float) -> tuple[Sequence[float], Sequence[float]]:
        """Return m₁ and π at a time in units of τ, and their slopes; constant before and after."""
        rows = self._rows
        last = len(rows) - 1
        node = u * last
        if node <= 0.0:
            return rows[0][0], _REST
        if node >= last:
            return rows[-1][0], _REST
        index = int(node)
        rest = node - index
        (x, y, z, w), (a, b, c, d) = rows[index]
        (x1, y1, z1, w1), (a1, b1, c1, d1) = rows[index + 1]
        return (
            (x + rest * (x1 - x), y + rest * (y1 - y), z + rest * (z1 - z), w + rest * (w1 - w)),
            (a + rest * (a1 - a), b + rest * (b1 - b), c + rest * (c1 - c), d + rest * (d1 - d)),
        )


def rollout_expecting(
    model: DecoupledDmp,
    times: Array,
    hands: Array,
    hand_velocities: Array,
    start: Sequence[float],
    options: PartnerOptions | None = None,
) -> Rollout:
    """
    Run a movement with the partner model against a hand, from rest at its start.

    Args:
        model: a movement of three dimensions with a partner path, learnt for the goal weight of
            the partner model (`with_goal_weight_of`).
        times: s, (n,), increasing.
        hands: p at these times, m, (n, 3).
        hand_velocities: ṗ, m/s, (n, 3).
        start: x₀, m, (3,).
        options: the constants; those of `config/` if left out.

    Returns:
        The motion at these times.

    Raises:
        DataError: the movement has no partner path.

    """
    partner = PartnerModel(model, options)
    state = model.initial_state(start)
    states = [state]
    seen = zip(map(tuple, hands.tolist()), map(tuple, hand_velocities.tolist()), strict=True)
    for dt, (hand, velocity) in zip(np.diff(times).tolist(), seen, strict=False):
        expected = partner.expect(hand, velocity, state, dt)
        state = model.step(state, expected.goal, expected.goal_velocity, dt, expected.phase_rate)
        states.append(state)
    phase = np.array([each.phase for each in states])
    return Rollout(
        times,
        np.array([each.position for each in states]),
        np.array([each.velocity for each in states]),
        model.goal_weight_at_time(-np.log(phase) / model.parameters.alpha),
        phase,
    )


_REST = (0.0, 0.0, 0.0, 0.0)
_Rows = list[tuple[tuple[float, ...], tuple[float, ...]]]


@lru_cache(maxsize=8)
def _tables(model: DecoupledDmp) -> tuple[_Rows, Vector, float, float]:
    path = model.partner_path
    assert path is not None
    whole = path[-1] - path[0]
    length = float(np.linalg.norm(whole))
    direction = whole / length if length > MIN_WAY_M else np.zeros(3)
    places = np.column_stack([path, (path - path[0]) @ direction])
    slopes = np.gradient(places, 1.0 / (len(path) - 1), axis=0)
    rows = list(zip(map(tuple, places.tolist()), map(tuple, slopes.tolist()), strict=True))
    way = places[:, 3]
    learnt_return = float((np.maximum.accumulate(way) - way).max())
    return rows, tuple(direction.tolist()), length, learnt_return
