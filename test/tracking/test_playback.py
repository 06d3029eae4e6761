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

"""Played partners, on bags of trials and on bags of others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from handover_dmp.common.errors import DataError
from handover_dmp.mocap import condition, HandoverTrial, synthesize
from handover_dmp.mocap.trial_bag import write_trial_bag
from handover_dmp.recording import BagWriter
from handover_dmp.recording.messages import header, pose_stamped
from handover_dmp.tracking.playback import HandSample, PlayedBag, PlayedTrial
import numpy as np
import pytest

EPOCH_NS = 1_700_000_000_123_456_789
POSE = 'geometry_msgs/msg/PoseStamped'


@pytest.fixture(scope='module')
def trial() -> HandoverTrial:
    return condition(synthesize(trials=1)[1])


def write(
    folder: Path,
    rows: list[tuple[str, int, Any]],
    frame: str = 'world',
    turn: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0),
) -> Path:
    """Write (topic, stamp in ns after the epoch or None, position) rows, logged at 10 ms each."""
    with BagWriter(folder) as bag:
        for topic in ('/hand/pose', '/human/pose'):
            bag.add_topic(topic, POSE)
        bag.add_topic('/handover/signal', 'std_msgs/msg/Header')
        for number, (topic, after_ns, position) in enumerate(rows):
            stamp_ns = 0 if after_ns is None else EPOCH_NS + after_ns
            message: Any = header(stamp_ns)
            if topic != '/handover/signal':
                message = pose_stamped(stamp_ns, position, turn, frame)
            bag.write_message(topic, message, EPOCH_NS + number * 10_000_000)
    return folder


def play(played: PlayedBag, until_s: float, from_s: float = 0.0) -> list[HandSample]:
    """Ask period by period; nothing comes before it is due."""
    got = []
    for number in range(round(from_s / 0.005), round(until_s / 0.005) + 1):
        for sample in played.hands(number * 0.005)[0]:
            assert sample.stamp_s <= number * 0.005 + 1e-6
            got.append(sample)
    return got


def test_a_bag_of_a_trial_is_what_a_tracker_sees_of_the_trial(
    tmp_path: Path, trial: HandoverTrial
) -> None:
    write_trial_bag(trial, tmp_path / 'bag')
    bag, tracked = PlayedBag(tmp_path / 'bag'), PlayedTrial(trial)
    bag.start(0.0)
    tracked.start(0.5)
    assert bag.signals() == pytest.approx(tracked.signals())
    assert bag.signals() == tracked.signals() == []
    humans = 0
    for number in range(1200):
        now_s = number * 0.005
        ((seen,),), ((expected,),) = bag.hands(now_s), tracked.hands(now_s)
        assert seen.stamp_s == pytest.approx(expected.stamp_s, abs=1e-8)
        np.testing.assert_allclose(seen.position, expected.position, atol=1e-9)
        person = bag.demonstrator(now_s)
        humans += len(person)
        for sample, other in zip(person, tracked.demonstrator(now_s), strict=False):
            np.testing.assert_allclose(sample.position, other.position, atol=1e-9)
    assert humans == 100 + len(trial.times)


def test_poses_are_played_as_they_were_recorded(tmp_path: Path) -> None:
    """Uneven spacing and a pose sent twice stay; the signal keeps its place; first it rests."""
    after_ms = [0, 7, 7, 31, 90, 500, 503]
    rows: list[tuple[str, int, Any]] = [
        ('/hand/pose', ms * 1_000_000, (0.1 * ms, 0.0, 1.0)) for ms in after_ms
    ]
    rows.insert(3, ('/handover/signal', 25_000_000, None))
    played = PlayedBag(write(tmp_path / 'bag', rows))
    resting = play(played, 0.1)
    assert [sample.stamp_s for sample in resting] == [0.005 * number for number in range(21)]
    assert all(sample.position.tolist() == [0.0, 0.0, 1.0] for sample in resting)
    played.start(1.5)
    assert played.signals() == pytest.approx([1.525], abs=1e-9)
    got = play(played, 3.0, 1.5)
    stamps = [sample.stamp_s for sample in got]
    np.testing.assert_allclose(stamps, 1.5 + 1e-3 * np.array(after_ms), atol=1e-8)
    assert [sample.position[0] for sample in got] == [0.1 * ms for ms in after_ms]
    played.start(4.0)
    assert len(play(played, 5.0, 4.0)) == len(after_ms)


def test_without_stamps_and_signal_the_times_of_recording_count(tmp_path: Path) -> None:
    rows: list[Any] = [('/hand/pose', None, (x, 0.0, 1.0)) for x in (0.0, 1.0, 2.0)]
    played = PlayedBag(write(tmp_path / 'bag', rows))
    played.start(2.0)
    assert played.signals() == [2.0]
    stamps = [sample.stamp_s for sample in play(played, 3.0, 2.0)]
    np.testing.assert_allclose(stamps, [2.0, 2.01, 2.02], atol=1e-8)


@pytest.mark.parametrize('place', [(0.0, 0.0, 0.0), (np.nan, np.nan, np.nan), (0.0, 0.0, 1.0)])
def test_a_lost_hand_is_played_as_it_was_recorded(
    tmp_path: Path, place: tuple[float, float, float]
) -> None:
    """Also where its quaternion alone says so; who hears it is to judge."""
    rows: list[Any] = [('/hand/pose', 10_000_000 * k, (0.3, 0.0, 1.0)) for k in range(3)]
    rows[1] = (*rows[1][:2], place)
    played = PlayedBag(write(tmp_path / 'bag', rows, frame='map', turn=(0.0, 0.0, 0.0, 0.0)))
    played.start(0.0)
    got = play(played, 0.1)
    np.testing.assert_array_equal(got[1].position, place)
    assert {sample.frame for sample in got} == {'map'}
    assert [sample.orientation for sample in got] == [(0.0, 0.0, 0.0, 0.0)] * 3


def test_nothing_long_past_is_played(tmp_path: Path, trial: HandoverTrial) -> None:
    write_trial_bag(trial, tmp_path / 'bag')
    played = PlayedBag(tmp_path / 'bag')
    played.start(0.0)
    assert played.hands(1000.0) == [[]]
    played.start(1001.0)
    assert len(played.hands(1001.0)[0]) == 1


def test_bags_that_cannot_be_played(tmp_path: Path) -> None:
    cases = {
        '0 poses on /hand/pose': write(tmp_path / 'a', [('/human/pose', 0, (0.0, 0.0, 1.0))]),
        'no such bag': tmp_path / 'nowhere',
    }
    with BagWriter(tmp_path / 'd') as bag:
        bag.add_topic('/hand/pose', 'std_msgs/msg/Header')
        bag.write_message('/hand/pose', header(1), 1)
    cases['messages of another type'] = tmp_path / 'd'
    for message, folder in cases.items():
        with pytest.raises(DataError, match=message) as raised:
            PlayedBag(folder)
        assert str(folder) in str(raised.value)
