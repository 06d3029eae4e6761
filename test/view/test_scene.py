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

"""The pictures show what happened: who, where, and who has the object."""

from __future__ import annotations

from handover_dmp.common.errors import DataError
from handover_dmp.robot.model import BasePlacement, RobotModel
from handover_dmp.simulation.stances import stance_of
from handover_dmp.view.scene import Scene, SceneOptions
from handover_dmp.view.surroundings import SURROUNDINGS
import numpy as np
import pytest

SIZE = (240, 180)


def handover(robot='lwr4', direction='give', **keywords):
    """Make a scene of a hand that comes and an arm that swings towards it, 1.5 s."""
    times = np.linspace(0.0, 1.5, 60)
    u = (times / 1.5)[:, None]
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    hand = np.array([1.35, 0.2, 0.85]) + s * np.array([-0.35, -0.2, 0.2])
    model = RobotModel.load(robot, base=BasePlacement((0.0, 0.0, 0.6), 0.0))
    toward = np.zeros(model.dof)
    toward[0] = 0.8
    joints = model.home + (1.0 - s) * toward
    return Scene(model, times, joints, hand, direction=direction, **keywords)


def near(picture, colour, tolerance=0.35):
    """Count the pixels of a colour, whatever its brightness."""
    rgb = picture.astype(float) + 1.0
    rgb /= np.linalg.norm(rgb, axis=2, keepdims=True)
    wanted = np.array(colour) / np.linalg.norm(colour)
    return int((np.linalg.norm(rgb - wanted, axis=2) < tolerance).sum())


@pytest.fixture(scope='module')
def scene():
    with handover() as made:
        yield made


@pytest.fixture(scope='module')
def three(scene):
    return scene.three_images(480, 360)


def test_pictures_have_the_size_that_was_asked_for(scene, three):
    assert all(p.shape == (360, 480, 3) and p.dtype == np.uint8 for p in three)
    assert scene.image(0.3, 120, 200).shape == (200, 120, 3)


def test_trails_grow(three):
    red = [near(p, (1.0, 0.16, 0.18), 0.15) for p in three]
    blue = [near(p, (0.12, 0.48, 1.0), 0.15) for p in three]
    assert red[0] < 5 < red[1] < red[2]
    assert blue[0] < 5 < blue[1] < blue[2]


def test_robot_and_person_are_seen(three):
    for picture in three:
        assert near(picture, (0.95, 0.45, 0.10), 0.2) > 1000  # the arm's shells
        assert near(picture, (0.23, 0.44, 0.58), 0.12) > 1000  # the shirt


def test_same_moment_gives_the_same_picture(scene):
    first = scene.image(0.7, *SIZE)
    scene.image(1.2, *SIZE)
    assert np.array_equal(first, scene.image(0.7, *SIZE))


def test_middle_is_the_middle_of_the_way(scene):
    wrist = scene.wrist_path
    steps = np.linalg.norm(np.diff(wrist, axis=0), axis=1)
    made = steps[scene.times[1:] <= scene.middle_time_s].sum()
    assert made / steps.sum() == pytest.approx(0.5, abs=0.05)


def test_camera_sees_all_of_it_and_wastes_little():
    with handover() as scene:
        for size in ((320, 180), (180, 320)):
            camera = scene.camera(*size)
            person = scene.figure.pelvis
            points = np.array(
                [
                    [*person[:2], scene.floor_height_m],
                    [*person[:2], scene.floor_height_m + scene.figure.height_m],
                    [*scene.model.base.position[:2], scene.floor_height_m],
                    [1.35, 0.2, 0.85],
                ]
            )
            seen = camera.project(points)
            assert np.all(np.abs(seen) < 1.0)
            assert np.ptp(seen, axis=0).max() > 1.2


def test_bodies_are_drawn_where_the_camera_projects_them(scene):
    """Ask PyBullet's picture and the arithmetic for floor and framing agree."""
    picture = scene.image(float(scene.times[-1]), 480, 360).astype(float)
    camera = scene.camera(480, 360)
    x, y = camera.project(scene.object_pose[0][None])[0]
    column, row = (x + 1) / 2 * 480, (1 - y) / 2 * 360
    patch = picture[int(row) - 3: int(row) + 4, int(column) - 3: int(column) + 4]  # fmt: skip
    assert near(patch, (0.98, 0.80, 0.15), 0.15) > 5


def test_rays_are_the_inverse_of_the_projection(scene):
    camera = scene.camera(64, 48)
    points = camera.eye + 2.0 * camera.rays()
    seen = camera.project(points.reshape(-1, 3)).reshape(48, 64, 2)
    assert seen[0, 0] == pytest.approx([-1 + 1 / 64, 1 - 1 / 48], abs=1e-5)
    assert seen[40, 10] == pytest.approx([-1 + 21 / 64, 1 - 81 / 48], abs=1e-5)


