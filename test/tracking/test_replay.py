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

"""The replay: a trial at any time, recorded poses as they arrived."""

from __future__ import annotations

from dataclasses import replace

from handover_dmp.common.errors import DataError
from handover_dmp.mocap import condition, synthesize
from handover_dmp.tracking import Replay, SensorModel
import numpy as np
import pytest


@pytest.fixture(scope='module')
def trial():
    return condition(synthesize(trials=1)[1])


def test_a_trial_starts_at_zero_and_holds_at_its_ends(trial):
    replay = Replay.from_trial(replace(trial, times=trial.times + 7.0))
    assert replay.duration_s == pytest.approx(trial.duration_s)
    for k in (0, 10, 111, len(trial.times) - 1):
        sample = replay.newest(trial.times[k])
        assert sample.stamp_s == trial.times[k]
        np.testing.assert_allclose(sample.position, trial.partner[k], atol=1e-12)
    np.testing.assert_allclose(replay.newest(-3.0).position, trial.partner[0])
    np.testing.assert_allclose(replay.newest(99.0).position, trial.partner[-1])
    assert replay.newest(99.0).stamp_s == 99.0


def test_any_motion(trial):
    replay = Replay.from_motion(trial.times, trial.demonstrator)
    np.testing.assert_allclose(replay.newest(0.5).position, trial.demonstrator[100], atol=1e-9)


def test_between_the_samples_it_is_smooth():
    """A 24 Hz trial, played at 200 Hz, gives no staircase of speeds."""
    slow = synthesize(trials=1, rate_hz=24.0, noise_m=0.0)[1]
    fine = synthesize(trials=1, rate_hz=200.0, noise_m=0.0)[1]
    replay = Replay.from_trial(slow)
    inside = fine.times <= slow.duration_s
    played = np.array([replay.newest(time).position for time in fine.times[inside]])
    np.testing.assert_allclose(played, fine.partner[inside], atol=1e-3)
    speeds = np.linalg.norm(np.diff(played, axis=0), axis=1) * 200.0
    assert np.abs(np.diff(speeds)).max() < 0.1


def test_poses_are_played_as_they_were_recorded():
    poses = [(50.0 + 0.1 * k, (0.1 * k, 0.0, 1.0)) for k in range(5)]
    replay = Replay.from_poses([poses[2], poses[0], poses[1], poses[4], poses[3]])
    assert replay.duration_s == pytest.approx(0.4)
    assert replay.newest(-0.01) is None
    assert replay.newest(0.0).stamp_s == 0.0
    assert replay.newest(0.19).stamp_s == pytest.approx(0.1)
    np.testing.assert_array_equal(replay.newest(0.19).position, (0.1, 0.0, 1.0))
    assert replay.newest(77.0).stamp_s == pytest.approx(0.4)


def test_what_a_tracker_saw_is_played_in_the_order_of_arrival(trial):
    model = SensorModel(120.0, delay_s=0.02, jitter_s=0.03, duplicates=0.2, dropout=0.1)
    seen = model.observe(trial)
    replay = Replay.from_poses(seen)
    zero = min(observation.stamp_s for observation in seen)
    clock, got = -1.0, []
    while clock < replay.duration_s:
        got += replay.between(clock, clock + 0.005)
        clock += 0.005
        arrived = [observation for observation in seen if observation.arrival_s - zero <= clock]
        newest = replay.newest(clock)
        assert (newest is None) == (not arrived)
        if arrived:
            assert newest.stamp_s == arrived[-1].stamp_s - zero
    expected = [observation.stamp_s - zero for observation in seen]
    assert [sample.stamp_s for sample in got] == expected


def test_between_gives_a_trial_one_sample(trial):
    replay = Replay.from_trial(trial)
    assert [sample.stamp_s for sample in replay.between(0.1, 0.2)] == [0.2]
    assert replay.between(0.2, 0.2) == []


@pytest.mark.parametrize(
    ('poses', 'message'),
    [
        ([], 'no poses'),
        ([(0.0, (1.0, 2.0))], 'pose 0 to play back'),
        ([(0.0, (1.0, 2.0, 3.0)), (float('nan'), (1.0, 2.0, 3.0))], 'pose 1 to play back'),
        ([(float('inf'), (1.0, 2.0, 3.0))], 'pose 0 to play back'),
    ],
)
def test_poses_that_cannot_be_played(poses, message):
    with pytest.raises(DataError, match=message):
        Replay.from_poses(poses)
