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

"""
The readers of Motive, Vicon, TRC and Qualisys text, on files with any mix of their oddities.

Each generator writes a file as its program does; whatever it mixes in, the reader has to give back
the truth or refuse.
"""

from __future__ import annotations

import random

from handover_dmp.common.errors import DataError
from handover_dmp.mocap.motive import read_motive
from handover_dmp.mocap.qualisys import read_qualisys
from handover_dmp.mocap.trc import read_trc
from handover_dmp.mocap.trial import read_trial
from handover_dmp.mocap.up_axis import turn_up
from handover_dmp.mocap.vicon import read_vicon
from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
import numpy as np
import pytest

RATE_HZ = 120.0
FRAMES = 60
METRES = {'Meters': 1.0, 'Centimeters': 0.01, 'Millimeters': 0.001, 'mm': 0.001, 'm': 1.0}
NAMES = st.lists(
    st.sampled_from(['1_wrist', 'wrist', '_w', '*7', 'P1:RWRA', 'Hand, left', 'Höger', 'a b']),
    min_size=2, max_size=4, unique=True,
)  # fmt: skip


def motion(markers, up='z', seed=0):
    """
    Return (frames, markers, 3) in m: hands that go to each other, `up` pointing up.

    The first and the third marker are on one wrist, the second and the fourth on the other.
    """
    rng = np.random.default_rng(seed)
    u = np.clip(np.linspace(-0.2, 1.2, FRAMES), 0.0, 1.0)[:, None, None]
    start = rng.uniform([-0.2, -0.4, 0.8], [0.1, 0.3, 1.1], (markers, 3))
    start[::2, 0] += 1.7
    start[2:] = start[: max(markers - 2, 0)] + rng.uniform(-0.05, 0.05, (max(markers - 2, 0), 3))
    goal = start + [0.4, 0.1, 0.15] * np.where(np.arange(markers) % 2, 1, -1)[:, None]
    path = start + (10 * u**3 - 15 * u**4 + 6 * u**5) * (goal - start)
    return path @ np.linalg.inv(np.array([turn_up(line, up) for line in np.eye(3)]).T).T


def numbers(row, lost, word=''):
    return [word if gone else f'{value:.6f}' for place, gone in zip(row, lost, strict=True)
            for value in place]  # fmt: skip


def quoted(cell):
    return f'"{cell}"' if ',' in cell else cell


def motive(names, table, lost, frames, *, version, unit, bodies, solved, timecode, word):
    """Write what Motive exports; from 1.24 on its header lines say what they are."""
    labelled = version >= '1.24'
    kinds = ['Rigid Body' if bodies else 'Marker'] * len(names)
    parts = [*([('Rotation', 'XYZW')] if bodies else []), ('Position', 'XYZ')]
    columns = [
        (kind, name, part, axis)
        for kind, name in zip(kinds, names, strict=True)
        for part, axes in parts
        for axis in axes
    ]
    if solved:
        columns = [('Rigid Body Marker', name, 'Position', axis) for name in names
                   for axis in 'XYZ'] + columns  # fmt: skip
    first = ['', 'Type', 'Name', 'ID', 'Parent'] if labelled else [''] * 4
    lead = 3 if timecode else 2

    def head(label, cells):
        return ','.join(['', label, ''][:lead] + [quoted(cell) for cell in cells])

    lines = [
        f'Format Version,{version},Take Name,Take 2023-05-01,Capture Frame Rate,120.000000,'
        f'Total Exported Frames,{len(frames)},Rotation Type,Quaternion,Length Units,{unit},'
        'Coordinate Space,Global',
        '',
        head(first[1], [column[0] for column in columns]),
        head(first[2], [column[1] for column in columns]),
        head(first[3], [f'{7 + k}' for k, _ in enumerate(columns)]),
    ]
    if labelled:
        lines.append(head('Parent', ['' for _ in columns]))
    lines.append(head('', [column[2] for column in columns]))
    titles = ['Frame', 'Time (Seconds)', 'TimeCode'][:lead]
    lines.append(','.join(titles + [column[3] for column in columns]))
    for frame in frames:
        cells = [str(frame), f'{frame / RATE_HZ:.6f}', '15:26:46:12.02'][:lead]
        for kind, name, part, axis in columns:
            k = names.index(name)
            value = 0.5 if part == 'Rotation' else table[frame, k, 'XYZ'.index(axis)]
            if kind == 'Rigid Body Marker':
                value += 77.0
            cells.append(word if lost[frame, k] else f'{value:.6f}')
        lines.append(','.join(cells))
    return '\r\n'.join(lines) + '\r\n'


