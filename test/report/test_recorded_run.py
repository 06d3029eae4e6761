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

from collections.abc import Callable
from pathlib import Path
from typing import Any

from handover_dmp.common.errors import DataError
from handover_dmp.recording import BagWriter
from handover_dmp.recording.messages import string
from handover_dmp.report import load_run
import numpy as np
import pytest


def test_arrays_are_what_was_written(run_bag: Path, make_motion: Callable[..., Any]) -> None:
    run = load_run(run_bag)
    motion = make_motion()
    times = np.arange(0.0, 2.5, 0.005)
    np.testing.assert_allclose(run.hand_times, times, atol=2e-9)
    np.testing.assert_array_equal(run.hand_positions, motion.hand(times))
    np.testing.assert_array_equal(run.wrist_positions, motion.wrist(times))
    np.testing.assert_array_equal(run.demonstrator_positions, motion.demonstrator(times))
    positions, velocities = motion.joints(times)
    np.testing.assert_array_equal(run.joint_positions, positions)
    np.testing.assert_array_equal(run.joint_velocities, velocities)
    np.testing.assert_array_equal(run.joint_commands, velocities)
    assert run.joint_names == tuple(f'joint_{number}' for number in range(1, 8))
    assert set(run.phase) == {'time_s', 'phase', 'goal_weight', 'hand_age_s'}
    assert run.phase['phase'].shape == run.phase_times.shape == (500,)
    assert run.ik['active_limits'].max() == 2.0
    assert [name for _, name in run.states] == ['idle', 'reaching', 'exchange', 'done']
    assert run.reaching_time_s == pytest.approx(0.5)
    assert run.exchange_span_s == pytest.approx((1.9, 2.3))
    assert run.handed_over
    assert run.info['seed'] == 3
    assert run.simulated_clock
    assert [status.message for status in run.diagnostics] == ['ok', 'hand too old', 'ok']
    assert run.diagnostics[0].values == {'rate (Hz)': '200.0'}
    limits = run.joint_limits
    assert limits is not None
    np.testing.assert_array_equal(limits.acceleration, 8.0)
    assert limits.upper[1] == 2.09
    assert limits.origin == '/robot_description'


def test_what_is_not_known_of_a_period_does_not_hide_the_rest(run_bag: Path) -> None:
    run = load_run(run_bag)
    assert len(run.ik_times) == len(run.phase_times)
    unknown = np.isnan(run.ik['smallest_singular_value'])
    assert 1 <= unknown.sum() < 10
    assert np.all(run.ik['speed_scale'][unknown] == 0.8)


def test_a_recorder_on_another_clock(make_run: Callable[..., Path], tmp_path: Path) -> None:
    # rosbag2 records by the wall clock unless told otherwise, while the graph runs on /clock
    same = load_run(make_run(tmp_path / 'same'))
    other = load_run(make_run(tmp_path / 'other', recorder_ahead_s=1.7e9))
    for one, two in zip(same.states, other.states, strict=True):
        assert two[0] == pytest.approx(one[0], abs=1e-6)
    np.testing.assert_allclose(other.joint_command_times, same.joint_command_times, atol=1e-6)


def test_wall_clock_times_keep_their_digits(make_run: Callable[..., Path], tmp_path: Path) -> None:
    run = load_run(make_run(tmp_path / 'run', start_s=1_700_000_000.0, leave_out=('/clock',)))
    assert not run.simulated_clock
    np.testing.assert_allclose(np.diff(run.hand_times), 0.005, atol=1e-6)
    assert run.hand_times[0] == 0.0


def test_joint_states_in_another_order(make_run: Callable[..., Path], tmp_path: Path) -> None:
    run = load_run(make_run(tmp_path / 'run', shuffle_joints=True))
    straight = load_run(make_run(tmp_path / 'straight'))
    assert run.joint_names == straight.joint_names
    np.testing.assert_array_equal(run.joint_positions, straight.joint_positions)
    np.testing.assert_array_equal(run.joint_velocities, straight.joint_velocities)


def test_what_is_optional_may_be_missing(make_run: Callable[..., Path], tmp_path: Path) -> None:
    absent = (
        '/clock', '/human/pose', '/wrist/pose_command', '/wrist/twist_command', '/handover/state',
        '/joint_velocity_controller/commands', '/handover/phase', '/wrist/ik_status',
        '/diagnostics', '/handover/info',
    )  # fmt: skip
    run = load_run(make_run(tmp_path / 'run', leave_out=absent))
    assert run.info == {}
    assert run.states == ()
    assert run.exchange_span_s is None
    assert not run.handed_over
    assert run.demonstrator_positions.shape == (0, 3)
    np.testing.assert_array_equal(run.goal_offset, 0.0)
    # a URDF knows of no accelerations
    assert run.joint_limits is not None
    assert not np.isfinite(run.joint_limits.acceleration).any()
    np.testing.assert_array_equal(run.joint_limits.velocity[:2], [1.74, 1.91])


@pytest.mark.parametrize('topic', ['/hand/pose', '/wrist/pose', '/joint_states'])
def test_what_is_needed_may_not_be_missing(
    make_run: Callable[..., Path], tmp_path: Path, topic: str
) -> None:
    bag = make_run(tmp_path / 'run', leave_out=(topic,))
    with pytest.raises(DataError, match=f'not a recorded run: 0 messages on {topic}'):
        load_run(bag)


@pytest.mark.parametrize(
    ('info', 'fault'),
    [
        ({'goal_offset_m': [1, 2]}, 'instead of 3'),
        ({'goal_offset_m': 'far'}, 'not a vector'),
        ({'joint_limits': {'lower': [0.0]}}, 'instead of 7'),
    ],
)
def test_information_that_makes_no_sense(
    make_run: Callable[..., Path], tmp_path: Path, info: dict[str, Any], fault: str
) -> None:
    with pytest.raises(DataError, match=fault):
        _ = load_run(make_run(tmp_path / 'run', info=info)).goal_offset


def test_topics_of_another_type(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'run') as bag:
        bag.add_topic('/hand/pose', 'std_msgs/msg/String')
        bag.write_message('/hand/pose', string('here'), 0)
    with pytest.raises(DataError, match='/hand/pose: messages of another type'):
        load_run(tmp_path / 'run')


def test_a_killed_recording_is_read_as_far_as_it_goes(
    make_run: Callable[..., Path], tmp_path: Path
) -> None:
    bag = make_run(tmp_path / 'run')
    (bag / 'metadata.yaml').unlink()
    file = bag / 'run_0.mcap'
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    run = load_run(bag)
    assert 0.3 < run.end_time_s < 2.4


def test_a_run_in_a_bag_of_another_writer(make_run: Callable[..., Path], tmp_path: Path) -> None:
    # definitions without comments, other chunks, other schema and channel numbers
    convert = pytest.importorskip('rosbags.convert.converter')
    bag = make_run(tmp_path / 'run')
    convert.convert(
        srcs=[bag],
        dst=tmp_path / 'other',
        dst_storage='mcap',
        dst_version=9,
        compress=None,
        compress_mode='file',
        default_typestore=None,
        typestore=None,
        exclude_topics=(),
        include_topics=(),
        exclude_msgtypes=(),
        include_msgtypes=(),
    )
    one, other = load_run(bag), load_run(tmp_path / 'other')
    np.testing.assert_array_equal(one.hand_positions, other.hand_positions)
    np.testing.assert_array_equal(one.joint_positions, other.joint_positions)
    assert one.states == other.states
    assert one.info == other.info
