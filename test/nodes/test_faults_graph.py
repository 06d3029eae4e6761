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
Processes that fail while the arm is in motion: killed, stalled, or saying what makes no sense.

The whole graph runs in lockstep, so that times are those of the simulated arm however busy the
machine is, and what happened is read from the bag; nodes that are looked at alone have this test
for a neighbour and run on the wall clock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import nan
from pathlib import Path
import resource
import signal
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from fault_parameters import prepare_for_faults
from handover_dmp.common.settings import defaults
from handover_dmp.handover.scenario import Scenario
from handover_dmp.nodes.conversions import (
    NANOSECONDS,
    nanoseconds,
    pose_message,
    stamp,
    to_float_array,
)
from handover_dmp.nodes.graph import Graph, GraphError
from handover_dmp.nodes.qos import message_class, qos_profile
from handover_dmp.recording import read_bag, repair_bag
from handover_dmp.runs.folder import keep_inputs
from handover_dmp.topics import (
    CLOCK,
    DIAGNOSTICS,
    HAND_POSE,
    IK_STATUS,
    JOINT_COMMAND,
    JOINT_STATES,
    POSE_COMMAND,
    STATE,
    Topic,
    TWIST_COMMAND,
    WRIST_POSE,
)
import numpy as np
import psutil
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from shared_memory import shared_memory_of
from std_msgs.msg import Float64MultiArray, MultiArrayDimension
from std_srvs.srv import Trigger
from written_bag import WrittenBag

pytestmark = [pytest.mark.ros, pytest.mark.timeout(600)]

WAIT_S = 60.0
MAX_S = 20.0
MOVING_RAD_S = 0.3
STILL_RAD_S = 0.01
PERIOD_S = 0.005
COMMAND_TIMEOUT_S = 0.05
HAND_TIMEOUT_S = 0.1
# from the fastest that the wrist gets, at the acceleration limits of wrist and joints
BRAKING_S = 0.3
WRIST_ACCELERATION = 20.0
# simulated; a stream that has got so far in the bag leaves no other one behind by more
APART_S = 0.05
SHORT_PATIENCE_S = 3.0
LOOK_S = 0.25


