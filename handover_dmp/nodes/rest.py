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

"""What a recorder leaves out while no handover is on, so that a bag does not grow for ever."""

from __future__ import annotations

from collections import deque
from math import inf
import re

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from handover_dmp.handover.controller import HandoverState, MOVING
from handover_dmp.nodes.conversions import NANOSECONDS
from handover_dmp.topics import MARKERS, Quality, Topic

BEFORE_S = 1.0
"""What was said so long before a handover is recorded all the same, s."""
REPEATED_S = 60.0
"""How often the same report of a node is recorded at rest, s."""
OFTEN_SAID = (Quality.SENSOR, Quality.COMMAND)
KeptMessage = tuple[str, bytes, int]


def is_left_out_at_rest(topic: Topic) -> bool:
    """
    Tell whether a topic is said many times a second, a handover or not.

    Args:
        topic: which.

    Returns:
        Whether.

    """
    return topic.quality in OFTEN_SAID or topic is MARKERS


class Rest:
    """
    Tells when streams are to be left out, and keeps the last second of them.

    Before a state of the handover was heard there is no rest: the recorder may be alone.
    """

    def __init__(self, after_s: float) -> None:
        """
        Take the rule.

        Args:
            after_s: s without a handover, after which there is rest; 0: never.

        """
        self._after_ns = round(after_s * NANOSECONDS)
        self._since_ns: int | None = None
        self._kept: deque[KeptMessage] = deque()

    def hear(self, state: str, time_ns: int) -> list[KeptMessage]:
        """
        Take in a state of the handover.

        Args:
            state: its name.
            time_ns: when, ns.

        Returns:
            Topic, bytes and time of what was said shortly before, now to be recorded.

        """
        if self._after_ns == 0 or state not in set(HandoverState):
            return []
        if HandoverState(state) not in MOVING:
            self._since_ns = time_ns
            return []
        self._since_ns = None
        kept, self._kept = list(self._kept), deque()
        return kept

    def keeps(self, topic: str, data: bytes, time_ns: int) -> bool:
        """
        Keep a message of a stream, where there is rest.

        Args:
            topic: its topic.
            data: its bytes.
            time_ns: when it came, ns.

        Returns:
            Whether it is kept here, and is not to be recorded now.

        """
        if self._since_ns is None or 0 <= time_ns - self._since_ns <= self._after_ns:
            return False
        self._kept.append((topic, data, time_ns))
        while time_ns - self._kept[0][2] > BEFORE_S * NANOSECONDS:
            self._kept.popleft()
        return True


class Reports:
    """Tells which reports on `/diagnostics` say something new, whatever numbers are in them."""

    def __init__(self) -> None:
        """Begin without any."""
        self._told: dict[str, tuple[tuple[object, ...], float]] = {}

    def are_news(self, reports: DiagnosticArray, time_ns: int) -> bool:
        """
        Take in reports.

        Args:
            reports: of some nodes.
            time_ns: when they came, ns.

        Returns:
            Whether one of them differs from the last news of its node, or that is a minute ago.

        """
        time_s = time_ns / NANOSECONDS
        # of all of them, since each is taken note of
        news = [self._is_news(status, time_s) for status in reports.status]
        return any(news)

    def _is_news(self, status: DiagnosticStatus, time_s: float) -> bool:
        stage = [value.value for value in status.values if value.key == 'stage']
        says = (bytes(status.level), re.sub(r'[\d.]+', '', status.message), *stage)
        told, told_s = self._told.get(status.name, ((), -inf))
        if says == told and 0.0 <= time_s - told_s < REPEATED_S:
            return False
        self._told[status.name] = says, time_s
        return True
