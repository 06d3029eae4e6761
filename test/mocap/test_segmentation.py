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

"""Segmentation: sessions made of known trials are cut where these begin and end."""

from __future__ import annotations

from dataclasses import replace

from handover_dmp.common.errors import DataError, UsageError
from handover_dmp.mocap import read_data_set, synthesize
from handover_dmp.mocap.segmentation import GIVERS, segment, Segmentation
from handover_dmp.mocap.wrists import WristMotion
import numpy as np
import pytest


@pytest.fixture(scope='module')
def trials():
    made = synthesize(seed=3, trials=3)
    return [trial for number in (1, 2, 3) for trial in made if trial.number == number]


@pytest.mark.parametrize(('rate_hz', 'noise_m'), [(200.0, 1e-4), (100.0, 1e-3), (24.0, 5e-4)])
def test_every_handover_is_found_where_it_is(play_session, trials, rate_hz, noise_m):
    motion, spans = play_session(trials, rate_hz=rate_hz, noise_m=noise_m)
    found = segment(motion)
    assert len(found.segments) == len(trials)
    assert found.passages == []
    for part, (start, end), trial in zip(found.segments, spans, trials, strict=True):
        assert start - 0.15 < part.start_s < start + 0.2, trial.label
        # The hands creep for the last quarter of a second of a reach, and then hold.
        assert end - 0.3 < part.exchange_s < end + 0.05, trial.label
    cut = found.trials('garage')
    for new, trial in zip(cut, trials, strict=True):
        assert new.configuration == 'garage'
        assert new.times[0] == 0.0
        np.testing.assert_allclose(new.demonstrator[0], trial.demonstrator[0], atol=0.01)
        np.testing.assert_allclose(new.demonstrator[-1], trial.demonstrator[-1], atol=0.01)
        np.testing.assert_allclose(new.partner[-1], trial.partner[-1], atol=0.01)
    right = sum(new.direction == trial.direction for new, trial in zip(cut, trials, strict=True))
    assert right >= len(trials) - 2
    names = [(trial.direction, trial.number) for trial in cut]
    assert len(set(names)) == len(names)


def test_who_gives_where_it_is_known(play_session, trials):
    motion, _ = play_session(trials[:4])
    expected = {
        'p2': ['give'] * 4,
        'p1': ['take'] * 4,
        'p2_then_p1': ['give', 'take'] * 2,
        'p1_then_p2': ['take', 'give'] * 2,
    }
    assert {*expected, 'first_mover'} == set(GIVERS)
    for giver, exchanges in expected.items():
        found = segment(motion, Segmentation(giver=giver))
        assert [part.direction for part in found.segments] == exchanges


def test_partners_exchanged_are_gives_for_takes(play_session):
    """Where both hands move and one is clearly first."""
    made = [trial for trial in synthesize(seed=1, trials=4) if trial.direction == 'take']
    motion, _ = play_session(made)
    mirrored = replace(motion, partner=motion.demonstrator, demonstrator=motion.partner)
    takes = [part.direction for part in segment(motion).segments]
    gives = [part.direction for part in segment(mirrored).segments]
    assert takes.count('take') >= 11
    assert gives.count('give') >= 11


def reach(times, onset_s, duration_s, start, goal):
    u = np.clip((times - onset_s) / duration_s, 0.0, 1.0)[:, None]
    share = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    return np.array(start) + share * (np.array(goal) - np.array(start))


@pytest.mark.parametrize('giver', ['p1', 'p2'])
def test_who_starts_counts_and_not_who_is_faster(giver):
    times = np.arange(0.0, 6.0, 0.01)
    slow = reach(times, 1.0, 2.4, (-0.5, 0.0, 1.0), (-0.15, 0.0, 1.0))
    fast = reach(times, 1.6, 1.0, (0.5, 0.0, 1.0), (0.15, 0.0, 1.0))
    pair = (slow, fast) if giver == 'p1' else (fast, slow)
    found = segment(WristMotion(times, *pair, 'two'))
    assert [part.direction for part in found.segments] == ['take' if giver == 'p1' else 'give']
    assert 0.85 < found.segments[0].start_s < 1.35


