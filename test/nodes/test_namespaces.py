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

"""Two graphs in one domain, each in a namespace: neither hears the other."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

from handover_dmp.handover.scenario import Scenario
from handover_dmp.nodes.graph import Graph
from handover_dmp.nodes.run_graph import graph_parameters
from handover_dmp.recording import bag_information, read_bag
from handover_dmp.report import load_run
from handover_dmp.runs.folder import keep_inputs
from handover_dmp.topics import HAND_POSE, STATE, TOPICS
import pytest

pytestmark = [pytest.mark.ros, pytest.mark.timeout(400)]

SHARED = {'/diagnostics', '/clock', '/rosout', '/parameter_events', '/tf', '/tf_static'}
START_S = {'/left': 0.5, '/right': 1.0}


def hand_stamps_ns(bag: Path, namespace: str) -> list[int]:
    stamps = (m.header.stamp for _, m, _ in read_bag(bag, [HAND_POSE.within(namespace)]))
    return [stamp.sec * 10**9 + stamp.nanosec for stamp in stamps]


def test_two_graphs_do_not_hear_each_other(tmp_path: Path, scenario: Scenario) -> None:
    """Each in lockstep with itself: a message of the other would put a hand out of its place."""
    graphs = {}
    for space, start_s in START_S.items():
        folder = tmp_path / space.strip('/')
        folder.mkdir()
        keep_inputs(folder, scenario)
        parameters = graph_parameters(folder, scenario, {'by': space}, lockstep=True)
        parameters['hand_tracker']['replay_at_s'] = start_s
        graphs[space] = Graph(folder, parameters, namespace=space)
    with graphs['/left'] as left, graphs['/right'] as right:
        left.pause(False)
        assert left.wait_for_state(('done', 'aborted'), 20.0, lambda: None)
        left_alone = right.time_s, right.state
        left.pause(True)
        right.pause(False)
        assert right.wait_for_state(('done', 'aborted'), 20.0, lambda: None)
        assert (left.state, right.state) == ('done', 'done')
        right.spin()
    # the time and the state of the one are not those of the other
    assert left_alone[0] == 0.0
    assert left_alone[1] in ('', 'idle')
    ours = {topic.name for topic in TOPICS}
    for space, start_s in START_S.items():
        bag = tmp_path / space.strip('/') / 'bag'
        recorded = {name for name, topic in bag_information(bag).topics.items() if topic.count}
        assert all(name.startswith(f'{space}/') for name in recorded - SHARED)
        assert HAND_POSE.within(space) in recorded
        assert not recorded & (ours - SHARED)
        assert [m.data for _, m, _ in read_bag(bag, [STATE.within(space)])] == [
            'idle', 'reaching', 'exchange', 'done',
        ]  # fmt: skip
        # in lockstep one pose a period and no other: no gap, none twice at another place
        stamps_ns = sorted(set(hand_stamps_ns(bag, space)))
        assert {b - a for a, b in pairwise(stamps_ns)} == {5_000_000}
        run = load_run(bag)
        assert run.namespace == space
        assert run.info == {'by': space}
        assert {status.node for status in run.diagnostics} >= {'dmp', 'priority_ik', 'robot_sim'}
        reaching_s = run.reaching_time_s
        assert reaching_s is not None
        assert abs(reaching_s + run.start_ns * 1e-9 - start_s) < 0.1
