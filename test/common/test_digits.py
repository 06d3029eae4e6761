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

"""Numbers as text."""

from __future__ import annotations

from handover_dmp.common.digits import rounded
from hypothesis import given
from hypothesis import strategies as st
import pytest


@given(st.floats(-1e6, 1e6), st.integers(0, 4), st.sampled_from('+-'))
def test_it_is_the_number_and_zero_has_no_minus(value: float, digits: int, sign: str) -> None:
    text = rounded(value, digits, sign)
    assert float(text) == pytest.approx(value, abs=0.51 * 10.0**-digits)
    assert text.startswith('-') == (float(text) < 0.0)
    assert text.startswith('+') == (sign == '+' and float(text) >= 0.0)
