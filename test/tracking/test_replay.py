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

"""The replay: a recorded hand at any time."""

from __future__ import annotations

from handover_dmp.mocap import condition, synthesize
from handover_dmp.tracking import Replay
import numpy as np
import pytest


@pytest.fixture(scope='module')
def trial():
    return condition(synthesize(trials=1)[1])


def test_a_trial_starts_at_zero_and_holds_at_its_ends(trial):
    replay = Replay(trial.times + 7.0, trial.partner)
    for k in (0, 10, 111, len(trial.times) - 1):
        np.testing.assert_allclose(replay(trial.times[k]), trial.partner[k], atol=1e-12)
    np.testing.assert_allclose(replay(-3.0), trial.partner[0])
    np.testing.assert_allclose(replay(99.0), trial.partner[-1])


def test_any_motion(trial):
    replay = Replay(trial.times, trial.demonstrator)
    np.testing.assert_allclose(replay(0.5), trial.demonstrator[100], atol=1e-9)


def test_between_the_samples_it_is_smooth():
    """A 24 Hz trial, played at 200 Hz, gives no staircase of speeds."""
    slow = synthesize(trials=1, rate_hz=24.0, noise_m=0.0)[1]
    fine = synthesize(trials=1, rate_hz=200.0, noise_m=0.0)[1]
    replay = Replay(slow.times, slow.partner)
    inside = fine.times <= slow.duration_s
    played = np.array([replay(time) for time in fine.times[inside]])
    np.testing.assert_allclose(played, fine.partner[inside], atol=1e-3)
    speeds = np.linalg.norm(np.diff(played, axis=0), axis=1) * 200.0
    assert np.abs(np.diff(speeds)).max() < 0.1
