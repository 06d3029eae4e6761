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

"""Confidence intervals from resampled trials."""

from __future__ import annotations

from handover_dmp.common.arrays import Array
import numpy as np

LEVEL = 0.95
ROUNDS = 2000


def draw_samples(trials: int, seed: np.random.SeedSequence, rounds: int = ROUNDS) -> Array:
    """
    Draw trials with replacement.

    Args:
        trials: number of trials, and of draws in each round.
        seed: seed of the draws.
        rounds: number of rounds.

    Returns:
        (rounds, trials): how often each trial was drawn in each round.

    """
    generator = np.random.default_rng(seed)
    counts = generator.multinomial(trials, np.full(trials, 1.0 / trials), size=rounds)
    return counts.astype(np.float64)


def interval(draws: Array, level: float = LEVEL) -> tuple[float, float]:
    """
    Take the percentile interval of a statistic.

    Args:
        draws: (rounds,) the statistic in each round; NaN rounds are left out.
        level: share of the rounds inside the interval.

    Returns:
        Its lower and upper end; NaN if the statistic never existed.

    """
    real = draws[np.isfinite(draws)]
    if real.size == 0:
        return float('nan'), float('nan')
    tail = (1.0 - level) / 2.0
    low, high = np.quantile(real, [tail, 1.0 - tail])
    return float(low), float(high)
