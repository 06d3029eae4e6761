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

"""A picture of an arm in its home configuration."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from handover_dmp.robot.model import RobotModel
from handover_dmp.simulation.engine import Engine
from handover_dmp.simulation.world import joint_numbers, load_robot
from handover_dmp.view.camera_image import camera_image, Pixels
from handover_dmp.view.drawn_robot import drawn_description
from handover_dmp.view.primitives import refine, write_unit_meshes
from handover_dmp.view.scene import Camera
import numpy as np
from numpy.typing import NDArray
from PIL import Image

SIDE = 900
"""Size of the square picture, pixels."""
SAMPLES = 2
"""Samples per pixel, in width and in height."""
BACKGROUND = 214
LIGHT: dict[str, Any] = {
    'lightDirection': [1.0, -0.8, 2.0],
    'lightAmbientCoeff': 0.55,
    'lightDiffuseCoeff': 0.5,
    'lightSpecularCoeff': 0.05,
}
FRAME = 0.06
"""Free margin around the arm, as a share of the picture."""
MARGIN = 1.15
"""Field of view relative to the arm."""


def draw_portrait(model: RobotModel) -> Pixels:
    """
    Draw an arm in its home configuration.

    Args:
        model: the arm.

    Returns:
        (height, width, 3), red, green and blue.

    """
    with Engine() as engine:
        with TemporaryDirectory() as folder:
            fine = refine(drawn_description(model), *write_unit_meshes(Path(folder)))
            robot = load_robot(model, fine, engine)
        for number, q in zip(joint_numbers(model, robot, engine), model.home, strict=True):
            engine.resetJointState(robot, number, float(q))
        camera = _camera(robot, engine)
        pixels, seen = camera_image(
            camera.width, camera.height, camera.view, camera.projection, engine.client, **LIGHT
        )
    picture = np.where(seen[..., None] >= 0, pixels[..., :3], BACKGROUND).astype(np.uint8)
    picture = _framed(picture, seen >= 0)
    small = Image.fromarray(picture).resize((SIDE, SIDE), Image.Resampling.LANCZOS)
    return np.asarray(small)


def _framed(picture: Pixels, arm: NDArray[np.bool_]) -> Pixels:
    """Cut out the square around the arm."""
    rows, columns = np.flatnonzero(arm.any(axis=1)), np.flatnonzero(arm.any(axis=0))
    if not len(rows):
        return picture
    half = round((0.5 + FRAME) * max(np.ptp(rows), np.ptp(columns)))
    wide = np.pad(picture, ((half, half), (half, half), (0, 0)), constant_values=BACKGROUND)
    first = [int(ends[0] + ends[-1]) // 2 for ends in (rows, columns)]
    return wide[tuple(slice(start, start + 2 * half) for start in first)]


def _camera(robot: int, engine: Engine) -> Camera:
    """Place the camera in front and to the side of the arm, so that it sees all of it."""
    links = range(-1, engine.getNumJoints(robot))
    boxes = np.array([engine.getAABB(robot, link) for link in links])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    middle, radius = (low + high) / 2.0, float(np.linalg.norm(high - low)) / 2.0
    distance = max(MARGIN * radius / np.sin(np.radians(16.0)), 0.3)
    away = np.array([0.75, -0.6, 0.28])
    eye = middle + distance * away / np.linalg.norm(away)
    return Camera(eye, middle, SAMPLES * SIDE, SAMPLES * SIDE)
