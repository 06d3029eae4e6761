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
The elements of synthetic hand motions: reaches, sway, spread.

They use only sums, products and square roots, on random numbers of a frozen stream, so that one
seed gives the same bytes on every machine.
"""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.common.arrays import Array
import numpy as np
from numpy.random import RandomState

_AIM_SPREAD_M = np.array([0.030, 0.030, 0.020])
_CURVE_SPREAD = 0.25
_SWAY_M = 0.004
_SWAY_PERIOD_S = 0.35


@dataclass(frozen=True, eq=False)
class CorrectedReach:
    """
    A reach that aims a little beside its goal and is corrected on the way (Meyer et al. 1988).

    Attributes:
        onset_s: time at which the hand leaves its rest, s.
        duration_s: time until it rests at the goal, s.
        start: (3,) m.
        goal: (3,) m.
        aim: (3,) m, end of the first movement without correction.
        correction_onset_s: start of the second movement, s.
        curve: (3,) m, deviation of the middle of the path from the straight line.

    """

    onset_s: float
    duration_s: float
    start: Array
    goal: Array
    aim: Array
    correction_onset_s: float
    curve: Array

    @classmethod
    def draw(
        cls, random: RandomState, onset_s: float, duration_s: float, start: Array, goal: Array
    ) -> CorrectedReach:
        """
        Draw its aim and the time of its correction.

        Args:
            random: the random stream.
            onset_s: time at which the hand leaves its rest, s.
            duration_s: time until it rests at the goal, s.
            start: (3,) m.
            goal: (3,) m.

        Returns:
            The reach, straight except for its correction.

        """
        aim = goal + spread(random, _AIM_SPREAD_M)
        correction_onset_s = onset_s + duration_s * random.uniform(0.40, 0.50)
        return cls(onset_s, duration_s, start, goal, aim, correction_onset_s, np.zeros(3))

    @property
    def end_s(self) -> float:
        """Time at which the hand rests at the goal, s."""
        return self.onset_s + self.duration_s

    def share(self, times: Array) -> Array:
        """Return the progress of a straight reach at times (n,) s; (n,) from 0 to 1."""
        return rise((times - self.onset_s) / self.duration_s)

    def at(self, times: Array) -> Array:
        """Return positions at times (n,) s; (n, 3) m, at rest before and after."""
        correction_duration = self.onset_s + self.duration_s - self.correction_onset_s
        first = rise((times - self.onset_s) / (0.95 * self.duration_s))[:, None]
        second = rise((times - self.correction_onset_s) / correction_duration)[:, None]
        straight = self.start + first * (self.aim - self.start) + second * (self.goal - self.aim)
        return straight + bump((times - self.onset_s) / self.duration_s)[:, None] * self.curve


@dataclass(frozen=True, eq=False)
class HandSway:
    """
    A hand that wanders smoothly between random points some millimetres apart.

    Attributes:
        places: (k, 3) m, one point every 0.35 s; no sway before the first and after the last.
        ahead: share of that interval that has passed at time 0.

    """

    places: Array
    ahead: float

    @classmethod
    def draw(cls, random: RandomState, duration_s: float) -> HandSway:
        """
        Draw the points.

        Args:
            random: the random stream.
            duration_s: duration of the sway from 0, s.

        Returns:
            The sway.

        """
        ahead = random.uniform(0.0, 1.0)
        count = int(duration_s / _SWAY_PERIOD_S + ahead) + 2
        return cls(_SWAY_M * clipped_normal(random, (count, 3)), ahead)

    @property
    def span_s(self) -> tuple[float, float]:
        """Start and end of the motion, s."""
        first = -self.ahead - 1.0
        return first * _SWAY_PERIOD_S, (first + 1.0 + len(self.places)) * _SWAY_PERIOD_S

    def without(self, start_s: float, end_s: float) -> HandSway:
        """Return the same sway with a rest from one time to another, s."""
        at_s = (np.arange(len(self.places)) - self.ahead) * _SWAY_PERIOD_S
        apart = (at_s <= start_s - _SWAY_PERIOD_S) | (at_s >= end_s + _SWAY_PERIOD_S)
        return HandSway(self.places * apart[:, None], self.ahead)

    def at(self, times: Array) -> Array:
        """Return the offsets of the hand at times (n,) s; (n, 3) m."""
        places = np.vstack([np.zeros((1, 3)), self.places, np.zeros((2, 3))])
        position = np.clip(times / _SWAY_PERIOD_S + self.ahead, -1.0, len(self.places)) + 1.0
        here = position.astype(int)
        share = rise(position - here)[:, None]
        return np.asarray(places[here] + share * (places[here + 1] - places[here]))


def rise(u: Array) -> Array:
    """Rise from 0 to 1 for u from 0 to 1, at rest at both ends (Flash and Hogan 1985)."""
    u = np.clip(u, 0.0, 1.0)
    return u * u * u * (10.0 + u * (6.0 * u - 15.0))


def bump(u: Array) -> Array:
    """Rise from 0 to 1 at u = 1/2 and fall to 0 again, at rest at both ends."""
    u = np.clip(u, 0.0, 1.0)
    arch = 4.0 * u * (1.0 - u)
    return arch * arch * arch


def spread_curve(random: RandomState, curve: tuple[float, float, float]) -> Array:
    """Draw the curve of one path about the usual one, m."""
    return np.array(curve) * drawn_about(random, 1.0, _CURVE_SPREAD)


def spread(random: RandomState, deviation: Array) -> Array:
    """Draw an offset with standard deviations (3,), m."""
    return deviation * clipped_normal(random, 3)


def drawn_about(random: RandomState, mean: float, deviation: float) -> float:
    """Draw a number about a mean, at most 2 deviations away."""
    return mean + deviation * float(clipped_normal(random, 1)[0])


def clipped_normal(random: RandomState, shape: int | tuple[int, int]) -> Array:
    """Draw normal numbers, clipped to 2 standard deviations."""
    return np.clip(random.standard_normal(shape), -2.0, 2.0)
