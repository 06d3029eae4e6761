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

"""A simulated tracker with an unknown frame and delay, which sees a marker on a moving body."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from handover_dmp.common.arrays import Array
from handover_dmp.common.settings import setting
import numpy as np
from scipy.spatial.transform import Rotation

_setting = partial(setting, 'calibration_motion', read_only=True)


@dataclass(frozen=True)
class TrackerPlace:
    """Frame, delay and noise of the tracker, which the calibration has to find."""

    position: Sequence[float] = _setting(
        'simulated_tracker.position',
        'Position of the origin of its frame in the room, (3,), m',
    )
    quaternion: Sequence[float] = _setting(
        'simulated_tracker.quaternion',
        'Rotation from the axes of its frame to those of the room, as x, y, z, w',
    )
    delay_s: float = _setting(
        'simulated_tracker.delay_s',
        'Delay of the stamps of its poses, s',
        0.0,
        10.0,
    )
    noise_m: float = _setting(
        'simulated_tracker.noise_m',
        'Standard deviation of the noise on each axis, m',
        0.0,
        1.0,
    )
    marker: Sequence[float] = _setting(
        'simulated_tracker.marker',
        'Position of the marker in the axes of the body, (3,), m',
    )
    seed: int = _setting('simulated_tracker.seed', 'Seed of the noise', 0, 2147483647)


class SimulatedTracker:
    """Measures the marker, pose by pose."""

    def __init__(self, place: TrackerPlace) -> None:
        """
        Set the tracker up.

        Args:
            place: its parameters.

        """
        self._turn = Rotation.from_quat(place.quaternion).as_matrix()
        self._place = place
        self._random = np.random.default_rng(place.seed)
        self._waiting: deque[tuple[float, Array]] = deque()

    def see(self, time_s: float, position: Array, rotation: Array) -> list[tuple[float, Array]]:
        """
        Observe the body now.

        Args:
            time_s: present time, s.
            position: (3,) m, position of the body.
            rotation: (3, 3), from its axes to those of the room.

        Returns:
            The published pose: stamp, s, and position of the marker in the tracker's frame, m.

        """
        marker = position + rotation @ np.array(self._place.marker)
        seen = (marker - np.array(self._place.position)) @ self._turn
        noisy = seen + self._place.noise_m * self._random.standard_normal(3)
        self._waiting.append((time_s + self._place.delay_s, noisy))
        ready = []
        while self._waiting and self._waiting[0][0] <= time_s + 1e-9:
            ready.append(self._waiting.popleft())
        return ready
