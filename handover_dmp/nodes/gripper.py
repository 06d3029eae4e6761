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


"""Commands to a gripper: by a topic, and by an action if one is named."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from handover_dmp.common.errors import UsageError
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.nodes.parameters import Parameter
from handover_dmp.topics import GRIPPER_COMMAND
from std_msgs.msg import Bool

OF_GRIPPER = (
    Parameter(
        'session.gripper_action',
        'Action of type control_msgs/action/GripperCommand that is called besides the topic; '
        'empty: none',
        read_only=True,
    ),
    Parameter(
        'session.gripper_closed_m', 'Position of the closed gripper, for the action, m', 0.0, 1.0,
        read_only=True,
    ),
    Parameter(
        'session.gripper_open_m', 'Position of the open gripper, for the action, m', 0.0, 1.0,
        read_only=True,
    ),
    Parameter(
        'session.gripper_effort_n', 'Maximum effort of the gripper, for the action, N',
        0.0, 1000.0, read_only=True,
    ),
)  # fmt: skip


class Gripper:
    """Commands a gripper whenever the command changes."""

    def __init__(self, node: HandoverNode) -> None:
        """
        Advertise the topic, and connect to the action if one is named.

        Args:
            node: with the parameters of `OF_GRIPPER`.

        Raises:
            UsageError: an action is named, but `control_msgs` is not installed.

        """
        self._node = node
        self._closed: bool | None = None
        self._topic = node.advertise(GRIPPER_COMMAND)
        self._action, self._client = None, None
        if name := node.values['session.gripper_action']:
            self._action = _action_type()
            self._client = _client(node, self._action, name)

    def command(self, closed: bool) -> None:
        """
        Close or open the gripper.

        Args:
            closed: whether to close it. Repeated commands are not sent, and a restarted node,
                which cannot know what the gripper holds, does not open it.

        """
        before, self._closed = self._closed, closed
        if closed is before or (before is None and not closed):
            return
        self._topic.publish(Bool(data=closed))
        self._node.say(f'gripper: {"close" if closed else "open"}')
        if self._client is not None and self._action is not None:
            goal = self._action.Goal()
            width = 'session.gripper_closed_m' if closed else 'session.gripper_open_m'
            goal.command.position = self._node.values[width]
            goal.command.max_effort = self._node.values['session.gripper_effort_n']
            self._client.send_goal_async(goal)


def _action_type() -> Any:
    # not in the wheels; a system's ROS may have it
    try:
        return import_module('control_msgs.action').GripperCommand
    except ImportError as error:
        raise UsageError(
            'session.gripper_action needs control_msgs, which is not installed; leave it empty, '
            'and use the topic gripper/command'
        ) from error


def _client(node: HandoverNode, action: Any, name: str) -> Any:
    from rclpy.action import ActionClient

    return ActionClient(node, action, name)
