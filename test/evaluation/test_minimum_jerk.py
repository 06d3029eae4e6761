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

"""The minimum-jerk oracle against an independent solution."""

from __future__ import annotations

from handover_dmp.evaluation.minimum_jerk import minimum_jerk
import numpy as np
import pytest

START, END = np.array([0.1, -0.4, 0.9]), np.array([0.6, 0.2, 1.1])


def test_it_is_the_textbook_quintic():
    path = minimum_jerk(START, END)
    for sample in range(101):
        u = sample / 100
        expected = START + (END - START) * (10 * u**3 - 15 * u**4 + 6 * u**5)
        assert path[sample] == pytest.approx(expected, abs=1e-12)


def test_no_smooth_change_of_it_has_less_jerk():
    path = minimum_jerk(START, END, samples=2001)
    u = np.linspace(0.0, 1.0, 2001)
    bump = (u * (1.0 - u)) ** 3 * np.sin(3.0 * u)
    for factor in (-0.3, 0.3):
        changed = path + factor * bump[:, None]
        assert jerk(changed) > jerk(path)


def jerk(path: np.ndarray) -> float:
    return float((np.diff(path, n=3, axis=0) ** 2).sum())