def vicon(names, table, lost, frames, *, unit, devices, delimiter, word):
    """Write what Vicon Nexus exports, perhaps with devices before and a padded section after."""

    def line(cells):
        return delimiter.join(cells)

    lines = []
    if devices:
        lines += ['Devices', '1200', line(['', '', 'Force', '', ''])]
        lines += [line(['Frame', 'Sub Frame', 'Fx', 'Fy', 'Fz']), line(['', '', 'N', 'N', 'N'])]
        lines += [*(line(['1', str(k), '1', '2', '3']) for k in range(5)), '']
    lines += ['Trajectories' + delimiter * (3 if devices else 0), f'{RATE_HZ:g}']
    lines.append(line(['', '', *(cell for name in names for cell in (quoted(name), '', ''))]))
    lines.append(line(['Frame', 'Sub Frame', *('XYZ' * len(names))]))
    lines.append(line(['', '', *([unit] * 3 * len(names))]))
    for frame in frames:
        lines.append(line([str(frame + 101), '0', *numbers(table[frame], lost[frame], word)]))
    lines += ['', 'Model Outputs', '120', ',,Angle', 'Frame,Sub Frame,X,Y,Z'] if devices else []
    return '\n'.join(lines) + '\n'


def trc(names, table, lost, frames, *, unit, blank, word):
    lines = [
        'PathFileType\t4\t(X/Y/Z)\ttrial.trc',
        'DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate',
        f'120.00\t120.00\t{len(frames)}\t{len(names)}\t{unit}\t120.00',
        '\t'.join(['Frame#', 'Time', *(cell for name in names for cell in (name, '', ''))]),
        '\t'.join(['', '', *(f'{axis}{k}' for k, _ in enumerate(names, 1) for axis in 'XYZ')]),
        *([''] if blank else []),
    ]
    for frame in frames:
        cells = [str(frame + 1), f'{frame / RATE_HZ:.6f}']
        lines.append('\t'.join(cells + numbers(table[frame], lost[frame], word)) + '\t')
    return '\n'.join(lines) + '\n'


def qualisys(names, table, lost, frames, *, columns, titles, bodies, encoding, word):
    """Write what Qualisys exports; frames that are missing have no line."""
    kind = 'BODY_NAMES' if bodies else 'MARKER_NAMES'
    lines = [f'NO_OF_FRAMES\t{len(frames)}', 'NO_OF_CAMERAS\t8', f'FREQUENCY\t{RATE_HZ:g}',
             'TIME_STAMP\t2022-06-03, 10:47:36.627\t94247.4',
             f'DATA_INCLUDED\t{6 if bodies else 3}D', 'EVENT\tgrasp\t7\t0.0583',
             f'{kind}\t' + '\t'.join(names)]  # fmt: skip
    after = (
        ['Roll', 'Pitch', 'Yaw', 'Residual', *(f'Rot[{k}]' for k in range(9))] if bodies else []
    )
    if titles:
        axes = ((f'{name} X', 'Y', 'Z') if bodies else [f'{name} {axis}' for axis in 'XYZ']
                for name in names)  # fmt: skip
        lines.append('\t'.join([*columns, *(c for axis in axes for c in (*axis, *after))]))
    for frame in frames:
        known = {'Frame': str(frame + 1), 'Time': f'{frame / RATE_HZ:.5f}'}
        cells = [known[name] for name in columns]
        for place, gone in zip(table[frame], lost[frame], strict=True):
            cells += numbers([place], [gone], word)
            if bodies:
                cells += [word if gone else '0.5'] * 3 + ['-1.0' if gone else '1.2']
                cells += [word if gone else '0.5'] * 9
        lines.append('\t'.join(cells))
    return ('\r\n'.join(lines) + '\r\n').encode(encoding)


