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

"""The calibration motion on the graph: move the arm and record both paths."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from handover_dmp.common.errors import UsageError
from handover_dmp.nodes.graph import Graph, GraphError
from handover_dmp.robot.descriptions import ArmChoice
from handover_dmp.topics import (
    CLOCK,
    HAND_POSE,
    JOINT_COMMAND,
    JOINT_STATES,
    ROBOT_DESCRIPTION,
    WRIST_POSE,
)

MOTION = 'calibration_motion'
ALLOWANCE_S = 60.0
FIRST_POSES_S = 30.0


def move_and_record(
    bag: Path,
    arm: ArmChoice,
    *,
    duration_s: float,
    running: bool,
    seed: int,
    tell: Callable[[str, float], None],
    tracker_topic: str = HAND_POSE.name,
) -> None:
    """
    Move an arm through the calibration motion and record it.

    Args:
        bag: folder to record into, which must not exist.
        arm: the arm.
        duration_s: duration of the motion, s.
        running: whether to move the arm that runs in this domain with its tracker; if not,
            `robot_sim` is started, in a domain of its own, with a simulated tracker.
        seed: seed of the simulated tracker's noise.
        tell: called with the current step and the share done.
        tracker_topic: topic of the tracker's poses.

    Raises:
        GraphError: a node did not start or failed, or the arm or the tracker is silent.
        UsageError: the duration is out of range, or the bag exists.

    """
    if not 5.0 <= duration_s <= 600.0:
        raise UsageError(f'--duration is {duration_s:g} s; it must be from 5 to 600')
    if bag.exists():
        raise UsageError(f'{bag}: exists already; choose another one with --bag')
    topics = [JOINT_STATES.name, JOINT_COMMAND.name, WRIST_POSE.name, tracker_topic]
    topics += [ROBOT_DESCRIPTION.name] + ([] if running else [CLOCK.name])
    # the fields of an arm are named like the parameters of the nodes
    described = vars(arm)
    parameters: dict[str, dict[str, Any]] = {
        'recorder': {
            'folder': str(bag.absolute()),
            'topics': topics,
            # no handover will come
            'rest_s': 0.0,
            'transforms': not running,
            **described,
        },
        MOTION: {
            **described,
            'duration_s': duration_s,
            'start': 'service',
            'simulated_tracker.enabled': not running,
            'simulated_tracker.seed': seed,
        },
        'robot_sim': {**described, 'real_time_factor': 0.0},
    }
    nodes = ('recorder', MOTION) if running else ('recorder', MOTION, 'robot_sim')
    with TemporaryDirectory() as folder:
        graph = Graph(
            Path(folder), parameters, lockstep=not running, nodes=nodes, isolated=not running
        )
        with graph:
            tell('waiting for all poses', 0.05)
            if not running:
                graph.pause(False)
            graph.wait_for_recorder(FIRST_POSES_S)
            graph.call(f'{MOTION}/start')
            tell('moving the arm', 0.1)
            _wait_for_the_end(graph, duration_s, tell)
            tell('calibrating', 1.0)


def _wait_for_the_end(graph: Graph, duration_s: float, tell: Callable[[str, float], None]) -> None:
    """Wait until the node of the motion ends; the end of any other node is a fault."""
    begun_s = graph.clock_s()
    while graph.processes[MOTION].poll() is None:
        try:
            graph.spin()
        except GraphError:
            if graph.processes[MOTION].poll() != 0:
                raise
        elapsed_s = graph.clock_s() - begun_s
        if elapsed_s > duration_s + ALLOWANCE_S:
            raise GraphError(f'{MOTION}: did not end within {elapsed_s:.0f} s')
        tell('moving the arm', min(0.1 + 0.85 * elapsed_s / duration_s, 0.95))
