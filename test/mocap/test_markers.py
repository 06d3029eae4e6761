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
from handover_dmp.mocap.markers import MarkerRecording
from handover_dmp.mocap.up_axis import AXES, turn_up
from handover_dmp.mocap.wrists import WristMotion
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
    for axis in AXES:
        turned = np.array([turn_up(direction, axis) for direction in basis])
        assert np.linalg.det(turned) == pytest.approx(1.0)
        up = basis['xyz'.index(axis[-1])] * (-1.0 if axis[0] == '-' else 1.0)
        np.testing.assert_array_equal(turn_up(up, axis), [0.0, 0.0, 1.0])


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


def reach(start, end, samples=SAMPLES):
    """Go from one place to another with minimum jerk; m."""
    u = np.clip(np.linspace(-0.2, 1.2, samples), 0.0, 1.0)[:, None]
    return np.array(start) + (10 * u**3 - 15 * u**4 + 6 * u**5) * np.subtract(end, start)


P1 = reach([0.9, 0.3, 1.0], [0.55, 0.2, 1.15])
P2 = reach([0.0, 0.05, 0.9], [0.5, 0.2, 1.1])


def wrists(partner=P1, demonstrator=P2, unit='', up='', told=None, told_up=None, usual='z'):
    """Record two wrists in metres, in a file that says this or that, and take them out again."""
    return recording(
        positions={'a': partner, 'c': demonstrator}, unit=unit, up=up, usual_up=usual
    ).wrists(['a'], ['c'], unit=told, up=told_up)


@pytest.mark.parametrize('word', ['m', 'meters', 'Metres', '[m]', 'METER ', 'm\0\0'])
def test_words_for_units(word):
    motion = wrists(unit=word)
    assert motion.unit == ('m', 'in the file')
    np.testing.assert_allclose(motion.demonstrator, P2)


@pytest.mark.parametrize(('word', 'metres'), [('Centimeters', 0.01), ('Inches', 0.0254)])
def test_other_units_and_what_was_told_goes_before_what_the_file_tells(word, metres):
    for unit, told in ((word, None), ('furlong', word), ('mm', word)):
        motion = wrists(P1 / metres, P2 / metres, unit=unit, told=told)
        np.testing.assert_allclose(motion.partner, P1)


@pytest.mark.parametrize('metres', [1.0, 0.1, 0.01])
def test_what_is_too_small_for_people_is_refused(metres):
    """Metres, decimetres or centimetres that are taken for millimetres, whatever wrist moves."""
    for one, other in ((P1, P2), (P2, P1), (P1[:1] + 0.0 * P1, P2)):
        with pytest.raises(DataError, match=r'--unit'):
            wrists(one / metres, other / metres)
    for name in ('mm', 'millimeters'):
        with pytest.raises(DataError, match=r'if the unit is mm; say which with --unit'):
            wrists(P1 / metres, P2[:1] / metres + 0.0 * P2, unit=name)


def test_a_partner_may_hold_still():
    still = P1[:1] + 1e-4 * np.random.default_rng(0).standard_normal(P1.shape)
    np.testing.assert_allclose(wrists(still * 1e3, P2 * 1e3).partner, still)
    assert wrists(still * 1e3, P2 * 1e3).unit == ('mm', 'assumed')


@pytest.mark.parametrize('axis', ['x', 'y', 'z', '-y'])
@pytest.mark.parametrize('usual', ['z', 'y'])
def test_up_is_the_axis_along_which_the_wrists_rest_as_high_as_those_of_people(axis, usual):
    back = np.linalg.inv(np.array([turn_up(line, axis) for line in np.eye(3)]).T).T
    motion = wrists(P1 @ back, P2 @ back, unit='m', usual=usual)
    assert motion.up == (axis, 'by the height of the wrists')
    np.testing.assert_allclose(motion.partner, P1, atol=1e-12)
    np.testing.assert_allclose(motion.demonstrator, P2, atol=1e-12)