def test_a_hand_that_never_rests():
    """A reach begins at the earliest when the wrists have parted after the one before."""
    times = np.arange(0.0, 20.0, 0.01)
    turn = 2.0 * np.pi * times / 4.0
    circle = np.column_stack([0.4 * np.cos(turn), 0.4 * np.sin(turn), 1.0 + 0.0 * times])
    still = np.tile([0.7, 0.0, 1.0], (len(times), 1))
    found = segment(WristMotion(times, still, circle, 'circle'), Segmentation(giver='p2'))
    assert [round(part.exchange_s) for part in found.segments] == [4, 8, 12, 16, 20]
    for before, after in zip(found.segments[:-1], found.segments[1:], strict=True):
        assert before.exchange_s < after.start_s < after.exchange_s


def test_an_hour_without_handovers_and_gaps(play_session, trials):
    motion, spans = play_session(trials[:3])
    # Both wrists out of sight while they go back after the first; the rest stays usable.
    hidden = (motion.times > spans[0][1] + 0.7) & (motion.times < spans[0][1] + 1.5)
    seen = replace(
        motion,
        times=motion.times[~hidden],
        partner=motion.partner[~hidden],
        demonstrator=motion.demonstrator[~hidden],
    )
    assert len(segment(seen).segments) == 3
    resting = WristMotion(
        np.arange(20000) / 100.0, np.zeros((20000, 3)), np.ones((20000, 3)), 'rest'
    )
    nothing = segment(resting)
    assert nothing.segments == []
    assert nothing.passages == []


def test_a_gap_in_the_reach_is_not_bridged(play_session, trials):
    motion, spans = play_session(trials[:2])
    middle = 0.5 * sum(spans[0])
    hidden = np.abs(motion.times - middle) < 0.2
    seen = replace(
        motion,
        times=motion.times[~hidden],
        partner=motion.partner[~hidden],
        demonstrator=motion.demonstrator[~hidden],
    )
    for part in segment(seen).segments:
        assert part.start_s > middle or part.exchange_s < middle


def test_what_is_left_out_is_told(play_session, trials):
    motion, _ = play_session(trials[:2])
    # P2 stays, the exchange comes to him.
    still = replace(
        motion,
        partner=motion.partner - motion.demonstrator,
        demonstrator=np.zeros_like(motion.demonstrator),
    )
    left_out = segment(still)
    assert left_out.segments == []
    assert [reason for _, reason in left_out.passages] == ['P2 does not reach'] * 2
    short = segment(motion, Segmentation(min_duration_s=0.2, max_duration_s=0.5))
    assert short.segments == []
    assert all(reason.startswith('lasts ') for _, reason in short.passages)
    far = segment(motion, Segmentation(min_reach_m=2.0))
    assert all(reason.startswith('P2 reaches only 0.5') for _, reason in far.passages)


@pytest.mark.parametrize(
    'wrong',
    [
        {'near_m': 0.9},
        {'moving_speed': 0.5},
        {'max_duration_s': 0.1},
        {'margin_s': -1.0},
        {'near_m': float('nan')},
        {'giver': 'nobody'},
    ],
)
def test_thresholds_that_make_no_sense(wrong):
    with pytest.raises(UsageError):
        Segmentation(**wrong)


def test_too_short_for_a_trial(play_session, trials):
    motion, _ = play_session(trials[:1], rate_hz=24.0)
    few = replace(motion, times=motion.times * 1.0)
    found = segment(few)
    assert len(found.trials('x')) == 1
    with pytest.raises(DataError, match='at least 10'):
        few.trial(0, 5, configuration='x', direction='give', number=1)


def test_real_people(kth_folder, play_session):
    recorded = [trial for trial in read_data_set(kth_folder) if trial.direction == 'give']
    for configuration in ('raw', 'p01', 'p02', 'p03', 'p04'):
        case = [trial for trial in recorded if trial.configuration == configuration]
        motion, spans = play_session(case, rate_hz=60.0)
        found = segment(motion, Segmentation(giver='p2'))
        assert len(found.segments) == len(case), configuration
        for part, (start, end), trial in zip(found.segments, spans, case, strict=True):
            assert abs(part.start_s - start) < 0.2, trial.label
            assert abs(part.exchange_s - end) < 0.3, trial.label
