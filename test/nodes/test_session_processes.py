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
Processes that die or stall at every stage of a session on the graph.

In lockstep, at most as fast as the wall clock. Whatever fails, the object is held or handed over,
never dropped, the arm keeps its limits, and the wrist never goes towards a hand that is lost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
import signal
import time
from typing import Any

from fault_parameters import prepare_for_faults
from handover_dmp.bench.session_watch import SessionWatch, STAGES, StageWatch
from handover_dmp.common.settings import defaults
from handover_dmp.handover.session_scenario import make_session_scenario, SessionScenario
from handover_dmp.nodes.conversions import NANOSECONDS, nanoseconds, position_of
from handover_dmp.nodes.graph import Graph
from handover_dmp.nodes.qos import message_class, qos_profile
from handover_dmp.nodes.run_graph import graph_parameters
from handover_dmp.robot.model import BasePlacement
from handover_dmp.runs.folder import keep_session, session_info
from handover_dmp.topics import (
    GRIPPER_COMMAND,
    HAND_POSE,
    JOINT_STATES,
    OBJECT_HOLDER,
    STATE,
    Topic,
    WRIST_POSE,
)
import numpy as np
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger

pytestmark = [pytest.mark.ros, pytest.mark.slow, pytest.mark.timeout(1800)]

MASS_KG = 0.8
BASE = BasePlacement((-0.62, 0.01, 0.97), -0.60)
SHORT_PATIENCE_S = 1.0
"""Who is killed is not to be waited for as long as who is merely slow, s."""
FAILS_S = 0.8
"""Of simulated time, s."""
INTO_STAGE_S = 0.3
"""After the beginning of a stage, if it lasts so long, s."""
WAIT_S = 120.0
SESSION_S = 30.0
"""A whole one takes 20 s of simulated time, and more if a partner waits, s."""
NAMES = [name for name, _, _ in STAGES]


