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

"""A tracker's place and delay, found again from what it would have seen; what cannot be told."""

from __future__ import annotations

from dataclasses import replace

from handover_dmp.common.errors import DataError
from handover_dmp.common.plain_yaml import load_plain
from handover_dmp.common.ros_parameters import unknown_parameter
from handover_dmp.common.settings import defaults
from handover_dmp.mocap.body_path import BodyPath, make_body_path
from handover_dmp.tracking.calibration import calibrate, Calibration
from handover_dmp.tracking.calibration_figure import draw_calibration
from handover_dmp.tracking.calibration_file import node_parameters
from handover_dmp.tracking.frames import FixedTransform
import numpy as np
from PIL import Image
import pytest
from scipy.spatial.transform import Rotation

DELAY_S = 0.083
MARKER = (0.03, -0.02, 0.08)
DURATION_S = 60.0
MILLIMETRE = 1e-3


class Scene:
    """A body in motion, known exactly at any time, and a tracker that stands anywhere."""

    def __init__(self, seed: int = 0, *, turning: float = 0.4, swing: float = 0.15) -> None:
        self.random = np.random.default_rng(seed)
        self.turn = Rotation.random(random_state=seed)
        self.place = self.random.uniform(-1.5, 1.5, 3)
        # as many sines without a common period for each coordinate and each angle
        self.hertz = self.random.uniform(0.05, 0.4, (4, 6))
        self.phases = self.random.uniform(0.0, 6.28, (4, 6))
        self.sizes = np.array([swing] * 3 + [turning] * 3) / 2.0

    def body(self, times):
        waves = np.sin(2 * np.pi * self.hertz * times[:, None, None] + self.phases)
        states = self.sizes * waves.sum(axis=1)
        return states[:, :3] + [0.6, 0.1, 0.9], Rotation.from_rotvec(states[:, 3:])

    def paths(
        self, *, rate_hz=60.0, noise_m=MILLIMETRE, marker=MARKER, delay_s=DELAY_S, turned=True
    ) -> tuple[BodyPath, BodyPath]:
        known = np.arange(0.0, DURATION_S, 0.005)
        positions, turns = self.body(known)
        none = np.full((len(known), 4), np.nan)
        reference = make_body_path(
            'arm', 'world', known, positions, turns.as_quat() if turned else none
        )
        times = np.arange(0.3, DURATION_S - 0.3, 1.0 / rate_hz) + 0.0017
        positions, turns = self.body(times)
        seen = self.turn.inv().apply(positions + turns.apply(marker) - self.place)
        seen += noise_m * self.random.standard_normal(seen.shape)
        return reference, make_body_path(
            'camera', 'camera', times + delay_s, seen, np.full((len(times), 4), np.nan)
        )

    def errors(self, found: Calibration) -> tuple[float, float, float]:
        """Return those of place, mm, rotation, degrees, and delay, ms."""
        turn = Rotation.from_quat(found.quaternion) * self.turn.inv()
        return (
            1e3 * float(np.linalg.norm(found.position - self.place)),
            float(np.rad2deg(turn.magnitude())),
            1e3 * abs(found.delay_s - DELAY_S),
        )


def turned_into(path: BodyPath, positions) -> BodyPath:
    return replace(path, positions=positions)


@pytest.mark.parametrize(
    'seed',
    [seed if seed < 2 else pytest.param(seed, marks=pytest.mark.slow) for seed in range(20)],
)
def test_a_minute_with_a_millimetre_of_noise(seed: int) -> None:
    scene = Scene(seed)
    reference, tracker = scene.paths()
    found = calibrate(reference, tracker)
    place_mm, turn_deg, delay_ms = scene.errors(found)
    assert place_mm < 1.0
    assert turn_deg < 0.1
    assert delay_ms < 2.0
    np.testing.assert_allclose(found.marker, MARKER, atol=1e-3)
    assert found.undetermined == ()
    assert found.warnings == ()
    # of the length of a vector with three normal parts
    assert found.residual_m == pytest.approx(np.sqrt(3.0) * MILLIMETRE, rel=0.1)


