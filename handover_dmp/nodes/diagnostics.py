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

"""Reports of a node on `/diagnostics`: at its start, once a second, and at its end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import os

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.topics import DIAGNOSTICS, HARDWARE_ID
from handover_dmp.tracking import GoalEstimator, TrackerReport
from rclpy.node import Node


def full_name(node: Node) -> str:
    """
    Name a node as its reports do.

    Args:
        node: the node.

    Returns:
        Its full name without the first slash, e.g. `dmp` or `left/dmp`.

    """
    return str(node.get_fully_qualified_name()).lstrip('/')


def of_the_hand(hand: GoalEstimator, reports: Sequence[TrackerReport]) -> dict[str, str]:
    """
    Report the condition of the hand and of each of its trackers.

    Args:
        hand: the hand, as estimated from all trackers.
        reports: reports of the trackers.

    Returns:
        Name to value: the time without a change, and the poses refused since the node began, all
        and by reason; of each tracker the rate, age, bias, share of refused poses, and their
        distance from the hand.

    """
    refused = hand.rejected
    values = {
        'hand unchanged (s)': f'{hand.unchanged_s:.3f}',
        'hand refused': str(refused.total()),
        **{f'hand refused, {reason}': str(refused[reason]) for reason in sorted(refused)},
    }
    for report in reports:
        bias = ', '.join(f'{1e3 * axis:.1f}' for axis in report.bias_m)
        values |= {
            f'{report.name}: rate (Hz)': f'{report.rate_hz:.1f}',
            f'{report.name}: age (s)': f'{report.age_s:.3f}',
            f'{report.name}: bias (mm)': bias,
            f'{report.name}: refused (%)': f'{100.0 * report.refused:.0f}',
            f'{report.name}: distance (mm)': f'{1e3 * report.distance_m:.1f}',
        }
    return values


def report_condition(
    node: HandoverNode, condition: Callable[[], tuple[str, dict[str, str]]]
) -> None:
    """
    Publish the condition of a node once a second on the wall clock.

    The last reports are latched, so that even a node that ends within a second is seen from its
    start to its end.

    Args:
        node: the node.
        condition: returns the fault, empty while there is none, and further values.

    """
    publisher = node.advertise(DIAGNOSTICS)

    def publish() -> None:
        stage = node.once_per_second.stage
        # before the first input everything is missing, which is not a fault yet
        fault, values = ('', {}) if stage == 'start' else condition()
        urgent = os.sched_getscheduler(0) == os.SCHED_FIFO
        scheduling = {'scheduling': 'real-time' if urgent else 'ordinary'}
        values = {'stage': stage, **node.periods.take(), **scheduling, **values}
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if fault else DiagnosticStatus.OK,
            name=full_name(node),
            message=fault or 'ok',
            hardware_id=HARDWARE_ID,
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(array)

    node.once_per_second.add(publish)


class Attendance:
    """
    Tracks which nodes of a graph are present, by their reports.

    Attributes:
        present: full names of the nodes that have reported, and not yet for the last time.

    """

    def __init__(self, namespace: str) -> None:
        """
        Start without any node.

        Args:
            namespace: namespace of the graph; other nodes are ignored.

        """
        self.present: set[str] = set()
        self._within = namespace.strip('/')

    def hear(self, reports: DiagnosticArray) -> None:
        """
        Update from reports.

        Args:
            reports: a message of `/diagnostics`, of any node.

        """
        for status in reports.status:
            if status.hardware_id != HARDWARE_ID or status.name.rpartition('/')[0] != self._within:
                continue
            ends = any(value.key == 'stage' and value.value == 'end' for value in status.values)
            (self.present.discard if ends else self.present.add)(status.name)
