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

"""Messages that a recorder leaves out at rest, so that a bag does not grow without bound."""

from __future__ import annotations

from collections import deque
from math import inf
import re

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from handover_dmp.handover.controller import HandoverState, MOVING
from handover_dmp.nodes.conversions import NANOSECONDS
from handover_dmp.topics import (
    HAND_FUSED,
    HAND_TRUTH,
    MARKERS,
    OBJECT_POSE,
    Quality,
    TF,
    Topic,
)

BEFORE_S = 1.0
"""Time before a handover from which messages are still recorded, s."""
REPEATED_S = 60.0
"""Period at which an unchanged report of a node is recorded at rest, s."""
OFTEN_SAID = (Quality.SENSOR, Quality.COMMAND)
ALSO_OFTEN = (HAND_FUSED, HAND_TRUTH, OBJECT_POSE, MARKERS, TF)
KeptMessage = tuple[str, bytes, int]


def is_left_out_at_rest(topic: Topic) -> bool:
    """
    Tell whether a topic is a fast stream even without a handover.

    Args:
        topic: the topic.

    Returns:
        Whether it is.

    """
    return topic.quality in OFTEN_SAID or topic in ALSO_OFTEN


class Rest:
    """
    Decides when streams are left out, and keeps their last second.

    There is no rest before the first state of the handover: the recorder may be alone.
    """

    def __init__(self, after_s: float) -> None:
        """
        Set the rule.

        Args:
            after_s: time without a handover after which rest begins, s; 0: never.

        """
        self._after_ns = round(after_s * NANOSECONDS)
        self._since_ns: int | None = None
        self._kept: deque[KeptMessage] = deque()

    def hear(self, state: str, time_ns: int) -> list[KeptMessage]:
        """
        Update with a state of the handover.

        Args:
            state: its name.
            time_ns: its time, ns.

        Returns:
            Topic, bytes and time of the kept messages, which are to be recorded now.

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
        Keep a message of a stream at rest.

        Args:
            topic: its topic.
            data: its bytes.
            time_ns: time of its arrival, ns.

        Returns:
            Whether it is kept here, and not recorded now.

        """
        if self._since_ns is None or 0 <= time_ns - self._since_ns <= self._after_ns:
            return False
        self._kept.append((topic, data, time_ns))
        while time_ns - self._kept[0][2] > BEFORE_S * NANOSECONDS:
            self._kept.popleft()
        return True


class Reports:
    """Tells which reports on `/diagnostics` are new, apart from the numbers in them."""

    def __init__(self) -> None:
        """Start without any."""
        self._told: dict[str, tuple[tuple[object, ...], float]] = {}

    def are_news(self, reports: DiagnosticArray, time_ns: int) -> bool:
        """
        Check a message of reports.

        Args:
            reports: reports of some nodes.
            time_ns: time of arrival, ns.

        Returns:
            Whether one differs from the last recorded report of its node, or that is a minute old.

        """
        time_s = time_ns / NANOSECONDS
        # all of them, since each is remembered
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
