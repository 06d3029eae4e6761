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

"""Presets of trackers: those of the package, one's own, and what is wrong with one."""

from __future__ import annotations

from handover_dmp.common.errors import DataError, UsageError
from handover_dmp.common.resources import share_path
from handover_dmp.tracking.tracker_preset import read_trackers
import pytest

PRESETS = sorted(path.stem for path in share_path('config/trackers').glob('*.yaml'))


def test_those_of_the_package():
    assert PRESETS == ['depth_camera', 'mocap', 'webcam']
    found = read_trackers(PRESETS, seed=3)
    assert [one.name for one in found] == PRESETS
    assert len({one.sensor.seed for one in found}) == len({one.topic for one in found}) == 3
    for one in found:
        # what is told of a simulated one is what it does
        assert one.tracker.noise_m == one.sensor.noise_m
        assert one.tracker.rate_hz == one.sensor.rate_hz
        assert one.parameters['latency_s'] == one.sensor.delay_s
        text = share_path(f'config/trackers/{one.name}.yaml').read_text(encoding='utf-8')
        assert '(' in text, 'where its numbers come from'
    camera = found[0]
    assert (camera.tracker.bias, camera.sensor.offset_m) == ('learnt', (0.022, 0.0, 0.0))


def test_ones_own_with_two_trackers(tmp_path):
    file = tmp_path / 'lab.yaml'
    file.write_text(
        '/**:\n  ros__parameters:\n'
        '    left: {topic: hand/left, noise_m: 0.002, bias: fixed, bias_m: [0, 0, 0.1]}\n'
        '    right: {topic: /eye/pose, sensor: {fault: dies, fault_at_s: 1.5}}\n'
    )
    left, right = read_trackers([str(file)])
    assert (left.tracker.noise_m, left.tracker.bias_m) == (0.002, (0.0, 0.0, 0.1))
    assert (left.absolute_topic, right.absolute_topic) == ('/hand/left', '/eye/pose')
    assert (right.sensor.fault, right.sensor.fault_at_s) == ('dies', 1.5)


@pytest.mark.parametrize(
    ('names', 'kind', 'words'),
    [
        (['lidar'], UsageError, 'depth_camera, mocap, webcam'),
        (['nowhere.yaml'], DataError, 'nowhere.yaml'),
        (['mocap', 'mocap'], UsageError, 'two trackers have one name'),
    ],
)
def test_what_is_not_there(names, kind, words):
    with pytest.raises(kind, match=words):
        read_trackers(names)


@pytest.mark.parametrize(
    ('content', 'words'),
    [
        (b'a: \xff\xfe', 'cannot be read'),
        (b'a: [1, ', 'not proper YAML'),
        (b'#' * 300_000, 'larger than'),
    ],
)
def test_what_is_no_yaml_is_named(tmp_path, content, words):
    file = tmp_path / 'lab.yaml'
    file.write_bytes(content)
    with pytest.raises(DataError, match=f'lab.yaml: .*{words}'):
        read_trackers([str(file)])


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('eye: {noise: 0.1}', 'eye.noise is not a parameter'),
        ('eye: {noise_m: -1.0}', 'eye.noise_m'),
        ('eye: {noise_m: much}', 'lab.yaml'),
        ('eye: {sensor: {fault: sleeps}}', 'sleeps'),
        ('a: {noise_m: 0.1}\n    b: {noise_m: 0.1}', 'two trackers have one topic'),
        ('trackers: [eye]', 'no parameters'),
    ],
)
def test_what_makes_no_sense(tmp_path, text, words):
    file = tmp_path / 'lab.yaml'
    file.write_text(f'/**:\n  ros__parameters:\n    {text}\n')
    with pytest.raises(UsageError, match=words):
        read_trackers([str(file)])
