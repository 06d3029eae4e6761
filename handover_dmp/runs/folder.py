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

"""What every run leaves behind: a folder with the bag, the report and the pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
import json
import math
from pathlib import Path
import platform
import shlex
import sys
from typing import Any, TYPE_CHECKING

from handover_dmp import __version__
from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.common.files import write_text
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
    Make the folder of a run.

    Args:
        output: where; none: `runs/<date-time>_<exchange>_<configuration>`.
        what: is run, `give`, `take` or `session`.
        configuration: where.

    Returns:
        The folder, empty.

    Raises:
        DataError: it exists and is not empty, or cannot be made.

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
    Write down what is run: the recorded handover and the learnt movement.

    Args:
        folder: of the run.
        scenario: what is run.

    """
    write_trial(scenario.trial, folder / 'trial.csv')
    save_model(scenario.model, folder / 'model.json')


def run_info(
    scenario: Scenario, scale: float, trackers: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """
    Describe a run, for `/handover/info`.

    Args:
        scenario: what is run.
        scale: of the recorded motion.
        trackers: name to topic of those that see the hand; none: one, on the usual topic.

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
        scenario: what is run.
        mass_kg: of the object.
        trackers: name to topic of those that see the hand; none: one, on the usual topic.

    Returns:
        Plain types; `legs` has what differs from leg to leg.

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
    """Describe what a run has whatever is run: seed, trackers, arm, command, versions."""
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
    """Return them as JSON has them, which knows of no limit that is infinite."""
    return [number if math.isfinite(number) else None for number in numbers.tolist()]


def keep_session(folder: Path, scenario: SessionScenario) -> Path:
    """
    Write down what is run: the recorded session and the learnt movements.

    Args:
        folder: of the run.
        scenario: what is run.

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
        folder: of the run.
        scenario: what was run.
        progress: is told the share of the film that is done.

    Returns:
        The report, plain types.

    """
    # imported here, since what draws takes seconds, and who starts nodes should not wait for it
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
    report: dict[str, Any] = write_report(folder)
    return report


def _scenes(stage: Stage) -> Iterator[tuple[str, Any]]:
    """Draw start, middle and exchange of a handover; of a session, what is done in turn."""
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


def save_json(report: dict[str, Any], path: Path | None) -> None:
    """
    Write a result for machines, if that was asked for.

    Args:
        report: plain types.
        path: where; none: nowhere.

    """
    if path is not None:
        write_text(path, json.dumps(report, indent=2) + '\n')
