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

"""The band of human variability, against which time-normalised curves are tested."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from handover_dmp.common.arrays import Array
import numpy as np

ROUNDING_M = 1e-9
"""Tolerance for rounding: a nanometre decides no test, m."""


@dataclass(frozen=True)
class Envelope:
    """
    Mean and standard deviation of human curves, sample by sample and dimension by dimension.

    Attributes:
        mean: (..., samples, d) m.
        deviation: (..., samples, d) m, with n − 1 in the denominator.
        trials: number of curves in it.

    """

    mean: Array
    deviation: Array
    trials: int

    @classmethod
    def of(cls, curves: Array) -> Envelope:
        """
        Make the envelope of some curves.

        Args:
            curves: (n, samples, d) m, n ≥ 2.

        Returns:
            Their envelope; arrays of shape (samples, d).

        """
        return cls(curves.mean(axis=0), curves.std(axis=0, ddof=1), len(curves))

    @classmethod
    def of_the_others(cls, curves: Array) -> Envelope:
        """
        Make, for each curve, the envelope of all the others.

        Args:
            curves: (n, samples, d) m, n ≥ 3.

        Returns:
            n envelopes in one; arrays of shape (n, samples, d).

        """
        n = len(curves)
        centre = curves.mean(axis=0)
        # Relative to the common centre, so that the sums of squares below lose no digits.
        offsets = curves - centre
        mean_offsets = -offsets / (n - 1)
        squares = (offsets**2).sum(axis=0) - offsets**2 - (n - 1) * mean_offsets**2
        deviation = np.sqrt(np.maximum(squares, 0.0) / (n - 2))
        return cls(centre + mean_offsets, deviation, n - 1)

    def at(self, trials: Sequence[int]) -> Envelope:
        """
        Select the envelopes of some trials.

        Args:
            trials: their indices.

        Returns:
            Arrays of shape (len(trials), samples, d); the envelope itself if all trials share it.

        """
        if self.mean.ndim == 2:
            return self
        chosen = list(trials)
        return Envelope(self.mean[chosen], self.deviation[chosen], self.trials)

    def sigmas(self, curves: Array) -> Array:
        """
        Find for each curve the least k of a kσ band that contains all of it.

        A curve is within kσ if |y_d(u) − m_d(u)| ≤ k·s_d(u) at every sample.

        Args:
            curves: (..., samples, d) m, broadcast against the envelope.

        Returns:
            (..., d), infinite if the band has no width and the curve is not on it.

        """
        away = np.abs(curves - self.mean) - ROUNDING_M
        with np.errstate(divide='ignore', invalid='ignore'):
            ratio = np.where(away <= 0.0, 0.0, away / self.deviation)
        return np.asarray(ratio.max(axis=-2))
