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

from collections.abc import Mapping
from datetime import datetime
import json
import math
from pathlib import Path
import platform
import shlex
import sys
from typing import Any

from handover_dmp import __version__
from handover_dmp.common.errors import DataError
from handover_dmp.common.files import write_text
from handover_dmp.common.versions import installed_versions, LIBRARIES
from handover_dmp.dmp import save_model
from handover_dmp.handover.scenario import Scenario
from handover_dmp.mocap import HandoverTrial, write_trial
from handover_dmp.robot.descriptions import ArmChoice
import numpy as np
from numpy.typing import NDArray


def new_run_folder(output: Path | None, trial: HandoverTrial) -> Path:
    """
    Make the folder of a run.

    Args:
        output: where; none: `runs/<date-time>_<exchange>_<configuration>`.
        trial: what is run.

    Returns:
        The folder, empty.

    Raises:
        DataError: it exists and is not empty, or cannot be made.

    """
    if output is None:
        now = datetime.now().strftime('%Y-%m-%d_%H-%M-%S')
        output = Path('runs') / f'{now}_{trial.direction}_{trial.configuration}'
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
    trial, robot = scenario.trial, scenario.robot
    limits = robot.limits
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
        'seed': scenario.seed,
        'scale': scale,
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


def _finite(numbers: NDArray[np.float64]) -> list[float | None]:
    """Return them as JSON has them, which knows of no limit that is infinite."""
    return [number if math.isfinite(number) else None for number in numbers.tolist()]


def finish(folder: Path, scenario: Scenario) -> dict[str, Any]:
    """
    Draw the pictures of a run and write its report, from its bag.

    Args:
        folder: of the run.
        scenario: what was run.

    Returns:
        The report, plain types.

    """
    # imported here, since what draws takes seconds, and who starts nodes should not wait for it
    from handover_dmp.report import write_report
    from handover_dmp.view.stage import set_up
    from PIL import Image

    robot = scenario.robot
    choice = ArmChoice(robot.description.asked_for, robot.wrist_frame, robot.base_frame)
    with set_up(folder, choice) as stage:
        (folder / 'figures').mkdir(exist_ok=True)
        met = math.isfinite(stage.scene.exchange_time_s)
        names = ('start', 'middle', 'exchange' if met else 'end')
        for name, pixels in zip(names, stage.scene.three_images(), strict=True):
            Image.fromarray(pixels).save(folder / 'figures' / f'scene_{name}.png')
    report: dict[str, Any] = write_report(folder)
    return report


def save_json(report: dict[str, Any], path: Path | None) -> None:
    """
    Write a result for machines, if that was asked for.

    Args:
        report: plain types.
        path: where; none: nowhere.

    """
    if path is not None:
        write_text(path, json.dumps(report, indent=2) + '\n')
