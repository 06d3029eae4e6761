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

"""The whole graph: five processes over DDS, held against the same objects in one process."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
import subprocess
import sys
import time
from typing import Any

from handover_dmp.handover import Handover
from handover_dmp.nodes.graph import Graph
from handover_dmp.recording import read_bag
from handover_dmp.scenario import Scenario
import numpy as np
import pytest

pytestmark = [pytest.mark.ros, pytest.mark.timeout(400)]

LONGEST_S = 20.0
STREAMS = (
    '/clock',
    '/hand/pose',
    '/human/pose',
    '/wrist/pose',
    '/wrist/pose_command',
    '/wrist/twist_command',
    '/wrist/ik_status',
    '/joint_states',
    '/joint_velocity_controller/commands',
    '/handover/phase',
)


def positions(bag: Path, topic: str) -> dict[int, np.ndarray]:
    """Stamp in ns to position in m."""
    found = {}
    for _, message, _ in read_bag(bag, [topic]):
        stamp, place = message.header.stamp, message.pose.position
        found[stamp.sec * 10**9 + stamp.nanosec] = np.array([place.x, place.y, place.z])
    return found


@pytest.fixture(scope='module')
def lockstep_path(scenario: Scenario) -> dict[int, np.ndarray]:
    handover = Handover(scenario)
    path = {period.time_ns: period.wrist_position for period in handover.run()}
    handover.close()
    return path


@pytest.mark.parametrize(
    ('factor', 'executor'), [(0.0, 'events'), (0.2, 'events'), (2.0, 'events'), (0.0, 'default')]
)
def test_gives_the_same_motion_as_one_process_at_any_speed(
    prepare: Any, lockstep_path: dict[int, np.ndarray], factor: float, executor: str
) -> None:
    speed = {'real_time_factor': factor}
    folder, parameters = prepare(
        robot_sim={**speed, 'executor': executor},
        dmp={'executor': executor},
        priority_ik={'executor': executor},
        hand_tracker={'executor': executor},
    )
    with Graph(folder, parameters) as graph:
        begun = time.monotonic()
        graph.unpause()
        assert graph.wait_for_state(('done',), LONGEST_S, lambda: None)
        took, passed = time.monotonic() - begun, graph.time_s
        graph.linger(0.1)
    if factor:
        assert took >= 0.9 * passed / factor
    recorded = positions(folder / 'bag', '/wrist/pose')
    counts = Counter(topic for topic, _, _ in read_bag(folder / 'bag'))
    periods = max(recorded) // 5_000_000 + 1
    assert set(recorded) == set(range(0, periods * 5_000_000, 5_000_000)), 'a period was lost'
    for topic in STREAMS:
        assert counts[topic] >= periods - 1, topic
    apart = [
        np.linalg.norm(recorded[t] - lockstep_path[t]) for t in lockstep_path if t in recorded
    ]
    assert len(apart) > 300
    assert max(apart) < 1e-6


def hand_over(graph: Graph) -> None:
    """
    Hand over on the wall clock.

    Tried again where the machine has stood still for so long that a node has stopped the arm, as
    it must.
    """
    for _ in range(5):
        for service in ('/dmp/reset', '/robot_sim/reset', '/robot_sim/resume'):
            graph.call(service)
        assert graph.wait_for_state(('idle',), LONGEST_S, lambda: None)
        graph.call('/hand_tracker/replay')
        graph.wait_for_state(('done', 'aborted'), 8.0, lambda: None)
        if graph.state == 'done':
            graph.linger(0.3)  # the recorder may be the last to hear of it
            return
    pytest.fail('never handed over')


def states(bag: Path) -> list[str]:
    return [message.data for _, message, _ in read_bag(bag, ['/handover/state'])]


def test_hands_over_on_the_wall_clock(prepare: Any, lockstep_path: dict[int, Any]) -> None:
    folder, parameters = prepare(lockstep=False)
    with Graph(folder, parameters, lockstep=False) as graph:
        hand_over(graph)
    assert states(folder / 'bag')[-3:] == ['reaching', 'exchange', 'done']
    reached = list(positions(folder / 'bag', '/wrist/pose').values())[-1]
    assert np.linalg.norm(reached - list(lockstep_path.values())[-1]) < 0.02


def test_two_handovers_one_after_the_other_are_alike(prepare: Any) -> None:
    folder, parameters = prepare(lockstep=False)
    ends = []
    with Graph(folder, parameters, lockstep=False) as graph:
        for _ in range(2):
            hand_over(graph)
            ends.append(graph.node.get_clock().now().nanoseconds)
    said = states(folder / 'bag')
    assert ''.join(said).count('reachingexchangedone') == 2
    way = positions(folder / 'bag', '/wrist/pose')
    first, second = (way[max(t for t in way if t <= end)] for end in ends)
    assert np.linalg.norm(first - second) < 0.005


@pytest.mark.parametrize('source', ['bag', '24 Hz'])
def test_the_hand_may_come_from_a_bag_or_from_a_slow_tracker(
    prepare: Any, tmp_path: Path, scenario: Scenario, source: str,
    lockstep_path: dict[int, np.ndarray],
) -> None:  # fmt: skip
    change: dict[str, Any]
    if source == 'bag':
        bags = tmp_path / 'bags'
        data_set = tmp_path / 'data'
        from handover_dmp.hand import write_data_set

        write_data_set([scenario.trial], data_set)
        words = ['-m', 'handover_dmp', 'bag', str(data_set), '-o', str(bags)]
        subprocess.run([sys.executable, *words], check=True)
        change = {'hand_tracker': {'trial': str(next(p for p in bags.iterdir() if p.is_dir()))}}
    else:
        slow = {'lockstep_hand_period_s': 0.04}
        change = {'hand_tracker': {'rate_hz': 25.0}, 'dmp': slow, 'priority_ik': slow}
    folder, parameters = prepare(**change)
    with Graph(folder, parameters) as graph:
        graph.unpause()
        assert graph.wait_for_state(('done',), LONGEST_S, lambda: None)
    recorded = positions(folder / 'bag', '/wrist/pose')
    apart = [
        np.linalg.norm(recorded[t] - lockstep_path[t]) for t in lockstep_path if t in recorded
    ]
    assert np.sqrt(np.mean(np.square(apart))) < (1e-4 if source == 'bag' else 0.02)
