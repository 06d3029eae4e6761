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

"""Run a handover or a session on the graph, from the start of the nodes to the recorder's end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import json
from pathlib import Path
from typing import Any

from handover_dmp.handover.controller import AFTERWARDS_S
from handover_dmp.handover.lockstep import MAX_EXTRA_S, REPLAY_AT_S
from handover_dmp.handover.scenario import Scenario
from handover_dmp.handover.session_lockstep import MAX_WAIT_S
from handover_dmp.handover.session_scenario import SessionScenario
from handover_dmp.nodes.graph import Graph
from handover_dmp.robot.model import RobotModel
from handover_dmp.tracking.tracker_preset import SENSOR, TrackerPreset


def run_graph(
    folder: Path,
    scenario: Scenario | SessionScenario,
    info: dict[str, Any],
    tell: Callable[[str, float], None],
    trackers: Sequence[TrackerPreset] = (),
    *,
    lockstep: bool = True,
) -> None:
    """
    Run one handover or session on the five nodes and record it to `bag/` in the run's folder.

    Args:
        folder: folder of the run, with the files that `graph_parameters` names.
        scenario: scenario to run.
        info: content of `/handover/info`; of a session, with the mass of the object.
        tell: called with the current step and the share done.
        trackers: trackers that see the hand; default: a perfect one.
        lockstep: whether to run on simulated time; if not, on the wall clock.

    Raises:
        GraphError: a node did not start, failed or did not end cleanly.

    """
    if isinstance(scenario, SessionScenario):
        times = scenario.session.motion.times
        # a session is filmed afterwards, which takes long
        doing, share_of_run = 'giving and taking back', 0.6
        max_duration_s = REPLAY_AT_S + float(times[-1] - times[0]) + MAX_WAIT_S
    else:
        doing, share_of_run = 'handing over', 1.0
        max_duration_s = REPLAY_AT_S + scenario.trial.duration_s + MAX_EXTRA_S
    parameters = graph_parameters(folder, scenario, info, lockstep, trackers)
    tell('starting five nodes', share_of_run * 0.05)
    with Graph(folder, parameters, lockstep=lockstep) as g:
        tell(doing, share_of_run * 0.2)
        begun_s = g.time_s
        if lockstep:
            g.pause(False)
        else:
            g.call('hand_tracker/replay')

        def progress() -> None:
            share = (g.time_s - begun_s) / max_duration_s
            tell(doing, share_of_run * (0.2 + 0.7 * share))

        g.wait_for_state(('done', 'aborted'), max_duration_s, progress)
        g.linger(AFTERWARDS_S)
        tell('stopping the nodes', share_of_run * 0.9)


def graph_parameters(
    folder: Path,
    scenario: Scenario | SessionScenario,
    info: dict[str, Any],
    lockstep: bool,
    trackers: Sequence[TrackerPreset] = (),
) -> dict[str, dict[str, Any]]:
    """
    Make the parameters of the five nodes for a run.

    Args:
        folder: folder of the run, with `trial.csv` and `model.json`; of a session, with its file
            and index, `model.json` and `take_model.json`.
        scenario: scenario to run.
        info: content of `/handover/info`; of a session, with the mass of the object.
        lockstep: whether to run on simulated time; if not, on the wall clock.
        trackers: trackers that see the hand; default: a perfect one.

    Returns:
        Node to name to value.

    """
    arm = _arm_parameters(scenario.robot)
    seen, replayed = _tracker_parameters(trackers)
    parameters: dict[str, dict[str, Any]] = {
        'recorder': {
            'folder': str(folder / 'bag'),
            'info': json.dumps(info),
            'transforms': True,
            **arm,
        },
        'hand_tracker': {
            'cutoff_hz': 0.0,
            'replay_at_s': REPLAY_AT_S if lockstep else -1.0,
            **replayed,
        },
        'dmp': {
            'model': str(folder / 'model.json'),
            'partner_model': scenario.partner_model,
            **seen,
        },
        'priority_ik': {**arm, **seen},
        'robot_sim': {
            **arm,
            'initial_positions': scenario.q_start.tolist(),
            'real_time_factor': 0.0,
        },
    }
    if isinstance(scenario, SessionScenario):
        further = _session_parameters(folder, scenario, float(info['object_mass_kg']))
    else:
        further = scenario.carried.node_parameters(scenario.model)
        further['hand_tracker'] = {'trial': str(folder / 'trial.csv')}
    return {node: values | further.get(node, {}) for node, values in parameters.items()}


def _session_parameters(
    folder: Path, scenario: SessionScenario, mass_kg: float
) -> dict[str, dict[str, Any]]:
    further = scenario.profile.node_parameters(scenario.models.give)
    further['hand_tracker'] = {
        'source': 'session',
        'trial': str(folder / scenario.session.file_name),
    }
    further['dmp'] |= {
        'session.enabled': True,
        'session.take_model': str(folder / 'take_model.json'),
    }
    if scenario.pick_up is not None:
        further['dmp'] |= {
            'session.pick_up': True,
            'session.pick_up_position': scenario.pick_up.tolist(),
        }
    further['robot_sim'] = scenario.carried(mass_kg).parameters
    return further


def _arm_parameters(robot: RobotModel) -> dict[str, Any]:
    return {
        'robot': robot.description.asked_for,
        'wrist_frame': robot.wrist_frame,
        'base_frame': robot.base_frame,
        'base_position': [float(x) for x in robot.base.position],
        'base_roll': float(robot.base.roll),
        'base_pitch': float(robot.base.pitch),
        'base_yaw': float(robot.base.yaw),
    }


def _tracker_parameters(
    trackers: Sequence[TrackerPreset],
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the parameters of nodes that see the hand, and of the one that replays it."""
    seen: dict[str, Any] = {}
    replayed: dict[str, Any] = {}
    if trackers:
        seen['trackers'] = replayed['trackers'] = [one.name for one in trackers]
    for one in trackers:
        told = dict(one.parameters) | {'sensor.seed': one.sensor.seed}
        for name, value in told.items():
            if name.startswith(SENSOR) or name == 'topic':
                replayed[f'{one.name}.{name}'] = value
            if not name.startswith(SENSOR):
                seen[f'{one.name}.{name}'] = value
    return seen, replayed
