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

"""Whole sessions: the data set's reaches are in them, and what is cut out is what went in."""

from __future__ import annotations

from dataclasses import replace
import hashlib

from handover_dmp.cli.main import main
from handover_dmp.common.errors import DataError
from handover_dmp.handover.teaching import learn_from_trials, reproduction_error
from handover_dmp.mocap import read_data_set, read_trial, synthesize, write_data_set
from handover_dmp.mocap.garage import SCENES
from handover_dmp.mocap.segmentation import segment, Segmentation
from handover_dmp.mocap.session import (
    read_session,
    session_files,
    write_sessions,
)
from handover_dmp.mocap.synthetic import REST_SPREAD_M
from handover_dmp.mocap.synthetic_session import synthesize_sessions
from handover_dmp.mocap.wrists import WristMotion
from hypothesis import given, Phase, settings
from hypothesis import strategies as st
import numpy as np
import pytest

# Of all files of the default sessions, in the order of their names.
DIGEST = '8de0cd8410d7ee75adc516082dc9d2a888d484152d5e780487f3d350cb4299de'


@pytest.fixture(scope='module')
def sessions():
    return synthesize_sessions()


@pytest.fixture(scope='module')
def folder(sessions, tmp_path_factory):
    path = tmp_path_factory.mktemp('sessions')
    write_sessions(sessions, path)
    return path


def test_the_same_bytes_as_on_the_machine_it_was_made_on(folder):
    files = sorted(folder.iterdir())
    assert hashlib.sha256(b''.join(file.read_bytes() for file in files)).hexdigest() == DIGEST


@pytest.mark.parametrize('rate_hz', [200.0, 120.0])
def test_the_reaches_are_those_of_the_data_set(rate_hz):
    trials = {trial.label: trial for trial in synthesize(7, 2, rate_hz=rate_hz, noise_m=0.0)}
    for session in synthesize_sessions(7, 2, rate_hz=rate_hz, noise_m=0.0):
        assert [part.direction for part in session.exchanges] == ['give', 'take']
        for part in session.exchanges:
            trial = trials[f'{session.configuration} {part.direction} {session.number}']
            first = round(part.start_s * rate_hz)
            rows = slice(first, first + len(trial.times))
            assert part.exchange_s - part.start_s == pytest.approx(trial.duration_s, abs=1e-6)
            np.testing.assert_allclose(session.motion.partner[rows], trial.partner, atol=2e-6)
            np.testing.assert_allclose(
                session.motion.demonstrator[rows], trial.demonstrator, atol=2e-6
            )


def same_turn(first, second, within_deg):
    """Tell whether quaternions, (n, 4) each, are the same rotations."""
    along = np.abs(np.sum(first * second, axis=1))
    return np.degrees(2.0 * np.arccos(np.minimum(along, 1.0))).max() < within_deg


def test_wrists_turn_as_in_the_data_set_and_turn_back():
    wanted = {'noise_m': 0.0, 'orientation': True}
    trials = {trial.label: trial for trial in synthesize(7, 2, **wanted)}
    plain = synthesize_sessions(7, 2, noise_m=0.0)
    for session, bare in zip(synthesize_sessions(7, 2, **wanted), plain, strict=True):
        motion = session.motion
        np.testing.assert_array_equal(motion.partner, bare.motion.partner)
        assert bare.motion.partner_orientation is None
        for name in ('partner_orientation', 'demonstrator_orientation'):
            turned = getattr(motion, name)
            assert np.abs(np.diff(turned, axis=0)).max() < 0.03
            assert same_turn(turned[:1], turned[-1:], 0.1)
            for part in session.exchanges:
                trial = trials[f'{session.configuration} {part.direction} {session.number}']
                first = round(part.start_s * 200.0)
                rows = slice(first, first + len(trial.times))
                assert same_turn(turned[rows], getattr(trial, name), 0.01)


def test_orientations_are_kept_by_files_cuts_and_low_pass(tmp_path):
    (session,) = synthesize_sessions(3, 1, configurations=['under_car'], orientation=True)
    write_sessions([session], tmp_path / 'whole')
    read = read_session(tmp_path / 'whole' / session.file_name)
    cut = tmp_path / 'cut'
    words = ['import', 'csv', str(tmp_path / 'whole' / session.file_name), '-o', str(cut)]
    assert main([*words, '--segment', '--way-back']) == 0
    trials = read_data_set(cut)
    assert [trial.direction for trial in trials] == ['give', 'take']
    smoothed = session.low_passed(6.0).motion
    for name in ('partner_orientation', 'demonstrator_orientation'):
        went_in = getattr(session.motion, name)
        np.testing.assert_array_equal(getattr(read.motion, name), went_in)
        assert same_turn(getattr(smoothed, name), went_in, 1.0)
        for trial, part in zip(trials, segment(read.motion).segments, strict=True):
            for one, start_s in ((trial, part.start_s), (trial.way_back, part.way_back_s[0])):
                first = int(np.searchsorted(session.motion.times, start_s - 1e-9))
                rows = slice(first, first + len(one.times))
                assert same_turn(getattr(one, name), went_in[rows], 0.01)


