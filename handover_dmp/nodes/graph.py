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
The five nodes as five processes: started, watched, ended. None outlives its parent.

For the demo, the benchmark and the tests; `ros2 launch` does not need it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
import faulthandler
from math import inf
import os
from pathlib import Path
import socket
import subprocess
import sys
from time import monotonic
from typing import Any

from handover_dmp.common.errors import HandoverError
from handover_dmp.common.plain_yaml import dump_plain
from handover_dmp.common.resources import share_path
from handover_dmp.common.settings import ANYWHERE
from handover_dmp.nodes.conversions import NANOSECONDS, nanoseconds
from handover_dmp.nodes.qos import message_class, qos_profile
from handover_dmp.nodes.shutdown import end_context, shut_down
from handover_dmp.nodes.spin import events_executor, MAX_END_S, PARENT_VARIABLE, STDERR
from handover_dmp.topics import (
    CLOCK,
    DEMONSTRATOR_POSE,
    HAND_POSE,
    IK_STATUS,
    JOINT_COMMAND,
    JOINT_STATES,
    PHASE,
    POSE_COMMAND,
    STATE,
    Topic,
    TWIST_COMMAND,
    WRIST_POSE,
)
import rclpy
from rclpy.client import Client
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import get_default_context
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

NODES = ('recorder', 'hand_tracker', 'dmp', 'priority_ik', 'robot_sim')
RECORDED_AND_READ = (WRIST_POSE, POSE_COMMAND, TWIST_COMMAND, IK_STATUS, JOINT_STATES)
RECORDED_ALONE = (DEMONSTRATOR_POSE, PHASE)
START_TIMEOUT_S = 90.0
CALL_TIMEOUT_S = 30.0
ANSWER_S = 2.0
END_TIMEOUT_S = 20.0
STALL_S = 60.0
# DDS domains: first port, ports per domain, offset of the first participant.
FIRST_PORT = 7400
PORTS = 250
FIRST_PARTICIPANT = 10
DOMAINS = 100
PROFILE_VARIABLE = 'FASTRTPS_DEFAULT_PROFILES_FILE'
RANGE_VARIABLE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'


class GraphError(HandoverError):
    """The graph failed to start, to run or to end; names the node."""