@pytest.mark.slow
def test_the_intervals_hold_what_they_promise() -> None:
    """95 of 100, of independent noise and of noise that lasts for a third of a second."""
    for smoothed in (1, 20):
        inside = []
        for seed in range(40):
            scene = Scene(seed)
            reference, tracker = scene.paths(noise_m=0.0)
            noise = scene.random.standard_normal((len(tracker.times) + smoothed - 1, 3))
            kernel = np.ones(smoothed) / np.sqrt(smoothed)
            noise = np.column_stack([np.convolve(n, kernel, 'valid') for n in noise.T])
            found = calibrate(
                reference, turned_into(tracker, tracker.positions + MILLIMETRE * noise)
            )
            inside += (abs(found.position - scene.place) <= found.position_interval_m).tolist()
            inside += (abs(found.marker - MARKER) <= found.marker_interval_m).tolist()
            inside.append(abs(found.delay_s - DELAY_S) <= found.delay_interval_s)
        assert 0.9 <= np.mean(inside) <= 0.99, smoothed


def test_poses_that_are_wrong_or_lost_spoil_nothing() -> None:
    scene = Scene(5)
    reference, tracker = scene.paths()
    positions = tracker.positions.copy()
    wrong = scene.random.random(len(positions)) < 0.1
    positions[wrong] += scene.random.standard_normal((wrong.sum(), 3))
    positions[600:1000] += [0.3, 0.0, 0.2]  # another marker, for seven seconds
    end = len(positions)
    kept = np.r_[0:1500, 1900:end]  # hidden for seven
    spoiled = replace(tracker, times=tracker.times[kept], positions=positions[kept])
    # and the reference is lost for three seconds, with spikes
    places = reference.positions.copy()
    places[::500] += 0.5
    end = len(places)
    seen = np.r_[0:4000, 4600:end]
    other = BodyPath(
        'arm', 'world', reference.times[seen], places[seen], reference.quaternions[seen]
    )
    found = calibrate(other, spoiled)
    place_mm, turn_deg, delay_ms = scene.errors(found)
    assert place_mm < 1.5
    assert turn_deg < 0.1
    assert delay_ms < 2.0
    assert not found.counted[wrong[kept][: len(found.counted)].nonzero()[0][:5]].any()


def test_a_hand_with_two_trackers_that_are_noisy_both() -> None:
    """Neither tells how the hand is turned, and their samples fall together, which tempts."""
    scene = Scene(2)
    reference, tracker = scene.paths(marker=(0.0, 0.0, 0.0), turned=False, rate_hz=100.0)
    every = slice(None, None, 2)
    noisy = reference.positions + MILLIMETRE * scene.random.standard_normal(
        reference.positions.shape
    )
    found = calibrate(BodyPath('mocap', 'world', reference.times[every], noisy[every]), tracker)
    place_mm, turn_deg, delay_ms = scene.errors(found)
    assert place_mm < 1.0
    assert turn_deg < 0.1
    assert delay_ms < 2.0
    assert any('assumed to be at the origin' in warning for warning in found.warnings)
    np.testing.assert_array_equal(found.marker, 0.0)


def test_a_marker_that_is_told_is_not_estimated() -> None:
    scene = Scene(3)
    found = calibrate(*scene.paths(), marker=MARKER)
    assert scene.errors(found)[0] < 1.0
    np.testing.assert_array_equal(found.marker, MARKER)
    assert found.warnings == ()


def test_two_clocks_that_are_hours_apart() -> None:
    scene = Scene(4)
    reference, tracker = scene.paths()
    hours_s = 5.0 * 3600.0
    # the recording knows: the poses were recorded so long after their stamps
    shifted = replace(tracker, times=tracker.times - hours_s, delay_s=hours_s)
    found = calibrate(reference, shifted)
    assert found.delay_s + hours_s == pytest.approx(DELAY_S, abs=2e-3)


def test_a_line_does_not_tell_the_rotation_about_it() -> None:
    scene = Scene(6, turning=0.0)
    reference, tracker = scene.paths(noise_m=0.0)
    way = np.array([0.6, 0.0, 0.8])
    onto = np.outer(way, way)
    on_line = reference.positions @ onto
    truth = (scene.turn.apply(tracker.positions) + scene.place) @ onto
    noise = MILLIMETRE * scene.random.standard_normal(truth.shape)
    seen = scene.turn.inv().apply(truth - scene.place) + noise
    found = calibrate(turned_into(reference, on_line), turned_into(tracker, seen))
    assert 'rotation' in found.undetermined
    assert any('motion is on a line' in warning for warning in found.warnings)
    assert found.delay_s == pytest.approx(DELAY_S, abs=2e-3)  # which a line does tell


