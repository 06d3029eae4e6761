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
import re

from handover_dmp.common.errors import DataError
from handover_dmp.handover.recordings import recorded_trial
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


def write(folder, streams, *, storage='MCAP', mode=None):
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

    bag = rosbag2.Writer(folder, version=9, storage_plugin=rosbag2.StoragePlugin[storage])
    if mode:
        bag.set_compression(rosbag2.CompressionMode[mode], rosbag2.CompressionFormat.ZSTD)
    with bag as writer:
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
    """P2 comes at another rate, now and then late and with repetitions, and starts later."""
    late = np.arange(0.1, trial.times[-1], 1.0 / 120.0)
    truth = interpolate(trial.times, trial.demonstrator)
    second = rows(late, truth(late))
    # A neighbour late every now and then, and the last five once more.
    for k in range(10, len(second) - 10, 17):
        second[k], second[k + 1] = second[k + 1], second[k]
    second = [*second, *(second[-1:] * 5)]
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
    again = recorded_trial(folder, cutoff_hz=0.0)
    of_file = recorded_trial(folder / 'monday_0.mcap', cutoff_hz=0.0)
    assert again.label == of_file.label == trial.label
    np.testing.assert_allclose(again.demonstrator[-1], trial.demonstrator[-1], atol=5e-3)


def run_bag(folder, trial, *, at_s=(2.0,), end_s=9.0):
    """Write a bag as a run leaves it: both wrists at rest, the handovers, rest again."""
    from handover_dmp.recording import BagWriter, SENSOR
    from handover_dmp.recording.messages import pose_stamped

    topics = ('/hand/pose', '/human/pose')
    with BagWriter(folder) as bag:
        for topic in topics:
            bag.add_topic(topic, 'geometry_msgs/msg/PoseStamped', SENSOR)
        for time_s in np.arange(0.0, end_s, 0.005):
            begun_s = max((at for at in at_s if at <= time_s), default=at_s[0])
            since_s = float(np.clip(time_s - begun_s, 0.0, trial.duration_s))
            # after each handover but the last, both go back
            over_s = time_s - begun_s - trial.duration_s
            if len(at_s) > 1 and begun_s != at_s[-1] and over_s > 0.5:
                since_s = float(np.clip(trial.duration_s - (over_s - 0.5), 0.0, None))
            time_ns = round((1.0 + time_s) * 1e9)
            for topic, path in zip(topics, (trial.partner, trial.demonstrator), strict=True):
                place = [float(np.interp(since_s, trial.times, axis)) for axis in path.T]
                bag.write_message(topic, pose_stamped(time_ns, place), time_ns)
    return folder


def test_the_handover_in_the_bag_of_a_run_is_found(tmp_path, trial):
    found = recorded_trial(run_bag(tmp_path / 'bag', trial), cutoff_hz=0.0)
    assert found.duration_s == pytest.approx(trial.duration_s, abs=0.4)
    np.testing.assert_allclose(found.partner[-1], trial.partner[-1], atol=0.02)
    assert re.fullmatch(r'.*bag, [12]\.\d\d s to [34]\.\d\d s', found.source), found.source


def test_the_handover_in_a_bag_is_chosen(tmp_path, trial):
    bag = run_bag(tmp_path / 'bag', trial)
    chosen = recorded_trial(bag, cutoff_hz=0.0, span_s=(2.0, 3.0))
    assert chosen.duration_s == pytest.approx(1.0, abs=0.006)
    np.testing.assert_allclose(chosen.partner[0], trial.partner[0], atol=1e-9)
    with pytest.raises(DataError, match='0 samples are too few for a handover'):
        recorded_trial(bag, cutoff_hz=0.0, span_s=(20.0, 30.0))


def test_of_several_handovers_in_a_bag_one_is_asked_for(tmp_path, trial):
    bag = run_bag(tmp_path / 'bag', trial, at_s=(2.0, 8.0), end_s=13.0)
    with pytest.raises(DataError, match=r'2 handovers, .* choose one'):
        recorded_trial(bag, cutoff_hz=0.0)


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
    later = [(stamp + 10**11, log, *place) for stamp, log, *place in good]
    cases = {
        'poses on /b': [('/a', POSE, 'world', good)],
        'holds no poses': [
            ('/a', POSE, 'world', good),
            ('/b', 'std_msgs/msg/Header', 'world', good),
        ],
        "/a is in frame 'world', /b in 'map'": [
            ('/a', POSE, 'world', good),
            ('/b', POSE, 'map', good),
        ],
        'do not overlap': [('/a', POSE, 'world', good), ('/b', POSE, 'world', later)],
        '1 poses on /b': [('/a', POSE, 'world', good), ('/b', POSE, 'world', good[:1] * 9)],
    }
    for number, (message, streams) in enumerate(cases.items()):
        folder = write(tmp_path / str(number), streams)
        with pytest.raises(DataError, match=message):
            read_bag_wrists(folder, '/a', '/b')
    with pytest.raises(DataError, match='no such bag'):
        read_bag_wrists(tmp_path / 'nowhere')


