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

"""Marker recordings: units, axes, middles of markers, gaps."""

from __future__ import annotations

from handover_dmp.common.errors import DataError
from handover_dmp.mocap.markers import MarkerRecording, WristMotion
import numpy as np
import pytest

SAMPLES = 100


def recording(**changes):
    times = np.arange(SAMPLES) / 100.0
    path = np.column_stack([300.0 * times, 0.0 * times + 20.0, 1000.0 + 0.0 * times])
    positions = {'a': path, 'b': path + [0.0, 40.0, 0.0], 'c': path + [400.0, 0.0, 0.0]}
    values = {'names': list(positions), 'positions': positions, 'unit': 'mm', 'up': 'z'}
    return MarkerRecording(times=times, source='file.c3d', **{**values, **changes})


def test_metres_and_the_middle_of_two_markers():
    motion = recording().wrists(['a', 'b'], ['c'])
    np.testing.assert_allclose(motion.partner[50], [0.15, 0.04, 1.0])
    np.testing.assert_allclose(motion.demonstrator[50], [0.55, 0.02, 1.0])
    again = recording(unit='m').wrists(['a', 'b'], ['c'], unit='mm')
    np.testing.assert_array_equal(again.partner, motion.partner)


def test_y_up_becomes_z_up_and_stays_right_handed():
    motion = recording(up='y').wrists(['a'], ['c'])
    np.testing.assert_allclose(motion.partner[50], [0.15, -1.0, 0.02])
    np.testing.assert_array_equal(recording().wrists(['a'], ['c'], up='y').partner, motion.partner)
    basis = np.eye(3)
    turned = [
        recording(positions={'a': np.tile(axis, (SAMPLES, 1)), 'c': np.zeros((SAMPLES, 3))})
        .wrists(['a'], ['c'], unit='m', up='y')
        .partner[0]
        for axis in basis
    ]
    assert np.linalg.det(turned) == pytest.approx(1.0)


def test_unknown_markers_are_named_with_those_that_are_there():
    with pytest.raises(DataError, match="no marker 'wrist'; there are a, b, c"):
        recording().wrists(['wrist'], ['c'])
    many = [f'marker{k}' for k in range(500)]
    with pytest.raises(DataError, match='and 480 more') as caught:
        recording(names=many).wrists(['wrist'], ['c'])
    assert len(str(caught.value)) < 500


def hidden(first, end):
    base = recording()
    positions = {name: path.copy() for name, path in base.positions.items()}
    positions['a'][first:end] = np.nan
    return recording(positions=positions).wrists(['a'], ['c'])


def test_short_gaps_stay_in_and_long_ones_cut():
    short = hidden(30, 50)
    assert len(short.times) == 80
    assert short.spans() == [(0, 80)]
    trial = short.trial(0, 80, configuration='bay', direction='give', number=1)
    assert trial.duration_s == pytest.approx(0.99)
    long = hidden(30, 60)
    assert long.spans() == [(0, 30), (30, 70)]
    with pytest.raises(DataError, match=r'file.c3d: 0.290 s: a wrist is out of sight for 0.31 s'):
        long.trial(0, 70, configuration='bay', direction='give', number=1)
    assert long.trial(30, 70, configuration='bay', direction='give', number=1).times[0] == 0.0


def test_samples_that_make_no_sense():
    with pytest.raises(DataError, match='never seen together'):
        hidden(0, SAMPLES)
    with pytest.raises(DataError, match='are these millimetres'):
        recording().wrists(['a'], ['c'], unit='m')
    jump = {name: path.copy() for name, path in recording().positions.items()}
    jump['c'][40:, 1] += 2000.0
    with pytest.raises(DataError, match=r'0.400 s: a jump of 2 m'):
        recording(positions=jump).wrists(['a'], ['c'])
    with pytest.raises(DataError, match='no samples'):
        nothing = WristMotion(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), 'x')
        nothing.trial(0, 0, configuration='a', direction='give', number=1)
