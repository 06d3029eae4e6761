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

"""The partner of a session: waits at each exchange, moves smoothly, signals each reach."""

from __future__ import annotations

from dataclasses import replace
import math

from handover_dmp.mocap.synthetic_session import synthesize_sessions
from handover_dmp.tracking.sensor_model import SensorModel
from handover_dmp.tracking.session_playback import SessionPlayback
from handover_dmp.tracking.waiting_clock import RAMP_S
from hypothesis import given, Phase, settings
from hypothesis import strategies as st
import numpy as np
import pytest

PERIOD_S = 0.005
SESSIONS = synthesize_sessions(4, 1, noise_m=0.0)


def play(playback, late_s, *, start_s=0.5, until_s=26.0):
    """
    Let the object pass so long after the partner is there.

    Returns:
        Times, places of the hand, signals, and from when to when the partner waited.

    """
    playback.start(start_s)
    holder, begun = 'robot', None
    times, places, signals, waits = [], [], [], []
    for count in range(round(until_s / PERIOD_S)):
        now_s = count * PERIOD_S
        told = playback.step(now_s, holder)
        times.append(now_s)
        places.append(told.hands[0][-1].position)
        signals += told.signals
        if playback.is_waiting(now_s):
            begun = now_s if begun is None else begun
            if now_s - begun >= late_s:
                waits.append((begun, now_s))
                holder = 'partner' if playback.next_exchange.direction == 'give' else 'robot'
        else:
            begun = None
    return np.array(times), np.array(places), signals, waits


