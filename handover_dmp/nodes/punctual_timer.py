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
A timer whose periods begin in time: woken a little early, and kept behind its input.

A process that sleeps is woken late now and then, by tenths of a millisecond where others have the
processor. One that is woken early, and looks at the clock until its time has come, is in time if
it is not later than that.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter, sleep

from handover_dmp.nodes.node import HandoverNode
from handover_dmp.nodes.phase_lock import PhaseLock


class PunctualTimer:
    """A timer that fires `wake_early_s` before a period is due, and then waits for that."""

    def __init__(self, node: HandoverNode, period_s: float, callback: Callable[[], None]) -> None:
        """
        Start it.

        Args:
            node: with the parameters `wake_early_s` and `phase_lock`, which count only where it
                does not follow simulated time.
            period_s: s.
            callback: what a period does.

        """
        self._period_s = period_s
        self._callback = callback
        self._early_s = 0.0 if node.simulated else float(node.values['wake_early_s'])
        locked = node.values['phase_lock'] and not node.simulated
        self._lock = PhaseLock(period_s, self._early_s) if locked else None
        self._timer = node.every(period_s, self._fire)

    def arrived(self) -> None:
        """Note that the input has come; move the timer if that is worth it."""
        wait_s = self._lock.arrived(perf_counter()) if self._lock else None
        if self._lock is None or wait_s is None:
            return
        sleep(max(wait_s - self._early_s, 0.0))
        self._timer.reset()
        if self._lock.moved(perf_counter() + self._early_s):
            self._timer.callback()

    def _fire(self) -> None:
        """Wait until the period is due, for `wake_early_s` at most, and let it begin."""
        left_s = 1e-9 * (self._timer.time_until_next_call() or 0)
        # only now, since the question takes time itself, and no period is to begin too early
        fired_s = now_s = perf_counter()
        due_s = fired_s + left_s - self._period_s + self._early_s
        while now_s < due_s and now_s < fired_s + self._early_s:
            now_s = perf_counter()
        if self._lock is not None:
            self._lock.ticked(now_s, due_s)
        self._callback()
