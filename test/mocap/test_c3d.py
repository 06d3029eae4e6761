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

"""The C3D reader, on files written by another library, ezc3d."""

from __future__ import annotations

import random
import struct

from handover_dmp.common.errors import DataError
from handover_dmp.mocap.c3d import read_c3d
import numpy as np
import pytest

ezc3d = pytest.importorskip('ezc3d')

NAMES = ['M_wrist', 'A_wrist', 'elbow']
FRAMES = 60
RATE_HZ = 100.0


def positions():
    steps = np.arange(FRAMES)[:, None, None]
    return 100.0 * np.arange(9).reshape(1, 3, 3) + 2.5 * steps + 1.0


def write(path, *, table=None, unit='mm', y_screen='+Z', analog=0):
    table = positions() if table is None else table
    file = ezc3d.c3d()
    points = np.ones((4, 3, len(table)))
    points[:3] = table.transpose(2, 1, 0)
    file['data']['points'] = points
    file['parameters']['POINT']['RATE']['value'] = [RATE_HZ]
    file['parameters']['POINT']['LABELS']['value'] = NAMES
    file['parameters']['POINT']['UNITS']['value'] = [unit]
    file.add_parameter('POINT', 'Y_SCREEN', [y_screen])
    if analog:
        file['parameters']['ANALOG']['RATE']['value'] = [RATE_HZ * 10]
        file['parameters']['ANALOG']['LABELS']['value'] = [f'force{k}' for k in range(analog)]
        file['data']['analogs'] = np.random.default_rng(0).random((1, analog, len(table) * 10))
    file.write(str(path))
    return path


@pytest.mark.parametrize('analog', [0, 6])
def test_what_another_library_wrote(tmp_path, analog):
    recording = read_c3d(write(tmp_path / 'a.c3d', analog=analog))
    assert recording.names == NAMES
    assert (recording.unit, recording.up, recording.source) == ('mm', 'z', 'a.c3d')
    np.testing.assert_allclose(recording.times, np.arange(FRAMES) / RATE_HZ)
    for k, name in enumerate(NAMES):
        np.testing.assert_allclose(recording.positions[name], positions()[:, k], rtol=1e-6)


def test_units_and_axes(tmp_path):
    recording = read_c3d(
        write(tmp_path / 'a.c3d', unit='m', y_screen='+Y', table=positions() / 1e3)
    )
    assert (recording.unit, recording.up) == ('m', 'y')
    motion = recording.wrists(['M_wrist'], ['A_wrist'])
    np.testing.assert_allclose(motion.demonstrator[0], [0.301, -0.501, 0.401], atol=1e-6)
    recording = read_c3d(write(tmp_path / 'b.c3d', unit='furlong'))
    with pytest.raises(DataError, match=r"unit 'furlong' .*--unit"):
        recording.wrists(['M_wrist'], ['A_wrist'])
    assert recording.wrists(['M_wrist'], ['A_wrist'], unit='mm', up='z').unit.value == 'mm'


def test_markers_out_of_sight(tmp_path):
    table = positions()
    table[20:25, 1] = np.nan
    recording = read_c3d(write(tmp_path / 'a.c3d', table=table), ['A_wrist', 'nobody'])
    assert list(recording.positions) == ['A_wrist']
    np.testing.assert_allclose(recording.positions['A_wrist'], table[:, 1], rtol=1e-6)
    with pytest.raises(DataError, match="no marker 'nobody'; there are M_wrist, A_wrist, elbow"):
        recording.wrists(['nobody'], ['A_wrist'])


def integers(scale=0.5):
    """
    Make a file of scaled 16-bit integers by hand, by the C3D manual: three blocks of 512 bytes.

    Older systems write these, ezc3d cannot.
    """

    def parameter(name, group, kind, dimensions, data):
        rest = bytes([kind & 0xFF, len(dimensions), *dimensions]) + data + b'\0'
        head = struct.pack('bb', len(name), group) + name.encode()
        return head + struct.pack('<h', len(rest) + 2) + rest

    frames = 20
    header = struct.pack('<BBHHHHHfHH', 2, 80, 1, 0, 1, frames, 10, scale, 3, 0)
    header = (header + struct.pack('<f', RATE_HZ)).ljust(512, b'\0')
    group = struct.pack('bb', 5, -1) + b'POINT' + struct.pack('<h', 3) + b'\0'
    section = b'\1\x50\1\x54' + group
    section += parameter('USED', 1, 2, [], struct.pack('<h', 1))
    section += parameter('FRAMES', 1, 2, [], struct.pack('<h', frames))
    section += parameter('DATA_START', 1, 2, [], struct.pack('<h', 3))
    section += parameter('SCALE', 1, 4, [], struct.pack('<f', scale))
    section += parameter('RATE', 1, 4, [], struct.pack('<f', RATE_HZ))
    section += parameter('UNITS', 1, -1, [2], b'mm')
    section += parameter('LABELS', 1, -1, [4, 1], b'hand')
    section += b'\0\0'
    data = b''.join(
        struct.pack('<hhhh', 10 * k, -k, 100, -1 if k == 5 else 0) for k in range(frames)
    )
    return header + section.ljust(512, b'\0') + data.ljust(512, b'\0')


def test_scaled_integers(tmp_path):
    (tmp_path / 'old.c3d').write_bytes(integers())
    path = read_c3d(tmp_path / 'old.c3d').positions['hand']
    expected = 0.5 * np.array([[10 * k, -k, 100] for k in range(20)], dtype=float)
    expected[5] = np.nan
    np.testing.assert_allclose(path, expected)


def test_files_that_are_broken(tmp_path):
    good = write(tmp_path / 'good.c3d').read_bytes()
    (tmp_path / 'half.c3d').write_bytes(good[: len(good) - 1500])
    with pytest.raises(DataError, match=r'half.c3d: truncated after \d+ of 60 frames'):
        read_c3d(tmp_path / 'half.c3d')
    for content in (good[:300], good[:700], b'\0' * 4096, b'\xff' * 4096, b'PK\3\4' * 600):
        (tmp_path / 'bad.c3d').write_bytes(content)
        with pytest.raises(DataError, match=r'bad\.c3d: '):
            read_c3d(tmp_path / 'bad.c3d')
    (tmp_path / 'empty.c3d').write_bytes(b'')
    with pytest.raises(DataError, match='is empty'):
        read_c3d(tmp_path / 'empty.c3d')


def test_damaged_files_are_read_or_a_data_error(tmp_path):
    good = write(tmp_path / 'good.c3d').read_bytes()
    path = tmp_path / 'bad.c3d'
    for seed in range(150):
        rng = random.Random(seed)
        content = bytearray(good)
        for _ in range(rng.randint(1, 6)):
            content[rng.randrange(1200)] = rng.randrange(256)
        path.write_bytes(content)
        try:
            recording = read_c3d(path, NAMES[:2])
        except DataError as error:
            assert '\n' not in str(error)
            assert len(str(error)) < 1000
        else:
            assert len(recording.times) <= 5_000_000
