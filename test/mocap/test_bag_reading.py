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

"""Wrists out of bags, on bags written by another library, rosbags."""

from __future__ import annotations

import json

from handover_dmp.common.errors import DataError
from handover_dmp.handover.scenario import recorded_trial
from handover_dmp.mocap import synthesize
from handover_dmp.mocap.bag import describe_bag, read_bag_wrists
from handover_dmp.mocap.filtering import interpolate
import numpy as np
import pytest

pytest.importorskip('mcap')
rosbag2 = pytest.importorskip('rosbags.rosbag2')
typesys = pytest.importorskip('rosbags.typesys')

EPOCH_NS = 1_700_000_000_123_456_789


@pytest.fixture(scope='module')
def trial():
    return synthesize(trials=1)[1]


def write(folder, streams):
    """Write (topic, type, frame, [(stamp ns, log time ns, x, y, z), ...]) streams."""
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    types = store.types

    def message(kind, frame, stamp_ns, place):
        seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
        stamp = types['builtin_interfaces/msg/Time'](sec=seconds, nanosec=nanoseconds)
        header = types['std_msgs/msg/Header'](stamp=stamp, frame_id=frame)
        if kind == 'std_msgs/msg/Header':
            return header
        point = types['geometry_msgs/msg/Point'](*place)
        turn = types['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0)
        if kind == 'geometry_msgs/msg/PointStamped':
            return types[kind](header=header, point=point)
        if kind == 'geometry_msgs/msg/TransformStamped':
            way = types['geometry_msgs/msg/Vector3'](*place)
            transform = types['geometry_msgs/msg/Transform'](translation=way, rotation=turn)
            return types[kind](header=header, child_frame_id='wrist', transform=transform)
        pose = types['geometry_msgs/msg/Pose'](position=point, orientation=turn)
        if kind == 'geometry_msgs/msg/PoseWithCovarianceStamped':
            pose = types['geometry_msgs/msg/PoseWithCovariance'](
                pose=pose, covariance=np.zeros(36)
            )
        return types[kind](header=header, pose=pose)

    with rosbag2.Writer(folder, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        for topic, kind, frame, rows in streams:
            connection = writer.add_connection(topic, kind, typestore=store)
            for stamp_ns, log_ns, *place in rows:
                data = store.serialize_cdr(message(kind, frame, stamp_ns, place), kind)
                writer.write(connection, log_ns, data)
    return folder


def rows(times, path, *, stamped=True):
    stamps = [EPOCH_NS + round(1e9 * time) for time in times]
    return [
        (stamp if stamped else 0, stamp + 1_000_000, *place)
        for stamp, place in zip(stamps, path.tolist(), strict=True)
    ]


POSE = 'geometry_msgs/msg/PoseStamped'
KINDS = [
    POSE,
    'geometry_msgs/msg/PointStamped',
    'geometry_msgs/msg/TransformStamped',
    'geometry_msgs/msg/PoseWithCovarianceStamped',
]


@pytest.mark.parametrize('kind', KINDS)
def test_any_stamped_place(tmp_path, trial, kind):
    folder = write(
        tmp_path / 'bag',
        [
            ('/hand/pose', kind, 'world', rows(trial.times, trial.partner)),
            ('/human/pose', kind, 'world', rows(trial.times, trial.demonstrator)),
        ],
    )
    motion = read_bag_wrists(folder)
    np.testing.assert_allclose(motion.times, trial.times, atol=1e-8)
    np.testing.assert_array_equal(motion.partner, trial.partner)
    np.testing.assert_allclose(motion.demonstrator, trial.demonstrator, atol=1e-9)


def test_two_clocks_out_of_order_and_twice(tmp_path, trial):
    """P2 comes at another rate, mixed up and with repetitions, and starts later."""
    late = np.arange(0.1, trial.times[-1], 1.0 / 120.0)
    truth = interpolate(trial.times, trial.demonstrator)
    second = rows(late, truth(late))
    second = [*second[1::2], *second[::2], *second[:5]]
    folder = write(
        tmp_path / 'bag',
        [('/a', POSE, 'world', rows(trial.times, trial.partner)), ('/b', POSE, 'world', second)],
    )
    motion = read_bag_wrists(folder, '/a', '/b')
    inside = (trial.times > late[0] - 1e-9) & (trial.times < late[-1] + 1e-9)
    np.testing.assert_allclose(motion.times, trial.times[inside], atol=1e-8)
    np.testing.assert_allclose(motion.demonstrator, trial.demonstrator[inside], atol=5e-4)


def test_without_stamps_the_time_of_recording_counts(tmp_path, trial):
    folder = write(
        tmp_path / 'bag',
        [
            ('/a', POSE, 'world', rows(trial.times, trial.partner, stamped=False)),
            ('/b', POSE, 'world', rows(trial.times, trial.demonstrator, stamped=False)),
        ],
    )
    np.testing.assert_allclose(read_bag_wrists(folder, '/a', '/b').times, trial.times, atol=1e-8)


def test_where_p2_is_silent_nothing_is_made_up(tmp_path, trial):
    seen = (trial.times < 0.4) | (trial.times > 0.8)
    folder = write(
        tmp_path / 'bag',
        [
            ('/a', POSE, 'world', rows(trial.times, trial.partner)),
            ('/b', POSE, 'world', rows(trial.times[seen], trial.demonstrator[seen])),
        ],
    )
    motion = read_bag_wrists(folder, '/a', '/b')
    assert not ((motion.times > 0.41) & (motion.times < 0.79)).any()
    assert len(motion.spans()) == 2


def test_a_bag_tells_what_it_is_of(tmp_path, trial):
    from handover_dmp.mocap.trial_bag import write_trial_bag

    assert trial.label == 'engine_bay take 1'
    folder = tmp_path / 'monday'
    write_trial_bag(trial, folder)
    again = recorded_trial(folder)
    assert again.label == recorded_trial(folder / 'monday_0.mcap').label == trial.label
    np.testing.assert_allclose(again.demonstrator[-1], trial.demonstrator[-1], atol=5e-3)


RUN = {'configuration': 'under_car', 'exchange': 'take', 'number': 3, 'trial': 'under_car take 3'}
TOLD = {
    'a run': (RUN, {}, ('under_car', 'take', 3)),
    'both': (RUN, {'exchange': 'give', 'trial': '7'}, ('bay', 'give', 7)),
    'its name': ({'seed': 7}, {'robot': 'lwr4'}, ('bay', 'take', 2)),
    'nonsense': (['take'], {'exchange': 'lend', 'trial': '-1'}, ('bay', 'take', 2)),
}


@pytest.mark.parametrize('name', TOLD)
def test_what_a_bag_tells_goes_before_its_name(tmp_path, name):
    from handover_dmp.recording import BagWriter
    from handover_dmp.recording.messages import string

    info, pairs, expected = TOLD[name]
    with BagWriter(tmp_path / 'bay_take_2', custom_data=pairs) as bag:
        bag.add_topic('/handover/info', 'std_msgs/msg/String')
        bag.write_message('/handover/info', string(json.dumps(info)), 1)
    assert describe_bag(tmp_path / 'bay_take_2') == expected


def test_bags_that_cannot_be_used(tmp_path, trial):
    good = rows(trial.times, trial.partner)
    broken = [good[0], (good[1][0], good[1][1], float('nan'), 0.0, 0.0), *good[2:]]
    later = [(stamp + 10**11, log, *place) for stamp, log, *place in good]
    cases = {
        'poses on /b': [('/a', POSE, 'world', good)],
        'holds no stamped poses': [
            ('/a', POSE, 'world', good),
            ('/b', 'std_msgs/msg/Header', 'world', good),
        ],
        "/a is in frame 'world', /b in 'map'": [
            ('/a', POSE, 'world', good),
            ('/b', POSE, 'map', good),
        ],
        'not finite': [('/a', POSE, 'world', good), ('/b', POSE, 'world', broken)],
        'do not overlap': [('/a', POSE, 'world', good), ('/b', POSE, 'world', later)],
        '1 stamps on /b': [('/a', POSE, 'world', good), ('/b', POSE, 'world', good[:1] * 9)],
    }
    for number, (message, streams) in enumerate(cases.items()):
        folder = write(tmp_path / str(number), streams)
        with pytest.raises(DataError, match=message):
            read_bag_wrists(folder, '/a', '/b')
    with pytest.raises(DataError, match='no such bag'):
        read_bag_wrists(tmp_path / 'nowhere')