@pytest.mark.parametrize('direction', ['give', 'take'])
def test_object_is_with_the_giver_first_and_does_not_jump(direction):
    with handover(direction=direction, exchange_time_s=1.0) as scene:
        distance = {}
        for time_s in (0.0, 1.0 - 1e-6, 1.0 + 1e-6, 1.5):
            scene.show(time_s)
            index = np.searchsorted(scene.times, time_s)
            hand = scene.hand_path[min(index, 59)]
            wrist = scene.wrist_path[min(index, 59)]
            distance[time_s] = (
                np.linalg.norm(scene.object_pose[0] - wrist),
                np.linalg.norm(scene.object_pose[0] - hand),
            )
            if time_s == 1.0 - 1e-6:
                before = scene.object_pose[0]
            if time_s == 1.0 + 1e-6:
                assert scene.object_pose[0] == pytest.approx(before, abs=1e-5)
    giver = 0 if direction == 'give' else 1
    # Held by the giver before and by the receiver after: at the same distance all along.
    assert distance[0.0][giver] == pytest.approx(distance[1.0 - 1e-6][giver], abs=2e-2)
    assert distance[1.5][1 - giver] == pytest.approx(distance[1.0 + 1e-6][1 - giver], abs=2e-2)
    assert distance[0.0][1 - giver] > distance[1.0 - 1e-6][1 - giver] + 0.05


@pytest.mark.parametrize('robot', ['iiwa14', 'panda', 'ur5'])
def test_other_robots_are_drawn_too(robot):
    with handover(robot, options=SceneOptions(samples=1)) as scene:
        with_robot = scene.image(0.0, *SIZE)
        x, y = scene.camera(*SIZE).project(scene.wrist_path[:1])[0]
    column, row = int((x + 1) / 2 * 240), int((1 - y) / 2 * 180)
    patch = with_robot[row - 12: row + 12, column - 12: column + 12].astype(float)  # fmt: skip
    assert patch.std() > 5  # something stands out from the flat background


@pytest.mark.parametrize('fault', ['short', 'nan'])
def test_data_that_cannot_be_drawn_are_one_clear_line(fault):
    model = RobotModel.load('lwr4')
    hand = np.tile([1.0, 0.0, 1.0], (4 if fault == 'short' else 5, 1))
    hand[2, 1] = 0.0 if fault == 'short' else np.nan
    with pytest.raises(DataError, match='hand: not 5 rows of finite numbers'):
        Scene(model, np.arange(5.0), np.tile(model.home, (5, 1)), hand)


def test_one_moment_is_enough():
    model = RobotModel.load('lwr4')
    with Scene(model, np.zeros(1), model.home[None], np.array([[1.0, 0.0, 1.0]])) as scene:
        assert len(scene.three_images(40, 30)) == 3


def test_writes_nothing_to_the_terminal(capfd):
    with handover('panda', options=SceneOptions(samples=1)) as scene:
        scene.image(0.5, 60, 40)
    assert capfd.readouterr() == ('', '')


def test_many_pictures_take_no_more_memory(scene):
    import resource

    def most_kilobytes():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    for time_s in np.linspace(0, 1.5, 10):
        scene.image(time_s, 160, 120)
    before = most_kilobytes()
    for time_s in np.linspace(0, 1.5, 30):
        scene.image(time_s, 160, 120)
    assert most_kilobytes() - before < 1000


def test_what_is_around_the_person_is_drawn_and_in_the_picture():
    around = SURROUNDINGS['hydraulic_lift']
    with handover(surroundings=around, options=SceneOptions(samples=1)) as scene:
        picture, camera = scene.image(0.5, *SIZE), scene.camera(*SIZE)
        assert len(scene.around) == len(around.pieces)
        eye = camera.eye
        wheels = [place for piece, place, _ in scene.around if piece.is_round]
        near_wheel = min(wheels, key=lambda place: float(np.linalg.norm(place - eye)))
        places = camera.project(np.array([place for _, place, _ in scene.around]))
        x, y = camera.project(near_wheel[None])[0]
    assert np.all(np.abs(places) < 1.0)
    hub = picture[int((1 - y) / 2 * 180), int((x + 1) / 2 * 240)]
    assert hub.mean() < 140  # before the sky, which is nearly white


def test_object_that_goes_back_is_with_the_robot_again_and_never_jumps():
    with handover(exchange_time_s=0.6, back_time_s=1.2, options=SceneOptions(samples=1)) as scene:
        places, to_wrist = [], []
        for time_s in np.arange(0.0, 1.5, 0.005):
            scene.show(time_s)
            places.append(scene.object_pose[0])
            wrist, _ = scene.model.wrist_pose(scene.joint_positions(time_s))
            to_wrist.append(np.linalg.norm(places[-1] - wrist))
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / 0.005
    assert speeds.max() < 3.0  # the arm swings at up to 1.5 m/s, and the object is turned
    # in the gripper it keeps its distance from the wrist
    assert np.ptp(to_wrist[:120]) < 1e-6
    assert np.ptp(to_wrist[241:]) < 1e-6
    assert np.ptp(to_wrist[120:241]) > 0.02


@pytest.mark.parametrize('configuration', SURROUNDINGS)
def test_what_is_around_the_person_is_in_the_picture(configuration):
    around = SURROUNDINGS[configuration]
    with handover(surroundings=around, stance=stance_of(configuration)) as made:
        camera = made.camera(480, 360)
        ends = [
            place + 0.5 * piece.size[2] * np.array([0.0, 0.0, side])
            for piece, place, _ in made.around
            for side in (-1.0, 1.0)
        ]
    assert len(ends) == 2 * len(around.pieces)
    assert np.abs(camera.project(np.array(ends))).max() < 0.95
