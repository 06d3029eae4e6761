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

"""One measured figure, and the measurement of times on a shared, noisy machine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
import gc
from statistics import median
from time import perf_counter


@dataclass(frozen=True)
class Measurement:
    """
    One figure of the benchmark.

    Attributes:
        name: name of the figure.
        value: the figure, in `unit`.
        unit: its unit.
        target: target, in `unit`; None if there is none.
        floor: least possible value, measured in the same run, in `unit`; None if there is none.
        peers: figure of each peer at the same work, measured in the same run, in `unit`.
        higher_is_better: whether the target is a lower bound instead of an upper one.
        note: remarks, e.g. a peer that is not installed.

    """

    name: str
    value: float
    unit: str
    target: float | None = None
    floor: float | None = None
    peers: dict[str, float] = field(default_factory=dict)
    higher_is_better: bool = False
    note: str = ''

    @property
    def reached(self) -> bool | None:
        """Whether the target is met; None without a target."""
        if self.target is None:
            return None
        return self.value >= self.target if self.higher_is_better else self.value <= self.target


def time_call(work: Callable[[], object], *, rounds: int = 15, calls: int = 1) -> float:
    """
    Measure the time of one call.

    Args:
        work: the function to call.
        rounds: number of measurements; the median is returned.
        calls: number of calls in each round.

    Returns:
        Time of one call without garbage collection, s.

    """
    work()
    collecting = gc.isenabled()
    gc.disable()
    try:
        times = []
        for _ in range(rounds):
            start = perf_counter()
            for _ in range(calls):
                work()
            times.append((perf_counter() - start) / calls)
    finally:
        if collecting:
            gc.enable()
    return median(times)
