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

"""The Qualisys reader, on files written by the rules of Qualisys' own manual."""

from __future__ import annotations

from handover_dmp.common.errors import DataError
from handover_dmp.mocap.qualisys import read_qualisys
from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
import numpy as np
import pytest

NAMES = ['M_wrist', 'A_wrist', 'tool tip']
FRAMES = 12


def positions():
    steps = np.arange(FRAMES)[:, None, None]
    return 100.0 * np.arange(9).reshape(1, 3, 3) + 1.25 * steps + 1.0


def qtm(
    *,
    frame_and_time=True,
    titles=True,
    names=NAMES,
    frequency='120',
    included='3D',
    version=True,
    table=None,
):
    """Write as Qualisys Track Manager does, by its manual's page on motion data in TSV."""
    table = positions() if table is None else table
    lines = ['FILE_VERSION\t2.0.0'] if version else []
    lines += [
        f'NO_OF_FRAMES\t{len(table)}',
        'NO_OF_CAMERAS\t8',
        f'NO_OF_MARKERS\t{len(names)}',
        f'FREQUENCY\t{frequency}',
        'NO_OF_ANALOG\t0',
        'ANALOG_FREQUENCY\t0',
        'DESCRIPTION\t--',
        'TIME_STAMP\t2013-03-01, 10:12:44.093\t2457.15183241',
        f'DATA_INCLUDED\t{included}',
        'EVENT\tcontact\t7\t0.05833',
        'MARKER_NAMES\t' + '\t'.join(names),
        'TRAJECTORY_TYPES\t' + '\t'.join(['Measured'] * len(names)),
    ]
    if titles:
        columns = [f'{name} {axis}' for name in names for axis in 'XYZ']
        lines.append('\t'.join((['Frame', 'Time'] if frame_and_time else []) + columns))
    for frame, row in enumerate(table):
        leading = [str(frame + 1), f'{frame / 120.0:.5f}'] if frame_and_time else []
        cells = ['' if np.isnan(value) else f'{value:.3f}' for value in row.ravel()]
        lines.append('\t'.join(leading + cells))
    return '\r\n'.join(lines) + '\r\n'


def read(folder, text, markers=None):
    path = folder / 'session.tsv'
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_qualisys(path, markers)


@pytest.mark.parametrize('frame_and_time', [True, False])
@pytest.mark.parametrize('titles', [True, False])
@pytest.mark.parametrize('version', [True, False])
def test_every_layout(tmp_path, frame_and_time, titles, version):
    recording = read(tmp_path, qtm(frame_and_time=frame_and_time, titles=titles, version=version))
    assert recording.names == NAMES
    # It tells neither.
    assert (recording.unit, recording.up) == ('', '')
    assert (recording.usual_unit, recording.usual_up) == ('mm', 'z')
    np.testing.assert_allclose(recording.times, np.arange(FRAMES) / 120.0, atol=1e-5)
    for k, name in enumerate(NAMES):
        np.testing.assert_allclose(recording.positions[name], positions()[:, k], atol=1e-3)


def test_only_what_is_wanted(tmp_path):
    recording = read(tmp_path, qtm(), ['A_wrist', 'nobody', 'A_wrist'])
    assert list(recording.positions) == ['A_wrist']
    np.testing.assert_allclose(recording.positions['A_wrist'], positions()[:, 1], atol=1e-3)
    with pytest.raises(DataError, match="no marker 'nobody'; there are M_wrist, A_wrist, tool"):
        recording.wrists(['A_wrist'], ['nobody'])


@pytest.mark.parametrize('frame_and_time', [True, False])
def test_markers_out_of_sight(tmp_path, frame_and_time):
    empty, zero = positions(), positions()
    empty[3:6, 2] = np.nan
    empty[4, 0] = np.nan
    zero[np.isnan(empty)] = 0.0
    # Two coordinates of 0 are a place like any other.
    empty[8, 1, :2] = zero[8, 1, :2] = 0.0
    one = read(tmp_path, qtm(table=empty, frame_and_time=frame_and_time))
    other = read(tmp_path, qtm(table=zero, frame_and_time=frame_and_time))
    for k, name in enumerate(NAMES):
        np.testing.assert_allclose(one.positions[name], empty[:, k], atol=1e-3)
        np.testing.assert_array_equal(one.positions[name], other.positions[name])


