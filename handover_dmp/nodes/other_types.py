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

"""Warns of topics of another type than a node expects, to which DDS does not connect it."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from rclpy.subscription import Subscription

CALLS_PER_LOOK = 3


def other_types(node: Node) -> Callable[[], None]:
    """
    Make a job, to be done once a second, that warns once of each topic that is not heard.

    Args:
        node: node whose subscriptions are looked at.

    Returns:
        The job.

    """
    calls = 0
    before: set[str] = set()
    warned_of: set[str] = set()

    def look() -> None:
        nonlocal calls, before
        calls += 1
        if calls % CALLS_PER_LOOK:
            return
        faults = set(filter(None, (_fault(node, each) for each in node.subscriptions)))
        # not at the first look, since some nodes then subscribe to the other type
        for fault in sorted((faults & before) - warned_of):
            node.get_logger().warning(fault)
            warned_of.add(fault)
        before = faults

    return look


def _fault(node: Node, subscription: Subscription) -> str:
    """Say what is published instead of the expected type; empty if that is published, too."""
    name, kind = subscription.topic_name, subscription.msg_type
    package, folder, *_ = kind.__module__.split('.')
    expected = f'{package}/{folder}/{kind.__name__}'
    types = {end.topic_type for end in node.get_publishers_info_by_topic(name)}
    if not types or expected in types:
        return ''
    published = ' and '.join(sorted(types))
    return f'{name} is not heard: it is published as {published}, expected {expected}'
