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

"""Orientations of the wrists: in trials, out of every format that has them, and into bags."""

from __future__ import annotations

from dataclasses import replace

from handover_dmp.common.errors import DataError
from handover_dmp.mocap import condition, HandoverTrial, read_trial, synthesize, write_trial
from handover_dmp.mocap.bag import read_bag_wrists
from handover_dmp.mocap.motive import read_motive
from handover_dmp.mocap.orientation import orientation_at
from handover_dmp.mocap.qualisys import read_qualisys
from handover_dmp.mocap.trial import HEADER, TURN_HEADERS
from handover_dmp.mocap.trial_bag import write_trial_bag
from handover_dmp.mocap.up_axis import turn_up
from handover_dmp.mocap.vicon import read_vicon
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

COUNT = 40
RATE_HZ = 100.0
TRIALS = synthesize(3, 1, configurations=['engine_bay'], orientation=True)
quaternions = arrays(float, 4, elements=st.floats(-1.0, 1.0)).filter(
    lambda q: np.linalg.norm(q) > 0.1
)


def turning(seed: int) -> Rotation:
    """Give a smooth turn in 40 samples, by more than half a revolution."""
    random = np.random.default_rng(seed)
    share = np.linspace(0.0, 1.0, COUNT)[:, None]
    axis = random.standard_normal(3)
    spin = Rotation.from_rotvec(3.5 * share * axis / np.linalg.norm(axis))
    return spin * Rotation.random(random_state=seed)


