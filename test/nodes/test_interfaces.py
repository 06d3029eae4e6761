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

"""Parameters, services, diagnostics and quality of service of the running graph."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
import math
from pathlib import Path
import time
from typing import Any

from handover_dmp.common.errors import UsageError
from handover_dmp.handover.scenario import Scenario
from handover_dmp.nodes.conversions import values_of
from handover_dmp.nodes.dmp import Dmp, PRIMITIVE
from handover_dmp.nodes.graph import Graph
from handover_dmp.nodes.hand_tracker import HandTracker
from handover_dmp.nodes.parameters import COMMON, declare, on_change
from handover_dmp.nodes.priority_ik import PriorityIkNode
from handover_dmp.nodes.qos import is_installed, message_class, qos_profile
from handover_dmp.nodes.recorder import Recorder
from handover_dmp.nodes.robot_sim import POSTURE, RobotSim
from handover_dmp.nodes.run_graph import graph_parameters
from handover_dmp.nodes.tracker_parameters import of
from handover_dmp.runs.folder import keep_inputs
from handover_dmp.topics import (
    DIAGNOSTICS,
    HAND_POSE,
    MARKERS,
    OPTIONAL,
    PHASE,
    POSE_COMMAND,
    Quality,
    STATE,
    TF,
    TF_STATIC,
    Topic,
    TOPICS,
    TWIST_COMMAND,
    WRIST_POSE,
)
import pytest
from rcl_interfaces.msg import ParameterType, SetParametersResult
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParametersAtomically,
)
import rclpy
from rclpy.parameter import Parameter as RosParameter
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
import yaml

pytestmark = [pytest.mark.ros, pytest.mark.timeout(300)]

QUEUE = 2000
AT_START_M = 0.05
OF_ROS = ('use_sim_time', 'start_type_description_service')
NODES = (RobotSim, HandTracker, Dmp, PriorityIkNode, Recorder)


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory, scenario: Scenario) -> Iterator[Graph]:
    folder: Path = tmp_path_factory.mktemp('graph')
    keep_inputs(folder, scenario)
    parameters = graph_parameters(folder, scenario, {'a': {'b': [1, "it's"]}}, lockstep=False)
    with Graph(folder, parameters, lockstep=False) as running:
        yield running


def ask(graph: Graph, kind: Any, service: str, request: Any) -> Any:
    client = graph.node.create_client(kind, service)
    end = time.monotonic() + 60.0
    while not client.service_is_ready():
        graph.spin(0.02)
        assert time.monotonic() < end, service
    future = client.call_async(request)
    while not future.done():
        graph.spin(0.02)
        assert time.monotonic() < end, service
    graph.node.destroy_client(client)
    return future.result()


def set_together(graph: Graph, node: str, **values: Any) -> Any:
    request = SetParametersAtomically.Request()
    request.parameters = [
        RosParameter(name, value=value).to_parameter_msg() for name, value in values.items()
    ]
    return ask(
        graph, SetParametersAtomically, f'/{node}/set_parameters_atomically', request
    ).result


@contextmanager
def hearing(graph: Graph, *topics: Topic) -> Iterator[list[list[Any]]]:
    """Hear all that is said on topics, if late where the machine is busy."""
    heard: list[list[Any]] = [[] for _ in topics]
    subscriptions = []
    for topic, messages in zip(topics, heard, strict=True):
        queue = qos_profile(topic.quality)
        queue.depth = QUEUE
        subscriptions.append(
            graph.node.create_subscription(
                message_class(topic.type_name), topic.name, messages.append, queue
            )
        )
    try:
        yield heard
    finally:
        for subscription in subscriptions:
            graph.node.destroy_subscription(subscription)


def catch_up(graph: Graph, *heard: list[Any]) -> None:
    """Wait until all has been heard that was said up to now."""
    now_s, end_s = graph.node.get_clock().now().nanoseconds / 1e9, time.monotonic() + 60.0
    while not all(messages and stamp_s(messages[-1]) > now_s for messages in heard):
        graph.spin(0.02)
        assert time.monotonic() < end_s


def stamp_s(message: Any) -> float:
    stamp = (message.markers[0] if hasattr(message, 'markers') else message).header.stamp
    return float(stamp.sec + stamp.nanosec * 1e-9)


def latched(graph: Graph, topic: Topic) -> Any:
    """Hear what was said before."""
    with hearing(graph, topic) as (heard,):
        end_s = time.monotonic() + 60.0
        while not heard:
            graph.spin(0.02)
            assert time.monotonic() < end_s, topic.name
    return heard[-1].data


@pytest.mark.parametrize('node', NODES, ids=lambda node: node.NAME)
def test_every_parameter_is_described(graph: Graph, node: Any) -> None:
    own = COMMON + node.PARAMETERS + {Dmp: PRIMITIVE, RobotSim: POSTURE}.get(node, ())
    own += tuple(replace(kind, name=of('tracker', kind.name)) for kind in node.OF_EACH_TRACKER)
    known = {parameter.name: parameter for parameter in own}
    listed = ask(graph, ListParameters, f'/{node.NAME}/list_parameters', ListParameters.Request())
    names = [name for name in listed.result.names if name not in OF_ROS]
    assert set(known) == set(names)
    request = DescribeParameters.Request(names=names)
    answer = ask(graph, DescribeParameters, f'/{node.NAME}/describe_parameters', request)
    assert [d.name for d in answer.descriptors] == names
    for descriptor in answer.descriptors:
        assert descriptor.description, descriptor.name
        assert descriptor.read_only == known[descriptor.name].read_only, descriptor.name
        if descriptor.type == ParameterType.PARAMETER_DOUBLE:
            assert descriptor.floating_point_range, descriptor.name
        if descriptor.type == ParameterType.PARAMETER_INTEGER:
            assert descriptor.integer_range, descriptor.name
    # in one request, as `ros2 param dump` asks: one that had no value would leave all without
    request = GetParameters.Request(names=names)
    values = ask(graph, GetParameters, f'/{node.NAME}/get_parameters', request).values
    assert len(values) == len(names)
    assert ParameterType.PARAMETER_NOT_SET not in {value.type for value in values}


def test_parameters_of_one_request_are_taken_together_or_not_at_all(graph: Graph) -> None:
    assert set_together(graph, 'dmp', stiffness=300.0, mu=0.6).successful
    refused = set_together(graph, 'dmp', stiffness=150.0, formulation='no such')
    assert not refused.successful
    assert 'no such' in refused.reason
    refused = set_together(graph, 'dmp', stiffness=150.0, sigma=-1.0)
    assert not refused.successful
    refused = set_together(graph, 'dmp', stiffness=150.0, model='another.json')
    assert not refused.successful
    request = GetParameters.Request(names=['stiffness', 'mu', 'formulation'])
    values = ask(graph, GetParameters, '/dmp/get_parameters', request).values
    assert values[0].double_value == 300.0
    assert values[1].double_value == 0.6
    assert values[2].string_value == 'stiff'
    assert set_together(graph, 'priority_ik', orientation='level', separation=True).successful
    assert not set_together(graph, 'priority_ik', orientation='none', braking_share=7.0).successful
    assert set_together(graph, 'priority_ik', orientation='none', separation=False).successful
    # a bare off, as YAML reads it
    assert set_together(graph, 'dmp', partner_model=False).successful
    assert 'auto, off' in set_together(graph, 'dmp', partner_model=True).reason
    assert set_together(graph, 'dmp', partner_model='auto').successful
    assert set_together(graph, 'robot_sim', real_time_factor=2.0).successful
    assert 'at the start' in set_together(graph, 'dmp', use_sim_time=True).reason


def test_nothing_of_a_request_that_anybody_refuses_is_applied(graph: Graph) -> None:
    node = rclpy.create_node('someone', context=graph.node.context, use_global_arguments=False)
    names = ('stiffness', 'mu')
    parameters = [parameter for parameter in PRIMITIVE if parameter.name in names]
    declare(node, parameters, defaults_from={'stiffness': 200.0, 'mu': 0.75})
    applied: list[dict[str, Any]] = []

    def prepare(values: dict[str, Any]) -> Any:
        if values['mu'] < 0.1:
            raise UsageError('mu')
        return lambda: applied.append(values)

    def set_(**values: float) -> bool:
        requested = [RosParameter(name, value=value) for name, value in values.items()]
        return bool(node.set_parameters_atomically(requested).successful)

    willing = True

    def judge(_requested: list[RosParameter]) -> SetParametersResult:
        return SetParametersResult(successful=willing)

    try:
        node.add_on_set_parameters_callback(judge)
        on_change(node, parameters, prepare)
        assert set_(stiffness=300.0)
        assert applied == [{'stiffness': 300.0, 'mu': 0.75}]
        willing = False
        assert not set_(stiffness=400.0)
        willing = True
        assert not set_(stiffness=400.0, mu=0.05)
        assert len(applied) == 1
        assert set_(mu=0.6)
        assert applied[1:] == [{'stiffness': 300.0, 'mu': 0.6}]
    finally:
        node.destroy_node()


def test_pose_and_twist_of_one_command_carry_the_same_stamp(graph: Graph) -> None:
    with hearing(graph, POSE_COMMAND, TWIST_COMMAND) as (poses, twists):
        catch_up(graph, poses, twists)  # the one may be heard long before the other
        poses.clear()
        twists.clear()
        end = time.monotonic() + 20.0
        while min(len(poses), len(twists)) < 50 and time.monotonic() < end:
            graph.spin(0.02)
    stamps = [{(m.header.stamp.sec, m.header.stamp.nanosec) for m in h} for h in (poses, twists)]
    assert len(stamps[0] & stamps[1]) > 0.8 * len(stamps[0])
    assert {message.header.frame_id for message in poses + twists} == {'world'}


def test_topics_have_the_type_and_quality_of_the_table(graph: Graph) -> None:
    for topic in TOPICS:
        offered = graph.node.get_publishers_info_by_topic(topic.name)
        # the recorder writes the one itself, and on the wall clock nobody makes a time
        unsent = topic in (TF, TF_STATIC) and not is_installed(topic.type_name)
        if topic.name in ('/handover/info', '/clock') or topic in OPTIONAL or unsent:
            assert not offered, topic.name
            continue
        assert offered, topic.name
        for info in offered:
            assert info.topic_type == topic.type_name
            wanted = qos_profile(topic.quality)
            assert info.qos_profile.reliability == wanted.reliability, topic.name
            assert info.qos_profile.durability == wanted.durability, topic.name
    assert {topic.quality for topic in TOPICS} == set(Quality)


def test_what_is_latched_reaches_a_late_listener(graph: Graph) -> None:
    from handover_dmp.topics import ROBOT_DESCRIPTION

    assert '<robot' in latched(graph, ROBOT_DESCRIPTION)
    assert latched(graph, STATE) in ('idle', 'done')


def test_every_node_tells_its_condition(graph: Graph) -> None:
    nodes = {node.NAME for node in NODES}
    told: dict[str, set[str]] = {node: set() for node in nodes}
    periodic = ('robot_sim', 'hand_tracker', 'dmp', 'priority_ik')
    of_periods = {'rate (Hz)', 'period error, 99 % (ms)', 'overruns'}

    def is_told() -> bool:
        # where the machine stood still, a second has no periods to tell of
        return all(told.values()) and all(of_periods <= told[node] for node in periodic)

    with hearing(graph, DIAGNOSTICS) as (heard,):
        end_s = time.monotonic() + 30.0
        while not is_told():
            assert time.monotonic() < end_s, told
            graph.spin(0.02)
            for status in (status for message in heard for status in message.status):
                values = {value.key: value.value for value in status.values}
                if values['stage'] == 'running':
                    told[status.name] |= set(values)
    assert set(told) == nodes
    assert {'age of the hand (s)', 'age of the wrist (s)'} <= told['dmp']
    inputs = {f'age of the {name} (s)' for name in ('joint states', 'wrist command', 'hand')}
    assert inputs | {'active limits'} <= told['priority_ik']
    assert 'age of the joint command (s)' in told['robot_sim']


@pytest.mark.parametrize('kind', NODES, ids=lambda node: node.NAME)
def test_a_dump_loads_again_and_changes_nothing(graph: Graph, kind: Any, tmp_path: Path) -> None:
    """What `ros2 param dump` and `ros2 param load` do."""
    client = AsyncParameterClient(graph.node, f'/{kind.NAME}')

    def answer(asked: Any) -> Any:
        while not asked.done():
            graph.spin(0.02)
        return asked.result()

    assert client.wait_for_services(60.0)
    names = sorted(answer(client.list_parameters()).result.names)

    def dump() -> dict[str, Any]:
        values = answer(client.get_parameters(names)).values
        told = map(parameter_value_to_python, values)
        plain = [list(value) if isinstance(value, array) else value for value in told]
        return dict(zip(names, plain, strict=True))

    before = dump()
    file = tmp_path / 'dump.yaml'
    file.write_text(yaml.dump({f'/{kind.NAME}': {'ros__parameters': before}}), encoding='utf-8')
    results = answer(client.load_parameter_file(str(file))).results
    refused = [(n, r.reason) for n, r in zip(names, results, strict=True) if not r.successful]
    assert not refused
    assert dump() == before


def settle(graph: Graph) -> None:
    """Bring the arm back to its start, ready, whatever a stalled machine has stopped."""
    for service in ('/dmp/reset', '/robot_sim/reset', '/robot_sim/resume'):
        graph.call(service)
    assert graph.wait_for_state(('idle',), 30.0, lambda: None), graph.state
    with hearing(graph, POSE_COMMAND, WRIST_POSE) as (commands, wrists):
        catch_up(graph, commands, wrists)
        end_s = time.monotonic() + 30.0
        while (
            math.dist(*(place(each[-1].pose.position) for each in (commands, wrists))) > AT_START_M
        ):
            graph.spin(0.02)
            assert time.monotonic() < end_s


def handovers(graph: Graph) -> Iterator[None]:
    """Be ready for a handover, again where a stalled machine has broken off the one before."""
    for _ in range(5):
        settle(graph)
        yield
    pytest.fail('never handed over')


def test_services_lead_through_the_states(graph: Graph) -> None:
    def until(*states: str) -> None:
        assert graph.wait_for_state(states, 30.0, lambda: None), graph.state

    settle(graph)
    graph.call('/dmp/start')
    until('reaching', 'aborted')
    if graph.state == 'reaching':
        with pytest.raises(Exception, match='handover is active'):
            graph.call('/dmp/start')
    graph.call('/dmp/abort')
    until('aborted')
    graph.call('/dmp/reset')
    until('idle')
    for _ in handovers(graph):
        graph.call('/hand_tracker/replay')
        if graph.wait_for_state(('done',), 8.0, lambda: None):
            return


def test_markers_show_where_hand_and_wrist_are_and_were(graph: Graph) -> None:
    for _ in handovers(graph):
        with (
            hearing(graph, MARKERS, HAND_POSE, WRIST_POSE) as (markers, hands, wrists),
            hearing(graph, PHASE) as (phases,),
        ):
            graph.call('/hand_tracker/replay')
            done = graph.wait_for_state(('done',), 8.0, lambda: None)
            catch_up(graph, markers, hands, wrists)
            last = {marker.ns: marker for marker in markers[-1].markers}
            settle(graph)
            catch_up(graph, markers)
        if done:
            break
    assert {name for name, marker in last.items() if marker.action == marker.ADD} == {
        'learnt path', 'hand', 'hand trail', 'wrist', 'wrist trail', 'exchange',
    }  # fmt: skip
    for name, poses in (('hand', hands), ('wrist', wrists)):
        # the hand of another replay is hidden, and said to be lost, until that begins
        heard = (place(message.pose.position) for message in poses)
        seen = [position for position in heard if all(map(math.isfinite, position))]
        shown = place(last[name].pose.position)
        assert min(math.dist(shown, other) for other in seen) < 0.01
        # the last second; what was before, nobody listened to here
        trail = [place(point) for point in last[f'{name} trail'].points][-20:]
        assert trail[-1] == shown
        assert all(min(math.dist(point, other) for other in seen) < 0.02 for point in trail)
    direction, wrist = (place(last[name].pose.position) for name in ('exchange', 'wrist'))
    assert math.dist(direction, wrist) < 0.1
    gone = [m for message in markers for m in message.markers if m.action == m.DELETE]
    assert {marker.ns for marker in gone} == {'exchange', 'expected meeting point'}
    meetings = [
        place(marker.pose.position)
        for message in markers
        for marker in message.markers
        if marker.ns == 'expected meeting point' and marker.action == marker.ADD
    ]
    assert len(meetings) > 10
    # long before the hand is there it shows where that will be
    exchange = place(last['exchange'].pose.position)
    assert math.dist(meetings[len(meetings) // 3], exchange) < 0.1
    values = [values_of(message) for message in phases]
    assert all({'trust', 'lead', 'phase_rate'} <= set(each) for each in values)
    assert max(each['trust'] for each in values) > 0.9
    assert max(each['phase_rate'] for each in values) > 0.9
    assert 'exchange' not in {m.ns for m in markers[-1].markers if m.action == m.ADD}


def place(point: Any) -> tuple[float, float, float]:
    return point.x, point.y, point.z
