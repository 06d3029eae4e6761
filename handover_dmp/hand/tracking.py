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

"""A replayed hand as a tracker sees it, for as long as one looks: before, during and after."""

from __future__ import annotations

import math

from handover_dmp.hand.replay import HandSample, Replay
from handover_dmp.hand.sensor import SensorModel
import numpy as np

CATCH_UP_S = 0.25
ROUNDING = 1e-6


class TrackedHand:
    """
    The poses that a tracker publishes while a recording is played back.

    The tracker measures at whole multiples of its period, so that the same times give the same
    poses whoever asks and however often. Before the start of the replay the hand rests where it
    was first seen, after the end where it was last seen.
    """

    def __init__(self, replay: Replay, sensor: SensorModel | None = None) -> None:
        """
        Take the recording and the tracker.

        Args:
            replay: the hand, for any time.
            sensor: rate, noise, delay, drop-outs and outliers; jitter and duplicates are for
                `SensorModel.observe` alone.

        """
        self._replay = replay
        self._sensor = sensor or SensorModel()
        self._start_s = math.inf
        self._next: int | None = None

    @property
    def start_s(self) -> float:
        """When the replay starts, s; infinite until it is told."""
        return self._start_s

    def start(self, at_s: float) -> None:
        """
        Play the recording back.

        Args:
            at_s: when its first sample is, s.

        """
        self._start_s = at_s

    def due(self, now_s: float) -> list[HandSample]:
        """
        Tell what arrives now.

        Args:
            now_s: the time, s; where it went back or far ahead, the tracker goes on from there.

        Returns:
            The poses that arrived since the last call, in order.

        """
        sensor = self._sensor
        newest = math.floor((now_s - sensor.delay_s) * sensor.rate_hz + ROUNDING)
        oldest = newest - math.floor(CATCH_UP_S * sensor.rate_hz)
        if self._next is None or not oldest <= self._next <= newest + 1:
            self._next = newest
        numbers = range(self._next, newest + 1)
        self._next = newest + 1
        seen = (self._measure(number) for number in numbers if number >= 0)
        return [sample for sample in seen if sample is not None]

    def _measure(self, number: int) -> HandSample | None:
        sensor = self._sensor
        stamp_s = number / sensor.rate_hz
        sample = self._replay.newest(max(0.0, stamp_s - self._start_s))
        if sample is None:
            return None
        position = sample.position
        if sensor.noise_m or sensor.dropout or sensor.outliers:
            random = np.random.default_rng((sensor.seed, number))
            if random.uniform() < sensor.dropout:
                return None
            position = position + sensor.noise_m * random.standard_normal(3)
            if random.uniform() < sensor.outliers:
                direction = random.standard_normal(3)
                position = position + (
                    sensor.outlier_distance_m * direction / np.linalg.norm(direction)
                )
        return HandSample(stamp_s, position)