def moving(seed: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    share = np.linspace(0.0, 1.0, COUNT)[:, None]
    return random.uniform([-0.3, -0.3, 0.9], [0.0, 0.3, 1.1]) + share * [0.4, 0.1, 0.15]


def same(found: np.ndarray, wanted: Rotation, atol: float = 1e-5) -> None:
    """Hold quaternions against rotations, and their signs against each other."""
    off = (Rotation.from_quat(found) * wanted.inv()).magnitude()
    np.testing.assert_allclose(off, 0.0, atol=atol)
    assert (np.einsum('ij,ij->i', found[1:], found[:-1]) > 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-8)


@pytest.mark.parametrize('kept', [(True, True), (True, False), (False, True), (False, False)])
def test_a_trial_with_any_of_them_comes_back_from_its_file_to_the_last_bit(kept, tmp_path) -> None:
    names = ('partner_orientation', 'demonstrator_orientation')
    lost = {name: None for name, has in zip(names, kept, strict=True) if not has}
    trial = replace(TRIALS[0], **lost)
    write_trial(trial, tmp_path / 'a_give_1.csv')
    back = read_trial(tmp_path / 'a_give_1.csv')
    header = (tmp_path / 'a_give_1.csv').read_text().splitlines()[0].split(',')
    assert header == [
        *HEADER, *(n for columns, has in zip(TURN_HEADERS, kept, strict=True) if has
                   for n in columns),
    ]  # fmt: skip
    for name in ('times', 'partner', 'demonstrator', *names):
        np.testing.assert_array_equal(getattr(back, name), getattr(trial, name))


def test_synthetic_positions_do_not_depend_on_whether_there_are_orientations() -> None:
    for bare, turned in zip(synthesize(7, 2), synthesize(7, 2, orientation=True), strict=True):
        np.testing.assert_array_equal(bare.partner, turned.partner)
        np.testing.assert_array_equal(bare.demonstrator, turned.demonstrator)
        assert bare.demonstrator_orientation is None
        smooth = condition(turned)
        for path in (smooth.partner_orientation, smooth.demonstrator_orientation):
            steps = (
                Rotation.from_quat(path[1:]) * Rotation.from_quat(path[:-1]).inv()
            ).magnitude()
            # a hand that reaches turns at some rad/s, without jumps
            assert steps.max() * 200.0 < 8.0
            assert np.abs(np.diff(steps)).max() * 200.0 < 0.3


@pytest.mark.parametrize(
    'damage, fault',
    [
        (lambda q: q * np.where(np.arange(len(q)) == 7, 0.0, 1.0)[:, None], 'norm 0 instead of 1'),
        (lambda q: np.where(np.arange(len(q))[:, None] == 7, np.nan, q), 'not a finite number'),
        (lambda q: 1.2 * q, 'norm 1.2 instead of 1'),
        (lambda q: np.where(np.arange(len(q))[:, None] < 7, q, q[:, ::-1] * [1, -1, 1, -1]),
         'deg from one sample'),
        (lambda q: q[:-1], 'not \\(n, 4\\)'),
    ],
)  # fmt: skip
def test_what_is_no_orientation_is_refused_in_one_line(damage, fault, tmp_path) -> None:
    trial = TRIALS[0]
    with pytest.raises(DataError, match=fault):
        replace(trial, demonstrator_orientation=damage(trial.demonstrator_orientation))


def test_a_faulty_line_of_a_file_is_named(tmp_path) -> None:
    file = tmp_path / 'a_give_1.csv'
    write_trial(replace(TRIALS[0], partner_orientation=None), file)
    lines = file.read_text().splitlines()
    lines[9] = ','.join([*lines[9].split(',')[:7], '0', '0', '0', '0'])
    file.write_text('\n'.join(lines))
    with pytest.raises(DataError, match='line 10: a quaternion of norm 0'):
        read_trial(file)
    file.write_text('\n'.join([lines[0].replace('p2_qw', 'p2_qq'), *lines[1:]]))
    with pytest.raises(DataError, match='line 1: header'):
        read_trial(file)


@settings(max_examples=30)
@given(turn=quaternions, inner=quaternions, flips=st.integers(0, 2**20))
def test_neither_signs_nor_frames_matter(turn, inner, flips) -> None:
    """Smoothing commutes with turning the room and the axes of the wrist."""
    trial = TRIALS[0]
    path = trial.demonstrator_orientation
    signs = np.where([flips >> (k % 20) & 1 for k in range(len(path))], -1.0, 1.0)[:, None]
    room, wrist = Rotation.from_quat(turn), Rotation.from_quat(inner)
    other = (room * Rotation.from_quat(path) * wrist).as_quat()
    moved = condition(replace(trial, demonstrator_orientation=signs * other))
    expected = room * Rotation.from_quat(condition(trial).demonstrator_orientation) * wrist
    same(moved.demonstrator_orientation, expected, atol=1e-9)


def motive(bodies, unit='Meters') -> str:
    """Write rigid bodies as Motive does: rotation, then position, y up."""
    axes = [*'XYZW', *'XYZ']
    parts = ['Rotation'] * 4 + ['Position'] * 3
    lines = [
        f'Format Version,1.23,Rotation Type,Quaternion,Length Units,{unit},'
        'Coordinate Space,Global',
        '',
        ',,' + ','.join(['Rigid Body'] * 7 * len(bodies)),
        ',,' + ','.join(name for name in bodies for _ in axes),
        ',,' + ','.join(['7'] * 7 * len(bodies)),
        ',,' + ','.join(parts * len(bodies)),
        'Frame,Time (Seconds),' + ','.join(axes * len(bodies)),
    ]
    for k in range(COUNT):
        cells = [f'{v:.7f}' for turn, place in bodies.values() for v in (*turn[k], *place[k])]
        lines.append(','.join([str(k), f'{k / RATE_HZ:.6f}', *cells]))
    return '\n'.join(lines) + '\n'


def qualisys(bodies) -> str:
    lines = [f'FREQUENCY\t{RATE_HZ:g}', 'DATA_INCLUDED\t6D', 'BODY_NAMES\t' + '\t'.join(bodies)]
    for k in range(COUNT):
        cells = []
        for turn, place in bodies.values():
            columns = Rotation.from_quat(turn[k]).as_matrix().T.ravel()
            cells += [*(1e3 * place[k]), 0.0, 0.0, 0.0, 0.3, *columns]
        lines.append('\t'.join(f'{v:.7f}' for v in cells))
    return '\n'.join(lines) + '\n'


def vicon(bodies, kind: str) -> str:
    quaternion = kind == 'quaternion'
    turn_axes = ['RX', 'RY', 'RZ', *(['RW'] if quaternion else [])]
    labels, units = [], []
    for name in bodies:
        labels += [f'Global Angle ({"Quaternion" if quaternion else "Helical"}) {name}']
        labels += [''] * (len(turn_axes) - 1) + [name, '', '']
        units += [('' if quaternion else kind)] * len(turn_axes) + ['mm'] * 3
    axes = [*turn_axes, 'TX', 'TY', 'TZ'] * len(bodies)
    lines = ['Objects', f'{RATE_HZ:g}', ',,' + ','.join(labels)]
    lines += ['Frame,Sub Frame,' + ','.join(axes), ',,' + ','.join(units)]
    for k in range(COUNT):
        cells = []
        for turn, place in bodies.values():
            vector = Rotation.from_quat(turn[k]).as_rotvec(degrees=kind == 'deg')
            cells += [*(turn[k] if quaternion else vector), *(1e3 * place[k])]
        lines.append(','.join([str(k + 1), '0', *(f'{v:.7f}' for v in cells)]))
    return '\n'.join(lines) + '\n'


READERS = {
    'motive': (motive, read_motive, 'y'),
    'qualisys': (qualisys, read_qualisys, 'z'),
    'vicon quaternion': (lambda b: vicon(b, 'quaternion'), read_vicon, 'z'),
    'vicon deg': (lambda b: vicon(b, 'deg'), read_vicon, 'z'),
    'vicon rad': (lambda b: vicon(b, 'rad'), read_vicon, 'z'),
}


@pytest.mark.parametrize('name', READERS)
def test_rigid_bodies_bring_their_orientation_along(name, tmp_path) -> None:
    write, read, up = READERS[name]
    turns = {'p1': turning(1), 'p2': turning(2)}
    places = {'p1': moving(1) + [1.5, 0.0, 0.0], 'p2': moving(2)}
    # what z up becomes where the file has another axis up
    room = Rotation.from_matrix(turn_up(np.eye(3), up).T)
    signs = np.where(np.arange(COUNT) % 3, 1.0, -1.0)[:, None]
    bodies = {
        who: (signs * (room.inv() * turns[who]).as_quat(), room.inv().apply(places[who]))
        for who in turns
    }
    (tmp_path / 'file').write_text(write(bodies))
    recording = read(tmp_path / 'file')
    motion = recording.wrists(['p1'], ['p2'], up=up)
    np.testing.assert_allclose(motion.partner, places['p1'], atol=1e-6)
    same(motion.partner_orientation, turns['p1'])
    same(motion.demonstrator_orientation, turns['p2'])
    trial = motion.trial(3, 30, configuration='a', direction='give', number=1)
    same(trial.demonstrator_orientation, turns['p2'][3:30])


def test_a_wrist_of_several_bodies_has_none(tmp_path) -> None:
    bodies = {who: (turning(k).as_quat(), moving(k) + [k, 0, 0]) for k, who in enumerate('abc')}
    (tmp_path / 'file').write_text(qualisys(bodies))
    motion = read_qualisys(tmp_path / 'file').wrists(['a', 'b'], ['c'], up='z')
    assert motion.partner_orientation is None
    assert motion.demonstrator_orientation is not None


@pytest.mark.parametrize('word', [np.nan, 0.0])
def test_a_short_gap_is_bridged_and_a_long_one_is_not(word) -> None:
    times = np.arange(COUNT) / RATE_HZ
    turns = turning(4)
    lost = turns.as_quat()
    lost[10:20] = word
    found = orientation_at(times, lost, times, 0.25)
    np.testing.assert_array_less((Rotation.from_quat(found) * turns.inv()).magnitude(), 0.02)
    assert orientation_at(times, lost, times, 0.05) is None
    assert orientation_at(times, np.full_like(lost, word), times, 0.25) is None
    assert orientation_at(times, np.tile([0, 0, 0, 1.0], (COUNT, 1)), times, 0.25) is None


def test_a_bag_of_a_trial_carries_them(tmp_path) -> None:
    trial = TRIALS[1]
    write_trial_bag(trial, tmp_path / 'bag')
    back = read_bag_wrists(tmp_path / 'bag')
    assert back.partner_orientation is not None
    np.testing.assert_allclose(back.demonstrator_orientation, trial.demonstrator_orientation,
                               atol=1e-9)  # fmt: skip
    write_trial_bag(replace(trial, demonstrator_orientation=None), tmp_path / 'other')
    half = read_bag_wrists(tmp_path / 'other')
    assert half.demonstrator_orientation is None
    np.testing.assert_allclose(half.partner_orientation, trial.partner_orientation, atol=1e-9)


def test_a_real_recording_makes_a_trial(kth_full, tmp_path) -> None:
    trial = kth_full
    write_trial(trial, tmp_path / 'whole_give_1.csv')
    back = condition(read_trial(tmp_path / 'whole_give_1.csv'))
    path = Rotation.from_quat(back.demonstrator_orientation)
    # both hands turn on the way, as hands do
    assert 0.1 < (path[-1] * path[0].inv()).magnitude() < 2.5
    assert isinstance(back, HandoverTrial)
