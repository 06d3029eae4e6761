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

"""Fig. 2 of the paper: the partner's three postures, each with the arm."""

from __future__ import annotations

from pathlib import Path

from handover_dmp.common.errors import DataError
from handover_dmp.common.files import replacing
from handover_dmp.handover.scenario import expected_path
from handover_dmp.handover.teaching import learn_from_trials
from handover_dmp.mocap import HandoverTrial, synthesize
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.placement import choose_base_placement
from handover_dmp.simulation.stances import stance_of
from handover_dmp.view.camera_image import Pixels
from handover_dmp.view.scene import Scene
from handover_dmp.view.surroundings import SURROUNDINGS
import numpy as np
from PIL import Image, ImageDraw, ImageFont

WIDTH, HEIGHT = 760, 700
"""Size of a panel, pixels."""
INK = (60, 66, 74)
TITLES = {
    'under_car': '(a) under the car',
    'engine_bay': '(b) at the engine bay',
    'hydraulic_lift': '(c) under the hydraulic lift',
}


def draw_postures(arm: RobotModel, path: Path, seed: int = 0) -> None:
    """
    Draw person and arm at the exchange in each configuration, side by side.

    Args:
        arm: the robot; its base placement is chosen for each configuration.
        path: image file; its suffix sets the format.
        seed: seed of the synthetic handovers.

    Raises:
        DataError: the file cannot be written, or the arm cannot be drawn.
        UnreachableError: the arm cannot reach the path from any base placement.

    """
    given = {
        trial.configuration: trial
        for trial in synthesize(seed, trials=1, configurations=tuple(TITLES))
        if trial.direction == 'give'
    }
    panels = [_panel(arm, given[name], title) for name, title in TITLES.items()]
    try:
        with replacing(path) as temporary:
            Image.fromarray(np.hstack(panels)).save(temporary)
    except (OSError, ValueError) as error:
        raise DataError(f'{path}: cannot be written: {error}') from error


def _panel(arm: RobotModel, trial: HandoverTrial, title: str) -> Pixels:
    way = expected_path(learn_from_trials([trial]), trial)
    robot = arm.placed(choose_base_placement(way, arm, partner=trial.partner[-1]))
    meets, hand = robot.inverse(trial.demonstrator[-1]), trial.partner[-1]
    with Scene(
        robot,
        np.array([0.0, 1.0]),
        np.array([meets, meets]),
        np.array([hand, hand]),
        exchange_time_s=1.0,
        stance=stance_of(trial.configuration),
        surroundings=SURROUNDINGS[trial.configuration],
    ) as scene:
        picture = Image.fromarray(scene.image(1.0, WIDTH, HEIGHT))
    ImageDraw.Draw(picture).text(
        (WIDTH / 2, HEIGHT - 20), title, INK, ImageFont.load_default(26), anchor='md'
    )
    return np.asarray(picture)
