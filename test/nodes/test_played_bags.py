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

"""A player of bags in place of the tracker: with its clock, and over and over again."""

from __future__ import annotations

import math
from pathlib import Path
import subprocess
import sys
import time
from typing import Any

from handover_dmp.handover.scenario import Scenario
from handover_dmp.mocap.trial import HandoverTrial
from handover_dmp.mocap.trial_bag import write_trial_bag
from handover_dmp.nodes.graph import Graph
from handover_dmp.topics import HAND_POSE, SIGNAL
import pytest

pytestmark = [pytest.mark.ros, pytest.mark.timeout(300)]

NODES = ('recorder', 'dmp', 'priority_ik', 'robot_sim')
ONE = ['idle', 'reaching', 'exchange', 'done']
LATE_S = 15.0
PLAYER = Path(__file__).with_name('play_bag.py')


def states_while_played(graph: Graph, bag: Path, wanted: list[str], *words: str) -> list[str]:
    """Play a bag to its end, and return the states of the handover that there were until then."""
    command = [sys.executable, str(PLAYER), str(bag), *words]
    # dmp twice and the recorder hear the signal; the recorder, dmp and priority_ik the hand
    command += ['--heard', HAND_POSE.name, '3', '--heard', SIGNAL.name, '3']
    seen: list[str] = []
    with subprocess.Popen(command) as player:
        end_s = math.inf
        # the nodes of a busy machine may be late
        while player.poll() is None or (seen != wanted and time.monotonic() < end_s):
            graph.spin(0.02)
            if graph.state and [graph.state] != seen[-1:]:
                seen.append(graph.state)
            if player.poll() is not None:
                end_s = min(end_s, time.monotonic() + LATE_S)
    assert player.returncode == 0
    return seen


def check_states(
    prepare: Any,
    trial: HandoverTrial,
    tmp_path: Path,
    wanted: list[str],
    *words: str,
    **changes: Any,
) -> None:
    """Play a trial to four nodes; again where a machine that stood still has stopped the arm."""
    write_trial_bag(trial, tmp_path / 'trial')
    said = []
    for number in range(3):
        recorder = {**changes.get('recorder', {}), 'folder': str(tmp_path / f'bag_{number}')}
        folder, parameters = prepare(lockstep=False, **{**changes, 'recorder': recorder})
        with Graph(folder, parameters, lockstep=False, nodes=NODES) as graph:
            said.append(states_while_played(graph, tmp_path / 'trial', wanted, *words))
        if said[-1] == wanted:
            return
    pytest.fail(f'said {said}')


def test_on_a_played_clock_the_object_changes_hands(
    prepare: Any, scenario: Scenario, tmp_path: Path
) -> None:
    """At the rate of rosbag2: two of its jumps are as long as a command may be old."""
    on_it = {name: {'use_sim_time': True} for name in NODES}
    check_states(prepare, scenario.trial, tmp_path, ONE, '--clock', '40', **on_it)


@pytest.mark.slow
def test_a_bag_in_a_loop_gives_one_handover_a_loop(
    prepare: Any, scenario: Scenario, tmp_path: Path
) -> None:
    arrival = {name: {'hand_stamps': 'arrival'} for name in ('dmp', 'priority_ik')}
    check_states(prepare, scenario.trial, tmp_path, [*ONE, *ONE], '--loops', '2', **arrival)