def test_a_plane_tells_everything() -> None:
    scene = Scene(7, turning=0.0)
    reference, tracker = scene.paths(marker=(0.0, 0.0, 0.0))
    flat = np.diag([1.0, 1.0, 0.0])
    noise = MILLIMETRE * scene.random.standard_normal(tracker.positions.shape)
    truth, _ = scene.body(tracker.times - DELAY_S)
    seen = scene.turn.inv().apply(truth @ flat - scene.place) + noise
    found = calibrate(
        turned_into(reference, reference.positions @ flat), turned_into(tracker, seen)
    )
    assert scene.errors(found)[1] < 0.1
    assert found.undetermined == ()


def test_a_steady_circle_does_not_tell_delay_and_rotation_apart() -> None:
    times = np.arange(0.0, 60.0, 0.01)
    angle = 2 * np.pi * 0.2 * times
    circle = 0.2 * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    noise = np.random.default_rng(0).standard_normal((2, *circle.shape))
    found = calibrate(
        BodyPath('arm', 'world', times, circle + 5e-4 * noise[0]),
        BodyPath('camera', 'camera', times + 0.1, circle + MILLIMETRE * noise[1]),
    )
    assert {'delay', 'rotation'} <= set(found.undetermined)
    assert any('repeats itself' in warning for warning in found.warnings)


def test_a_body_that_is_turned_about_one_axis_tells_two_parts_of_the_marker() -> None:
    scene = Scene(8)
    scene.sizes[[3, 4]] = 0.0  # about z alone
    found = calibrate(*scene.paths())
    np.testing.assert_allclose(found.marker, [MARKER[0], MARKER[1], 0.0], atol=1e-3)
    assert any('too few axes' in warning and '1.00' in warning for warning in found.warnings)


def test_what_no_transform_mends_is_refused() -> None:
    scene = Scene(9)
    reference, tracker = scene.paths()
    with pytest.raises(DataError, match='stays within'):
        calibrate(turned_into(reference, 0.01 * reference.positions), tracker)
    with pytest.raises(DataError, match='millimetres'):
        calibrate(reference, turned_into(tracker, 1e3 * tracker.positions))
    mirrored = turned_into(tracker, tracker.positions * [1.0, 1.0, -1.0])
    with pytest.raises(DataError, match='mirror image'):
        calibrate(reference, mirrored)
    with pytest.raises(DataError, match='both are of one body'):
        calibrate(reference, Scene(99).paths()[1])
    with pytest.raises(DataError, match='overlap'):
        calibrate(reference, replace(tracker, times=tracker.times + 1000.0))


def test_the_parameters_are_those_of_the_nodes_and_undo_the_tracker() -> None:
    scene = Scene(10)
    found = calibrate(*scene.paths())
    told = node_parameters(found, 'tracker', '/vrpn/wand', 'wrist', 'camera', 'world')
    values = load_plain(told)['/**']['ros__parameters']
    flat = {f'tracker.{name}': value for name, value in values['tracker'].items()}
    for node in ('dmp', 'priority_ik'):
        assert set(flat) <= set(defaults(node))
        assert not unknown_parameter(flat, set(defaults(node)), for_many=True)
    transform = FixedTransform(flat['tracker.position'], flat['tracker.quaternion'])
    point = np.array([0.4, -0.2, 0.7])
    in_tracker = scene.turn.inv().apply(point - scene.place)
    np.testing.assert_allclose(transform(in_tracker), point, atol=2e-3)
    assert flat['tracker.topic'] == '/vrpn/wand'
    assert flat['tracker.body'] == 'wrist'
    assert flat['tracker.delay_s'] == pytest.approx(DELAY_S, abs=2e-3)
    assert flat['tracker.noise_m'] == pytest.approx(MILLIMETRE, rel=0.1)
    assert flat['tracker.rate_hz'] == 60.0
    # the topic that the nodes hear anyhow may be remapped
    other = load_plain(node_parameters(found, 'mocap', '/hand/pose', '', 'camera', 'hall'))
    values = other['/**']['ros__parameters']
    assert values['frame'] == 'hall'
    assert {'topic', 'body'}.isdisjoint(values['mocap'])


def test_the_figure_has_both_paths_and_what_was_left_out(tmp_path) -> None:
    scene = Scene(11)
    reference, tracker = scene.paths()
    positions = tracker.positions.copy()
    positions[::50] += 0.3
    picture = tmp_path / 'calibration.png'
    draw_calibration(calibrate(reference, turned_into(tracker, positions)), picture)
    pixels = np.asarray(Image.open(picture).convert('RGB')).astype(int)
    for colour in ((0x1F, 0x4E, 0x9C), (0xE0, 0xA5, 0x26), (0xD6, 0x27, 0x28)):
        assert (abs(pixels - colour).sum(axis=2) < 30).sum() > 50