def check(recording, case, metres, *, usual, times=True):
    """
    Hold what was read, and the wrists that are taken out of it, against what was written.

    What the file does not tell, unit or axis, is right or asked for.
    """
    names, table, lost, frames, up = case
    expected = np.where(lost[..., None], np.nan, table)[frames]
    assert list(recording.positions) == names
    for k, name in enumerate(names):
        np.testing.assert_allclose(recording.positions[name], expected[:, k], atol=2e-6)
    if times:
        elapsed = recording.times - recording.times[0]
        np.testing.assert_allclose(elapsed, (frames - frames[0]) / RATE_HZ, atol=2e-5)
    told = {}
    if not recording.unit and not np.isclose(METRES[usual], metres):
        with pytest.raises(DataError, match='--unit'):
            recording.wrists(names[::2], names[1::2])
        told['unit'] = next(unit for unit in METRES if np.isclose(METRES[unit], metres))
    try:
        two = recording.wrists(names[::2], names[1::2], **told)
    except DataError as error:
        assert 'say which with --up' in str(error)
        two = recording.wrists(names[::2], names[1::2], up=up, **told)
    assert two.up.value == up
    whole = ~lost[frames]
    seen = whole[:, ::2].any(axis=1) & whole[:, 1::2].any(axis=1)
    truth = metres * turn_up(table.reshape(-1, 3), up).reshape(table.shape)[frames][seen]
    np.testing.assert_allclose(two.partner, truth[:, ::2].mean(axis=1), atol=4e-6)
    np.testing.assert_allclose(two.demonstrator, truth[:, 1::2].mean(axis=1), atol=4e-6)


@st.composite
def cases(draw, metres):
    """Draw names, a motion in that unit, what was not seen, the frames, and what points up."""
    names = draw(NAMES)
    up = draw(st.sampled_from(['z', 'y', 'x', '-y']))
    table = motion(len(names), up, seed=draw(st.integers(0, 20))) / metres
    lost = np.zeros(table.shape[:2], dtype=bool)
    for _ in range(draw(st.integers(0, 3))):
        begin = draw(st.integers(0, FRAMES - 12))
        length, marker = draw(st.integers(1, 10)), draw(st.integers(0, len(names) - 1))
        lost[begin:, marker][:length] = True
    frames = np.arange(draw(st.integers(0, 9)), FRAMES)
    missing = draw(st.lists(st.integers(11, FRAMES - 2), max_size=5))
    return names, table, lost, frames[~np.isin(frames, missing)], up


WORDS = st.sampled_from(['', 'NaN', 'nan', 'No data', '0.000000'])
GENTLY = settings(
    max_examples=40, deadline=None, derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)  # fmt: skip