def lost_in(good, first, end, place):
    return [*good[:first], *((*row[:2], *place) for row in good[first:end]), *good[end:]]


@pytest.mark.parametrize('place', [(0.0, 0.0, 0.0), (float('nan'), 1.0, 1.0)])
def test_lost_poses_are_gaps(tmp_path, trial, place):
    first = rows(trial.times, trial.partner)
    second = rows(trial.times, trial.demonstrator)
    folder = write(
        tmp_path / 'bag',
        [
            ('/a', POSE, 'world', lost_in(first, 30, 31, place)),
            ('/b', POSE, 'world', lost_in(second, 60, 90, place)),
        ],
    )
    motion = read_bag_wrists(folder, '/a', '/b')
    kept = np.delete(np.arange(len(trial.times)), 30)
    np.testing.assert_allclose(motion.times, trial.times[kept], atol=1e-8)
    np.testing.assert_array_equal(motion.partner, trial.partner[kept])
    # 30 samples at 200 Hz are bridged.
    np.testing.assert_allclose(motion.demonstrator, trial.demonstrator[kept], atol=5e-3)
    assert [gap.who for gap in motion.gaps] == ['P1', 'P2']
    np.testing.assert_allclose(motion.gaps[1][1:], trial.times[[59, 90]], atol=1e-6)


def reset_rows(trial, back_s, stamped=True):
    """Record the trial, then with a clock set back its mirror image."""
    once = rows(trial.times, trial.partner, stamped=stamped)
    begin = EPOCH_NS + round((trial.duration_s + 0.01) * 1e9)
    shift = round(1e9 * back_s)
    mirrored = trial.partner * [1.0, -1.0, 1.0]
    again = [
        (begin + round(1e9 * time) - shift, begin + round(1e9 * time) + 1_000_000, *place)
        for time, place in zip(trial.times, mirrored.tolist(), strict=True)
    ]
    return once + again, mirrored


@pytest.mark.parametrize('back_s', [0.1, 0.3, 1.0, 100.0])
@pytest.mark.parametrize('which', ['both', 'one'])
def test_a_clock_that_was_set_back(tmp_path, trial, back_s, which):
    first, mirrored = reset_rows(trial, back_s)
    second = first if which == 'both' else reset_rows(trial, 0.0)[0]
    folder = write(tmp_path / 'bag', [('/a', POSE, 'world', first), ('/b', POSE, 'world', second)])
    with pytest.raises(DataError, match=r'the clock was set back .* --part \(1: .*, 2: .*\)'):
        read_bag_wrists(folder, '/a', '/b')
    np.testing.assert_array_equal(
        read_bag_wrists(folder, '/a', '/b', part=1).partner, trial.partner
    )
    if which == 'both':
        motion = read_bag_wrists(folder, '/a', '/b', part=2)
        np.testing.assert_array_equal(motion.partner, mirrored)
        np.testing.assert_allclose(motion.times, trial.times, atol=1e-8)
    with pytest.raises(DataError, match=r'no part 3'):
        read_bag_wrists(folder, '/a', '/b', part=3)


def test_trackers_whose_clocks_differ(tmp_path, trial):
    first = rows(trial.times, trial.partner)
    second = [
        (stamp - 300_000_000, log, *place)
        for stamp, log, *place in rows(trial.times, trial.demonstrator)
    ]
    folder = write(tmp_path / 'bag', [('/a', POSE, 'world', first), ('/b', POSE, 'world', second)])
    (remark,) = read_bag_wrists(folder, '/a', '/b').remarks
    assert '/a is stamped 0.001 s and /b 0.301 s before it was recorded' in remark
    assert 'apart in time by 0.300 s' in remark
    motion = read_bag_wrists(folder, '/a', '/b', clock='log')
    assert motion.remarks == ()
    np.testing.assert_allclose(motion.demonstrator, trial.demonstrator, atol=1e-9)


