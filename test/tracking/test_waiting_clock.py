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

"""The clock that waits: its rate is continuous, and it stands where it is told to."""

from __future__ import annotations

from handover_dmp.tracking.waiting_clock import RAMP_S, WaitingClock
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

spans = st.floats(0.0, 3.0)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(spans, st.floats(-0.5, 3.0)), max_size=4), st.floats(-2.0, 2.0))
def test_rate_is_continuous_and_what_was_shown_stays(changes, start_s):
    clock = WaitingClock(start_s, start_s + 1.0)
    now_s, shown = 0.0, {}
    for later_s, ahead_s in changes:
        now_s += later_s
        grid = np.linspace(0.0, now_s, 10)
        shown |= {time: clock.recorded(time) for time in grid}
        clock.go_on(now_s, clock.recorded(now_s) + ahead_s)
    assert all(clock.recorded(time) == value for time, value in shown.items())
    times = np.arange(0.0, now_s + 4.0, 5e-3)
    values = np.array([clock.recorded(time) for time in times])
    rates = np.array([clock.rate(time) for time in times])
    assert values[0] == start_s
    assert rates.min() > -1e-9
    assert rates.max() < 1.0 + 1e-9
    assert np.abs(np.diff(rates)).max() < 5.01e-3 / RAMP_S
    integral = start_s + np.concatenate([[0.0], np.cumsum(2.5e-3 * (rates[1:] + rates[:-1]))])
    np.testing.assert_allclose(values, integral, atol=1e-4)


@settings(max_examples=60, deadline=None)
@given(st.floats(0.0, 5.0), st.floats(0.0, 1.0))
def test_it_stands_exactly_where_it_is_told_to_and_knows_when(wait_s, share):
    clock = WaitingClock(0.0, wait_s)
    assert clock.recorded(1e3) == pytest.approx(wait_s, abs=1e-9)
    assert clock.rate(1e3) == 0.0
    at_s = clock.when(share * wait_s)
    assert clock.recorded(at_s) == pytest.approx(share * wait_s, abs=1e-6)
    assert clock.when(wait_s + 1e-3) == np.inf
    clock.go_on(at_s)
    assert np.isfinite(clock.when(wait_s + 1e-3))


def test_who_is_told_too_late_stops_softly():
    clock = WaitingClock(0.0)
    clock.go_on(2.0, 0.5)
    assert clock.rate(2.0) == pytest.approx(1.0)
    assert clock.recorded(9.0) == pytest.approx(clock.recorded(2.0) + RAMP_S / 2.0)
