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

import json
from pathlib import Path
import sys

from handover_dmp.cli.main import main
from handover_dmp.handover.recordings import recorded_trial
from handover_dmp.mocap import HandoverTrial, write_data_set
from handover_dmp.recording import message_definition, read_bag
import numpy as np
import pytest


@pytest.fixture
def trials() -> list[HandoverTrial]:
    times = np.linspace(2.0, 3.5, 61)
    path = np.stack([0.3 * times, 0.1 * times**2, np.ones_like(times)], axis=1)
    return [
        HandoverTrial(times, path + number, path - 0.5, 'engine_bay', direction, number)
        for direction in ('give', 'take')
        for number in (1, 2)
    ]


@pytest.fixture
def data_set(trials: list[HandoverTrial], tmp_path: Path) -> Path:
    write_data_set(trials, tmp_path / 'data')
    return tmp_path / 'data'


def test_trials_become_bags(trials: list[HandoverTrial], data_set: Path, tmp_path: Path) -> None:
    highlevel = pytest.importorskip('rosbags.highlevel')
    outcome = tmp_path / 'outcome.json'
    folder = tmp_path / 'bags'
    assert main(['bag', str(data_set), '-o', str(folder), '--json', str(outcome)]) == 0
    written = json.loads(outcome.read_text())['bags']
    assert [Path(bag['folder']).name for bag in written] == [
        'engine_bay_give_1',
        'engine_bay_give_2',
        'engine_bay_take_1',
        'engine_bay_take_2',
    ]
    for trial, bag in zip(trials, written, strict=True):
        with highlevel.AnyReader([Path(bag['folder'])]) as reader:
            paths: dict[str, list[list[float]]] = {'/hand/pose': [], '/human/pose': []}
            stamps: dict[str, list[int]] = {'/hand/pose': [], '/human/pose': []}
            signals = []
            for connection, time_ns, data in reader.messages():
                message = reader.deserialize(data, connection.msgtype)
                header = getattr(message, 'header', message)
                assert header.frame_id == 'world'
                assert header.stamp.sec * 10**9 + header.stamp.nanosec == time_ns > 0
                if connection.topic == '/handover/signal':
                    assert connection.ext.offered_qos_profiles[0].durability.name == (
                        'TRANSIENT_LOCAL'
                    )
                    signals.append(time_ns)
                    continue
                point = message.pose.position
                paths[connection.topic].append([point.x, point.y, point.z])
                stamps[connection.topic].append(time_ns)
        # the hand rests for 0.5 s before the trial and for 5 s after it
        first, end = 20, 20 + len(trial.times)
        hand, seconds = np.array(paths['/hand/pose']), np.array(stamps['/hand/pose']) * 1e-9
        np.testing.assert_array_equal(hand[first:end], trial.partner)
        np.testing.assert_array_equal(hand[:first], np.tile(trial.partner[0], (20, 1)))
        np.testing.assert_array_equal(hand[end:], np.tile(trial.partner[-1], (200, 1)))
        np.testing.assert_allclose(np.diff(seconds), 0.025, atol=2e-9)
        np.testing.assert_array_equal(paths['/human/pose'], trial.demonstrator)
        assert stamps['/human/pose'] == stamps['/hand/pose'][first:end]
        assert signals == stamps['/human/pose'][:1]
        back = recorded_trial(bag['folder'], cutoff_hz=0.0)
        np.testing.assert_array_equal(back.partner, trial.partner)
        np.testing.assert_allclose(np.diff(back.times), np.diff(trial.times), atol=1e-9)


def test_one_trial_becomes_a_bag(data_set: Path, tmp_path: Path) -> None:
    trial = data_set / 'engine_bay_take_2.csv'
    assert main(['bag', str(trial), '-o', str(tmp_path / 'bags'), '--compression', 'lz4']) == 0
    assert sum(1 for _ in read_bag(tmp_path / 'bags' / 'engine_bay_take_2')) == 343


def test_nothing_is_overwritten_and_nothing_half_done(
    data_set: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'bags' / 'engine_bay_take_1').mkdir(parents=True)
    assert main(['bag', str(data_set), '-o', str(tmp_path / 'bags')]) == 1
    assert 'engine_bay_take_1: exists already' in capsys.readouterr().err
    assert [path.name for path in (tmp_path / 'bags').iterdir()] == ['engine_bay_take_1']


def test_without_definitions_no_empty_bag_is_left(
    data_set: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    message_definition.cache_clear()
    monkeypatch.setattr(sys, 'prefix', '/nowhere')
    monkeypatch.setenv('AMENT_PREFIX_PATH', '')
    monkeypatch.setitem(sys.modules, 'rosbags.typesys', None)
    assert main(['bag', str(data_set), '-o', str(tmp_path / 'bags')]) == 1
    assert 'no package on this machine defines it' in capsys.readouterr().err
    assert not (tmp_path / 'bags').exists()


def test_information_and_repair(
    data_set: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(['bag', str(data_set / 'engine_bay_give_1.csv'), '-o', str(tmp_path)])
    bag = tmp_path / 'engine_bay_give_1'
    outcome = tmp_path / 'outcome.json'
    assert main(['bag', 'info', str(bag), '--json', str(outcome)]) == 0
    information = json.loads(outcome.read_text())
    assert information['complete']
    assert information['topics']['/hand/pose'] == {
        'type': 'geometry_msgs/msg/PoseStamped',
        'messages': 281,
        'rate_hz': pytest.approx(40.0),
    }
    # a recorder that is killed leaves no metadata and a file without an end
    (bag / 'metadata.yaml').unlink()
    file = bag / 'engine_bay_give_1_0.mcap'
    file.write_bytes(file.read_bytes()[:-100])
    capsys.readouterr()
    assert main(['bag', 'info', str(bag)]) == 0
    assert f'bag repair {bag}' in capsys.readouterr().out.replace('\n', '')
    assert main(['bag', 'repair', str(bag), '--json', str(outcome)]) == 0
    repaired = json.loads(outcome.read_text())
    assert repaired['rewritten'] == [str(file)]
    assert repaired['messages'] == 343
    assert main(['bag', 'repair', str(bag)]) == 0
    assert 'nothing to repair' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('words', 'code', 'fault'),
    [
        (['somewhere'], 2, '-o DIR'),
        (['info'], 2, 'needs a bag'),
        (['repair'], 2, 'needs a bag'),
        (['a', 'b', '-o', 'c'], 2, 'one data set'),
        (['nowhere', '-o', 'c'], 1, 'no such folder'),
        (['info', 'nowhere'], 1, 'no such bag'),
        (['repair', 'nowhere'], 1, 'no such bag'),
    ],
)
def test_words_that_make_no_sense(
    words: list[str],
    code: int,
    fault: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(['bag', *words]) == code
    error = capsys.readouterr().err
    assert fault in error
    assert len(error.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
