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

"""A tracker with the faults of real ones, for tests: rate, noise, delay, drop-outs, outliers."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import NamedTuple

from handover_dmp.common.errors import UsageError
from handover_dmp.mocap.filtering import interpolate
from handover_dmp.mocap.trial import HandoverTrial
import numpy as np
from numpy.random import RandomState
from numpy.typing import NDArray


class Observation(NamedTuple):
    """
    One pose as it reaches the listener.

    Attributes:
        arrival_s: when it arrives, s.
        stamp_s: when it says it was measured, s.
        position: (3,) m.

    """

    arrival_s: float
    stamp_s: float
    position: NDArray[np.float64]


@dataclass(frozen=True)
class SensorModel:
    """
    How a tracker sees a hand.

    Attributes:
        rate_hz: poses a second.
        noise_m: standard deviation of white noise on each axis, m.
        delay_s: from the measurement to the arrival, s.
        dropout: share of poses that never arrive, 0 to 1.
        outliers: share of poses that lie `outlier_distance_m` off in a random direction, 0 to 1.
        seed: of the random stream; the same seed sees the same.
        jitter_s: largest extra delay of a pose, s, drawn evenly; more than a period brings poses
            out of order.
        duplicates: share of poses that arrive twice, 0 to 1.
        outlier_distance_m: how far off an outlier lies, m.

    Raises:
        UsageError: a value is out of range.

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

    def __post_init__(self) -> None:
        if not 0.0 < self.rate_hz <= 10_000.0:
            raise UsageError(f'sensor rate of {self.rate_hz} Hz is not between 0 and 10000')
        for name in ('noise_m', 'delay_s', 'jitter_s', 'outlier_distance_m'):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise UsageError(f'sensor {name}: {value} is not 0 or more')
        for name in ('dropout', 'outliers', 'duplicates'):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise UsageError(f'sensor {name}: {getattr(self, name)} is not between 0 and 1')
        if not 0 <= self.seed < 2**32:
            raise UsageError(f'sensor seed: {self.seed} is not between 0 and {2**32 - 1}')

    def observe(self, trial: HandoverTrial) -> list[Observation]:
        """
        Watch the hand of P1.

        Args:
            trial: the handover; its P1 is taken for the truth.

        Returns:
            What arrives, in the order of arrival, on the clock of the trial.

        """
        return self.observe_motion(trial.times, trial.partner)

    def observe_motion(
        self, times: NDArray[np.float64], positions: NDArray[np.float64]
    ) -> list[Observation]:
        """
        Watch any motion.

        Args:
            times: (n,) s, strictly increasing.
            positions: (n, 3) m, taken for the truth.

        Returns:
            What arrives, in the order of arrival.

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
        twice = random.uniform(size=count) < self.duplicates
        arrivals = stamps + self.delay_s + self.jitter_s * random.uniform(size=(2, count))
        observations = []
        for k in np.flatnonzero(~lost):
            for copy in range(1 + int(twice[k])):
                arrival = float(arrivals[copy, k])
                observations.append(Observation(arrival, float(stamps[k]), seen[k]))
        return sorted(observations, key=lambda observation: observation[:2])
