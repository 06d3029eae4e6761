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

"""A recorded partner, hand and all, played back from a trial or from a bag as it was recorded."""

from __future__ import annotations

from collections.abc import Sequence
import math
from pathlib import Path

from handover_dmp.errors import DataError
from handover_dmp.hand.replay import HandSample, Replay
from handover_dmp.hand.sensor import SensorModel
from handover_dmp.hand.tracking import CATCH_UP_S, TrackedHand
from handover_dmp.hand.trial import HandoverTrial
from handover_dmp.topics import FRAME, HAND_POSE, HUMAN_POSE, SIGNAL
import numpy as np

MOST_POSES = 2_000_000
NANOSECONDS = 1_000_000_000
ROUNDING_S = 1e-6


class PlayedTrial:
    """A trial as a tracker sees it: at rest before, in motion, at rest after."""

    def __init__(self, trial: HandoverTrial, sensor: SensorModel) -> None:
        """
        Take the recording and the tracker.

        Args:
            trial: the recording.
            sensor: how the tracker sees the hand.

        """
        self._hand = TrackedHand(Replay.from_trial(trial), sensor)
        self._human = Replay.from_motion(trial.times, trial.p2)

    @property
    def start_s(self) -> float:
        """When the trial starts, s; infinite until it is told."""
        return self._hand.start_s

    @property
    def signal_s(self) -> float:
        """When the handover is to start, s."""
        return self._hand.start_s

    def start(self, at_s: float) -> None:
        """Start the trial at a time, s."""
        self._hand.start(at_s)

    def hand(self, now_s: float) -> list[HandSample]:
        """Give the poses of the hand that arrived since the last call, at a time, s."""
        return self._hand.due(now_s)

    def human(self, now_s: float) -> list[HandSample]:
        """Give where the person is whose place the robot takes, at a time, s."""
        sample = self._human.newest(max(0.0, now_s - self.start_s))
        return [] if sample is None else [HandSample(now_s, sample.position)]


class PlayedBag:
    """
    The poses of a bag, each stamped with the time at which it is due, and no others between them.

    Before its first pose, so that listeners know of it, the hand rests there.
    """

    def __init__(self, path: Path | str) -> None:
        """
        Read the bag.

        Args:
            path: a rosbag2 folder, an MCAP file or the folder of a run. Of its poses the stamps
                count or, where these are zero, when they were recorded.

        Raises:
            DataError: there is no such bag, it is damaged, or no poses of a hand in the frame
                `world` are in it.

        """
        seen, signals = _read(path)
        if not seen[HAND_POSE.name]:
            raise DataError(f'{path}: 0 poses on {HAND_POSE.name}')
        zero_s = min(stamp_s for stamp_s, _ in seen[HAND_POSE.name])
        try:
            self._hand, self._human = (_PlayedPoses(poses, zero_s) for poses in seen.values())
        except DataError as error:
            raise DataError(f'{path}: {error}') from error
        self._signal_s = signals[0] - zero_s if signals else 0.0
        self.start_s = math.inf

    @property
    def signal_s(self) -> float:
        """When the handover is to start, s: at the first signal, without one at the start."""
        return self.start_s + self._signal_s

    def start(self, at_s: float) -> None:
        """Start the bag with its first pose of the hand at a time, s."""
        self.start_s = at_s

    def hand(self, now_s: float) -> list[HandSample]:
        """Give the poses of the hand that became due since the last call, at a time, s."""
        return self._hand.due(now_s, self.start_s)

    def human(self, now_s: float) -> list[HandSample]:
        """Give the same of the person whose place the robot takes."""
        return self._human.due(now_s, self.start_s)


_Pose = tuple[float, tuple[float, float, float]]


class _PlayedPoses:
    """The poses of one topic; `zero_s` is the start on the clock of their stamps."""

    def __init__(self, poses: Sequence[_Pose], zero_s: float) -> None:
        self._replay = Replay.from_poses(poses) if poses else None
        first_s, first = min(poses, default=(zero_s, ()))
        self._first_s, self._first = first_s - zero_s, np.array(first)
        self._asked_s = -math.inf

    def due(self, now_s: float, start_s: float) -> list[HandSample]:
        begin_s = start_s + self._first_s - ROUNDING_S
        # nobody is served with what is long past, be it after a stall or a late start
        after_s, self._asked_s = max(self._asked_s, now_s - CATCH_UP_S), now_s
        if self._replay is None:
            return []
        if now_s < begin_s:
            return [HandSample(now_s, self._first)]
        return [
            HandSample(start_s + self._first_s + sample.stamp_s, sample.position)
            for sample in self._replay.between(after_s - begin_s, now_s - begin_s)
        ]


def _read(path: Path | str) -> tuple[dict[str, list[_Pose]], list[float]]:
    """Return the poses of both topics and the times of the signals, s, all on one clock."""
    # not at the top: trials are played without the libraries that bags need
    from handover_dmp.recording import read_bag

    seen: dict[str, list[_Pose]] = {HAND_POSE.name: [], HUMAN_POSE.name: []}
    signals: list[float] = []
    zero_ns: int | None = None
    for topic, message, log_time_ns in read_bag(path, [*seen, SIGNAL.name]):
        try:
            header = message if topic == SIGNAL.name else message.header
            time_ns = header.stamp.sec * NANOSECONDS + header.stamp.nanosec or log_time_ns
            # seconds since 1970 leave a double only some tenths of a microsecond
            zero_ns = time_ns if zero_ns is None else zero_ns
            time_s = (time_ns - zero_ns) / NANOSECONDS
            if topic == SIGNAL.name:
                signals.append(time_s)
            else:
                place = message.pose.position
                seen[topic].append((time_s, (place.x, place.y, place.z)))
        except AttributeError as error:
            raise DataError(f'{path}: messages of another type on {topic}') from error
        if topic != SIGNAL.name and header.frame_id != FRAME:
            raise DataError(f'{path}: {topic} is in frame {header.frame_id!r}, not {FRAME!r}')
        if len(seen.get(topic, signals)) > MOST_POSES:
            raise DataError(f'{path}: more than {MOST_POSES} messages on {topic}')
    return seen, signals
