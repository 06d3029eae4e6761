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

from handover_dmp.nodes.gripper_action import GripperAction
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.nodes.parameters import fixed
from handover_dmp.topics import GRIPPER_COMMAND
from std_msgs.msg import Bool

OF_GRIPPER = (
    fixed(
        'session.gripper_action',
        'Action of type control_msgs/action/GripperCommand that is called besides the topic; '
        'empty: none',
    ),
    fixed(
        'session.gripper_closed_m', 'Position of the closed gripper, for the action, m', 0.0, 1.0
    ),
    fixed('session.gripper_open_m', 'Position of the open gripper, for the action, m', 0.0, 1.0),
    fixed(
        'session.gripper_effort_n', 'Maximum effort of the gripper, for the action, N', 0.0, 1000.0
    ),
)


class Gripper:
    """Commands a gripper whenever the command changes."""

    def __init__(self, node: HandoverNode) -> None:
        """
        Advertise the topic, and connect to the action if one is named.

        Args:
            node: with the parameters of `OF_GRIPPER`.

        Raises:
            UsageError: an action is named, but `control_msgs` is not installed, or the name is
                invalid.

        """
        self._node = node
        self._closed: bool | None = None
        self._topic = node.advertise(GRIPPER_COMMAND)
        self._action: GripperAction | None = None
        if name := node.values['session.gripper_action']:
            self._action = GripperAction(node, name)

    @property
    def fault(self) -> str:
        """Fault of the newest command, as far as the action tells; empty if there is none."""
        return '' if self._action is None else self._action.fault

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
        if self._action is not None:
            self._action.command(closed)
