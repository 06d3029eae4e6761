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

from __future__ import annotations

from handover_dmp.dmp.basis import Basis, equally_spaced, LAST_NODE, TABLE_RATE
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

ALPHA = -np.log(0.01)

PROPERTY = settings(max_examples=25, deadline=None)


@PROPERTY
@given(st.integers(2, 200), st.floats(1e-12, 1.0))
def test_activations_sum_to_one_at_every_phase(count, phase):
    activations = equally_spaced(count, ALPHA).activations(np.array([phase, 1e-300]))
    assert activations.sum(axis=1) == pytest.approx(1.0)
    assert (activations >= 0.0).all()


def test_activations_are_the_printed_ones():
    basis = Basis(np.array([1.0, 0.4, 0.1]), np.array([3.0, 9.0, 50.0]))
    for s in (1.0, 0.5, 0.2, 0.01):
        psi = [
            np.exp(-h * (s - c) ** 2) for c, h in zip(basis.centres, basis.sharpness, strict=True)
        ]
        assert basis.activations(np.array([s]))[0] == pytest.approx(np.array(psi) / sum(psi))


def test_centres_are_equally_spaced_in_time():
    basis = equally_spaced(50, ALPHA)
    times = -np.log(basis.centres) / ALPHA
    assert np.diff(times) == pytest.approx(1.0 / 49.0)
    assert times[0] == pytest.approx(0.0, abs=1e-12)
    assert times[-1] == pytest.approx(1.0)


def test_neighbours_meet_where_they_have_fallen_alike():
    basis = equally_spaced(20, ALPHA)
    middle = 0.5 * (basis.centres[:-1] + basis.centres[1:])
    left = np.exp(-basis.sharpness[:-1] * (middle - basis.centres[:-1]) ** 2)
    assert left == pytest.approx(np.exp(-0.25))


def test_widths_share_the_number():
    basis = equally_spaced(100, ALPHA, (0.045, 0.15))
    assert basis.size == 100
    reach = 1.0 / (np.sqrt(basis.sharpness) * ALPHA * basis.centres)
    assert reach[:60] == pytest.approx(0.045)
    assert reach[60:] == pytest.approx(0.15)


def test_the_table_holds_the_activations_at_its_nodes():
    basis = equally_spaced(30, ALPHA)
    table = basis.table(ALPHA)
    assert len(table) == LAST_NODE + 1
    u = 1234 / TABLE_RATE
    assert table[1234] == pytest.approx(basis.activations(np.array([np.exp(-ALPHA * u)]))[0])
    assert basis.table(ALPHA) is table


def test_arrays_cannot_be_written_to():
    basis = equally_spaced(5, ALPHA)
    with pytest.raises(ValueError, match='read-only'):
        basis.centres[0] = 2.0
