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

from __future__ import annotations

from collections.abc import Iterator

from handover_dmp.common.quiet_pybullet import pybullet, silenced
from handover_dmp.view.camera_image import bytes_of, camera_image, integers_of
import numpy as np
import pytest

VIEW = [0, -4, 0], [0, 0, 0], [0, 0, 1]


@pytest.fixture
def world() -> Iterator[int]:
    """Give a green ball in the origin."""
    with silenced():
        client = pybullet.connect(pybullet.DIRECT)
    ball(client, [0.0, 0.0, 0.0], 0.5)
    yield client
    pybullet.disconnect(client)


def ball(client: int, place: list[float], radius_m: float) -> int:
    world = {'physicsClientId': client}
    shape = pybullet.createVisualShape(
        pybullet.GEOM_SPHERE, radius=radius_m, rgbaColor=[0, 1, 0, 1], **world
    )
    return int(pybullet.createMultiBody(baseVisualShapeIndex=shape, basePosition=place, **world))


def looked(
    client: int, width: int, height: int, by_windows: bool | None = None
) -> tuple[np.ndarray, np.ndarray]:
    return camera_image(
        width,
        height,
        pybullet.computeViewMatrix(*VIEW),
        pybullet.computeProjectionMatrixFOV(30, width / height, 0.1, 10),
        client,
        by_windows=by_windows,
    )


@pytest.mark.parametrize('by_windows', [False, True])
@pytest.mark.parametrize(('width', 'height'), [(48, 32), (601, 403)])
def test_a_picture_shows_what_is_there_and_where(
    world: int, width: int, height: int, by_windows: bool
) -> None:
    """Whichever build of PyBullet it is."""
    rgba, seen = looked(world, width, height, by_windows)
    assert (rgba.shape, rgba.dtype) == ((height, width, 4), np.uint8)
    assert (seen.shape, seen.dtype) == ((height, width), np.int32)
    across = np.arange(width) - (width - 1) / 2
    down = np.arange(height)[:, None] - (height - 1) / 2
    # the ball's rim is seen at asin(0.5 / 4) off the axis
    radius = height / 2 * np.tan(np.arcsin(0.125)) / np.tan(np.radians(15))
    distance = np.hypot(across, down)
    assert (seen[distance < 0.9 * radius - 1] == 0).all()
    assert (seen[distance > radius + 1] == -1).all()
    assert (rgba[seen == -1] == 0).all()
    red, green, blue = rgba[height // 2, width // 2, :3].tolist()
    assert green > 100 > max(red, blue)


def test_windows_leave_nothing_out(world: int) -> None:
    rng = np.random.default_rng(3)
    for _ in range(4):
        for radius_m in (0.005, 0.02, 0.1):
            ball(world, (rng.uniform(-0.9, 0.9, 3)).tolist(), radius_m)
        rgba, seen = looked(world, 700, 500, by_windows=True)
        all_rgba, all_seen = looked(world, 700, 500, by_windows=False)
        assert all_seen.max() == seen.max()
        # a rim may round otherwise
        assert (seen != all_seen).mean() < 1e-4
        assert (rgba != all_rgba).mean() < 1e-3


def test_what_is_too_small_for_the_coarse_look_is_found_when_alone() -> None:
    with silenced():
        client = pybullet.connect(pybullet.DIRECT)
    ball(client, [0.013, 0.0, 0.021], 0.004)
    assert (looked(client, 700, 500, by_windows=True)[1] == 0).any()
    pybullet.disconnect(client)


@pytest.mark.parametrize('kind', [tuple, np.array])
def test_tuples_become_what_arrays_are(kind: type) -> None:
    """A PyBullet that was built without NumPy gives tuples."""
    rng = np.random.default_rng(1)
    colours, numbers = rng.integers(0, 256, 1000), rng.integers(-1, 2**31, 1000)
    got = bytes_of(tuple(colours.tolist()) if kind is tuple else colours.astype(np.uint8))
    assert got.dtype == np.uint8
    assert np.array_equal(got, colours)
    got = integers_of(tuple(numbers.tolist()) if kind is tuple else numbers.astype(np.int32))
    assert got.dtype == np.int32
    assert np.array_equal(got, numbers)
