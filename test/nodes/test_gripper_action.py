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


"""The gripper by an action: its server is absent, comes late, refuses, fails, is slow or dies."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import inf
import signal
import subprocess
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from handover_dmp.common.errors import UsageError
from handover_dmp.nodes.graph import isolate
from handover_dmp.nodes.gripper import OF_GRIPPER
from handover_dmp.nodes.gripper_action import GripperAction, Missing
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.nodes.shutdown import shut_down
import pytest
import rclpy
from rclpy.action import ActionServer, GoalResponse
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node

GripperCommand = pytest.importorskip(
    'control_msgs.action', reason='control_msgs is not installed'
).GripperCommand

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

NAME = '/gripper/move'
CLOSED_M, OPEN_M, EFFORT_N = 0.01, 0.07, 15.0
VALUES = (
    '-p', f'session.gripper_closed_m:={CLOSED_M}', '-p', f'session.gripper_open_m:={OPEN_M}',
    '-p', f'session.gripper_effort_n:={EFFORT_N}',
)  # fmt: skip


class Commander(HandoverNode):
    """A node that has the parameters of a gripper and nothing else."""

    NAME = 'dmp'
    PARAMETERS = OF_GRIPPER


class Driver:
    """A gripper, as its driver offers it; each goal lasts until `end`."""

    def __init__(self, node: Node) -> None:
        self.goals: list[tuple[float, float]] = []
        self.ended = 0
        self.accepts = True
        self._running: list[Any] = []
        self._end, self._stalled = '', False
        self._server = ActionServer(
            node, GripperCommand, NAME, self._execute,
            goal_callback=self._on_goal, handle_accepted_callback=self._running.append,
        )  # fmt: skip

    def _on_goal(self, goal: Any) -> GoalResponse:
        self.goals.append((goal.command.position, goal.command.max_effort))
        return GoalResponse.ACCEPT if self.accepts else GoalResponse.REJECT

    def _execute(self, handle: Any) -> Any:
        getattr(handle, self._end)()
        self.ended += 1
        return GripperCommand.Result(position=0.033, stalled=self._stalled)

    @property
    def runs(self) -> bool:
        return bool(self._running)

    def end(self, how: str, stalled: bool = False) -> None:
        self._end, self._stalled = how, stalled
        self._running.pop().execute()

    def close(self) -> None:
        self._server.destroy()


class Room:
    """A node that commands, a node of the driver, and what the first of them has said."""

    def __init__(self, executor: Executor, capfd: pytest.CaptureFixture[str]) -> None:
        self.node = Commander()
        self.other = rclpy.create_node('gripper_driver', use_global_arguments=False)
        self.action = GripperAction(self.node, NAME)
        # a busy machine is not to be taken for a slow driver
        self.action.patience_s = inf
        self._executor, self._capfd, self._said = executor, capfd, ''
        self._drivers: list[Driver] = []
        for node in (self.node, self.other):
            executor.add_node(node)

    def driver(self) -> Driver:
        """Offer the action, and wait until it is known."""
        self._drivers.append(Driver(self.other))
        self.until(self.is_served)
        return self._drivers[-1]

    def is_served(self) -> bool:
        return bool(self.action._client.server_is_ready())

    def leave(self) -> None:
        """End the driver, and wait until that could be known, before anybody looks."""
        self._drivers.pop().close()
        self.until(lambda: not self.is_served(), looks=False)

    def until(self, done: Callable[[], bool], *, looks: bool = True) -> None:
        end_s = time.monotonic() + 60.0
        while not done():
            assert time.monotonic() < end_s, self._said
            self._executor.spin_once(timeout_sec=0.01)
            if looks:
                # at once, and not once a second
                self.node.once_per_second.start()

    def hears(self, words: str) -> None:
        """Wait until the node has said this, and nothing else."""

        def heard() -> bool:
            self._said += self._capfd.readouterr().err
            return words in self._said

        self.until(heard)
        assert len(self._said.splitlines()) == 1, self._said
        assert self.action.fault in self._said
        assert bool(self.action.fault) is ('WARN' in self._said)
        self._said = ''

    def is_silent(self) -> bool:
        return not self._capfd.readouterr().err

    def close(self) -> None:
        self._executor.shutdown()
        for driver in self._drivers:
            driver.close()
        self.other.destroy_node()
        shut_down(self.node)


@pytest.fixture
def kind(request: pytest.FixtureRequest) -> Callable[[], Executor]:
    return getattr(request, 'param', EventsExecutor)


@pytest.fixture
def room(kind: Callable[[], Executor], capfd: pytest.CaptureFixture[str]) -> Iterator[Room]:
    isolate()
    rclpy.init(args=['--ros-args', *VALUES])
    room = Room(kind(), capfd)
    yield room
    room.close()


@pytest.mark.parametrize('kind', [EventsExecutor, SingleThreadedExecutor], indirect=True)
def test_every_command_is_a_goal_and_every_failure_a_line(room: Room) -> None:
    driver, command = room.driver(), room.action.command
    command(True)
    room.until(lambda: driver.runs)
    driver.end('succeed')
    command(False)
    room.until(lambda: driver.runs)
    assert room.is_silent()
    driver.end('abort')
    room.hears(f'{NAME} aborted at 0.033 m, told to open')
    command(True)
    room.until(lambda: driver.runs)
    # as ros2_control does when something is between the jaws
    driver.end('abort', stalled=True)
    driver.accepts = False
    command(False)
    room.hears(f'{NAME} refuses to open')
    closed, opened = (CLOSED_M, EFFORT_N), (OPEN_M, EFFORT_N)
    assert driver.goals == [closed, opened, closed, opened]


def test_a_result_of_an_earlier_command_is_not_told_of(room: Room) -> None:
    driver, command = room.driver(), room.action.command
    command(True)
    room.until(lambda: driver.runs)
    command(False)
    room.until(lambda: len(driver.goals) == 2)
    driver.end('succeed')
    # an earlier goal ends so when a later one replaces it
    driver.end('abort')
    command(True)
    room.until(lambda: driver.runs)
    assert room.is_silent()


def test_a_slow_gripper_is_told_of_and_so_is_its_end(room: Room) -> None:
    driver = room.driver()
    room.action.command(True)
    room.until(lambda: room.action._missing is Missing.RESULT)
    room.action.patience_s = 0.0
    room.hears(f'{NAME} accepted, but is not closed after 0 s')
    driver.end('succeed')
    room.hears('gripper: closed, ')


@pytest.mark.parametrize('closed', [True, False])
def test_a_goal_without_an_answer_is_told_of_and_only_closing_is_sent_again(
    room: Room, closed: bool
) -> None:
    driver = room.driver()
    room.action.patience_s = 0.0
    room.action.command(closed)
    room.node.once_per_second.start()
    room.hears(f'{NAME} has not answered within 0 s: is its server alive?')
    room.action.patience_s = inf
    room.until(lambda: room.action._missing is Missing.RESULT)
    room.action.command(not closed)
    once, other = (CLOSED_M, OPEN_M) if closed else (OPEN_M, CLOSED_M)
    room.until(lambda: other in dict(driver.goals))
    positions = [position for position, _ in driver.goals]
    assert positions == ([once, once, other] if closed else [once, other])


def test_a_gripper_that_comes_late_closes_and_never_opens(room: Room) -> None:
    command = room.action.command
    room.action.patience_s = 0.0
    command(True)
    room.hears(f'nobody serves {NAME}; it is told to close when somebody does')
    room.action.patience_s = inf
    driver = room.driver()
    room.until(lambda: driver.runs)
    command(False)
    room.until(lambda: len(driver.goals) == 2)
    room.leave()
    room.hears('has gone before it was open')
    command(False)
    room.hears(f'does not open, since nobody serves {NAME}')
    driver = room.driver()
    command(True)
    room.until(lambda: driver.runs)
    assert driver.goals == [(CLOSED_M, EFFORT_N)]
    assert room.is_silent()


def test_a_gripper_whose_server_is_restarted_closes(room: Room) -> None:
    room.driver()
    room.action.command(True)
    room.leave()
    driver = room.driver()
    room.action.patience_s = 0.0
    room.until(lambda: driver.runs)
    room.action.patience_s = inf
    assert set(driver.goals) == {(CLOSED_M, EFFORT_N)}
    room.hears(NAME)
    while driver.runs:
        driver.end('succeed')
    room.hears('gripper: closed, ')


def test_dmp_closes_a_gripper_that_it_discovers_later(room: Room) -> None:
    driver = room.driver()
    words = ['-p', 'session.enabled:=true', '-p', f'session.gripper_action:={NAME}', *VALUES]
    process = subprocess.Popen(
        [sys.executable, '-m', 'handover_dmp.nodes.dmp', '--ros-args', *words],
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        room.until(lambda: driver.runs)
        driver.end('succeed')
        room.until(lambda: bool(driver.ended))
        assert driver.goals == [(CLOSED_M, EFFORT_N)]
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=30)[1]
    finally:
        process.kill()
    assert process.returncode == 0
    assert 'WARN' not in said
    assert 'leaked' not in said


def test_diagnostics_tell_of_a_gripper_until_it_is_closed(room: Room) -> None:
    reports: list[str] = []
    room.other.create_subscription(
        DiagnosticArray, '/diagnostics', lambda array: reports.append(array.status[0].message), 10
    )
    words = ['-p', 'session.enabled:=true', '-p', f'session.gripper_action:={NAME}']
    process = subprocess.Popen(
        [sys.executable, '-m', 'handover_dmp.nodes.dmp', '--ros-args', *words],
        stderr=subprocess.DEVNULL,
    )
    fault = f'gripper: nobody serves {NAME}'
    try:
        room.until(lambda: any(fault in report for report in reports))
        driver = room.driver()
        room.until(lambda: driver.runs)
        driver.end('succeed')
        reports.clear()
        room.until(lambda: any('gripper' not in report for report in reports))
        process.send_signal(signal.SIGINT)
        process.wait(timeout=30)
    finally:
        process.kill()


@pytest.mark.parametrize('name', ['gripper move', '/gripper//move', 'gripper/', '1st_gripper'])
def test_an_invalid_name_gives_one_line(room: Room, name: str) -> None:
    with pytest.raises(UsageError, match=f"^session.gripper_action is '{name}': topic name .*$"):
        GripperAction(room.node, name)
    assert room.is_silent()