class Graph:
    """
    The five nodes, with access to their topics.

    A context manager: starts them on entry, ends them on exit. With `lockstep` every node waits
    for the others on the simulated time of `robot_sim`, which stands still until `pause(False)`.
    """

    def __init__(
        self,
        folder: Path,
        parameters: dict[str, dict[str, Any]],
        *,
        lockstep: bool = True,
        nodes: tuple[str, ...] = NODES,
        namespace: str = '/',
        isolated: bool = True,
    ) -> None:
        """
        Prepare the nodes.

        Args:
            folder: folder for the parameters and the logs.
            parameters: node to name to value.
            lockstep: whether to run on simulated time; if not, on the wall clock.
            nodes: names of the nodes to start.
            namespace: their namespace, e.g. `/left`; it has its own simulated time.
            isolated: whether they run in a domain of their own, in place of the current one.

        """
        self._namespace = namespace
        self._remaps = remaps(namespace)
        self._folder = folder
        self._isolated = isolated
        self._lockstep = lockstep
        self._nodes = nodes
        self._parameters = {
            name: {
                'lockstep': lockstep,
                'use_sim_time': lockstep and name != 'robot_sim',
                **parameters.get(name, {}),
            }
            for name in nodes
        }
        if lockstep and 'robot_sim' in nodes:
            self._parameters['robot_sim']['paused'] = True
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._clients: dict[str, Client] = {}
        self.state = ''
        self.time_s = 0.0

    def __enter__(self) -> Graph:
        """Start the nodes and wait until they have discovered each other."""
        if self._isolated:
            isolate()
        (self._folder / 'logs').mkdir(parents=True, exist_ok=True)
        write_node_parameters(self._folder / 'parameters.yaml', self._parameters)
        # the default context for the first graph, a new one for each further graph
        self._context = Context() if rclpy.ok() else get_default_context()
        rclpy.init(
            args=['--ros-args', *self._remaps],
            context=self._context,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        try:
            self._watch()
        except BaseException:
            end_context(self._context)
            raise
        try:
            for name in self._nodes:
                self.start(name)
            self._wait_for(
                self._complete, START_TIMEOUT_S, 'the nodes did not discover each other'
            )
            if set(self._nodes) == set(NODES):
                self.wait_for_recorder()
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(self, _kind: object, error: object, _trace: object) -> None:
        """End the nodes, the recorder last; raise an error if one did not end cleanly."""
        for name, code in self._end().items():
            if code != 0 and error is None:
                raise self._ended(name, code)

    def words(self, name: str) -> list[str]:
        """
        Return the arguments of Python for a node.

        Args:
            name: which.

        Returns:
            Its arguments.

        """
        return ['-m', f'handover_dmp.nodes.{name}']

    def start(self, name: str) -> None:
        """
        Start one node.

        Args:
            name: which.

        """
        with (self._folder / 'logs' / f'{name}.log').open('ab') as log:
            self.processes[name] = subprocess.Popen(
                [
                    sys.executable, *self.words(name),
                    # only logs with content are kept
                    '--ros-args', '--log-level', 'warn',
                    '--params-file', str(self._folder / 'parameters.yaml'),
                    *self._remaps,
                ],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env={**os.environ, PARENT_VARIABLE: str(os.getpid())},
            )  # fmt: skip

    def spin(self, timeout_s: float = 0.1) -> None:
        """
        Process what the nodes publish.

        Args:
            timeout_s: longest wait for something, s.

        Raises:
            GraphError: a node has ended.

        """
        self._executor.spin_once(timeout_sec=timeout_s)
        for name, process in self.processes.items():
            if process.poll() is not None:
                raise self._ended(name, process.returncode)

    def call(self, service: str, request: Any = None) -> None:
        """
        Call a service of type `std_srvs/Trigger`, or `std_srvs/SetBool`.

        Args:
            service: its name within the namespace of the graph, e.g. `dmp/start`.
            request: of type `SetBool.Request`; None: a `Trigger`.

        Raises:
            GraphError: the service does not answer, or fails.

        """
        fault = self._ask(service, request=request)
        if fault is not None:
            raise GraphError(f'{service}: {fault}')

    def _ask(self, service: str, again_s: float = inf, request: Any = None) -> str | None:
        """
        Call a service; return the reason if it failed, None if it succeeded.

        Call it again after `again_s` without an answer: a server that has not discovered its
        client yet drops the answer. Only for services that may be called twice.
        """
        if service not in self._clients:
            kind = Trigger if request is None else SetBool
            self._clients[service] = self.node.create_client(kind, service)
        client = self._clients[service]
        self._wait_for(client.service_is_ready, CALL_TIMEOUT_S, f'{service} is not offered')
        calls: list[Future] = []
        begun_s = monotonic()

        def answered() -> bool:
            if not calls or monotonic() >= begun_s + len(calls) * again_s:
                calls.append(client.call_async(request or Trigger.Request()))
            return any(call.done() for call in calls)

        self._wait_for(answered, CALL_TIMEOUT_S, f'{service} does not answer')
        answer = next(call.result() for call in calls if call.done())
        return None if answer.success else str(answer.message)

    def wait_for_recorder(self, timeout_s: float = START_TIMEOUT_S) -> None:
        """
        Wait until every stream is recorded, so that the bag lacks nothing of the motion.

        Args:
            timeout_s: longest wait, s.

        Raises:
            GraphError: a stream is still missing by then.

        """
        deadline_s = monotonic() + timeout_s
        while (fault := self._ask('recorder/ready', ANSWER_S)) is not None:
            if monotonic() > deadline_s:
                raise GraphError(f'recorder: {fault} within {timeout_s:.0f} s')
            self.spin(0.05)

    def clock_s(self) -> float:
        """Return the time on the graph's clock, s."""
        return self.time_s if self._lockstep else monotonic()

    def pause(self, paused: bool) -> None:
        """
        Stop time, or let it run.

        Args:
            paused: whether time shall stand still.

        """
        self.call('robot_sim/pause', SetBool.Request(data=paused))

    def wait_for_state(
        self, wanted: tuple[str, ...], timeout_s: float, progress: Callable[[], None]
    ) -> bool:
        """
        Watch the handover.

        Args:
            wanted: states that end the wait.
            timeout_s: on the graph's clock, s.
            progress: called now and then.

        Returns:
            Whether one of the states was reached.

        Raises:
            GraphError: a node has ended, or simulated time stands still.

        """
        deadline_s = self.clock_s() + timeout_s
        stalled_s = monotonic() + STALL_S
        last_s = self.time_s
        while self.state not in wanted:
            self.spin()
            progress()
            if self.time_s != last_s:
                last_s, stalled_s = self.time_s, monotonic() + STALL_S
            if self._lockstep and monotonic() > stalled_s:
                raise GraphError(f'simulated time stands still at {last_s:.3f} s')
            if self.clock_s() > deadline_s:
                return False
        return True

    def linger(self, duration_s: float) -> None:
        """
        Let the graph run for a while.

        Args:
            duration_s: on its clock, s.

        """
        self.wait_for_state((), duration_s, lambda: None)

    def _watch(self) -> None:
        self.node = rclpy.create_node('handover_dmp_watch', context=self._context)
        self._executor = events_executor(self._context) or SingleThreadedExecutor(
            context=self._context
        )
        self._executor.add_node(self.node)
        self._listen(STATE, self._on_state)
        if self._lockstep:
            self._listen(CLOCK, self._on_clock)

    def _listen(self, topic: Topic, callback: Callable[[Any], None]) -> None:
        self.node.create_subscription(
            message_class(topic.type_name), topic.relative, callback, qos_profile(topic.quality)
        )

    def _on_state(self, message: String) -> None:
        self.state = message.data

    def _on_clock(self, message: Clock) -> None:
        self.time_s = nanoseconds(message.clock) / NANOSECONDS

    def _complete(self) -> bool:
        """Whether every topic has its publishers and subscriptions."""
        if set(self._nodes) != set(NODES):
            there = self.node.get_node_names_and_namespaces()
            return all((name, self._namespace) in there for name in self._nodes)
        read = (*RECORDED_AND_READ, *self._topics_of_the_hand())
        ends = [(topic.within(self._namespace), 2) for topic in read]
        ends += [(topic.within(self._namespace), 1) for topic in RECORDED_ALONE]
        ends.append((JOINT_COMMAND.within(self._namespace), 2))
        return all(
            self.node.count_publishers(name) >= 1 and self.node.count_subscribers(name) >= minimum
            for name, minimum in ends
        )

    def _topics_of_the_hand(self) -> list[Topic]:
        """Return the topics of all trackers, by their parameters."""
        told = self._parameters['dmp']
        names = told.get('trackers', ['tracker'])
        topics = [str(told.get(f'{name}.topic', HAND_POSE.relative)) for name in names]
        return [replace(HAND_POSE, name=f'/{topic.lstrip("/")}') for topic in topics]

    def _wait_for(self, condition: Callable[[], bool], timeout_s: float, fault: str) -> None:
        deadline_s = monotonic() + timeout_s
        while not condition():
            self.spin(0.02)
            if monotonic() > deadline_s:
                raise GraphError(f'{fault} within {timeout_s:.0f} s')

    def _ended(self, name: str, code: int) -> GraphError:
        """Make the error of a node that ended, with the last line of its log."""
        log = self._folder / 'logs' / f'{name}.log'
        lines = log.read_text(encoding='utf-8', errors='replace').strip().splitlines()
        return GraphError(': '.join([f'{name} ended with code {code}', *lines[-1:]]))

    def _end(self) -> dict[str, int]:
        # the recorder last, so that it records the last messages of the others; the arm first,
        # since its watchdog would report the end of the commands
        others = [name for name in reversed(self.processes) if name != 'recorder']
        for group in (others, [name for name in self.processes if name == 'recorder']):
            processes = [self.processes[name] for name in group]
            for process in processes:
                if process.poll() is None:
                    # background jobs of a shell ignore SIGINT, as do nodes that still start
                    process.terminate()
            for process in processes:
                try:
                    process.wait(END_TIMEOUT_S)
                except subprocess.TimeoutExpired:
                    process.kill()
        # as in a node: a process that hangs in DDS is ended here, with a traceback
        faulthandler.dump_traceback_later(MAX_END_S, exit=True, file=STDERR)
        try:
            self._executor.shutdown()
            shut_down(self.node)
        finally:
            faulthandler.cancel_dump_traceback_later()
        return {name: process.wait() for name, process in self.processes.items()}


def isolate() -> None:
    """
    Isolate the graph: on this machine only, in a domain of its own unless one is set.

    Nothing leaves the loopback interface, and nothing is left in shared memory. A profile of
    Fast DDS that the user has chosen is kept.
    """
    if 'ROS_DOMAIN_ID' not in os.environ:
        os.environ['ROS_DOMAIN_ID'] = str(_free_domain())
    os.environ |= isolation(rclpy.get_rmw_implementation_identifier(), os.environ)


def isolation(middleware: str, environment: Mapping[str, str]) -> dict[str, str]:
    """
    Return the settings that keep a middleware on this machine.

    Args:
        middleware: its identifier, e.g. `rmw_fastrtps_cpp`.
        environment: variables that are already set.

    Returns:
        Environment variables to set.

    """
    if not middleware.startswith('rmw_fastrtps'):
        return {RANGE_VARIABLE: 'LOCALHOST'}
    if PROFILE_VARIABLE in environment:
        return {}
    # the only range that leaves the transports to the profile
    profile = share_path('config/fastdds_loopback.xml')
    return {PROFILE_VARIABLE: str(profile), RANGE_VARIABLE: 'SYSTEM_DEFAULT'}


def remaps(namespace: str) -> list[str]:
    """
    Put a graph into a namespace.

    Args:
        namespace: absolute.

    Returns:
        ROS arguments for each of its nodes. In lockstep each graph has its own time and `/clock`.

    """
    if namespace == '/':
        return []
    return ['-r', f'__ns:={namespace}', '-r', f'{CLOCK.name}:={namespace}{CLOCK.name}']


def write_node_parameters(file: Path, parameters: Mapping[str, Mapping[str, Any]]) -> None:
    """
    Write the parameters of several nodes to a file for `--params-file`.

    Args:
        file: to write.
        parameters: node to name to value.

    """
    tree = {ANYWHERE + name: {'ros__parameters': dict(v)} for name, v in parameters.items()}
    file.write_text(dump_plain(tree), encoding='utf-8')


def _free_domain() -> int:
    """Find a domain that is unused on this machine, by the port of its first participant."""
    for offset in range(DOMAINS):
        domain = 1 + (os.getpid() + offset) % DOMAINS
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(('127.0.0.1', FIRST_PORT + PORTS * domain + FIRST_PARTICIPANT))
            except OSError:
                continue
            return domain
    raise GraphError('all ROS domains of this machine are in use; set ROS_DOMAIN_ID')