def test_it_is_as_people_move(sessions):
    for session in sessions:
        motion = session.motion
        assert 11.0 < motion.times[-1] < 18.0
        for wrist in (motion.partner, motion.demonstrator):
            speed = np.linalg.norm(np.diff(wrist[::4], axis=0), axis=1) * 50.0
            assert speed.max() < 1.5
            assert max(speed[0], speed[-1]) < 0.12
            assert wrist[:, 2].min() > 0.15
        # P2 is at the tool before the give, and nowhere near the partner then
        give, take = session.exchanges
        before = motion.times < give.start_s
        apart = np.linalg.norm(motion.partner - motion.demonstrator, axis=1)
        assert apart[before].min() > 0.65
        assert give.exchange_s < give.parting_s <= give.way_back_s[0] < give.way_back_s[1]
        assert give.way_back_s[1] + 1.0 < take.start_s
        assert take.way_back_s[1] < motion.times[-1]


@settings(max_examples=6, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(st.integers(0, 2**32 - 1), st.sampled_from(['engine_bay', 'under_car', 'hydraulic_lift']))
def test_what_is_cut_is_what_went_in(seed, configuration):
    for session in synthesize_sessions(seed, 5, configurations=[configuration]):
        found = segment(session.motion, Segmentation(giver='p2_then_p1'))
        assert found.passages == []
        assert [part.direction for part in found.segments] == ['give', 'take']
        for part, true in zip(found.segments, session.exchanges, strict=True):
            assert part.start_s == pytest.approx(true.start_s, abs=0.25)
            assert part.exchange_s == pytest.approx(true.exchange_s, abs=0.35)
            assert part.parting_s == pytest.approx(true.parting_s, abs=0.2)
            assert part.way_back_s == pytest.approx(true.way_back_s, abs=0.2)
            rows = np.searchsorted(session.motion.times, [part.exchange_s, true.exchange_s])
            for wrist in (session.motion.partner, session.motion.demonstrator):
                assert np.linalg.norm(wrist[rows[0]] - wrist[rows[1]]) < 0.02


def test_who_moves_first_tells_most_directions_by_itself(sessions):
    found = [(segment(one.motion).segments, one.exchanges) for one in sessions]
    right = [
        part.direction == true.direction
        for parts, exchanges in found
        for part, true in zip(parts, exchanges, strict=True)
    ]
    assert np.mean(right) > 0.85


def test_a_session_is_read_back_to_the_last_bit(folder, sessions):
    assert session_files(folder) == [folder / one.file_name for one in sessions]
    for file, session in zip(session_files(folder), sessions, strict=True):
        read = read_session(file)
        assert (read.configuration, read.number) == (session.configuration, session.number)
        np.testing.assert_array_equal(read.motion.times, session.motion.times)
        np.testing.assert_array_equal(read.motion.partner, session.motion.partner)
        np.testing.assert_array_equal(read.motion.demonstrator, session.motion.demonstrator)
        for part, true in zip(read.exchanges, session.exchanges, strict=True):
            assert part.direction == true.direction
            assert part.way_back_s == pytest.approx(true.way_back_s, abs=1e-6)
            assert part[:2] == pytest.approx(true[:2], abs=1e-6)
            assert part.parting_s == pytest.approx(true.parting_s, abs=1e-6)


def test_where_no_index_tells_the_exchanges_they_are_found(folder, tmp_path, sessions):
    copy = tmp_path / 'lunch.csv'
    copy.write_bytes(session_files(folder)[0].read_bytes())
    read = read_session(copy)
    assert read.configuration == 'lunch'
    assert [part.direction for part in read.exchanges] == ['give', 'take']
    for part, true in zip(read.exchanges, sessions[0].exchanges, strict=True):
        assert part.exchange_s == pytest.approx(true.exchange_s, abs=0.35)


def test_what_is_no_session_is_refused_in_one_line(folder, tmp_path, sessions):
    with pytest.raises(DataError, match='exists already; a recording is never overwritten'):
        write_sessions(sessions[:1], folder)
    with pytest.raises(DataError, match='more than one session'):
        write_sessions([sessions[0], sessions[0]], tmp_path)
    assert list(tmp_path.iterdir()) == []
    text = session_files(folder)[0].read_text().splitlines()
    still = tmp_path / 'still.csv'
    still.write_text('\n'.join(text[:200]) + '\n')
    with pytest.raises(DataError, match=r'P2 moves only|stay within|no exchange'):
        read_session(still)
    good = tmp_path / sessions[0].file_name
    good.write_text('\n'.join(text) + '\n')
    index = (folder / 'sessions.csv').read_text().splitlines()
    for line, word in (
        (index[1].replace('give', 'throw'), 'throw'),
        (index[1].replace(',1,', ',one,'), 'not a number'),
        (index[1].rpartition(',')[0] + ',soon', 'not a number'),
        (index[1].rpartition(',')[0] + ',0.1', 'not in order'),
    ):
        (tmp_path / 'sessions.csv').write_text('\n'.join([index[0], line]) + '\n')
        with pytest.raises(DataError, match=word):
            read_session(good)


def test_it_tells_where_the_tool_was_picked_up(sessions):
    for session in sessions:
        place = session.low_passed(6.0).pick_up
        tool = np.array(SCENES[session.configuration].tool)
        assert np.all(np.abs(place - tool) < 3.5 * REST_SPREAD_M)
        # there the assistant stood
        before = session.motion.times < session.exchanges[0].start_s
        off_m = np.linalg.norm(session.motion.demonstrator[before] - place, axis=1)
        assert np.count_nonzero(off_m < 0.005) > 0.2 * 200.0
        later = replace(session, exchanges=session.exchanges[1:])
        assert later.pick_up is None
        start = int(np.argmin(np.linalg.norm(session.motion.demonstrator - place, axis=1)))
        cut = WristMotion(
            session.motion.times[start:],
            session.motion.partner[start:],
            session.motion.demonstrator[start:],
            'begins at the tool',
        )
        assert replace(session, motion=cut).low_passed(6.0).pick_up is None


def test_the_way_back_goes_with_the_trial(tmp_path, sessions):
    cut = segment(sessions[0].motion).trials('garage', way_back=True)
    write_data_set(cut, tmp_path)
    read = read_data_set(tmp_path)
    for trial, old in zip(read, cut, strict=True):
        back = trial.way_back
        assert back is not None
        np.testing.assert_array_equal(back.demonstrator, old.way_back.demonstrator)
        # from where the reach has ended to rest
        assert np.linalg.norm(back.demonstrator[0] - trial.demonstrator[-1]) < 0.03
        assert np.linalg.norm(back.demonstrator[-1] - back.demonstrator[0]) > 0.3
        assert (back.configuration, back.direction) == (trial.configuration, trial.direction)
    assert sorted(file.name for file in tmp_path.iterdir()) == [
        'garage_give_1.csv', 'garage_take_1.csv', 'trials.csv', 'way_back',
    ]  # fmt: skip
    # whoever knows nothing of ways back reads the same trials as ever
    plain = segment(sessions[0].motion).trials('garage')
    for trial, old in zip(read, plain, strict=True):
        np.testing.assert_array_equal(trial.demonstrator, old.demonstrator)
        assert old.way_back is None
    (tmp_path / 'way_back' / 'garage_give_1.csv').write_text('t\n1\n')
    with pytest.raises(DataError, match=r'way_back/garage_give_1\.csv: line 1'):
        read_trial(tmp_path / 'garage_give_1.csv')


def test_a_hand_that_stays_has_no_way_back():
    motion = synthesize_sessions(0, 1, configurations=['engine_bay'])[0].motion
    give = segment(motion).segments[0]
    end = int(np.searchsorted(motion.times, give.parting_s))
    held = type(motion)(
        motion.times[:end], motion.partner[:end], motion.demonstrator[:end], 'held out'
    )
    found = segment(held).segments
    assert [(part.parting_s, part.way_back_s) for part in found] == [(None, None)]
    assert segment(held).trials('garage', way_back=True)[0].way_back is None


def test_a_person_goes_back_as_it_was_recorded(kth_full_table):
    """The giver lets go at 3.6 s, still on the way back, which both begin at about 3.5 s."""
    taker, giver = (
        np.column_stack([kth_full_table[f'{who}_hand_{axis}'] for axis in 'xyz'])
        for who in ('taker', 'giver')
    )
    motion = WristMotion(kth_full_table['t'], taker, giver, 'whole').checked()
    found = segment(motion, Segmentation(giver='p2'))
    (part,) = found.segments
    assert part.start_s == pytest.approx(1.65, abs=0.1)
    assert part.way_back_s == pytest.approx((3.45, 4.95), abs=0.1)
    (trial,) = found.trials('whole', way_back=True)
    model = learn_from_trials([trial])
    assert reproduction_error(model.way_back, trial.way_back) < 1e-3
    assert np.linalg.norm(model.way_back.start - model.goal) < 0.01
    assert np.linalg.norm(model.way_back.goal - trial.demonstrator[0]) < 0.3


@pytest.mark.parametrize(('rate_hz', 'noise_m'), [(100.0, 1e-3), (24.0, 5e-4)])
def test_ways_back_of_worse_recordings(rate_hz, noise_m):
    for session in synthesize_sessions(3, 1, rate_hz=rate_hz, noise_m=noise_m):
        found = segment(session.motion)
        for trial, part in zip(
            found.trials('garage', way_back=True), session.exchanges, strict=True
        ):
            assert trial.way_back.duration_s == pytest.approx(
                part.way_back_s[1] - part.way_back_s[0], abs=0.25
            )