class Neighbour:
    """A node of this test, which hears and says what the others do."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.node = rclpy.create_node('neighbour', use_global_arguments=False)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self.heard: dict[str, list[Any]] = {}
        self.diagnosed: dict[str, list[Any]] = {}
        self.hear(DIAGNOSTICS)
        self.hear(STATE)

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()

    def hear(self, topic: Topic) -> list[Any]:
        heard = self.heard.setdefault(topic.name, [])

        def take(message: Any) -> None:
            if isinstance(message, DiagnosticArray):
                for status in message.status:
                    self.diagnosed.setdefault(status.name, []).append(status)
            heard.append(message)

        kind = message_class(topic.type_name)
        self.node.create_subscription(kind, topic.name, take, qos_profile(topic.quality))
        return heard

    def hear_times(
        self, topic: Topic, clock_s: Callable[[], float]
    ) -> tuple[dict[int, float], Any]:
        """Note, by their stamps, ns, when messages came first, s of a clock; until destroyed."""
        times: dict[int, float] = {}

        def take(message: Any) -> None:
            times.setdefault(nanoseconds(message.header.stamp), clock_s())

        kind = message_class(topic.type_name)
        quality = qos_profile(topic.quality)
        return times, self.node.create_subscription(kind, topic.name, take, quality)

    def speaker(self, topic: Topic) -> Callable[[Any], None]:
        publisher = self.node.create_publisher(
            message_class(topic.type_name), topic.name, qos_profile(topic.quality)
        )
        self.until(lambda: publisher.get_subscription_count() > 0)
        return lambda message: publisher.publish(message)

    def spin(self, duration_s: float = 0.0) -> None:
        end_s = time.monotonic() + duration_s
        while True:
            self._executor.spin_once(timeout_sec=0.005)
            self.graph.spin(0.0)
            if time.monotonic() >= end_s:
                return

    def said(self) -> dict[str, tuple[str, list[tuple[str, str]]]]:
        """Tell what every node said of itself last."""
        return {
            name: (heard[-1].message, [(v.key, v.value) for v in heard[-1].values])
            for name, heard in self.diagnosed.items()
            if heard
        }

    def until(self, condition: Callable[[], Any]) -> None:
        end_s = time.monotonic() + WAIT_S
        while not condition():
            self.spin()
            assert time.monotonic() < end_s, f'waited in vain: {self.said()}'

    def diagnosis(self, node: str, *words: str) -> Any:
        """Wait until a node says certain words of itself, from now on."""
        said = self.diagnosed.setdefault(node, [])
        said.clear()
        self.until(lambda: any(all(w in str(status) for w in words) for status in said))
        return next(s for s in reversed(said) if all(w in str(s) for w in words))

    def tell(self, service: str) -> None:
        """Call a service of a node that was started anew; its dead self may still be listed."""
        client = self.node.create_client(Trigger, service)
        self.until(client.service_is_ready)
        asked: list[tuple[float, Any]] = []

        def answered() -> bool:
            if not asked or time.monotonic() > asked[-1][0] + 2.0:
                asked.append((time.monotonic(), client.call_async(Trigger.Request())))
            return any(done.done() for _, done in asked)

        self.until(answered)
        self.node.destroy_client(client)

    def set_parameter(self, node: str, name: str, value: float) -> None:
        client = self.node.create_client(SetParameters, f'/{node}/set_parameters')
        self.until(client.service_is_ready)
        double = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
        done = client.call_async(
            SetParameters.Request(parameters=[Parameter(name=name, value=double)])
        )
        self.until(done.done)
        assert done.result().results[0].successful, done.result().results[0].reason
        self.node.destroy_client(client)


@dataclass
class Recorded:
    """What the bag holds from one simulated time on."""

    times: np.ndarray
    joint_positions: np.ndarray
    joint_velocities: np.ndarray
    commands: dict[float, np.ndarray]
    twists: dict[float, np.ndarray]
    hand: list[float]

    def speed(self, from_s: float, until_s: float = 1e9) -> float:
        """Greatest joint speed, rad/s."""
        inside = (self.times >= from_s - 1e-6) & (self.times < until_s)
        assert inside.any()
        return float(np.abs(self.joint_velocities[inside]).max())

    def stands_at(self, from_s: float) -> float:
        """When, after a time, the arm has come to stand, s."""
        after = self.times >= from_s - 1e-6
        moving = np.abs(self.joint_velocities[after]).max(axis=1) > STILL_RAD_S
        assert not moving[-1], 'still moving'
        times = self.times[after]
        return float(times[np.flatnonzero(moving)[-1] + 1]) if moving.any() else from_s


def last_before_a_gap(at: dict[float, np.ndarray]) -> float:
    """When the last message came before they stayed away for the first time, s."""
    return next(before for before, now in pairwise(sorted(at)) if now - before > 0.03)


class Bench:
    """The whole graph in lockstep, brought back to the start for every test."""

    def __init__(self, graph: Graph, folder: Path, scenario: Scenario) -> None:
        self.graph = graph
        self.folder = folder
        self.scenario = scenario
        self.neighbour = Neighbour(graph)
        self.bag = WrittenBag(folder / 'bag' / 'bag_0.mcap')
        self.joints = self.neighbour.hear(JOINT_STATES)

    def reset(self) -> None:
        self.neighbour.tell('/dmp/abort')
        self.wait_sim(0.4)
        for service in ('/robot_sim/reset', '/robot_sim/resume', '/dmp/reset'):
            self.neighbour.tell(service)
        self.wait_sim(0.3)

    def reach(self) -> None:
        """Begin a handover and wait until the arm is in full motion."""
        self.reset()
        self.neighbour.tell('/hand_tracker/replay')
        self.joints.clear()
        self.neighbour.until(
            lambda: any(max(map(abs, state.velocity)) > MOVING_RAD_S for state in self.joints)
        )
        self.wait_sim(0.25)

    def wait_sim(self, duration_s: float) -> None:
        end_s = self.graph.time_s + duration_s
        self.neighbour.until(lambda: self.graph.time_s >= end_s)

    def kill(self, name: str) -> None:
        process = self.graph.processes.pop(name)
        process.kill()
        process.wait()

    def start_again(self, name: str, *words: str) -> None:
        """Start a node that was killed while time stands still, and wait until it has spoken."""
        self.graph.pause(True)
        self.graph.start(name)
        self.neighbour.diagnosis(name, *words)
        self.graph.pause(False)

    def signal(self, name: str, number: signal.Signals) -> None:
        self.graph.processes[name].send_signal(number)

    def finish(self) -> None:
        end_s = self.graph.time_s + MAX_S
        self.neighbour.until(lambda: self.graph.state == 'done' or self.graph.time_s > end_s)
        assert self.graph.state == 'done', str(self.neighbour.said())

    def wait_for_bag(self) -> None:
        """Wait until the bag, which is still being written, holds all that was said so far."""
        wanted_s = self.graph.time_s + APART_S
        end_s = time.monotonic() + WAIT_S
        while self.bag.last_ns(JOINT_STATES.name) / NANOSECONDS <= wanted_s:
            assert time.monotonic() < end_s, 'the recorder writes no more'
            self.neighbour.spin(LOOK_S)

    def recorded(self, from_s: float) -> Recorded:
        self.wait_for_bag()
        found = self.read(from_s)
        self.check(found)
        return found

    def read(self, from_s: float) -> Recorded:
        times, positions, velocities = [], [], []
        # a recorder may take in one topic before the other
        from_ns = round((from_s - 0.05) * NANOSECONDS)
        for message, _ in self.bag.read(JOINT_STATES.name, from_ns):
            at_s = nanoseconds(message.header.stamp) / NANOSECONDS
            if not times or at_s > times[-1]:
                times.append(at_s)
                positions.append(message.position)
                velocities.append(message.velocity)
        commands = {
            int(message.layout.dim[0].label) / NANOSECONDS: np.array(message.data)
            for message, _ in self.bag.read(JOINT_COMMAND.name, from_ns)
        }
        twists = {}
        for message, _ in self.bag.read(TWIST_COMMAND.name, from_ns):
            v = message.twist.linear
            twists[nanoseconds(message.header.stamp) / NANOSECONDS] = np.array([v.x, v.y, v.z])
        hand = [
            nanoseconds(message.header.stamp) / NANOSECONDS
            for message, _ in self.bag.read(HAND_POSE.name, from_ns)
        ]
        return Recorded(
            np.array(times), np.array(positions), np.array(velocities), commands, twists, hand
        )  # fmt: skip

    def check(self, found: Recorded) -> None:
        """Hold all that the bag tells against what no fault may break."""
        limits = self.scenario.robot.limits
        assert np.isfinite(found.joint_velocities).all()
        assert np.all(np.abs(found.joint_velocities) <= 1.01 * limits.velocity)
        assert np.all(found.joint_positions <= limits.upper + 1e-3)
        assert np.all(found.joint_positions >= limits.lower - 1e-3)
        spans = np.diff(found.times)[:, None]
        change = np.abs(np.diff(found.joint_velocities, axis=0))
        # a reset puts the arm back at once
        still = np.abs(found.joint_velocities[1:]).max(axis=1) < 1e-9
        excess = (change / (limits.acceleration * spans)).max(axis=1)
        assert excess[~still].max(initial=0.0) < 1.05, 'the arm accelerates beyond its limits'
        for values in (*found.commands.values(), *found.twists.values()):
            assert np.isfinite(values).all()
        for command in found.commands.values():
            assert np.all(np.abs(command) <= limits.velocity * (1 + 1e-6))
        at = sorted(found.twists)
        for before, now in pairwise(at):
            if now - before < 1.5 * PERIOD_S:
                change = float(np.linalg.norm(found.twists[now] - found.twists[before]))
                assert change <= WRIST_ACCELERATION * PERIOD_S * 1.001


@pytest.fixture(scope='class')
def bench(tmp_path_factory: pytest.TempPathFactory, scenario: Scenario) -> Iterator[Bench]:
    from handover_dmp.nodes.run_graph import graph_parameters

    folder = tmp_path_factory.mktemp('faults')
    keep_inputs(folder, scenario)
    parameters = graph_parameters(folder, scenario, {'by': 'a test'}, True)
    prepare_for_faults(parameters, SHORT_PATIENCE_S)
    with Graph(folder, parameters) as graph:
        graph.pause(False)
        bench = Bench(graph, folder, scenario)
        yield bench
        bench.neighbour.close()


class TestWholeGraph:
    """One graph for all of these, which ends before the other tests start theirs."""

    def test_a_killed_tracker_stops_the_arm_until_it_is_back(self, bench: Bench) -> None:
        bench.reach()
        begun_s = bench.graph.time_s
        bench.kill('hand_tracker')
        bench.wait_sim(0.8)
        stopped = bench.recorded(begun_s)
        last_s = stopped.hand[-1]
        stands_s = stopped.stands_at(last_s) - last_s
        print(f'stands {stands_s:.3f} s after')
        assert stopped.speed(last_s, last_s + 0.02) > 0.1, 'in mid-motion'
        assert stands_s <= HAND_TIMEOUT_S + BRAKING_S
        again_s = bench.graph.time_s
        bench.start_again('hand_tracker')
        bench.neighbour.tell('/hand_tracker/replay')
        bench.finish()
        bench.recorded(again_s)

    def test_a_killed_dmp_stops_the_arm_which_moves_on_only_when_told(self, bench: Bench) -> None:
        bench.reach()
        begun_s = bench.graph.time_s
        bench.kill('dmp')
        bench.wait_sim(0.8)
        stopped = bench.recorded(begun_s)
        last_s = max(stopped.twists)
        stands_s = stopped.stands_at(last_s) - last_s
        print(f'stands {stands_s:.3f} s after')
        assert stopped.speed(last_s, last_s + 0.02) > 0.1, 'in mid-motion'
        assert stands_s <= COMMAND_TIMEOUT_S + BRAKING_S
        again_s = bench.graph.time_s
        bench.start_again('dmp', "value='idle'")
        bench.wait_sim(0.5)
        assert bench.recorded(again_s).speed(again_s) < STILL_RAD_S, 'not told to move'
        bench.neighbour.tell('/dmp/start')
        bench.finish()
        bench.recorded(again_s)

    @pytest.mark.slow
    def test_a_stalled_dmp_stops_the_arm_which_moves_on_only_when_told(self, bench: Bench) -> None:
        bench.reach()
        begun_s = bench.graph.time_s
        bench.signal('dmp', signal.SIGSTOP)
        bench.wait_sim(0.9)
        bench.signal('dmp', signal.SIGCONT)
        again_s = bench.graph.time_s
        bench.wait_sim(0.6)
        found = bench.recorded(begun_s)
        last_s = last_before_a_gap(found.twists)
        stands_s = found.stands_at(last_s) - last_s
        print(f'stands {stands_s:.3f} s after')
        assert found.speed(last_s, last_s + 0.02) > 0.1, 'in mid-motion'
        assert stands_s <= COMMAND_TIMEOUT_S + BRAKING_S
        assert found.speed(again_s) < STILL_RAD_S, 'not told to move'
        assert bench.graph.state == 'aborted'
        bench.neighbour.tell('/dmp/start')
        bench.finish()

    @pytest.mark.parametrize('how', ['killed', pytest.param('stalled', marks=pytest.mark.slow)])
    def test_without_priority_ik_the_arm_brakes_by_itself_and_moves_on_only_when_told(
        self, bench: Bench, how: str
    ) -> None:
        bench.reach()
        begun_s = bench.graph.time_s
        if how == 'killed':
            bench.kill('priority_ik')
        else:
            bench.signal('priority_ik', signal.SIGSTOP)
        bench.neighbour.set_parameter('robot_sim', 'patience_s', 0.05)
        bench.wait_sim(0.7)
        said = bench.neighbour.diagnosis('robot_sim', 'stopped: no command for 0.500 s')
        assert "key='timeouts', value='1'" in str(said)
        bench.neighbour.set_parameter('robot_sim', 'patience_s', 20.0)
        if how == 'killed':
            bench.start_again('priority_ik')
        else:
            bench.signal('priority_ik', signal.SIGCONT)
        again_s = bench.graph.time_s
        answers = bench.neighbour.hear(JOINT_COMMAND)
        bench.neighbour.until(lambda: len(answers) > 20)
        bench.wait_sim(0.5)
        found = bench.recorded(begun_s)
        last_s = last_before_a_gap(found.commands)
        stands_s = found.stands_at(last_s) - last_s
        print(f'stands {stands_s:.3f} s after')
        assert found.speed(last_s, last_s + 0.02) > 0.1, 'in mid-motion'
        assert COMMAND_TIMEOUT_S < stands_s <= COMMAND_TIMEOUT_S + BRAKING_S
        assert found.speed(again_s) < STILL_RAD_S, 'not told to move'
        bench.neighbour.tell('/robot_sim/resume')
        bench.neighbour.tell('/dmp/start')
        bench.finish()
        bench.recorded(again_s)

    def test_a_stalled_robot_sim_stops_time_and_nothing_jumps(self, bench: Bench) -> None:
        bench.reach()
        begun_s = bench.graph.time_s
        bench.signal('robot_sim', signal.SIGSTOP)
        bench.neighbour.spin(1.0)
        bench.signal('robot_sim', signal.SIGCONT)
        bench.finish()
        bench.recorded(begun_s)

    def test_paused_time_moves_nothing(self, bench: Bench) -> None:
        clocks = bench.neighbour.hear(CLOCK)
        bench.reach()
        begun_s = bench.graph.time_s
        bench.graph.pause(True)
        clocks.clear()
        # what was under way is heard once the same period is asked for again and again
        bench.neighbour.until(lambda: len(clocks) > 2 and clocks[-1] == clocks[-3])
        paused = clocks[-1]
        bench.neighbour.spin(0.5)
        assert clocks[-1] == paused
        bench.graph.pause(False)
        bench.finish()
        bench.recorded(begun_s)

    def test_changing_parameters_in_motion_does_not_jump(self, bench: Bench) -> None:
        kept = {name: defaults('dmp')[name] for name in ('stiffness', 'mu', 'acceleration_limit')}
        bench.reset()
        bench.neighbour.set_parameter('robot_sim', 'real_time_factor', 0.2)
        begun_s = bench.graph.time_s
        bench.neighbour.tell('/hand_tracker/replay')
        assert bench.graph.wait_for_state(('reaching',), MAX_S, lambda: None)
        changes = 0
        while bench.graph.state == 'reaching':
            for name, value in (
                ('stiffness', 200.0 + 50.0 * (changes % 3)),
                ('mu', 0.5 + 0.1 * (changes % 4)),
                ('acceleration_limit', 20.0 - 5.0 * (changes % 2)),
            ):
                bench.neighbour.set_parameter('dmp', name, value)
            bench.neighbour.set_parameter(
                'priority_ik', 'braking_share', 0.25 + 0.05 * (changes % 2)
            )
            changes += 1
        bench.neighbour.set_parameter('robot_sim', 'real_time_factor', 1.0)
        for name, value in kept.items():
            bench.neighbour.set_parameter('dmp', name, value)
        bench.neighbour.set_parameter('priority_ik', 'braking_share', 0.25)
        bench.finish()
        assert changes > 3
        assert bench.recorded(begun_s).speed(begun_s) > MOVING_RAD_S
        places = {
            nanoseconds(message.header.stamp): message.pose.position
            for message, _ in bench.bag.read(POSE_COMMAND.name)
        }
        way = [(t, places[t]) for t in sorted(places) if t / NANOSECONDS > begun_s]
        assert len(way) > 100
        for (t0, a), (t1, b) in pairwise(way):
            apart_m = np.linalg.norm([b.x - a.x, b.y - a.y, b.z - a.z])
            assert apart_m < 2.5 * (t1 - t0) / NANOSECONDS + 0.005

    def test_a_killed_recorder_changes_nothing_and_its_bag_is_repaired(self, bench: Bench) -> None:
        schedule = Path(f'/proc/{bench.graph.processes["recorder"].pid}/schedstat')

        def clock_s() -> float:
            """Tell the time, without that in which others kept the recorder from its work."""
            return time.monotonic() - int(schedule.read_text().split()[1]) / NANOSECONDS

        heard, hearing = bench.neighbour.hear_times(JOINT_STATES, clock_s)
        bench.reach()
        killed_s = clock_s()
        bench.neighbour.node.destroy_subscription(hearing)
        bench.kill('recorder')
        bench.finish()
        bag = bench.folder / 'bag'
        before = (bag / 'bag_0.mcap').stat().st_size
        bench.graph.start('recorder')
        process = bench.graph.processes.pop('recorder')
        assert process.wait(WAIT_S) == 1, 'a bag that exists is not overwritten'
        assert 'exists' in (bench.folder / 'logs' / 'recorder.log').read_text()
        assert (bag / 'bag_0.mcap').stat().st_size == before
        repair_bag(bag)
        stamps = {
            nanoseconds(message.header.stamp)
            for _, message, _ in read_bag(bag, [JOINT_STATES.name])
        }
        lost_s = [at_s for stamp_ns, at_s in heard.items() if stamp_ns > max(stamps)]
        first_s = min(lost_s, default=killed_s)
        print(
            f'{len(lost_s)} of {len(heard)} periods lost, of the last {killed_s - first_s:.3f} s'
        )
        assert first_s > killed_s - 1.0


def test_a_full_disk_ends_the_recording_and_not_the_handover(prepare: Any) -> None:
    folder, parameters = prepare()
    with (
        pytest.raises(GraphError, match='recorder ended with code 1'),
        Graph(folder, parameters) as graph,
    ):
        graph.pause(False)
        assert graph.wait_for_state(('reaching',), MAX_S, lambda: None)
        written = (folder / 'bag' / 'bag_0.mcap').stat().st_size
        recorder = graph.processes['recorder'].pid
        room = resource.prlimit(recorder, resource.RLIMIT_FSIZE)
        resource.prlimit(recorder, resource.RLIMIT_FSIZE, (written + 20_000, room[1]))
        neighbour = Neighbour(graph)
        assert graph.wait_for_state(('done',), MAX_S, lambda: None)
        assert 'File too large' in neighbour.diagnosis('recorder', 'recording stopped').message
        neighbour.close()
        # it is over for good, also with room again
        resource.prlimit(recorder, resource.RLIMIT_FSIZE, room)
    log = (folder / 'logs' / 'recorder.log').read_text()
    assert log.count('recording ended') == 1
    assert 'Traceback' not in log
    repair_bag(folder / 'bag')
    assert sum(1 for _ in read_bag(folder / 'bag')) > 0


@pytest.mark.slow
def test_twenty_handovers_in_a_row_are_alike_and_leave_nothing_behind(
    tmp_path: Path, scenario: Scenario
) -> None:
    from handover_dmp.nodes.run_graph import graph_parameters

    keep_inputs(tmp_path, scenario)
    parameters = graph_parameters(tmp_path, scenario, {'by': 'a test'}, True)
    parameters['hand_tracker']['replay_at_s'] = -1.0
    ends, resident = [], []
    with Graph(tmp_path, parameters) as graph:
        processes = {name: psutil.Process(p.pid) for name, p in graph.processes.items()}
        graph.pause(False)
        bench = Bench(graph, tmp_path, scenario)
        for _ in range(20):
            bench.reset()
            bench.neighbour.tell('/hand_tracker/replay')
            bench.finish()
            bench.joints.clear()
            bench.neighbour.until(lambda: bench.joints)
            ends.append(list(bench.joints[-1].position))
            resident.append({name: p.memory_info().rss for name, p in processes.items()})
        shared = {path for p in processes.values() for path in shared_memory_of(p.pid)}
        bench.neighbour.close()
    apart = float(np.abs(np.array(ends) - ends[0]).max())
    growth = {name: resident[-1][name] / resident[4][name] - 1.0 for name in processes}
    print(f'apart by {apart:.2e} rad; memory grew by {growth}')
    assert apart < 0.01
    assert max(growth.values()) < 0.05
    assert not any(process.is_running() for process in processes.values())
    assert [path for path in shared if path.exists()] == []


def joint_states(positions: list[float], names: list[str], now: Any) -> JointState:
    message = JointState(name=names, position=positions, velocity=[0.0] * len(positions))
    message.header.stamp = now
    return message


def test_joint_states_that_make_no_sense_stop_priority_ik_which_says_why(
    prepare: Any, scenario: Scenario
) -> None:
    folder, parameters = prepare(lockstep=False)
    names = list(scenario.robot.joint_names)
    home = scenario.q_start.tolist()
    with Graph(folder, parameters, lockstep=False, nodes=('priority_ik',)) as graph:
        neighbour = Neighbour(graph)
        answers, poses = neighbour.hear(JOINT_COMMAND), neighbour.hear(WRIST_POSE)
        say = neighbour.speaker(JOINT_STATES)

        def say_all(
            states: Callable[[], JointState], *words: str, answered: bool = False
        ) -> tuple[int, int]:
            """Say at least 40, until the node has said certain words; count its answers."""
            said = neighbour.diagnosed.setdefault('priority_ik', [])
            # what was said before gets too old to be answered
            neighbour.spin(0.3)
            said.clear()
            for heard in (answers, poses):
                heard.clear()
            end_s = time.monotonic() + WAIT_S
            times = 0
            while (
                times < 40
                or not any(all(w in str(status) for w in words) for status in said)
                or (answered and min(len(answers), len(poses)) < 20)
            ):
                say(states())
                times += 1
                neighbour.spin(0.005)
                assert time.monotonic() < end_s, neighbour.said()
            return len(answers), len(poses)

        def now() -> Any:
            return neighbour.node.get_clock().now().to_msg()

        say_all(lambda: joint_states(home, names, now()), 'no wrist command yet', answered=True)
        assert not any(np.any(message.data) for message in answers)
        say_all(
            lambda: joint_states([*home[::-1], 9.0], [*names[::-1], 'gripper'], now()),
            'no wrist command yet',
            answered=True,
        )
        place = poses[-1].pose.position
        expected = scenario.robot.wrist_pose(scenario.q_start)[0]
        assert np.allclose([place.x, place.y, place.z], expected, atol=1e-9)
        for states, fault in (
            (lambda: joint_states(home[1:], names[1:], now()), f'joint states lack {names[0]}'),
            (lambda: joint_states([nan, *home[1:]], names, now()), 'positions are not finite'),
            (lambda: joint_states(home[1:], names, now()), '7 names, but 6 positions'),
            (lambda: joint_states(home, [*names[1:], names[1]], now()), f'lack {names[0]}'),
        ):
            # the first of them may answer what came before
            answered, shown = say_all(states, fault)
            assert max(answered, shown) <= 1, fault
        say_all(lambda: joint_states(home, names, now()), 'no wrist command yet')
        answers.clear()
        neighbour.diagnosis('priority_ik', 'joint states are', 's old')
        answers.clear()
        neighbour.spin(0.3)
        assert answers == [], 'commands on stale joint states'
        neighbour.close()


def test_wrong_commands_are_refused_or_clipped_and_told(prepare: Any, scenario: Scenario) -> None:
    # a busy machine may pause this test for longer than the arm waits otherwise
    folder, parameters = prepare(lockstep=False, robot_sim={'command_timeout_s': 10.0})
    limits = scenario.robot.limits
    with Graph(folder, parameters, lockstep=False, nodes=('robot_sim',)) as graph:
        neighbour = Neighbour(graph)
        states = neighbour.hear(JOINT_STATES)
        say = neighbour.speaker(JOINT_COMMAND)

        def told(data: list[float], *words: str, label: str = '') -> None:
            said = neighbour.diagnosed.setdefault('robot_sim', [])
            said.clear()
            message = Float64MultiArray(data=data)
            if label:
                message.layout.dim = [MultiArrayDimension(label=label)]
            end_s = time.monotonic() + WAIT_S
            while not any(all(w in str(status) for w in words) for status in said):
                say(message)
                neighbour.spin(0.005)
                assert time.monotonic() < end_s, neighbour.said()

        told([0.0] * 6, 'shape (6,) for 7 joints')
        told([], 'shape (0,) for 7 joints')
        told([0.1] * 6 + [nan], 'numbers that are not finite')
        told([float('inf')] * 7, 'numbers that are not finite')
        still = np.array([state.position for state in states])
        assert np.ptp(still, axis=0).max() < 1e-6, 'what is refused moves nothing'
        told([0.0] * 7, "key='accepted'", label='9' * 5000)
        states.clear()
        told([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e6], 'commanded to 1e+06 rad/s')
        speeds = np.abs([state.velocity for state in states])
        assert np.all(speeds <= 1.01 * limits.velocity)
        # a flood, as fast as it goes
        neighbour.until(lambda: all(v == 0.0 for v in map(round, states[-1].velocity)))
        before = len(states)
        message = Float64MultiArray(data=[0.05] + [0.0] * 6)
        begun_s, sent = time.monotonic(), 0
        while time.monotonic() < begun_s + 1.0:
            for _ in range(100):
                say(message)
            sent += 100
            neighbour.spin()
        print(f'{sent} commands in {time.monotonic() - begun_s:.2f} s')
        neighbour.until(lambda: len(states) > before + 50)
        positions = np.array([state.position for state in states])
        velocities = np.array([state.velocity for state in states])
        assert np.isfinite(positions).all()
        assert np.all(positions >= limits.lower - 1e-3)
        assert np.all(positions <= limits.upper + 1e-3)
        assert np.all(np.abs(velocities) <= 1.01 * limits.velocity)
        neighbour.diagnosis('robot_sim', "key='last_fault'")
        neighbour.close()


class Partner:
    """The world around a `dmp` that is alone: hand, wrist and time, as a test will have them."""

    def __init__(self, neighbour: Neighbour, scenario: Scenario) -> None:
        self.neighbour = neighbour
        self.scenario = scenario
        self.wrist = scenario.robot.wrist_pose(scenario.q_start)[0]
        self.poses = neighbour.hear(POSE_COMMAND)
        self.twists = neighbour.hear(TWIST_COMMAND)
        self._say_hand = neighbour.speaker(HAND_POSE)
        self._say_wrist = neighbour.speaker(WRIST_POSE)
        self._say_status = neighbour.speaker(IK_STATUS)
        self.way: list[np.ndarray] = []
        self.velocities: list[np.ndarray] = []

    def period(self, time_s: float, *, stamp_s: float | None = None, frame: str = 'world') -> None:
        """Let a period pass, as the other nodes would; the arm follows the command at once."""
        time_ns = round(time_s * NANOSECONDS)
        stamp_ns = time_ns if stamp_s is None else round(stamp_s * NANOSECONDS)
        place = self.scenario.trial.partner[0] + [0.05 * np.sin(2.0 * time_s), 0.0, 0.0]
        hand = pose_message(stamp(max(0, stamp_ns)), place)
        hand.header.frame_id = frame
        end_s = time.monotonic() + WAIT_S

        def answered() -> bool:
            heard = (self.poses, self.twists)
            return all(h and nanoseconds(h[-1].header.stamp) == time_ns for h in heard)

        while not answered():
            # both again, as they may be lost, and are where `dmp` has not found this test yet
            self._say_hand(hand)
            self._say_wrist(pose_message(stamp(time_ns), self.wrist))
            again_s = time.monotonic() + (0.03 if self.way else 0.2)
            while time.monotonic() < again_s and not answered():
                self.neighbour.spin()
            assert time.monotonic() < end_s, self.neighbour.said()
        pose, twist = self.poses[-1].pose.position, self.twists[-1].twist.linear
        self.wrist = np.array([pose.x, pose.y, pose.z])
        self.way.append(self.wrist)
        self.velocities.append(np.array([twist.x, twist.y, twist.z]))
        self._say_status(to_float_array({'speed_scale': 1.0, 'time_s': time_s}))

    def check(self) -> float:
        """Hold the commands to their limits; tell how fast the last one is, m/s."""
        change = np.linalg.norm(np.diff(self.velocities, axis=0), axis=1)
        assert np.isfinite(self.way).all()
        assert change.max() <= WRIST_ACCELERATION * PERIOD_S * 1.001
        assert np.linalg.norm(np.diff(self.way, axis=0), axis=1).max() < 0.01
        return float(np.linalg.norm(self.velocities[-1]))


def test_time_that_jumps_and_a_tracker_that_lies_move_nothing_suddenly(
    prepare: Any, scenario: Scenario
) -> None:
    # with the partner model the third reach would be over before it is looked at
    folder, parameters = prepare(dmp={'patience_s': SHORT_PATIENCE_S, 'partner_model': 'off'})
    with Graph(folder, parameters, nodes=('dmp',)) as graph:
        neighbour = Neighbour(graph)
        partner = Partner(neighbour, scenario)
        now_s = 100.0

        def pass_time(duration_s: float, **hand: Any) -> float:
            nonlocal now_s
            for _ in range(round(duration_s / PERIOD_S)):
                offset_s = hand.get('offset_s', 0.0)
                partner.period(now_s, stamp_s=now_s + offset_s, frame=hand.get('frame', 'world'))
                now_s += PERIOD_S
            return partner.check()

        def reach() -> None:
            neighbour.tell('/dmp/start')
            assert pass_time(0.5) > 0.05, 'in motion'

        pass_time(0.1)
        for wrong, word in (
            ({'frame': 'camera'}, "hand in frame 'camera'"),
            ({'offset_s': 10.0}, 'other_time'),
            ({'offset_s': -10.0}, 'other_time'),
        ):
            reach()
            said = neighbour.diagnosed.setdefault('dmp', [])
            said.clear()
            assert pass_time(0.2, **wrong) == 0.0, 'braked'
            # a slow machine may tell of it once while that time passes, and not again
            neighbour.until(lambda said=said, word=word: any(word in str(one) for one in said))
            assert pass_time(0.4) > 0.01, 'and goes on'
            neighbour.tell('/dmp/abort')
            pass_time(0.1)
        for jump_s in (50.0, -50.0):
            reach()
            now_s += jump_s
            assert pass_time(0.3) == 0.0, 'braked'
            neighbour.until(lambda: graph.state == 'aborted')
        partner._say_status(Float64MultiArray(data=[nan]))
        reach()
        neighbour.close()
