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

"""The folder of a run, with the bag, the report and the pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
import math
from pathlib import Path
import platform
import shlex
import sys
from typing import Any, TYPE_CHECKING

from handover_dmp import __version__
from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.common.versions import installed_versions, LIBRARIES
from handover_dmp.dmp import save_model
from handover_dmp.handover.release import ReleaseOptions
from handover_dmp.handover.scenario import Scenario
from handover_dmp.handover.session_scenario import SessionScenario
from handover_dmp.mocap import write_trial
from handover_dmp.mocap.session import write_sessions
from handover_dmp.robot.descriptions import ArmChoice
from handover_dmp.simulation.carried_object import Holder

if TYPE_CHECKING:
    from handover_dmp.view.stage import Stage


def new_run_folder(output: Path | None, what: str, configuration: str) -> Path:
    """
    Create the folder of a run.

    Args:
        output: the folder; None: `runs/<date-time>_<exchange>_<configuration>`.
        what: kind of run, `give`, `take` or `session`.
        configuration: configuration of the run.

    Returns:
        The empty folder.

    Raises:
        DataError: the folder exists and is not empty, or cannot be made.

    """
    if output is None:
        now = datetime.now().strftime('%Y-%m-%d_%H-%M-%S')
        output = Path('runs') / f'{now}_{what}_{configuration}'
    try:
        output.mkdir(parents=True, exist_ok=True)
        if any(output.iterdir()):
            raise DataError(f'{output}: is not empty; a run is never overwritten')
    except OSError as error:
        raise DataError(f'{output}: cannot be made: {error.strerror}') from error
    return output


def keep_inputs(folder: Path, scenario: Scenario) -> None:
    """
    Save the inputs of a run: the recorded handover and the learnt movement.

    Args:
        folder: folder of the run.
        scenario: the scenario.

    """
    write_trial(scenario.trial, folder / 'trial.csv')
    save_model(scenario.model, folder / 'model.json')


def run_info(
    scenario: Scenario, scale: float, trackers: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """
    Describe a run, for `/handover/info`.

    Args:
        scenario: the scenario.
        scale: scale of the recorded motion.
        trackers: topic by name of the trackers; None: one, on the default topic.

    Returns:
        Plain types.

    """
    trial = scenario.trial
    return {
        'trial': trial.label,
        'trial_source': trial.source,
        'configuration': trial.configuration,
        'exchange': trial.direction,
        'number': trial.number,
        'learnt_from': scenario.model.source,
        'goal_offset_m': list(scenario.model.goal_offset),
        'partner_model': scenario.partner_model,
        'object': scenario.carried.as_dict(),
        'orientation': scenario.orientation,
        'learnt_distance_m': math.dist(scenario.model.start, scenario.model.goal),
        'scale': scale,
        **_setting(scenario, trackers),
    }


def session_info(
    scenario: SessionScenario, mass_kg: float, trackers: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """
    Describe a run of a session, for `/handover/info`.

    Args:
        scenario: the scenario.
        mass_kg: mass of the object, kg.
        trackers: topic by name of the trackers; None: one, on the default topic.

    Returns:
        Plain types; `legs` has the entries that differ from leg to leg.

    """
    session, models = scenario.session, scenario.models
    carried = scenario.carried(mass_kg)
    table = list(carried.table) if carried.holder == Holder.TABLE.value else None
    release = ReleaseOptions()
    movements = {'give': models.give, 'take': models.take}
    return {
        'trial': f'{session.configuration} session {session.number}',
        'trial_source': session.motion.source,
        'configuration': session.configuration,
        'exchange': 'session',
        'number': session.number,
        'object': scenario.profile.as_dict(),
        'orientation': scenario.orientation,
        'object_mass_kg': mass_kg,
        'object_table_m': table,
        'release': {'share': release.share, 'pull_n': release.pull_n},
        'goal_offset_m': list(models.give.goal_offset),
        'learnt_from': [movement.source for movement in movements.values()],
        'legs': {
            name: {
                'learnt_from': movement.source,
                'goal_offset_m': list(movement.goal_offset),
                'learnt_distance_m': math.dist(movement.start, movement.goal),
            }
            for name, movement in movements.items()
        },
        'partner_model': scenario.partner_model,
        **_setting(scenario, trackers),
    }


def _setting(
    scenario: Scenario | SessionScenario, trackers: Mapping[str, str] | None
) -> dict[str, Any]:
    """Describe what all runs have: seed, trackers, arm, command, versions."""
    robot = scenario.robot
    limits = robot.limits
    return {
        'seed': scenario.seed,
        'trackers': dict(trackers or {}),
        'robot': robot.name,
        'robot_description': robot.description.asked_for,
        'wrist_frame': robot.wrist_frame,
        'base_frame': robot.base_frame,
        'base_position_m': list(robot.base.position),
        'base_roll_rad': robot.base.roll,
        'base_pitch_rad': robot.base.pitch,
        'base_yaw_rad': robot.base.yaw,
        'joint_names': list(robot.joint_names),
        'joint_limits': {
            name: _finite(getattr(limits, name))
            for name in ('lower', 'upper', 'velocity', 'acceleration')
        },
        'command': shlex.join(['handover_dmp', *sys.argv[1:]]),
        'versions': {
            'handover_dmp': __version__,
            'python': platform.python_version(),
            **installed_versions(LIBRARIES),
        },
        'machine': f'{platform.system()} {platform.machine()}',
    }


def _finite(numbers: Array) -> list[float | None]:
    """Convert limits for JSON, which has no infinity."""
    return [number if math.isfinite(number) else None for number in numbers.tolist()]


def keep_session(folder: Path, scenario: SessionScenario) -> Path:
    """
    Save the inputs of a session: the recorded session and the learnt movements.

    Args:
        folder: folder of the run.
        scenario: the scenario.

    Returns:
        The file of the session.

    """
    write_sessions([scenario.session], folder)
    save_model(scenario.models.give, folder / 'model.json')
    save_model(scenario.models.take, folder / 'take_model.json')
    return folder / scenario.session.file_name


def finish(
    folder: Path,
    scenario: Scenario | SessionScenario,
    progress: Callable[[float], None] = lambda _share: None,
) -> dict[str, Any]:
    """
    Draw the pictures of a run and write its report, from its bag; film a session.

    Args:
        folder: folder of the run.
        scenario: the scenario.
        progress: called with the finished share of the film.

    Returns:
        The report, plain types.

    """
    # imported here, because drawing libraries take seconds to load and nodes do not need them
    from handover_dmp.report import write_report
    from handover_dmp.report.session import is_session
    from handover_dmp.view.session_film import film_session
    from handover_dmp.view.stage import set_up
    from PIL import Image

    robot = scenario.robot
    choice = ArmChoice(robot.description.asked_for, robot.wrist_frame, robot.base_frame)
    with set_up(folder, choice) as stage:
        (folder / 'figures').mkdir(exist_ok=True)
        for name, pixels in _scenes(stage):
            Image.fromarray(pixels).save(folder / 'figures' / f'scene_{name}.png')
        if is_session(stage.record):
            film_session(stage, folder, progress)
    report: dict[str, Any] = write_report(folder, run=stage.record)
    return report


def _scenes(stage: Stage) -> Iterator[tuple[str, Any]]:
    """Draw start, middle and exchange of a handover, or the stages of a session."""
    from handover_dmp.report.session import is_session

    scene = stage.scene
    met = math.isfinite(scene.exchange_time_s)
    if not is_session(stage.record):
        names = ('start', 'middle', 'exchange' if met else 'end')
        yield from zip(names, scene.three_images(), strict=True)
        return
    last_s = float(scene.times[-1])
    back_s = min(scene.back_time_s, last_s)
    moments = [('start', stage.span_s[0])]
    if met:
        moments += [
            ('give', scene.exchange_time_s),
            ('use', (scene.exchange_time_s + back_s) / 2),
        ]
    if math.isfinite(scene.back_time_s):
        moments.append(('take', back_s))
    moments.append(('end', last_s))
    for name, time_s in moments:
        yield name, scene.image(time_s, 960, 720)
