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

"""What the tests of this room share: long recordings made of trials, as a mocap session is."""

from __future__ import annotations

from collections.abc import Sequence

from handover_dmp.mocap.trial import HandoverTrial
from handover_dmp.mocap.wrists import WristMotion
import numpy as np
import pytest

HOLD_S = 0.5
RETREAT_S = 1.2
REST_S = 0.7


def minimum_jerk(u):
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def play(
    trials: Sequence[HandoverTrial],
    *,
    rate_hz: float = 200.0,
    noise_m: float = 1e-4,
    seed: int = 0,
) -> tuple[WristMotion, list[tuple[float, float]]]:
    """
    Play trials one after the other: reach, hold, go back to where the next one starts, rest.

    Returns:
        The motion, and for each trial when its data start and end.

    """
    random = np.random.default_rng(seed)
    pieces = []
    spans = []
    clock = 0.0
    first = np.hstack([trials[0].partner[0], trials[0].demonstrator[0]])
    rest = np.tile(first, (round(REST_S * rate_hz), 1))
    pieces.append(rest)
    clock += len(rest) / rate_hz
    for number, trial in enumerate(trials):
        both = np.hstack([trial.partner, trial.demonstrator])
        new = np.arange(0.0, trial.duration_s, 1.0 / rate_hz)
        reach = np.column_stack(
            [np.interp(new, trial.times - trial.times[0], column) for column in both.T]
        )
        spans.append((clock, clock + trial.duration_s))
        following = trials[number + 1] if number + 1 < len(trials) else trials[0]
        goal = np.hstack([following.partner[0], following.demonstrator[0]])
        hold = np.tile(both[-1], (round(HOLD_S * rate_hz), 1))
        u = np.arange(round(RETREAT_S * rate_hz))[:, None] / (RETREAT_S * rate_hz)
        retreat = both[-1] + minimum_jerk(u) * (goal - both[-1])
        rest = np.tile(goal, (round(REST_S * rate_hz), 1))
        for piece in (reach, hold, retreat, rest):
            pieces.append(piece)
            clock += len(piece) / rate_hz
    everything = np.vstack(pieces)
    everything = everything + noise_m * random.standard_normal(everything.shape)
    times = np.arange(len(everything)) / rate_hz
    return WristMotion(times, everything[:, :3], everything[:, 3:], 'session'), spans


@pytest.fixture(scope='session')
def play_session():
    """Return the function that makes a session of trials."""
    return play
