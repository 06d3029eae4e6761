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
The newest command to a gripper as a goal of an action `control_msgs/action/GripperCommand`.

A server that comes late, or comes back, is told to close, but never to open: by then the partner
may have let go of the object.
"""

from __future__ import annotations

from enum import Enum
from functools import partial
from importlib import import_module
from time import monotonic
from typing import Any

from action_msgs.msg import GoalStatus
from handover_dmp.common.errors import UsageError
from handover_dmp.nodes.node import HandoverNode
from rclpy.task import Future

PATIENCE_S = 3.0
ASKS = 8
"""Times that it asks again: DDS takes 20 s to miss a dead server, which may be back by then."""
FAILURES = {GoalStatus.STATUS_ABORTED: 'aborted', GoalStatus.STATUS_CANCELED: 'was cancelled'}


class Missing(Enum):
    """What a command still waits for."""

    NOTHING = 'nothing'
    SERVER = 'server'
    ANSWER = 'answer'
    RESULT = 'result'


class GripperAction:
    """
    Client of the action; tells in the log what goes wrong, and never waits.

    Attributes:
        patience_s: time without a server, an answer or a result after which the log says so, s.
        fault: fault of the newest command; empty if there is none.

    """

    def __init__(self, node: HandoverNode, name: str) -> None:
        """
        Connect.

        Args:
            node: with the parameters `OF_GRIPPER`.
            name: name of the action.

        Raises:
            UsageError: `control_msgs` is not installed, or the name is invalid.

        """
        kind = _action_type()
        self._node = node
        self._name = _resolved(node, name)
        self.patience_s = PATIENCE_S
        self._goal_type = kind.Goal
        # only few need it
        from rclpy.action import ActionClient

        self._client = ActionClient(node, kind, name)
        self._closed = False
        self._commands = 0
        self._missing = Missing.NOTHING
        self._since_s = self._commanded_s = 0.0
        self.fault = ''
        self._asks = 0
        self._goal: Any = None
        node.once_per_second.add(self._look)

    def command(self, closed: bool) -> None:
        """
        Close or open the gripper; replaces a command that is not done yet.

        Args:
            closed: whether to close it.

        """
        self._closed, self.fault, self._asks = closed, '', 0
        self._commands += 1
        self._commanded_s = monotonic()
        if self._client.server_is_ready():
            self._send()
        elif closed:
            self._wait_for(Missing.SERVER)
        else:
            self._wait_for(Missing.NOTHING)
            self._warn(f'does not open, since nobody serves {self._name}')

    def _send(self) -> None:
        values, width = self._node.values, 'closed' if self._closed else 'open'
        goal = self._goal_type()
        goal.command.position = values[f'session.gripper_{width}_m']
        goal.command.max_effort = values['session.gripper_effort_n']
        self._wait_for(Missing.ANSWER)
        answer = self._client.send_goal_async(goal)
        answer.add_done_callback(partial(self._on_answer, self._commands))

    def _on_answer(self, command: int, answer: Future) -> None:
        if command != self._commands or self._missing is not Missing.ANSWER:
            return
        self._goal = answer.result()
        if self._goal.accepted:
            self._ask_for_result()
        else:
            self._wait_for(Missing.NOTHING)
            self._warn(f'{self._name} refuses to {self._verb}')

    def _ask_for_result(self) -> None:
        self._wait_for(Missing.RESULT)
        result = self._goal.get_result_async()
        result.add_done_callback(partial(self._on_result, self._commands))

    def _on_result(self, command: int, told: Future) -> None:
        if command != self._commands or self._missing is not Missing.RESULT:
            return
        status, result = told.result().status, told.result().result
        # the controller of ros2_control calls it a failure to close on an object
        holds = self._closed and result.stalled
        if status == GoalStatus.STATUS_UNKNOWN:
            self._lose_server()
            return
        self._wait_for(Missing.NOTHING)
        if status in FAILURES and not holds:
            self._warn(
                f'{self._name} {FAILURES[status]} at {result.position:.3f} m, told to {self._verb}'
            )
        elif self.fault:
            self.fault = ''
            self._node.say(
                f'gripper: {self._done}, {monotonic() - self._commanded_s:.1f} s after the command'
            )

    def _look(self) -> None:
        """Send what waits for a server, and tell of what is overdue."""
        if self._missing is Missing.NOTHING or self._node.once_per_second.stage == 'end':
            return
        is_served = self._client.server_is_ready()
        is_overdue = monotonic() - self._since_s > self.patience_s
        if self._missing is Missing.SERVER:
            if is_served:
                self._asks = 0
                self._send()
            elif is_overdue:
                self._warn_once(
                    f'nobody serves {self._name}; it is told to close when somebody does'
                )
        elif not is_served:
            self._lose_server()
        elif is_overdue and self._asks < ASKS:
            self._ask_again()

    def _ask_again(self) -> None:
        """Tell once, and ask again: a server that was restarted meanwhile knows of nothing."""
        self._asks += 1
        if self._missing is Missing.RESULT:
            self._warn_once(
                f'{self._name} accepted, but is not {self._done} after {self.patience_s:g} s'
            )
            self._ask_for_result()
            return
        self._warn_once(
            f'{self._name} has not answered within {self.patience_s:g} s: is its server alive?'
        )
        if self._closed:
            self._send()

    def _lose_server(self) -> None:
        again = '; it is told to close when it is back' if self._closed else ''
        self._wait_for(Missing.SERVER if self._closed else Missing.NOTHING)
        self._warn_once(f'the server of {self._name} has gone before it was {self._done}{again}')

    def _wait_for(self, missing: Missing) -> None:
        self._missing, self._since_s = missing, monotonic()

    def _warn_once(self, text: str) -> None:
        if not self.fault:
            self._warn(text)

    def _warn(self, text: str) -> None:
        self.fault = f'gripper: {text}'
        self._node.get_logger().warning(self.fault)

    @property
    def _verb(self) -> str:
        return 'close' if self._closed else 'open'

    @property
    def _done(self) -> str:
        return 'closed' if self._closed else 'open'


def _action_type() -> Any:
    # not in the wheels; a system's ROS may have it
    try:
        return import_module('control_msgs.action').GripperCommand
    except ImportError as error:
        raise UsageError(
            'session.gripper_action needs control_msgs, which is not installed; leave it empty, '
            'and use the topic gripper/command'
        ) from error


def _resolved(node: HandoverNode, name: str) -> str:
    try:
        return str(node.resolve_service_name(name))
    except RuntimeError as error:
        reason = str(error).partition(': ')[2].rpartition(', at ')[0]
        raise UsageError(f'session.gripper_action is {name!r}: {reason}') from error
