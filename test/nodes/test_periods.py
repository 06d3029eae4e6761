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

"""The measured periods of a loop, summarised at any time."""

import time

from handover_dmp.nodes.periods import Periods
import pytest

LONG_S = 1000.0
"""A nominal period in which any machine reports again in time, s."""


def test_a_summary_before_the_next_period_is_the_last_one():
    periods = Periods(LONG_S)
    for _ in range(3):
        periods.tick()
        time.sleep(0.01)
    first = periods.take()
    assert 0.0 < float(first['rate (Hz)']) <= 100.0
    assert periods.take() == first


def test_a_single_period_has_its_rate():
    periods = Periods(0.01)
    periods.tick()
    time.sleep(0.05)
    periods.tick()
    told = periods.take()
    assert 0.0 < float(told['rate (Hz)']) <= 20.0
    assert told['overruns'] == '1'
    assert float(told['period error, median (ms)']) >= 40.0


@pytest.mark.parametrize('rests', [True, False])
def test_a_loop_that_stands_has_no_rate(rests: bool):
    periods = Periods(LONG_S if rests else 0.01)
    assert periods.take() == {'rate (Hz)': '0'}
    periods.tick()
    periods.tick()
    periods.take()
    if rests:
        periods.rest()
    else:
        time.sleep(0.05)
    assert periods.take() == {'rate (Hz)': '0'}
