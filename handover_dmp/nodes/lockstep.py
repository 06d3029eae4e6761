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
Answering each period of simulated time once, however slow the machine.

`robot_sim` does not step on before the joint command of a period has come, so every node has one
answer a period to give: when it has been asked, and when all that the answer needs is there. A
message that was lost makes `robot_sim` ask again; then the same answer is given again. An input
that does not come for long is done without, and from then on not waited for until it comes again.
"""

from __future__ import annotations

from collections.abc import Callable

from handover_dmp.nodes.conversions import NANOSECONDS

ASKED_IN_VAIN = 20
ASKED_WHEN_GONE = 2
JUMP_PERIODS = 10


class Lockstep:
    """Decides when to answer a period."""

    def __init__(
        self,
        period_s: float,
        answer: Callable[[int, float], None],
        again: Callable[[], None],
        *,
        begun: Callable[[], bool] = lambda: True,
        ready: Callable[[int], bool] = lambda _tick_ns: True,
        jumped: Callable[[], None] = lambda: None,
    ) -> None:
        """
        Take what to do.

        Args:
            period_s: s.
            answer: computes and publishes the answer to a period, given its time, ns, and the
                time since the last one answered, s.
            again: publishes the last answer again.
            begun: whether every input has come once; before that there is no answer.
            ready: whether all that the answer needs is there.
            jumped: called before the answer where time went back or far ahead.

        """
        self._period_ns = round(period_s * NANOSECONDS)
        self._answer = answer
        self._again = again
        self._begun = begun
        self._ready = ready
        self._waits = ASKED_IN_VAIN
        self._jumped = jumped
        self._asked_ns: int | None = None
        self._times_asked = 0
        self.answered_ns: int | None = None

    def ask(self, tick_ns: int) -> None:
        """
        Be asked for the answer to a period.

        Args:
            tick_ns: its time, ns.

        """
        if tick_ns == self.answered_ns:
            self._again()
            return
        self._times_asked = self._times_asked + 1 if tick_ns == self._asked_ns else 1
        self._asked_ns = tick_ns
        self.look()

    def look(self) -> None:
        """Answer if that is due and possible; to be called whenever an input came."""
        tick_ns = self._asked_ns
        if tick_ns is None or tick_ns == self.answered_ns:
            return
        ready = self._begun() and self._ready(tick_ns)
        if not ready and (self._times_asked < self._waits or not self._begun()):
            return
        self._waits = ASKED_IN_VAIN if ready else ASKED_WHEN_GONE
        elapsed_ns = self._period_ns
        if self.answered_ns is not None:
            elapsed_ns = tick_ns - self.answered_ns
            if not 0 < elapsed_ns <= JUMP_PERIODS * self._period_ns:
                self._jumped()
                elapsed_ns = self._period_ns
        self.answered_ns = tick_ns
        self._answer(tick_ns, elapsed_ns / NANOSECONDS)
