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
Lockstep: every node answers each period of simulated time once, however slow the machine is.

`robot_sim` makes the next period when the joint command of the last one has come. A node answers a
period when it has been asked and all inputs of the answer are there. If a message is lost,
`robot_sim` asks again, and the node repeats its answer. A node waits `patience_s` for an input.
Then it answers without that input, and does not wait for it again until it has come back. Nodes
further down the chain are more patient, so only the direct neighbour of a lost node answers
without it. If the questions to a waiting node are lost, time goes on without that node; it then
stops waiting, so that it is not left behind.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from handover_dmp.nodes.conversions import NANOSECONDS

ASK_AGAIN_S = 0.15
PATIENCE_WHEN_GONE_S = ASK_AGAIN_S
HEAD_START_S = 3 * ASK_AGAIN_S
JUMP_PERIODS = 10
MAX_LATENESS_S = 0.1


class Lockstep:
    """Decides when to answer a period."""

    def __init__(
        self,
        period_s: float,
        answer: Callable[[int, float], None],
        again: Callable[[], None],
        *,
        patience_s: Callable[[], float] = lambda: 0.0,
        begun: Callable[[], bool] = lambda: True,
        ready: Callable[[int], bool] = lambda _tick_ns: True,
        jumped: Callable[[], None] = lambda: None,
    ) -> None:
        """
        Set up the answers.

        Args:
            period_s: s.
            answer: computes and publishes the answer to a period, given its time, ns, and the
                time since the last one answered, s.
            again: repeats the last answer.
            patience_s: returns how long to wait for an input before answering without it, s.
            begun: tells whether every input has arrived once; before that there is no answer.
            ready: tells whether all inputs of the answer have arrived.
            jumped: called before the answer if time went back or far ahead.

        """
        self._period_ns = round(period_s * NANOSECONDS)
        self._answer = answer
        self._again = again
        self._begun = begun
        self._ready = ready
        self._patience_s = patience_s
        self._gone = False
        self._jumped = jumped
        self._asked_ns: int | None = None
        self._times_asked = 0
        self._left_behind = False
        self.answered_ns: int | None = None

    def ask(self, tick_ns: int) -> None:
        """
        Receive the request for the answer to a period.

        Args:
            tick_ns: its time, ns.

        """
        if tick_ns == self.answered_ns:
            self._again()
            return
        if tick_ns == self._asked_ns:
            self._times_asked += 1
        else:
            # a single request is not enough, since the inputs may still be on their way
            waited = self._asked_ns != self.answered_ns and self._times_asked > 1
            self._left_behind = waited and self._asked_ns is not None and tick_ns > self._asked_ns
            self._asked_ns = tick_ns
            self._times_asked = 1
        self.look()

    def look(self) -> None:
        """Answer if that is due and possible; call it whenever an input has arrived."""
        tick_ns = self._asked_ns
        if tick_ns is None or tick_ns == self.answered_ns or not self._begun():
            return
        ready = self._ready(tick_ns)
        if not ready and not self._waited_in_vain():
            return
        self._gone = not ready
        elapsed_ns = self._period_ns
        if self.answered_ns is not None:
            elapsed_ns = tick_ns - self.answered_ns
            if not 0 < elapsed_ns <= JUMP_PERIODS * self._period_ns:
                self._jumped()
                elapsed_ns = self._period_ns
        self.answered_ns = tick_ns
        self._answer(tick_ns, elapsed_ns / NANOSECONDS)

    def _waited_in_vain(self) -> bool:
        # counted in requests, not in time: if all nodes stood still, none was slow
        patience_s = self._patience_s()
        if self._gone:
            patience_s = min(patience_s, PATIENCE_WHEN_GONE_S)
        return self._left_behind or (self._times_asked - 1) * ASK_AGAIN_S >= patience_s


class Pace:
    """Keeps simulated time at a multiple of wall clock time, on average."""

    def __init__(self) -> None:
        """Start without a schedule."""
        self._due_s = -inf

    def wait_s(self, now_s: float, period_s: float) -> float:
        """
        Tell how long to wait before the next period.

        The next periods make up for a late one. Delays above `MAX_LATENESS_S`, as
        after a pause, are not made up.

        Args:
            now_s: on a monotonic clock, s.
            period_s: how long a period should take on it, s.

        Returns:
            Time to wait, s.

        """
        self._due_s += period_s
        if self._due_s < now_s - MAX_LATENESS_S:
            self._due_s = now_s
        return max(0.0, self._due_s - now_s)
