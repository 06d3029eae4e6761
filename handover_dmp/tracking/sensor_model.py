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
A tracker with the faults of real ones, for tests.

Rate, noise, delay, drop-outs, outliers, an offset, a wrong clock, and faults in mid-motion: it
dies, freezes, jumps or drifts.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import NamedTuple

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import UsageError
from handover_dmp.mocap.filtering import interpolate
import numpy as np
from numpy.random import RandomState


class Observation(NamedTuple):
    """
    One pose as received.

    Attributes:
        arrival_s: time of arrival, s.
        stamp_s: stamp of the measurement, s.
        position: (3,) m.

    """

    arrival_s: float
    stamp_s: float
    position: Array


FAULTS = ('none', 'dies', 'freezes', 'jumps', 'drifts')
DRIFT_S = 1.0
"""Duration of a drift, s."""


@dataclass(frozen=True)
class SensorModel:
    """
    Model of a tracker of the hand.

    Attributes:
        rate_hz: poses per second.
        noise_m: standard deviation of white noise on each axis, m.
        delay_s: time from the measurement to the arrival, s.
        dropout: share of poses that never arrive, 0 to 1.
        outliers: share of poses that are `outlier_distance_m` off in a random direction, 0 to 1.
        seed: random seed.
        jitter_s: maximum extra delay of a pose, uniformly distributed, s; more than a period
            reorders poses.
        duplicates: share of poses that arrive twice, 0 to 1.
        outlier_distance_m: distance of an outlier from the truth, m.
        offset_m: (3,), m, constant error of all poses.
        clock_s: offset of the stamps, positive if late, s.
        fault: fault in motion: it `dies`, `freezes` (repeats its last pose), `jumps` or `drifts`
            (by `fault_m`), or `none`.
        fault_at_s: time of the fault after the start of the motion, s.
        fault_m: (3,), m, size of the jump or drift.

    Raises:
        UsageError: a value is out of its range.

    """

    rate_hz: float = 200.0
    noise_m: float = 0.0
    delay_s: float = 0.0
    dropout: float = 0.0
    outliers: float = 0.0
    seed: int = 0
    jitter_s: float = 0.0
    duplicates: float = 0.0
    outlier_distance_m: float = 1.0
    offset_m: tuple[float, ...] = (0.0, 0.0, 0.0)
    clock_s: float = 0.0
    fault: str = 'none'
    fault_at_s: float = 0.0
    fault_m: tuple[float, ...] = (0.0, 0.5, 0.0)

    def __post_init__(self) -> None:
        if not 0.0 < self.rate_hz <= 10_000.0:
            raise UsageError(f'sensor rate_hz: {self.rate_hz} is not between 0 and 10000')
        for name in ('noise_m', 'delay_s', 'jitter_s', 'outlier_distance_m'):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise UsageError(f'sensor {name}: {value} is negative or not finite')
        for name in ('dropout', 'outliers', 'duplicates'):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise UsageError(f'sensor {name}: {getattr(self, name)} is not between 0 and 1')
        for name in ('offset_m', 'fault_m'):
            value = getattr(self, name)
            if len(value) != 3 or not all(map(math.isfinite, value)):
                raise UsageError(f'sensor {name}: {list(value)} is not three numbers')
        if not (math.isfinite(self.clock_s) and math.isfinite(self.fault_at_s)):
            raise UsageError('sensor clock_s and fault_at_s: both must be finite')
        if self.fault not in FAULTS:
            raise UsageError(f'sensor fault: {self.fault!r} is not one of {", ".join(FAULTS)}')
        if not 0 <= self.seed < 2**32:
            raise UsageError(f'sensor seed: {self.seed} is not between 0 and {2**32 - 1}')

    def is_dead(self, elapsed_s: float) -> bool:
        """Return whether it is dead at a time after the start of the motion, s."""
        return self.fault == 'dies' and elapsed_s >= self.fault_at_s

    def seen_at(self, elapsed_s: float) -> float:
        """Return the time of the pose that it gives at a time after the start, both in s."""
        return min(elapsed_s, self.fault_at_s) if self.fault == 'freezes' else elapsed_s

    def off_by(self, elapsed_s: float) -> Array:
        """Return its error without noise at a time after the start, s: (3,) m."""
        off = np.array(self.offset_m, dtype=float)
        if self.fault == 'jumps' and elapsed_s >= self.fault_at_s:
            off += self.fault_m
        elif self.fault == 'drifts':
            share = min(max((elapsed_s - self.fault_at_s) / DRIFT_S, 0.0), 1.0)
            off += share * np.array(self.fault_m)
        return off

    def observe_motion(self, times: Array, positions: Array) -> list[Observation]:
        """
        Observe any motion.

        Args:
            times: (n,) s, strictly increasing.
            positions: (n, 3) m, the truth.

        Returns:
            The poses in the order of arrival.

        """
        random = RandomState(self.seed)
        count = math.floor((times[-1] - times[0]) * self.rate_hz + 1e-6) + 1
        stamps = times[0] + np.arange(count) / self.rate_hz
        seen = interpolate(times, positions)(stamps)
        seen = seen + self.noise_m * random.standard_normal(seen.shape)
        directions = random.standard_normal(seen.shape)
        directions /= np.sqrt(np.square(directions).sum(axis=1, keepdims=True))
        off = random.uniform(size=count) < self.outliers
        seen[off] += self.outlier_distance_m * directions[off]
        lost = random.uniform(size=count) < self.dropout
        elapsed = stamps - times[0]
        seen += [self.off_by(time) for time in elapsed]
        # the frozen pose, including its noise
        seen = seen[[math.floor(self.seen_at(time) * self.rate_hz + 1e-6) for time in elapsed]]
        lost |= np.array([self.is_dead(time) for time in elapsed])
        twice = random.uniform(size=count) < self.duplicates
        arrivals = stamps + self.delay_s + self.jitter_s * random.uniform(size=(2, count))
        observations = []
        for k in np.flatnonzero(~lost):
            for copy in range(1 + int(twice[k])):
                arrival = float(arrivals[copy, k])
                stamp = float(stamps[k]) + self.clock_s
                observations.append(Observation(arrival, stamp, seen[k]))
        return sorted(observations, key=lambda observation: observation[:2])