def read(read_it, path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_it(path)


@given(data=st.data())
@GENTLY
def test_motive(tmp_path, data):
    unit = data.draw(st.sampled_from(['Meters', 'Centimeters', 'Millimeters']))
    said = data.draw(st.sampled_from([unit, unit, '']))
    case = data.draw(cases(METRES[unit]))
    text = motive(
        *case[:-1],
        version=data.draw(st.sampled_from(['1.2', '1.22', '1.23', '1.24', '1.25'])),
        unit=said,
        bodies=data.draw(st.booleans()),
        solved=data.draw(st.booleans()),
        timecode=data.draw(st.booleans()),
        word=data.draw(WORDS),
    )
    recording = read(read_motive, tmp_path / 'Take 2023-05-01 10.12.13 AM.csv', text)
    assert recording.unit == said
    check(recording, case, METRES[unit], usual='Meters')


@given(data=st.data())
@GENTLY
def test_vicon(tmp_path, data):
    unit = data.draw(st.sampled_from(['mm', 'm']))
    said = data.draw(st.sampled_from([unit, unit, '']))
    delimiter = data.draw(st.sampled_from([',', '\t', ';']))
    case = data.draw(cases(METRES[unit]))
    text = vicon(
        *case[:-1], unit=said, devices=data.draw(st.booleans()), delimiter=delimiter,
        word=data.draw(WORDS),
    )  # fmt: skip
    recording = read(read_vicon, tmp_path / 'trial.csv', text)
    check(recording, case, METRES[unit], usual='mm')


@given(data=st.data())
@GENTLY
def test_trc(tmp_path, data):
    unit = data.draw(st.sampled_from(['mm', 'm']))
    case = data.draw(cases(METRES[unit]))
    said = data.draw(st.sampled_from([unit, unit, '']))
    text = trc(*case[:-1], unit=said, blank=data.draw(st.booleans()), word=data.draw(WORDS))
    if data.draw(st.booleans()) and not any(',' in name for name in case[0]):
        text = text.replace('\t', ',')
    check(read(read_trc, tmp_path / 'trial.trc', text), case, METRES[unit], usual='mm')


@given(data=st.data())
@GENTLY
def test_qualisys(tmp_path, data):
    case = data.draw(cases(0.001))
    titles = data.draw(st.booleans())
    columns = data.draw(
        st.sampled_from([[], ['Frame', 'Time'], *([['Frame'], ['Time']] * titles)])
    )
    content = qualisys(
        *case[:-1], columns=columns, titles=titles, bodies=data.draw(st.booleans()),
        encoding=data.draw(st.sampled_from(['utf-8', 'utf-8-sig', 'utf-16', 'cp1252'])),
        word=data.draw(WORDS),
    )  # fmt: skip
    recording = read(read_qualisys, tmp_path / 'trial.tsv', content)
    check(recording, case, 0.001, usual='mm', times=bool(columns))


@given(data=st.data())
@GENTLY
def test_trial_csv(tmp_path, data):
    """The package's own format defines unit and axis; a gap is a sample that is not there."""
    table = motion(2, seed=data.draw(st.integers(0, 20)))
    rows = np.column_stack([np.arange(FRAMES) / RATE_HZ, table[:, 0], table[:, 1]])
    cells = [[f'{value:.6f}' for value in row] for row in rows]
    whole = True
    if data.draw(st.booleans()):
        begin, length = data.draw(st.integers(5, 40)), data.draw(st.integers(1, 9))
        hand = data.draw(st.sampled_from([1, 4]))
        word = data.draw(WORDS)
        for row in cells[begin: begin + length]:  # fmt: skip
            row[hand: hand + 3] = [word] * 3  # fmt: skip
        whole = False
    missing = data.draw(st.lists(st.integers(1, FRAMES - 2), max_size=5)) if whole else []
    kept = [k for k in range(FRAMES) if k not in missing]
    order = data.draw(st.sampled_from([kept, kept, kept[::-1], [*kept, *kept], [kept[0], *kept]]))
    scale = data.draw(st.sampled_from([1.0, 1.0, 1000.0]))
    if scale > 1.0 and whole:
        cells = [[row[0], *(f'{scale * float(cell)}' for cell in row[1:])] for row in cells]
    end = data.draw(st.sampled_from(['\n', '\r\n']))
    head = 't,p1_x,p1_y,p1_z,p2_x,p2_y,p2_z'
    text = end.join([head, *(','.join(cells[k]) for k in order)]) + end
    path = tmp_path / 'bay_give_1.csv'
    path.write_bytes(data.draw(st.sampled_from([b'', b'\xef\xbb\xbf'])) + text.encode())
    if whole and order is kept and scale == 1.0:
        trial = read_trial(path)
        np.testing.assert_allclose(trial.times, rows[kept, 0], atol=1e-6)
        np.testing.assert_allclose(trial.partner, rows[kept, 1:4], atol=1e-6)
        np.testing.assert_allclose(trial.demonstrator, rows[kept, 4:], atol=1e-6)
    else:
        with pytest.raises(DataError, match=r'bay_give_1\.csv: line [0-9]+: '):
            read_trial(path)


FOREIGN = {
    'an old Motive': (read_motive, 'info,version,1.0\n', 'which would begin with Format Version'),
    'an older Motive': (read_motive, 'Format Version,1.1,x,y\n', 'version 1.1; 1.2 or later'),
    'Motive without positions': (
        read_motive,
        'Format Version,1.23\n\n,,Bone\n,,a\n,,1\n,,Rotation\nFrame,Time (Seconds),X,Y,Z,W\n',
        'no positions',
    ),
    'Vicon without trajectories': (
        read_vicon, 'Devices\n1000\n,,a\nFrame,Sub Frame,a\n', 'no section .*; it has Devices',
    ),
    'Vicon that breaks off': (read_vicon, 'Trajectories\n100\n', 'ends within the header'),
    'no TRC': (read_trc, 'a\tb\n', 'not a TRC file'),
}  # fmt: skip


@pytest.mark.parametrize('name', FOREIGN)
def test_files_that_are_something_else(tmp_path, name):
    reader, text, message = FOREIGN[name]
    with pytest.raises(DataError, match=message):
        read(reader, tmp_path / 'file', text)


def test_files_that_are_broken_off(tmp_path):
    names, table = ['a', 'b'], motion(2)
    whole = np.zeros(table.shape[:2], dtype=bool), np.arange(FRAMES)
    texts = {
        read_trc: trc(names, table, *whole, unit='m', blank=True, word=''),
        read_motive: motive(names, table, *whole, version='1.23', unit='Meters', bodies=True,
                            solved=False, timecode=False, word=''),
    }  # fmt: skip
    for reader, text in texts.items():
        lines = text.splitlines()
        for shorter in (lines[:-3], [*lines[:-1], lines[-1][:15]]):
            with pytest.raises(
                DataError, match=r'frames, but the header says 60|values instead of'
            ):
                read(reader, tmp_path / 'short', '\n'.join(shorter))


@pytest.mark.parametrize('reader', [read_motive, read_vicon, read_trc])
def test_damage_gives_a_recording_or_one_line(tmp_path, reader):
    names, table = ['a', 'b'], motion(2)
    whole = np.zeros(table.shape[:2], dtype=bool), np.arange(12)
    text = {
        read_trc: trc(names, table, *whole, unit='m', blank=True, word=''),
        read_vicon: vicon(names, table, *whole, unit='m', devices=True, delimiter=',', word=''),
        read_motive: motive(names, table, *whole, version='1.25', unit='Meters', bodies=True,
                            solved=True, timecode=True, word=''),
    }[reader]  # fmt: skip
    rng = random.Random(3)
    for _ in range(200):
        content = bytearray(text.encode())
        for _ in range(rng.randint(1, 5)):
            at = rng.randrange(len(content))
            piece = rng.choice([b',', b'\n', b'\0', b'"', b'-', b'9e999', b'nan', b'\xff', b''])
            content[at: at + rng.randint(0, 4)] = piece  # fmt: skip
        try:
            recording = read(reader, tmp_path / 'bad', bytes(content))
        except DataError as error:
            assert '\n' not in str(error)
            assert len(str(error)) < 1000
        else:
            assert all(len(path) == len(recording.times) for path in recording.positions.values())
