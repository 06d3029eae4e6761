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

"""`handover_dmp calibrate`, from two CSV files and from bags that another library wrote."""

from __future__ import annotations

import json
from pathlib import Path

from handover_dmp.cli.main import main
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
import yaml

rosbag2 = pytest.importorskip('rosbags.rosbag2')
typesys = pytest.importorskip('rosbags.typesys')

EPOCH_NS = 1_700_000_000_000_000_000
PLACE = np.array([1.2, -0.4, 1.5])
TURN = Rotation.from_euler('xyz', [-110.0, 5.0, 80.0], degrees=True)
DELAY_S = 0.05
MARKER = (0.0, 0.04, 0.06)


def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return times, places and quaternions of an arm, and stamps and places of a tracker."""
    random = np.random.default_rng(1)
    hertz, phases = random.uniform(0.1, 0.5, (2, 6)), random.uniform(0.0, 6.28, (2, 6))

    def body(times):
        waves = np.sin(2 * np.pi * hertz * times[:, None, None] + phases).sum(axis=1)
        states = waves * ([0.12] * 3 + [0.3] * 3)
        return states[:, :3] + [0.5, 0.0, 0.8], Rotation.from_rotvec(states[:, 3:])

    times, seen_at = np.arange(0.0, 20.0, 0.01), np.arange(0.2, 19.8, 1.0 / 30.0)
    places, turns = body(times)
    then, turned = body(seen_at)
    seen = TURN.inv().apply(then + turned.apply(MARKER) - PLACE)
    seen += 1e-3 * random.standard_normal(seen.shape)
    return times, places, turns.as_quat(), seen_at + DELAY_S, seen


def write_csv(path: Path, header: str, columns: list[np.ndarray]) -> Path:
    lines = [','.join(map(repr, row)) for row in np.column_stack(columns).tolist()]
    path.write_text('\n'.join([header, *lines]) + '\n', encoding='utf-8')
    return path


def write_bag(folder: Path, storage: str, frame: str = 'camera') -> Path:
    """Write the arm as poses, and as transforms the hand among another body, now and then lost."""
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    make = store.types
    times, places, turns, stamps, seen = scene()

    def header(time_s, name):
        seconds, rest = divmod(EPOCH_NS + round(1e9 * time_s), 10**9)
        stamp = make['builtin_interfaces/msg/Time'](sec=seconds, nanosec=rest)
        return make['std_msgs/msg/Header'](stamp=stamp, frame_id=name)

    def pose(time_s, place, turn):
        return make['geometry_msgs/msg/PoseStamped'](
            header=header(time_s, 'world'),
            pose=make['geometry_msgs/msg/Pose'](
                position=make['geometry_msgs/msg/Point'](*place),
                orientation=make['geometry_msgs/msg/Quaternion'](*turn),
            ),
        )

    def transform(time_s, name, place):
        return make['geometry_msgs/msg/TransformStamped'](
            header=header(time_s, frame),
            child_frame_id=name,
            transform=make['geometry_msgs/msg/Transform'](
                translation=make['geometry_msgs/msg/Vector3'](*place),
                rotation=make['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0),
            ),
        )

    messages = [
        (t, '/wrist/pose', pose(t, *both))
        for t, *both in zip(times.tolist(), places.tolist(), turns.tolist(), strict=True)
    ]
    for number, (t, place) in enumerate(zip(stamps.tolist(), seen.tolist(), strict=True)):
        lost = number % 40 < 4
        messages.append((t, '/tracked', transform(t, 'wand', [0.0] * 3 if lost else place)))
        messages.append((t, '/tracked', transform(t, 'head', [1.0, 2.0, 3.0])))
    with rosbag2.Writer(
        folder, version=9, storage_plugin=rosbag2.StoragePlugin[storage]
    ) as writer:
        connections = {
            '/wrist/pose': writer.add_connection(
                '/wrist/pose', 'geometry_msgs/msg/PoseStamped', typestore=store
            ),
            '/tracked': writer.add_connection(
                '/tracked', 'geometry_msgs/msg/TransformStamped', typestore=store
            ),
        }
        for time_s, topic, message in sorted(messages, key=lambda item: item[0]):
            data = store.serialize_cdr(message, connections[topic].msgtype)
            writer.write(connections[topic], EPOCH_NS + round(1e9 * time_s), data)
    return folder


def check(parameters: Path, frame: str) -> None:
    values = yaml.safe_load(parameters.read_text(encoding='utf-8'))['/**']['ros__parameters']
    tracker = values['tracker']
    assert tracker['frame'] == frame
    np.testing.assert_allclose(tracker['position'], PLACE, atol=2e-3)
    turn = Rotation.from_quat(tracker['quaternion']) * TURN.inv()
    assert np.rad2deg(turn.magnitude()) < 0.15
    assert tracker['delay_s'] == pytest.approx(DELAY_S, abs=2e-3)


def test_two_csv_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    times, places, turns, stamps, seen = scene()
    arm = write_csv(tmp_path / 'arm.csv', 't,x,y,z,qx,qy,qz,qw', [times, places, turns])
    # columns in another order, and a pose that is none
    camera = write_csv(tmp_path / 'camera.csv', 'x,y,z,t', [seen, stamps])
    camera.write_text(camera.read_text(encoding='utf-8') + 'nan,nan,nan,19.99\n')
    output, told = tmp_path / 'out' / 'tracker.yaml', tmp_path / 'told.json'
    words = ['calibrate', str(arm), str(camera), '-o', str(output), '--json', str(told)]
    assert main([*words, '--frame', 'camera']) == 0
    check(output, 'camera')
    result = json.loads(told.read_text(encoding='utf-8'))
    np.testing.assert_allclose(result['marker_m'], MARKER, atol=1e-3)
    assert result['undetermined'] == []
    assert Path(result['figure']).stat().st_size > 10_000
    assert '± ' in capsys.readouterr().out


@pytest.mark.parametrize('storage', ['MCAP', 'SQLITE3'])
def test_bags_of_any_storage_and_type(tmp_path: Path, storage: str) -> None:
    bag = write_bag(tmp_path / 'bag', storage)
    output = tmp_path / 'tracker.yaml'
    words = ['calibrate', str(bag), '--tracker', '/tracked:wand', '-o', str(output)]
    assert main(words) == 0
    check(output, 'camera')
    assert 'body: wand' in output.read_text(encoding='utf-8')


def test_a_tracker_that_calls_its_frame_world_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The nodes would not transform its poses, whatever stood in the file."""
    bag = write_bag(tmp_path / 'bag', 'MCAP', frame='world')
    output = tmp_path / 'tracker.yaml'
    words = ['calibrate', str(bag), '--tracker', '/tracked:wand', '-o', str(output)]
    assert main(words) == 1
    assert "frame 'world', as is the reference" in capsys.readouterr().err
    assert not output.exists()
    assert main([*words, '--frame', 'camera']) == 0
    check(output, 'camera')