@pytest.mark.parametrize('word', ['', 'NaN', 'null', '-'])
def test_frames_before_any_marker_is_seen_take_their_time(tmp_path, word):
    table = positions()
    table[:5] = np.nan
    text = qtm(table=table, frame_and_time=False, titles=False)
    unseen = '\t'.join([''] * 9)
    lines = text.replace(unseen, unseen.replace('\t', f'{word}\t') + word).split('\r\n')
    recording = read(tmp_path, '\n'.join(lines[:1] + lines[2:]))  # without NO_OF_FRAMES
    np.testing.assert_allclose(recording.times, np.arange(FRAMES) / 120.0)
    for k, name in enumerate(NAMES):
        np.testing.assert_allclose(recording.positions[name], table[:, k], atol=1e-3)


def test_tabs_at_the_end_of_a_line_and_old_encodings(tmp_path):
    text = qtm(names=['Höger', 'Vänster', 'verktyg']).replace('\r\n', '\t\r\n')
    for encoding in ('cp1252', 'utf-8', 'utf-8-sig'):
        recording = read(tmp_path, text.encode(encoding))
        assert recording.names == ['Höger', 'Vänster', 'verktyg']
        np.testing.assert_allclose(recording.positions['Höger'], positions()[:, 0], atol=1e-3)


FAULTS = {
    'two dimensions': ({'included': '2D'}, "data of kind '2D'"),
    'edges': ({'frame_and_time': False, 'frequency': 'EXT'}, "FREQUENCY is 'EXT', not a number"),
    'no rate': ({'frame_and_time': False, 'frequency': '0'}, 'FREQUENCY of 0 Hz'),
    'no names': ({'names': []}, 'no MARKER_NAMES before it'),
}


@pytest.mark.parametrize('name', FAULTS)
def test_recordings_that_cannot_be_used(tmp_path, name):
    changes, message = FAULTS[name]
    with pytest.raises(DataError, match=message) as caught:
        read(tmp_path, qtm(**changes))
    assert 'session.tsv: line 1' in str(caught.value)


def test_faulty_lines_are_named(tmp_path):
    lines = qtm().split('\r\n')
    for row, text, message in (
        (16, lines[16].replace('.', ',', 3), "line 17: M_wrist is '"),
        (17, lines[17] + '\t1\t2', 'line 18: 13 values instead of 11'),
        (17, lines[17][:20], 'line 18: 4 values instead of 11'),
        (18, lines[18].replace('.', 'O', 3), "line 19: M_wrist is '"),
    ):
        broken = [*lines[:row], text, *lines[row + 1:]]  # fmt: skip
        with pytest.raises(DataError, match=message):
            read(tmp_path, '\n'.join(broken))
    with pytest.raises(DataError, match='11 frames, but the header says 12'):
        read(tmp_path, '\n'.join(lines[:-2]))
    with pytest.raises(DataError, match='holds no frames'):
        read(tmp_path, '\n'.join(lines[:13]))
    commas = [*lines[:13], *(line.split('\t', 2)[-1].replace('.', ',') for line in lines[14:])]
    with pytest.raises(DataError, match='holds no frames; decimal commas are not supported'):
        read(tmp_path, '\n'.join(commas))
    with pytest.raises(DataError, match='is empty'):
        read(tmp_path, '')
    with pytest.raises(DataError, match='more than 500000 lines'):
        read(tmp_path, 'x\n' * 500_001)
    with pytest.raises(DataError, match='no frames up to here'):
        read(tmp_path, ''.join(f'x{k}\ty\n' for k in range(20_000)))
    with pytest.raises(DataError, match='line 1: longer than'):
        read(tmp_path, 'x' * 2_000_000)


@given(st.data())
@settings(max_examples=100, deadline=None, suppress_health_check=list(HealthCheck))
def test_damaged_files_are_read_or_a_data_error(tmp_path, data):
    content = bytearray(qtm().encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content) - 1))
        replaced = slice(at, at + data.draw(st.integers(0, 3)))
        content[replaced] = data.draw(
            st.sampled_from([b'\t', b'\n', b'\0', b'-', b'9', b'e', b'nan', b'\xff', b''])
        )
    try:
        recording = read(tmp_path, bytes(content))
    except DataError as error:
        assert '\n' not in str(error)
        assert len(str(error)) < 1000
    else:
        assert recording.times.shape == (len(recording.positions[recording.names[0]]),)