@settings(max_examples=4, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(st.sampled_from(SESSIONS), st.floats(0.0, 4.0))
def test_the_partner_waits_as_long_as_the_robot_is_late_and_moves_on_smoothly(session, late_s):
    times, places, signals, waits = play(SessionPlayback(session), late_s)
    assert [signal.direction for signal in signals] == ['give', 'take']
    assert len(waits) == 2
    for begun, passed in waits:
        standing = places[(times > begun + 1e-6) & (times <= passed + 1e-6)]
        assert np.abs(standing - standing[:1]).max(initial=0.0) < 1e-9
    moving = np.diff(places, axis=0) / PERIOD_S
    recorded = np.diff(session.motion.partner, axis=0) / PERIOD_S
    fastest = np.linalg.norm(recorded, axis=1).max()
    assert np.linalg.norm(moving, axis=1).max() < 1.01 * fastest
    # r² a + r' v: the velocity never jumps
    steepest = np.linalg.norm(np.diff(recorded, axis=0), axis=1).max() / PERIOD_S
    changes = np.linalg.norm(np.diff(moving, axis=0), axis=1) / PERIOD_S
    assert changes.max() < 1.1 * steepest + 0.1 / RAMP_S
    np.testing.assert_allclose(places[-1], session.motion.partner[-1], atol=1e-6)


@pytest.mark.parametrize('session', SESSIONS, ids=lambda session: session.configuration)
def test_where_nobody_knows_of_an_object_it_goes_as_recorded(session):
    playback = SessionPlayback(session)
    playback.start(1.0)
    told = [playback.step(count * PERIOD_S) for count in range(4000)]
    signals = [signal for each in told for signal in each.signals]
    shift_s = 1.1
    assert [signal.stamp_s for signal in signals] == pytest.approx(
        [exchange.start_s + shift_s for exchange in session.exchanges]
    )
    rows = 240 + np.arange(2000)
    places = np.array([told[row].truth.position for row in rows])
    np.testing.assert_allclose(places, session.motion.partner[rows - 220], atol=1e-6)
    others = np.array([told[row].demonstrator.position for row in rows])
    np.testing.assert_allclose(others, session.motion.demonstrator[rows - 220], atol=1e-6)


def test_signals_come_before_the_reach_and_anew_in_the_next_session():
    playback = SessionPlayback(SESSIONS[0], lead_s=1.0)
    for start_s in (0.5, 30.5):
        playback.start(start_s)
        for count in range(round(25.0 / PERIOD_S)):
            now_s = start_s + count * PERIOD_S
            for signal in playback.step(now_s).signals:
                assert 0.0 < signal.stamp_s - now_s <= 0.1 + 1e-9
                if signal.direction == 'give':
                    assert signal.stamp_s == pytest.approx(start_s + 1.1)
        assert playback.next_exchange is None


def test_an_object_that_passes_early_stops_nobody_and_patience_has_an_end():
    playback = SessionPlayback(SESSIONS[0], patience_s=2.0)
    playback.start(0.0)
    waited = 0
    for count in range(6000):
        now_s = count * PERIOD_S
        playback.step(now_s, 'robot')
        waited += playback.is_waiting(now_s) and playback.next_exchange is not None
    # the robot never gives; in the take it holds the object from the start
    assert waited * PERIOD_S == pytest.approx(2.0, abs=0.02)
    assert playback.next_exchange is None
    np.testing.assert_allclose(
        playback.step(30.0, 'robot').truth.position, SESSIONS[0].motion.partner[-1], atol=1e-6
    )


@pytest.mark.parametrize('after', [1, 2])
@pytest.mark.parametrize('patience_s', [math.inf, 12.0])
def test_the_partner_stays_with_an_object_that_is_offered_once_more(patience_s, after):
    """After an abort the robot may give again what it took last."""
    session, held_s = SESSIONS[0], 14.0
    playback = SessionPlayback(session, patience_s=patience_s)
    playback.start(0.0)
    times, places, both_s = [], [], None
    for count in range(9000):
        now_s = count * PERIOD_S
        over = (
            2
            if playback.next_exchange is None
            else playback.exchanges.index(playback.next_exchange)
        )
        is_there = playback.is_waiting(now_s)
        holder = [['robot', 'partner'], ['partner', 'robot'], ['robot'] * 2][over][is_there]
        if over == after:
            both_s = now_s + 0.3 if both_s is None else both_s
            holder = 'both' if both_s <= now_s < both_s + held_s else holder
        times.append(now_s)
        places.append(playback.step(now_s, holder).truth.position)
    since_both_s, way = np.array(times) - both_s, np.array(places)
    stays_s = min(held_s, patience_s)
    standing = way[(since_both_s > RAMP_S + PERIOD_S) & (since_both_s < stays_s)]
    assert len(standing) > 200
    assert np.abs(standing - standing[0]).max() < 1e-9
    assert np.linalg.norm(standing[0] - session.motion.partner[-1]) > 0.1
    leaving = way[(since_both_s > stays_s + RAMP_S) & (since_both_s < stays_s + 4 * RAMP_S)]
    assert np.ptp(leaving, axis=0).max() > 0.02
    np.testing.assert_allclose(way[-1], session.motion.partner[-1], atol=1e-6)


def test_trackers_see_what_a_perfect_one_sees_later():
    late = SensorModel(rate_hz=100.0, delay_s=0.05)
    playback = SessionPlayback(SESSIONS[1], (SensorModel(), late))
    playback.start(0.1)
    perfect, delayed = {}, {}
    for count in range(3000):
        told = playback.step(count * PERIOD_S, 'robot')
        perfect |= {round(one.stamp_s, 6): one.position for one in told.hands[0]}
        delayed |= {round(one.stamp_s, 6): one.position for one in told.hands[1]}
    assert len(delayed) > 1400
    for stamp_s, position in delayed.items():
        np.testing.assert_allclose(position, perfect[stamp_s], atol=1e-9)


def test_an_exchange_with_no_parting_is_waited_at_too():
    session = SESSIONS[0]
    last = session.exchanges[-1]._replace(parting_s=None)
    playback = SessionPlayback(replace(session, exchanges=(last,)))
    playback.start(0.0)
    for count in range(4000):
        playback.step(count * PERIOD_S, 'partner')
    assert playback.is_waiting(4000 * PERIOD_S)
    hand = playback.step(4000 * PERIOD_S, 'partner').truth.position
    row = round(last.exchange_s / PERIOD_S)
    np.testing.assert_allclose(hand, session.motion.partner[row], atol=1e-6)


def test_who_asks_for_what_lies_on_a_table_waits_until_it_is_picked_up():
    session = SESSIONS[0]
    first = session.exchanges[0]
    at_rest = session.motion.partner[round(first.start_s / PERIOD_S)]
    for patience_s, fetched_s in ((math.inf, 6.0), (3.0, math.inf)):
        playback = SessionPlayback(session, lead_s=1.0, patience_s=patience_s)
        playback.start(0.0)
        signals, asked_s, left_s = [], math.inf, math.inf
        for count in range(2000):
            now_s = count * PERIOD_S
            told = playback.step(now_s, 'table' if now_s < asked_s + fetched_s else 'robot')
            signals += told.signals
            if signals:
                asked_s = signals[0].stamp_s
            off_m = np.linalg.norm(told.truth.position - at_rest)
            if now_s > asked_s and off_m > 1e-6:
                left_s = min(left_s, now_s)
        assert [signal.direction for signal in signals] == ['give']
        assert left_s - asked_s == pytest.approx(min(patience_s, fetched_s), abs=0.1)
        # it holds out the hand then, until patience has an end here, too
        assert playback.is_waiting(1999 * PERIOD_S) is math.isinf(patience_s)