@pytest.mark.filterwarnings('error')
def test_what_is_not_determined_is_not_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    times, places, _, stamps, _ = scene()
    way = np.array([0.0, 0.6, 0.8])
    line = 3.0 * np.outer(places @ way, way)
    seen = np.column_stack([np.interp(stamps - DELAY_S, times, column) for column in line.T])
    arm = write_csv(tmp_path / 'arm.csv', 't,x,y,z', [times, line])
    camera = write_csv(tmp_path / 'camera.csv', 't,x,y,z', [stamps, seen])
    output = tmp_path / 'tracker.yaml'
    assert main(['calibrate', str(arm), str(camera), '-o', str(output)]) == 1
    said = capsys.readouterr().out
    assert 'is on a line' in said
    assert 'no parameters written' in said
    assert not output.exists()
    assert output.with_suffix('.png').is_file()


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        ([], 'a bag, two CSV files, or --move'),
        (['arm.csv'], 'the CSV file of the tracker is missing'),
        (['bag', 'camera.csv'], 'must both be CSV files'),
        (['a', 'b', 'c'], 'a bag, two CSV files'),
        (['a', '-o', 'tracker.json'], 'must end in .yaml'),
        (['a', '--max-delay', '-1'], '--max-delay is -1 s'),
        (['a', '--move'], 'leave out the other sources'),
    ],
)
def test_wrong_usage_is_one_line(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['calibrate', *words]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count('\n') == 1


def test_a_csv_file_without_the_columns_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    times, places, *_ = scene()
    arm = write_csv(tmp_path / 'arm.csv', 't,x,y,z', [times, places])
    other = write_csv(tmp_path / 'other.csv', 'time,x,y,z', [times, places])
    assert main(['calibrate', str(arm), str(other)]) == 1
    assert "other.csv: line 1: no column 't'" in capsys.readouterr().err
    few = write_csv(tmp_path / 'few.csv', 't,x,y,z', [times[:5], places[:5]])
    assert main(['calibrate', str(arm), str(few)]) == 1
    assert 'few.csv: 5 poses; at least 20' in capsys.readouterr().err
