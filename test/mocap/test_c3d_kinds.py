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
C3D files of every kind, packed byte by byte after the manual (c3d.org), in any mix.

Processors of Intel, DEC and MIPS; integers and floats; frames counted from 0, from 1 or from
beyond 16 bits, and their number kept in whichever of the four places a program likes; analog
samples between the points; more labels than one parameter holds; units, screens, gaps.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
import struct

from handover_dmp.common.errors import DataError
from handover_dmp.mocap.c3d import read_c3d
from handover_dmp.mocap.up_axis import turn_up
from hypothesis import assume, given, HealthCheck, settings
from hypothesis import strategies as st
import numpy as np
import pytest

RATE_HZ = 100.0
BLOCK = 512
PROCESSORS = {'Intel': 84, 'DEC': 85, 'MIPS': 86}
METRES = {'mm': 1e-3, 'm': 1.0, 'meters': 1.0, 'Centimeters': 0.01, '': 1e-3}


@dataclass(frozen=True, eq=False)
class C3d:
    """What a program writes, and how."""

    table: np.ndarray = field(repr=False)
    names: list[str]
    lost: np.ndarray | None = field(default=None, repr=False)
    loss: str = 'residual'
    processor: str = 'Intel'
    real: bool = True
    scale: float = 0.05
    first: int = 1
    counted: tuple[str, ...] = ('header', 'frames')
    analog: int = 0
    unit: str = 'mm'
    screens: tuple[str, str] | None = None
    others: int = 0
    parameters_at: int = 2
    extra: tuple[bytes, ...] = field(default=())

    @property
    def end(self) -> str:
        return '>' if self.processor == 'MIPS' else '<'

    def floats(self, values) -> bytes:
        """IEEE floats, or those of a VAX: four times as much, and its halves the other way."""
        if self.processor != 'DEC':
            return np.asarray(values, f'{self.end}f4').tobytes()
        return (
            np.asarray(4.0 * np.asarray(values), '<f4')
            .view('<u2')
            .reshape(-1, 2)[:, ::-1]
            .tobytes()
        )

    def integer(self, value: int) -> bytes:
        return struct.pack(f'{self.end}H', value & 0xFFFF)

    def parameter(self, name: str, kind: int, dimensions: list[int], data: bytes, group=1):
        rest = bytes([kind & 0xFF, len(dimensions), *dimensions]) + data + b'\0'
        head = struct.pack('bb', len(name), group) + name.encode()
        return head + self.integer(len(rest) + 2) + rest

    def group(self, name: str, number: int) -> bytes:
        return struct.pack('bb', len(name), -number) + name.encode() + self.integer(3) + b'\0'

    def labels(self) -> bytes:
        width = max(len(name.encode()) for name in self.names)
        text = [name.encode().ljust(width) for name in self.names]
        parts = [text[at: at + 255] for at in range(0, len(text), 255)]  # fmt: skip
        return b''.join(
            self.parameter(f'LABELS{"" if k == 1 else k}', -1, [width, len(part)], b''.join(part))
            for k, part in enumerate(parts, 1)
        )

    def section(self, start: int) -> bytes:
        """Make groups and parameters; `start` is the block of the data."""
        frames = len(self.table)
        made = b''.join(self.group(f'OTHER{k}', 20 + k) for k in range(self.others))
        made += self.group('POINT', 1)
        made += self.parameter('USED', 2, [], self.integer(len(self.names)))
        made += self.parameter('RATE', 4, [], self.floats([RATE_HZ]))
        made += self.parameter('SCALE', 4, [], self.floats([-1.0 if self.real else self.scale]))
        made += self.parameter('DATA_START', 2, [], self.integer(start))
        if 'frames' in self.counted:
            made += self.parameter('FRAMES', 2, [], self.integer(min(frames, 65_535)))
        if 'wrapped frames' in self.counted:
            made += self.parameter('FRAMES', 2, [], self.integer(frames))
        if 'float frames' in self.counted:
            made += self.parameter('FRAMES', 4, [], self.floats([frames]))
        if 'long frames' in self.counted:
            made += self.parameter('LONG_FRAMES', 4, [], self.floats([frames]))
        if self.unit:
            made += self.parameter('UNITS', -1, [len(self.unit)], self.unit.encode())
        for name, axis in zip('XY', self.screens or (), strict=False):
            made += self.parameter(f'{name}_SCREEN', -1, [len(axis)], axis.encode())
        made += self.labels()
        if 'fields' in self.counted:
            made += self.group('TRIAL', 2)
            for name, value in (('START', self.first), ('END', self.first + frames - 1)):
                words = self.integer(value) + self.integer(value >> 16)
                made += self.parameter(f'ACTUAL_{name}_FIELD', 2, [2], words, group=2)
        return made + b''.join(self.extra) + b'\0\0'

    def data(self) -> bytes:
        lost = np.zeros(self.table.shape[:2], bool) if self.lost is None else self.lost
        points = np.dstack([self.table, np.zeros(self.table.shape[:2])])
        gone = {'residual': (1.0, 2.0, 3.0, -1.0), 'zeros': (0.0, 0.0, 0.0, 0.0),
                'nan': (np.nan, np.nan, np.nan, -1.0)}[self.loss]  # fmt: skip
        points[lost] = gone
        samples = np.arange(len(points) * self.analog).reshape(len(points), self.analog) % 99
        if self.real:
            return self.floats(np.hstack([points.reshape(len(points), -1), samples]).ravel())
        places = np.where(lost[..., None], points[..., :3], points[..., :3] / self.scale)
        rounded = np.dstack([np.rint(np.nan_to_num(places)), points[..., 3]])
        words = np.hstack([rounded.reshape(len(points), -1), samples])
        return words.astype(f'{self.end}i2').tobytes()

    def content(self) -> bytes:
        section = self.section(0)
        blocks = -(-(4 + len(section)) // BLOCK)
        start = self.parameters_at + blocks
        section = struct.pack('BBBB', 1, 80, blocks, PROCESSORS[self.processor])
        section += self.section(start)
        last = self.first + len(self.table) - 1
        header = struct.pack('BB', self.parameters_at, 80)
        header += self.integer(len(self.names)) + self.integer(self.analog)
        saturated = min(last, 65_535) if 'header' in self.counted else last
        header += self.integer(self.first) + self.integer(saturated) + self.integer(10)
        header += self.floats([-1.0 if self.real else self.scale])
        header += self.integer(start) + self.integer(1) + self.floats([RATE_HZ])
        header = header.ljust(BLOCK * (self.parameters_at - 1), b'\0')
        data = self.data()
        return header + section.ljust(BLOCK * blocks, b'\0') + data + bytes(-len(data) % BLOCK)


def reaching(frames=60, markers=2):
    """Return (frames, markers, 3) m, z up: two hands that go to each other, and others."""
    u = np.clip(np.linspace(-0.2, 1.2, frames), 0.0, 1.0)[:, None]
    shape = 10 * u**3 - 15 * u**4 + 6 * u**5
    first = np.array([1.2, 0.3, 1.0]) + shape * [-0.5, -0.1, 0.1]
    second = np.array([0.0, 0.05, 0.9]) + shape * [0.5, 0.15, 0.2]
    rest = np.linspace(0.2, 3.0, frames * (markers - 2) * 3).reshape(frames, markers - 2, 3)
    return np.concatenate([first[:, None], second[:, None], rest], axis=1)


def write(path, file: C3d):
    path.write_bytes(file.content())
    return path


def plain(**changes) -> C3d:
    table = 1e3 * reaching(changes.pop('frames', 60))
    return replace(C3d(table, ['P1', 'P2']), **changes)


COUNTED = [
    ('header', 'frames'), ('header',), ('header', 'float frames'), ('header', 'long frames'),
    ('header', 'frames', 'fields'), ('wrapped header', 'wrapped frames'),
    ('header', 'frames', 'long frames', 'fields'),
]  # fmt: skip


@pytest.mark.sample(5)
@pytest.mark.parametrize('counted', COUNTED, ids=' + '.join)
@pytest.mark.parametrize('processor', PROCESSORS)
@pytest.mark.parametrize(('first', 'frames'), [
    (0, 60), (1, 60), (3, 61), (400, 60), (65_530, 60), (65_535, 5), (70_000, 60),
    (1, 65_534), (1, 65_535), (0, 65_535), (1, 65_536), (2, 65_537), (1, 70_000), (66_000, 66_000),
])  # fmt: skip
def test_every_frame_wherever_their_number_is_kept(tmp_path, first, frames, counted, processor):
    file = plain(first=first, frames=frames, counted=counted, processor=processor, real=False)
    recording = read_c3d(write(tmp_path / 'a.c3d', file))
    assert len(recording.times) == frames
    assert recording.times[-1] == pytest.approx((frames - 1) / RATE_HZ)
    for k, name in enumerate(['P1', 'P2']):
        np.testing.assert_allclose(recording.positions[name], file.table[:, k], atol=0.026)


@pytest.mark.parametrize('count', [2, 255, 256, 511, 600])
def test_names_of_more_markers_than_one_parameter_holds(tmp_path, count):
    names = [f'marker{k}' for k in range(count)]
    file = C3d(1e3 * reaching(20, count), names)
    recording = read_c3d(write(tmp_path / 'a.c3d', file), [names[0], names[-1]])
    assert recording.names == names
    np.testing.assert_allclose(recording.positions[names[-1]], file.table[:, -1], rtol=1e-6)


def test_a_file_without_markers_is_said_to_be_one(tmp_path):
    """A file of force plates alone."""
    file = C3d(np.zeros((20, 0, 3)), [''], analog=6)
    content = bytearray(file.content())
    content[2:4] = b'\0\0'
    (tmp_path / 'a.c3d').write_bytes(content)
    with pytest.raises(DataError, match=r'a\.c3d: holds no markers'):
        read_c3d(tmp_path / 'a.c3d')


@pytest.mark.parametrize('up', ['x', 'y', 'z', '-x', '-y', '-z'])
def test_the_screen_tells_which_axis_points_up(tmp_path, up):
    sign, axis = ('-' if '-' in up else '+'), up[-1]
    across = 'Y' if axis == 'x' else 'X'
    back = np.linalg.inv(np.array([turn_up(line, up) for line in np.eye(3)]).T).T
    file = plain(screens=(f'+{across}', f'{sign}{axis.upper()}'))
    recording = read_c3d(write(tmp_path / 'a.c3d', replace(file, table=file.table @ back)))
    motion = recording.wrists(['P1'], ['P2'])
    assert motion.up == (up, 'in the file')
    np.testing.assert_allclose(motion.partner, file.table[:, 0] / 1e3, atol=1e-6)


@dataclass(frozen=True)
class Case:
    """A file of two wrists, and the truth of it."""

    frames: int
    floor: float
    up: str
    pair: bool
    gaps: list[tuple[int, int, int]]
    options: dict

    @property
    def truth(self) -> np.ndarray:
        """Both wrists, m, z up."""
        return reaching(self.frames) + [0.0, 0.0, self.floor]

    @property
    def lost(self) -> np.ndarray:
        lost = np.zeros((self.frames, 2 + self.pair), bool)
        for begin, length, marker in self.gaps:
            lost[begin: begin + length, marker % (2 + self.pair)] = True  # fmt: skip
        return lost

    @property
    def file(self) -> C3d:
        first, second = self.truth[:, 0], self.truth[:, 1]
        half = np.array([0.03, 0.02, 0.01])
        paths = [first + half, first - half, second] if self.pair else [first, second]
        back = np.linalg.inv(np.array([turn_up(line, self.up) for line in np.eye(3)]).T).T
        metres = METRES[self.options['unit']]
        table = np.stack(paths, axis=1) @ back / metres
        names = ['A', 'B', 'P2'] if self.pair else ['A', 'P2']
        return C3d(table, names, self.lost, scale=2.5 / metres / 32_000, **self.options)


@st.composite
def cases(draw):
    up = draw(st.sampled_from(['z', 'y', 'x', '-y']))
    told = ('+Y' if up == 'x' else '+X', f'{"" if up[0] == "-" else "+"}{up.upper()}')
    gap = st.tuples(st.integers(0, 30), st.integers(1, 12), st.integers(0, 2))
    options = {
        'loss': draw(st.sampled_from(['residual', 'zeros', 'nan'])),
        'processor': draw(st.sampled_from(list(PROCESSORS))),
        'real': draw(st.booleans()),
        'first': draw(st.sampled_from([0, 1, 2, 500, 65_500, 65_535, 70_000])),
        'counted': draw(st.sampled_from(COUNTED)),
        'analog': draw(st.sampled_from([0, 0, 4, 30])),
        'unit': draw(st.sampled_from(list(METRES))),
        'screens': draw(st.sampled_from([told, None, ('', '')])),
        'others': draw(st.integers(0, 6)),
        'parameters_at': draw(st.sampled_from([2, 2, 3])),
    }
    return Case(
        draw(st.integers(40, 90)), draw(st.sampled_from([0.0, 0.0, -0.9])), up,
        draw(st.booleans()), draw(st.lists(gap, max_size=3)), options,
    )  # fmt: skip


@given(case=cases())
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_mix_gives_the_truth_or_is_refused(tmp_path, case):
    file, truth = case.file, case.truth
    recording = read_c3d(write(tmp_path / 'a.c3d', file))
    told = any(file.screens or ())
    assert recording.names == file.names
    assert (recording.unit, recording.up) == (file.unit, case.up if told else '')
    unsure = case.floor and not told
    if unsure:
        assumed = recording.wrists(file.names[:-1], file.names[-1:])
        assert assumed.up.value == 'z'
        assert any('z is assumed' in remark for remark in assumed.remarks), 'never silently'
    motion = recording.wrists(file.names[:-1], file.names[-1:], up=case.up if unsure else None)
    assert motion.up.value == case.up
    rounding = 0.0 if file.real else file.scale * METRES[file.unit]
    seen = ~(file.lost[:, :-1].all(axis=1) | file.lost[:, -1])
    np.testing.assert_allclose(motion.times, np.flatnonzero(seen) / RATE_HZ, atol=1e-9)
    # The middle of two markers is learnt to the rounding of each.
    noise = 2e-6 + rounding * (3 if case.pair else 1)
    np.testing.assert_allclose(motion.partner, truth[seen, 0], atol=noise)
    np.testing.assert_allclose(motion.demonstrator, truth[seen, 1], atol=noise)


@given(case=cases(), cut=st.integers(1, 20_000))
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_is_broken_off_is_refused(tmp_path, case, cut):
    """Unless nothing but the padding of the last block is gone."""
    file = case.file
    # Where no place holds the number of frames, nothing tells that some are missing.
    assume(file.counted != ('header',) or file.first + case.frames - 1 < 65_535)
    content = file.content()
    padding = -len(file.data()) % BLOCK
    (tmp_path / 'a.c3d').write_bytes(content[: max(len(content) - padding - cut, 1)])
    with pytest.raises(DataError):
        read_c3d(tmp_path / 'a.c3d')


def test_a_dead_screen_parameter_tells_nothing(tmp_path):
    for screens in (('', ''), ('+X', '??'), ('+X', 'up')):
        assert read_c3d(write(tmp_path / 'a.c3d', plain(screens=screens))).up == ''