def test_unsure_which_axis_points_up_is_asked():
    aside = np.array([0.0, 0.7, 0.0])
    with pytest.raises(DataError, match=r'height along z and y; say which with --up'):
        wrists(P1 + aside, P2 + aside, unit='m')
    for told, up in (({'up': 'z'}, 'z'), ({'told_up': 'y', 'up': 'z'}, 'y')):
        assert wrists(P1 + aside, P2 + aside, unit='m', **told).up.value == up
    # The origin on a table: heights tell nothing.
    low = np.array([0.0, -0.4, -0.9])
    for usual in 'zy':
        assert wrists(P1 + low, P2 + low, unit='m', usual=usual).up == (
            usual, 'default of the format; the heights do not tell',
        )  # fmt: skip


def pair(rng, gap, marks):
    """Make two markers 60 mm apart on a wrist that turns, one of them unseen for a while."""
    angle = np.linspace(0.0, rng.uniform(0.0, 1.0), SAMPLES)[:, None]
    half = 0.03 * np.hstack([np.cos(angle), np.sin(angle), 0.0 * angle])
    one, other = P2 + half, P2 - half
    hidden = one.copy()
    hidden[gap] = marks
    return hidden, other


@pytest.mark.parametrize('marks', [0.0, np.nan, 9_999_999.0])
@pytest.mark.parametrize('gap', [slice(40, 60), slice(0, 15), slice(90, SAMPLES)])
def test_a_wrist_does_not_jump_when_one_of_its_markers_is_lost(gap, marks):
    one, other = pair(np.random.default_rng(1), gap, marks)
    for order in ({'a': one, 'b': other}, {'a': other, 'b': one}):
        made = recording(positions={**order, 'c': P1}, unit='m').wrists(['c'], ['a', 'b'])
        assert len(made.times) == SAMPLES
        np.testing.assert_allclose(made.demonstrator, P2, atol=4e-3)
        steps = np.abs(np.diff(made.demonstrator - P2, axis=0)).max()
        assert steps < 1e-3


def test_markers_that_are_never_seen_together():
    first, second = P2.copy(), P2 + 0.05
    first[50:], second[:50] = np.nan, np.nan
    with pytest.raises(DataError, match=r'a, b are never all seen at once'):
        recording(positions={'a': first, 'b': second, 'c': P1}, unit='m').wrists(['c'], ['a', 'b'])


def test_two_markers_of_one_name():
    with pytest.raises(DataError, match="2 markers are named 'a'"):
        recording(names=['a', 'b', 'a', 'c']).wrists(['a'], ['c'])


def test_gaps_are_told():
    lost = P2.copy()
    lost[30:50] = 0.0
    motion = wrists(P1, lost, unit='m')
    assert [gap.who for gap in motion.gaps] == ['P2']
    np.testing.assert_allclose(motion.gaps[0][1:], [0.29, 0.5])
    assert len(motion.times) == SAMPLES - 20


def test_an_axis_that_the_heights_speak_against_is_doubted():
    back = np.linalg.inv(np.array([turn_up(line, 'y') for line in np.eye(3)]).T).T
    motion = wrists(P1 @ back, P2 @ back, unit='m', up='z')
    assert motion.up == ('z', 'in the file')
    (remark,) = motion.remarks
    assert remark.startswith(
        "z is said to point up, but the wrists rest at a person's height along y"
    )
    for right in (
        wrists(P1, P2, unit='m', up='z'),
        wrists(P1 @ back, P2 @ back, told_up='z', unit='m'),
    ):
        assert right.remarks == ()


def test_a_marker_that_others_stood_in_for_is_told():
    one, other = pair(np.random.default_rng(1), slice(40, 60), np.nan)
    made = recording(positions={'a': one, 'b': other, 'c': P1}, unit='m').wrists(['c'], ['a', 'b'])
    assert made.remarks == ("'a' is missing in 20 of 100 frames: other markers replace it",)