class Session:
    """A session on the graph, watched by a node of this test."""

    def __init__(self, graph: Graph, folder: Path, scenario: SessionScenario) -> None:
        self.graph, self.folder, self.scenario = graph, folder, scenario
        self.node = rclpy.create_node('neighbour', use_global_arguments=False)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self.holder = self.state = ''
        self.closed = False
        self.stages = StageWatch()
        self.broken: list[str] = []
        self._hand: tuple[float, tuple[float, ...]] | None = None
        self.watch_anew()
        self._hear(STATE, self._on_state)
        self._hear(GRIPPER_COMMAND, self._on_gripper)
        self._hear(OBJECT_HOLDER, self._on_holder)
        self._hear(HAND_POSE, self._on_hand)
        self._hear(WRIST_POSE, self._on_wrist)
        self._hear(JOINT_STATES, self._on_joints)

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()

    def watch_anew(self) -> None:
        """Forget what was: the world has been put back to the start."""
        self.watch = SessionWatch()
        self._hand = None
        self._watches = True

    def _hear(self, topic: Topic, take: Callable[[Any], None]) -> None:
        kind = message_class(topic.type_name)
        self.node.create_subscription(kind, topic.name, take, qos_profile(topic.quality))

    def _on_state(self, message: Any) -> None:
        self.state = message.data
        self.stages.see(self.state, self.closed)

    def _on_gripper(self, message: Any) -> None:
        self.closed = message.data

    def _on_holder(self, message: Any) -> None:
        self.holder = message.data
        self.watch.see_holder(self.graph.time_s, self.holder)
        self._note()

    def _on_hand(self, message: Any) -> None:
        self._hand = nanoseconds(message.header.stamp) / NANOSECONDS, position_of(message)

    def _on_wrist(self, message: Any) -> None:
        if self._hand is None or not self._watches:
            return
        now_s, (seen_s, place) = nanoseconds(message.header.stamp) / NANOSECONDS, self._hand
        self.watch.see_wrist(now_s, position_of(message), place, now_s - seen_s)
        self._note()

    def _on_joints(self, message: Any) -> None:
        limits = self.scenario.robot.limits
        speeds, places = np.array(message.velocity), np.array(message.position)
        if np.any(np.abs(speeds) > 1.01 * limits.velocity):
            self.broken.append(f'a joint is faster than its limit: {speeds}')
        if np.any(places > limits.upper + 1e-3) or np.any(places < limits.lower - 1e-3):
            self.broken.append(f'a joint is beyond its limit: {places}')

    def _note(self) -> None:
        self.broken += self.watch.broken
        self.watch.broken.clear()

    def spin(self, duration_s: float = 0.0) -> None:
        end_s = time.monotonic() + duration_s
        while True:
            self._executor.spin_once(timeout_sec=0.005)
            self.graph.spin(0.0)
            if time.monotonic() >= end_s:
                return

    def until(self, condition: Callable[[], Any], what: str) -> None:
        end_s = time.monotonic() + WAIT_S
        while not condition():
            self.spin()
            assert time.monotonic() < end_s, f'waited in vain for {what}, in {self.state}'

    def wait_sim(self, duration_s: float) -> None:
        end_s = self.graph.time_s + duration_s
        self.until(lambda: self.graph.time_s >= end_s, f'{duration_s} s of simulated time')

    def tell(self, service: str) -> None:
        """Call a service of a node that was started anew; its dead self may still be listed."""
        client = self.node.create_client(Trigger, service)
        self.until(client.service_is_ready, service)
        asked: list[tuple[float, Any]] = []

        def answered() -> bool:
            if not asked or time.monotonic() > asked[-1][0] + 2.0:
                asked.append((time.monotonic(), client.call_async(Trigger.Request())))
            return any(done.done() for _, done in asked)

        self.until(answered, service)
        self.node.destroy_client(client)

    def set_patience(self, node: str, patience_s: float) -> None:
        client = self.node.create_client(SetParameters, f'/{node}/set_parameters')
        self.until(client.service_is_ready, f'parameters of {node}')
        value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=patience_s)
        told = SetParameters.Request(parameters=[Parameter(name='patience_s', value=value)])
        done = client.call_async(told)
        self.until(done.done, f'patience of {node}')
        self.node.destroy_client(client)

    def begin(self) -> None:
        """Put the world back to the start, and let the partner ask for the object."""
        self._watches = False  # the arm is put back in one step, wherever the hand is
        self.tell('/robot_sim/reset')
        self.tell('/robot_sim/resume')
        # what was sent before may still come
        self.wait_sim(0.1)
        self.watch_anew()
        # the last stage that a dead node told of is over
        self.stages = StageWatch()
        self.tell('/hand_tracker/replay')

    def reach_a_stage(self, left: list[str]) -> str:
        """Go on until one of some stages is on, taking up what has stopped."""
        begun_s = told_s = self.graph.time_s
        sessions = 1
        while self.stages.stage not in left:
            self.spin()
            now_s = self.graph.time_s
            if self.state in ('aborted', 'idle') and now_s > told_s + 2.0:
                told_s = now_s
                self.tell('/robot_sim/resume')
                self.tell('/dmp/start')
            if self.state == 'done' or now_s > begun_s + SESSION_S:
                # the next one, from the table on; one that was broken off may leave out stages,
                # and then nobody takes what is held out a second time
                assert sessions < 4, f'none of {left}, in {self.state} with {self.holder}'
                sessions += 1
                self.start_anew('dmp')
                self.begin()
                begun_s = told_s = self.graph.time_s
        found = self.stages.stage
        into_s = self.graph.time_s + INTO_STAGE_S
        while self.stages.stage == found and self.graph.time_s < into_s:
            self.spin()
        return found

    def start_anew(self, name: str) -> None:
        process = self.graph.processes.pop(name, None)
        if process is not None:
            process.kill()
            process.wait()
        bag = self.folder / 'bag'
        if name == 'recorder':
            bag.rename(bag.with_name(f'bag_{len(list(self.folder.iterdir()))}'))
        elif name == 'dmp':
            self.state = 'idle'
        self.graph.start(name)
        if name == 'recorder':
            self.until(bag.exists, 'the next bag')

    def kill(self, name: str) -> None:
        process = self.graph.processes.pop(name)
        process.kill()
        process.wait()
        self._fail(name)
        self.start_anew(name)
        self.wait_sim(0.3)
        if name == 'hand_tracker':
            # a partner who begins anew would jump back to the beginning with what they hold
            self.start_anew('dmp')
        if name in ('dmp', 'hand_tracker'):
            # it knows nothing of the session that was on
            self.begin()

    def stall(self, name: str) -> None:
        process = self.graph.processes[name]
        process.send_signal(signal.SIGSTOP)
        try:
            self._fail(name)
        finally:
            process.send_signal(signal.SIGCONT)

    def _fail(self, name: str) -> None:
        """Let time pass without a node; where it stands still with it, on the wall clock."""
        if name == 'robot_sim':
            self.spin(FAILS_S)
            return
        if name == 'priority_ik':
            self.set_patience('robot_sim', 0.05)
        self.wait_sim(FAILS_S)
        if name == 'priority_ik':
            self.set_patience('robot_sim', defaults('robot_sim')['patience_s'])


@contextmanager
def session_of(folder: Path) -> Iterator[Session]:
    scenario = make_session_scenario(base=BASE, pick_up=True)
    keep_session(folder, scenario)
    info = session_info(scenario, MASS_KG)
    parameters = graph_parameters(folder, scenario, info, True)
    prepare_for_faults(parameters, SHORT_PATIENCE_S)
    with Graph(folder, parameters) as graph:
        graph.pause(False)
        session = Session(graph, folder, scenario)
        try:
            yield session
        finally:
            session.close()


@pytest.mark.parametrize(
    ('name', 'how'),
    [
        *((name, how) for name in ('dmp', 'priority_ik', 'hand_tracker', 'recorder')
          for how in ('killed', 'stalled')),
        ('robot_sim', 'stalled'),
    ],
)  # fmt: skip
def test_what_fails_at_any_stage_drops_nothing(name: str, how: str, tmp_path: Path) -> None:
    with session_of(tmp_path) as session:
        session.begin()
        left = list(NAMES)
        while left:
            stage = session.reach_a_stage(left)
            left.remove(stage)
            before = session.holder
            fail = session.kill if how == 'killed' else session.stall
            fail(name)
            print(f'{name} {how} in {stage}: {before}, then {session.holder}, {session.state}')
            assert session.broken == []
        session.wait_sim(1.0)
        assert session.broken == []
