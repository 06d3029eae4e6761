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

"""A recorded hand played back: what a tracker would have to say now."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from typing import NamedTuple

from handover_dmp.errors import DataError
from handover_dmp.hand.filtering import interpolate
from handover_dmp.hand.trial import HandoverTrial
import numpy as np
from numpy.typing import ArrayLike, NDArray


class HandSample(NamedTuple):
    """
    A pose to publish.

    Attributes:
        stamp_s: when it was measured, s on the clock of the replay.
        position: (3,) m.

    """

    stamp_s: float
    position: NDArray[np.float64]


class Replay:
    """
    A recorded hand on a clock that starts at 0.

    Made from a trial, it answers for any time, between the samples too; before its start the hand
    rests where it was first seen, after its end where it was last seen. Made from stamped poses,
    it gives those poses and no others, the newest that has arrived.

    Attributes:
        duration_s: from the first sample to the last arrival, s.

    """

    def __init__(
        self,
        duration_s: float,
        *,
        path: Callable[[float], NDArray[np.float64]] | None = None,
        arrivals: Sequence[float] = (),
        samples: Sequence[HandSample] = (),
    ) -> None:
        """
        Make a replay; `from_trial` and `from_poses` are easier to use.

        Args:
            duration_s: from the first sample to the last arrival, s.
            path: (3,) m at any time of the replay; else recorded samples are played back.
            arrivals: when each sample arrives, s, in order.
            samples: what arrives.

        """
        self.duration_s = duration_s
        self._path = path
        self._arrivals = list(arrivals)
        self._samples = list(samples)

    @classmethod
    def from_trial(cls, trial: HandoverTrial) -> Replay:
        """
        Play back the hand of P1.

        Args:
            trial: the handover, conditioned where it is noisy.

        Returns:
            Its replay; 0 is the first sample.

        """
        return cls.from_motion(trial.times, trial.p1)

    @classmethod
    def from_motion(cls, times: NDArray[np.float64], positions: NDArray[np.float64]) -> Replay:
        """
        Play back any motion.

        Args:
            times: (n,) s, strictly increasing.
            positions: (n, 3) m.

        Returns:
            Its replay; 0 is the first sample.

        """
        start, duration = float(times[0]), float(times[-1] - times[0])
        spline = interpolate(times, positions)

        first, last = np.array(positions[0], dtype=float), np.array(positions[-1], dtype=float)

        def path(time_s: float) -> NDArray[np.float64]:
            if time_s <= 0.0:
                return first
            if time_s >= duration:
                return last
            place: NDArray[np.float64] = spline(start + time_s)
            return place

        return cls(duration, path=path)

    @classmethod
    def from_poses(
        cls,
        poses: Sequence[tuple[float, ArrayLike]] | Sequence[tuple[float, float, ArrayLike]],
    ) -> Replay:
        """
        Play back poses as they were recorded.

        Args:
            poses: (stamp in s, position (3,) in m) each, or (arrival in s, stamp in s, position)
                each, as `SensorModel.observe` gives them. Where no arrival is told a pose arrives
                when it was measured. Any clock; the replay's 0 is the earliest stamp.

        Returns:
            Their replay.

        Raises:
            DataError: there are none, or a number is not finite.

        """
        rows = [
            (float(pose[0]), float(pose[-2]), np.array(pose[-1], dtype=float)) for pose in poses
        ]
        if not rows:
            raise DataError('no poses to play back')
        for number, (arrival, stamp, position) in enumerate(rows):
            if position.shape != (3,) or not np.isfinite([arrival, stamp, *position]).all():
                raise DataError(f'pose {number} to play back is not three finite numbers')
        rows.sort(key=lambda row: row[:2])
        zero = min(stamp for _, stamp, _ in rows)
        arrivals = [arrival - zero for arrival, _, _ in rows]
        samples = [HandSample(stamp - zero, position) for _, stamp, position in rows]
        return cls(arrivals[-1], arrivals=arrivals, samples=samples)

    def newest(self, time_s: float) -> HandSample | None:
        """
        Tell what is to be published now.

        Args:
            time_s: time since the start of the replay, s.

        Returns:
            The newest sample; its stamp tells whether it is a new one. None before the first.

        """
        if self._path is not None:
            return HandSample(time_s, self._path(time_s))
        arrived = bisect_right(self._arrivals, time_s)
        return self._samples[arrived - 1] if arrived else None

    def between(self, after_s: float, until_s: float) -> list[HandSample]:
        """
        Tell everything that arrived in a span of time, late and repeated poses included.

        Args:
            after_s: beginning of the span, s, not itself part of it.
            until_s: end of the span, s.

        Returns:
            The samples in order of arrival; of a replay that has one for any time, the last.

        """
        if self._path is not None:
            return [HandSample(until_s, self._path(until_s))] if until_s > after_s else []
        first, end = (bisect_right(self._arrivals, time) for time in (after_s, until_s))
        return self._samples[first:end]

    def is_over(self, time_s: float) -> bool:
        """Tell whether nothing new comes after a time of the replay, s."""
        return time_s >= self.duration_s
