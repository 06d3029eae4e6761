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
from handover_dmp.tracking.tracker_preset import SENSOR, TrackerPreset


def run_graph(
    folder: Path,
    scenario: Scenario,
    info: dict[str, Any],
    tell: Callable[[str, float], None],
    trackers: Sequence[TrackerPreset] = (),
    *,
    lockstep: bool = True,
) -> None:
    """
    Run one handover on the five nodes and record it to `bag/` in the run's folder.

    Args:
        folder: folder of the run, with `trial.csv` and `model.json`.
        scenario: scenario to run.
        info: content of `/handover/info`.
        tell: called with the current step and the share done.
        trackers: trackers that see the hand; default: a perfect one.
        lockstep: whether to run on simulated time; if not, on the wall clock.

    Raises:
        GraphError: a node did not start, failed or did not end cleanly.

    """
    max_duration_s = REPLAY_AT_S + scenario.trial.duration_s + MAX_EXTRA_S
    parameters = graph_parameters(folder, scenario, info, lockstep, trackers)
    _run(folder, parameters, lockstep, max_duration_s, 'handing over', tell)


def run_session_graph(
    folder: Path,
    scenario: SessionScenario,
    info: dict[str, Any],
    tell: Callable[[str, float], None],
    trackers: Sequence[TrackerPreset] = (),
    *,
    lockstep: bool = True,
) -> None:
    """
    Run one session on the five nodes and record it to `bag/` in the run's folder.

    Args:
        folder: folder of the run, with the session, its index, `model.json` and
            `take_model.json`.
        scenario: scenario to run.
        info: content of `/handover/info`.
        tell: called with the current step and the share done.
        trackers: trackers that see the hand; default: a perfect one.
        lockstep: whether to run on simulated time; if not, on the wall clock.

    Raises:
        GraphError: a node did not start, failed or did not end cleanly.

    """
    motion = scenario.session.motion
    max_duration_s = REPLAY_AT_S + float(motion.times[-1] - motion.times[0]) + MAX_WAIT_S
    parameters = session_parameters(folder, scenario, info, lockstep, trackers)
    _run(
        folder,
        parameters,
        lockstep,
        max_duration_s,
        'giving and taking back',
        lambda what, share: tell(what, 0.6 * share),
    )


def _run(
    folder: Path,
    parameters: dict[str, dict[str, Any]],
    lockstep: bool,
    max_duration_s: float,
    doing: str,
    tell: Callable[[str, float], None],
) -> None:
    """Run the graph until the handover or session is over."""
    tell('starting five nodes', 0.05)
    with Graph(folder, parameters, lockstep=lockstep) as g:
        tell(doing, 0.2)
        begun_s = g.time_s
        if lockstep:
            g.pause(False)
        else:
            g.call('hand_tracker/replay')
        g.wait_for_state(
            ('done', 'aborted'),
            max_duration_s,
            lambda: tell(doing, 0.2 + 0.7 * (g.time_s - begun_s) / max_duration_s),
        )
        g.linger(AFTERWARDS_S)
        tell('stopping the nodes', 0.9)


def graph_parameters(
    folder: Path,
    scenario: Scenario,
    info: dict[str, Any],
    lockstep: bool,
    trackers: Sequence[TrackerPreset] = (),
) -> dict[str, dict[str, Any]]:
    """
    Make the parameters of the five nodes for a run.

    Args:
        folder: folder of the run.
        scenario: scenario to run.
        info: content of `/handover/info`.
        lockstep: whether to run on simulated time; if not, on the wall clock.
        trackers: trackers that see the hand; default: a perfect one.

    Returns:
        Node to name to value.

    """
    parameters = _parameters(folder, scenario, info, lockstep, trackers)
    parameters['hand_tracker']['trial'] = str(folder / 'trial.csv')
    for node, values in scenario.carried.node_parameters(scenario.model).items():
        parameters[node] |= values
    return parameters


def session_parameters(
    folder: Path,
    scenario: SessionScenario,
    info: dict[str, Any],
    lockstep: bool,
    trackers: Sequence[TrackerPreset] = (),
) -> dict[str, dict[str, Any]]:
    """
    Make the parameters of the five nodes for a session.

    Args:
        folder: folder of the run.
        scenario: scenario to run.
        info: content of `/handover/info`, with the mass of the object.
        lockstep: whether to run on simulated time; if not, on the wall clock.
        trackers: trackers that see the hand; default: a perfect one.

    Returns:
        Node to name to value.

    """
    parameters = _parameters(folder, scenario, info, lockstep, trackers)
    parameters['hand_tracker'] |= {
        'source': 'session',
        'trial': str(folder / scenario.session.file_name),
    }
    parameters['dmp'] |= {
        'session.enabled': True,
        'session.take_model': str(folder / 'take_model.json'),
    }
    if scenario.pick_up is not None:
        parameters['dmp'] |= {
            'session.pick_up': True,
            'session.pick_up_position': scenario.pick_up.tolist(),
        }
    parameters['robot_sim'] |= scenario.carried(float(info['object_mass_kg'])).parameters
    for node, values in scenario.profile.node_parameters(scenario.models.give).items():
        parameters[node] |= values
    return parameters


def _parameters(
    folder: Path,
    scenario: Scenario | SessionScenario,
    info: dict[str, Any],
    lockstep: bool,
    trackers: Sequence[TrackerPreset],
) -> dict[str, dict[str, Any]]:
    robot = scenario.robot
    arm = {
        'robot': robot.description.asked_for,
        'wrist_frame': robot.wrist_frame,
        'base_frame': robot.base_frame,
        'base_position': [float(x) for x in robot.base.position],
        'base_roll': float(robot.base.roll),
        'base_pitch': float(robot.base.pitch),
        'base_yaw': float(robot.base.yaw),
    }
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
    return {
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