def write_lists(folder, kind, trial):
    """Write both wrists and a third body as one message a time, of several kinds."""
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    if kind.startswith('mocap4r2'):
        store.register(typesys.get_types_from_msg(RIGID_BODY, 'mocap4r2_msgs/msg/RigidBody'))
        store.register(typesys.get_types_from_msg(RIGID_BODIES, kind))
    types = store.types
    turn = types['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0)

    def members(header, places):
        for name, place in zip(('head', 'p1', 'p2'), places, strict=True):
            if kind == 'tf2_msgs/msg/TFMessage':
                way = types['geometry_msgs/msg/Vector3'](*place)
                yield types['geometry_msgs/msg/TransformStamped'](
                    header, name, types['geometry_msgs/msg/Transform'](way, turn)
                )
                continue
            pose = types['geometry_msgs/msg/Pose'](types['geometry_msgs/msg/Point'](*place), turn)
            named = kind.startswith('mocap4r2')
            yield types['mocap4r2_msgs/msg/RigidBody'](name, pose) if named else pose

    with rosbag2.Writer(folder, version=8, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        connection = writer.add_connection('/bodies', kind, typestore=store)
        for time, *places in zip(trial.times, trial.partner - 0.5, trial.partner,
                                 trial.demonstrator, strict=True):  # fmt: skip
            stamp = EPOCH_NS + round(1e9 * time)
            header = types['std_msgs/msg/Header'](
                types['builtin_interfaces/msg/Time'](*divmod(stamp, 10**9)), 'world'
            )
            found = list(members(header, places))
            whole = kind == 'tf2_msgs/msg/TFMessage'
            message = types[kind](found) if whole else types[kind](header, found)
            writer.write(connection, stamp, store.serialize_cdr(message, kind))
    return folder


RIGID_BODY = 'string rigid_body_name\ngeometry_msgs/Pose pose\n'
RIGID_BODIES = 'std_msgs/Header header\nmocap4r2_msgs/RigidBody[] rigidbodies\n'
LISTS = {
    'tf2_msgs/msg/TFMessage': ('p1', 'p2', 'head, p1, p2'),
    'mocap4r2_msgs/msg/RigidBodies': ('p1', 'p2', 'head, p1, p2'),
    'geometry_msgs/msg/PoseArray': ('1', '2', '0, 1, 2'),
}


@pytest.mark.parametrize('kind', LISTS)
def test_several_bodies_on_one_topic(tmp_path, trial, kind):
    first, second, known = LISTS[kind]
    folder = write_lists(tmp_path / 'bag', kind, trial)
    with pytest.raises(DataError, match=f'/bodies holds several bodies.*/bodies:NAME, of {known}'):
        read_bag_wrists(folder, '/bodies', f'/bodies:{second}')
    with pytest.raises(DataError, match=f'/bodies holds several bodies.*of {known}'):
        read_bag_wrists(folder, '/bodies', '/bodies')
    with pytest.raises(DataError, match=f'P1 and P2 are both /bodies:{first}; choose two bodies'):
        read_bag_wrists(folder, f'/bodies:{first}', f'/bodies:{first}')
    with pytest.raises(DataError, match=f"no 'p3' on /bodies; there are {known}"):
        read_bag_wrists(folder, f'/bodies:{first}', '/bodies:p3')
    motion = read_bag_wrists(folder, f'/bodies:{first}', f'/bodies:{second}')
    np.testing.assert_array_equal(motion.partner, trial.partner)
    np.testing.assert_allclose(motion.demonstrator, trial.demonstrator, atol=1e-9)


def test_two_bodies_without_names_at_one_time(tmp_path, trial):
    first = rows(trial.times, trial.partner)
    woven = [row for two in zip(first, rows(trial.times, trial.demonstrator), strict=True)
             for row in two]  # fmt: skip
    folder = write(tmp_path / 'bag', [('/a', POSE, 'world', woven), ('/b', POSE, 'world', first)])
    with pytest.raises(DataError, match='two poses with one stamp are'):
        read_bag_wrists(folder, '/a', '/b')


COMPRESSIONS = [('none', None), ('file', 'FILE'), ('message', 'MESSAGE')]


@pytest.mark.parametrize('storage', ['MCAP', 'SQLITE3'])
@pytest.mark.parametrize(('name', 'mode'), COMPRESSIONS)
def test_every_storage_and_compression_of_rosbag2(tmp_path, trial, storage, name, mode):
    streams = [
        ('/hand/pose', POSE, 'world', rows(trial.times, trial.partner)),
        ('/human/pose', POSE, 'world', rows(trial.times, trial.demonstrator)),
    ]
    folder = write(tmp_path / 'bay_take_3', streams, storage=storage, mode=mode)
    motion = read_bag_wrists(folder)
    np.testing.assert_array_equal(motion.partner, trial.partner)
    assert describe_bag(folder) == ('bay', 'take', 3)
    file = next(path for path in folder.iterdir() if path.suffix != '.yaml')
    np.testing.assert_array_equal(read_bag_wrists(file).partner, trial.partner)


def test_a_humble_bag_without_definitions(tmp_path, trial):
    """Before ROS 2 Iron, sqlite3 files held topics and messages and nothing else."""
    import sqlite3

    streams = [
        ('/hand/pose', POSE, 'world', rows(trial.times, trial.partner)),
        ('/human/pose', POSE, 'world', rows(trial.times, trial.demonstrator)),
    ]
    folder = write(tmp_path / 'bag', streams, storage='SQLITE3')
    with sqlite3.connect(folder / 'bag.db3') as connection:
        for table in ('schema', 'metadata', 'message_definitions'):
            connection.execute(f'DROP TABLE {table}')
        connection.execute('ALTER TABLE topics DROP COLUMN type_description_hash')
    np.testing.assert_array_equal(read_bag_wrists(folder).partner, trial.partner)


@pytest.mark.parametrize(('set_s', 'silence'), [(0.2, 0), (-0.3, 70)])
def test_a_clock_that_was_set_though_the_stamps_go_on(tmp_path, trial, set_s, silence):
    """Forward, or back by less than the silence in which that was done."""
    first = rows(trial.times, trial.partner)
    moved = [
        (stamp + round(1e9 * set_s) * (k > 100), *rest)
        for k, (stamp, *rest) in enumerate(first)
        if not 100 < k <= 100 + silence
    ]
    second = rows(trial.times, trial.demonstrator)
    folder = write(tmp_path / 'bag', [('/a', POSE, 'world', moved), ('/b', POSE, 'world', second)])
    with pytest.raises(
        DataError, match=rf'the clock of /a was set by \{set_s:+.3f} s .*--clock log'
    ):
        read_bag_wrists(folder, '/a', '/b')
    motion = read_bag_wrists(folder, '/a', '/b', clock='log')
    kept = np.delete(np.arange(len(first)), range(101, 101 + silence))
    np.testing.assert_array_equal(motion.partner, trial.partner[kept])


def test_messages_that_come_in_a_bunch_are_no_clock_that_was_set(tmp_path, trial):
    first = rows(trial.times, trial.partner)
    held = [(stamp, max(log, first[180][1]) if 100 < k <= 180 else log, *place)
            for k, (stamp, log, *place) in enumerate(first)]  # fmt: skip
    second = rows(trial.times, trial.demonstrator)
    folder = write(tmp_path / 'bag', [('/a', POSE, 'world', held), ('/b', POSE, 'world', second)])
    motion = read_bag_wrists(folder, '/a', '/b')
    np.testing.assert_array_equal(motion.partner, trial.partner)


def test_poses_without_a_stamp_among_others_are_left_out(tmp_path, trial):
    """As those that come before the first time on a simulated clock."""
    first = [(0 if k < 3 else stamp, *rest)
             for k, (stamp, *rest) in enumerate(rows(trial.times, trial.partner))]  # fmt: skip
    second = rows(trial.times, trial.demonstrator)
    folder = write(tmp_path / 'bag', [('/a', POSE, 'world', first), ('/b', POSE, 'world', second)])
    motion = read_bag_wrists(folder, '/a', '/b')
    assert motion.remarks == ('/a: 3 poses without a stamp are left out',)
    np.testing.assert_array_equal(motion.partner, trial.partner[3:])
    np.testing.assert_allclose(motion.demonstrator, trial.demonstrator[3:], atol=1e-9)


@pytest.mark.parametrize('pace', [0.2, 0.5, 3.0])
def test_a_simulation_runs_at_its_own_pace_and_stands_still_now_and_then(tmp_path, trial, pace):
    def recorded(path):
        return [
            (stamp, EPOCH_NS + round((stamp - EPOCH_NS) / pace) + 700_000_000 * (k > 100), *place)
            for k, (stamp, _, *place) in enumerate(rows(trial.times, path))
        ]

    streams = [('/a', POSE, 'world', recorded(trial.partner)),
               ('/b', POSE, 'world', recorded(trial.demonstrator))]  # fmt: skip
    motion = read_bag_wrists(write(tmp_path / 'bag', streams), '/a', '/b')
    np.testing.assert_array_equal(motion.partner, trial.partner)
    np.testing.assert_allclose(motion.demonstrator, trial.demonstrator, atol=1e-9)


@pytest.mark.parametrize('change', [
    "messages SET timestamp = 'x'", 'messages SET timestamp = 1.5', "messages SET data = 'x'",
    "messages SET topic_id = 'x'", "topics SET name = x'00'", "topics SET type = x'ff'",
    'topics SET serialization_format = 3.5',
])  # fmt: skip
def test_columns_of_sqlite3_that_hold_something_else(tmp_path, trial, change):
    import sqlite3

    streams = [
        ('/hand/pose', POSE, 'world', rows(trial.times, trial.partner)),
        ('/human/pose', POSE, 'world', rows(trial.times, trial.demonstrator)),
    ]
    folder = write(tmp_path / 'bag', streams, storage='SQLITE3')
    with sqlite3.connect(folder / 'bag.db3') as connection:
        connection.execute(f'UPDATE {change}')
    with pytest.raises(DataError, match=r'bag\.db3: '):
        read_bag_wrists(folder)
