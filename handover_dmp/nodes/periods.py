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

"""The periods of a node's loop, counted and measured."""

from __future__ import annotations

from math import inf
from time import perf_counter

import numpy as np

OVERRUN = 1.5


class Periods:
    """
    Rate and jitter of a loop, measured on the processor's clock.

    Keeps the periods of the last second only.

    Attributes:
        count: periods begun; shows readers of a bag which ones it lacks.

    """

    def __init__(self, period_s: float) -> None:
        """
        Set the nominal period.

        Args:
            period_s: nominal period, s; one of more than 1.5 times this is an overrun.

        """
        self.count = 0
        self._nominal_s = period_s
        self._last_s: float | None = None
        self._periods_s: list[float] = []
        self._summary = {'rate (Hz)': '0'}

    def tick(self) -> None:
        """Note that a period begins."""
        now_s = perf_counter()
        self.count += 1
        if self._last_s is not None:
            self._periods_s.append(now_s - self._last_s)
        self._last_s = now_s

    def rest(self) -> None:
        """Do not count the time until the next period."""
        self._last_s = None

    def take(self) -> dict[str, str]:
        """
        Summarise the last second and start the next.

        A node that ends does so once more, maybe before its next period: the last summary holds.

        Returns:
            Rate, Hz; median and 99 % error of the period, ms; overruns.

        """
        periods, self._periods_s = self._periods_s, []
        if not periods:
            since_s = inf if self._last_s is None else perf_counter() - self._last_s
            return self._summary if since_s < OVERRUN * self._nominal_s else {'rate (Hz)': '0'}
        errors_ms = [abs(period - self._nominal_s) * 1e3 for period in periods]
        median, most = np.percentile(errors_ms, [50, 99])
        self._summary = {
            'rate (Hz)': f'{len(periods) / sum(periods):.1f}',
            'period error, median (ms)': f'{median:.3f}',
            'period error, 99 % (ms)': f'{most:.3f}',
            'overruns': str(sum(period > OVERRUN * self._nominal_s for period in periods)),
        }
        return self._summary
