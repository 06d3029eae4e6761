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

"""Fluency of a session, against motions whose intervals are known in closed form."""

from __future__ import annotations

from math import sqrt

from handover_dmp.mocap.fluency import activity, people_fluency, session_fluency
from handover_dmp.mocap.synthetic_session import synthesize_sessions
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

RATE_HZ = 200.0


def bell(times, start_s, duration_s, way_m):
    """Give the speed of a minimum-jerk reach."""
    u = np.clip((times - start_s) / duration_s, 0.0, 1.0)
    return 30.0 * way_m / duration_s * (u * (1.0 - u)) ** 2


def slow_s(duration_s, way_m):
    """Tell for how long it is slower than 0.05 m/s at each end: 30 d/T u²(1 − u)² = 0.05."""
    product = sqrt(0.05 * duration_s / (30.0 * way_m))
    return duration_s * (0.5 - sqrt(0.25 - product))


@settings(max_examples=25, deadline=None)
@given(
    st.floats(0.7, 1.8),
    st.floats(0.7, 1.8),
    st.floats(-0.5, 1.5),
    st.floats(0.3, 0.7),
    st.floats(0.0, 0.02),
)
def test_a_give_of_two_minimum_jerk_reaches(first_s, second_s, later_s, way_m, sway):
    """The person reaches at 1 s, the robot some time after; they hold; each goes back again."""
    times = np.arange(0.0, 10.0, 1.0 / RATE_HZ)
    person = bell(times, 1.0, first_s, way_m) + bell(times, 6.0, 1.0, way_m)
    robot = bell(times, 1.0 + later_s, second_s, way_m) + bell(times, 8.0, 1.0, way_m)
    person = np.maximum(person, sway)
    found = session_fluency(person, robot, RATE_HZ, [5.0])
    margin, other, back = (slow_s(time, way_m) for time in (first_s, second_s, 1.0))
    moving = (1.0 + margin, 1.0 + first_s - margin), (6.0 + back, 7.0 - back)
    going = (1.0 + later_s + other, 1.0 + later_s + second_s - other), (8.0 + back, 9.0 - back)
    busy = [sum(end - begin for begin, end in spans) for spans in (moving, going)]
    together = max(0.0, min(moving[0][1], going[0][1]) - max(moving[0][0], going[0][0]))
    whole = found.whole
    assert found.duration_s == 10.0
    assert whole.person_idle == pytest.approx(1.0 - busy[0] / 10.0, abs=0.002)
    assert whole.robot_idle == pytest.approx(1.0 - busy[1] / 10.0, abs=0.002)
    assert whole.concurrent == pytest.approx(together / 10.0, abs=0.002)
    (wait,) = found.waits
    assert wait.person_s == pytest.approx(5.0 - moving[0][1], abs=0.011)
    assert wait.robot_s == pytest.approx(5.0 - going[0][1], abs=0.011)


def test_the_delay_from_each_end_to_the_other_beginning():
    """Person 1 to 3 s, robot 4 to 5 s, person 6.5 to 8 s: 1 s and 1.5 s in 10 s."""
    times = np.arange(0.0, 10.0, 1.0 / RATE_HZ)
    person = 0.5 * (((times >= 1.0) & (times < 3.0)) | ((times >= 6.5) & (times < 8.0)))
    robot = 0.5 * ((times >= 4.0) & (times < 5.0))
    whole = session_fluency(person, robot, RATE_HZ).whole
    assert whole.functional_delay == pytest.approx(0.25, abs=1e-3)
    assert whole.person_idle == pytest.approx(0.65)
    assert whole.robot_idle == pytest.approx(0.9)


def test_sway_is_no_activity_and_a_moment_of_rest_no_pause():
    times = np.arange(0.0, 6.0, 1.0 / RATE_HZ)
    sway = 0.1 * np.abs(np.sin(9.0 * times))
    assert not activity(sway, RATE_HZ).any()
    strokes = sum(bell(times, start_s, 0.5, 0.08) for start_s in (1.0, 1.6, 2.2))
    (edges,) = np.nonzero(np.diff(activity(strokes, RATE_HZ)))
    margin = slow_s(0.5, 0.08)
    assert times[edges] == pytest.approx([1.0 + margin, 2.7 - margin], abs=0.006)
    apart = bell(times, 1.0, 0.5, 0.08) + bell(times, 3.0, 0.5, 0.08)
    assert len(np.flatnonzero(np.diff(activity(apart, RATE_HZ)))) == 4


def test_people_wait_for_each_other_as_the_session_was_made():
    for session in synthesize_sessions(6, 2):
        found = people_fluency(session)
        duration_s = float(session.motion.times[-1]) - session.exchanges[0].start_s
        assert found.duration_s == pytest.approx(duration_s, abs=0.02)
        # the hands have met for 0.06 s where the exchange is, and the later one still creeps
        assert all(0.0 <= wait.robot_s < 0.8 for wait in found.waits)
        assert min(found.waits[0].person_s, found.waits[0].robot_s) < 0.35
        # in the second session, P1 waits with his hand out before the give begins
        assert (found.waits[0].person_s > 1.0) == (session.number == 2)
        assert 0.2 < found.whole.person_idle < 0.7
        assert 0.4 < found.whole.robot_idle < 0.7
        assert 0.1 < found.whole.concurrent < 0.4


def test_who_never_stops_leaves_no_delay():
    times = np.arange(0.0, 2.0, 1.0 / RATE_HZ)
    moving, resting = np.full(len(times), 0.5), np.zeros(len(times))
    assert session_fluency(moving, resting, RATE_HZ).whole.functional_delay == 0.0
    assert session_fluency(moving, moving, RATE_HZ).whole.concurrent == 1.0
