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

"""
Playback of a recorded partner, as trackers would publish it.

`Replay` is the recording on a clock that starts at 0, `TrackedHand` is the same seen by a tracker,
before, during and after. `PlayedTrial` and `PlayedBag` are the partners of a trial and of a bag.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
import math
from pathlib import Path
from typing import NamedTuple

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.mocap.filtering import interpolate
from handover_dmp.mocap.trial import HandoverTrial
from handover_dmp.topics import DEMONSTRATOR_POSE, HAND_POSE, SIGNAL
from handover_dmp.tracking.sensor_model import SensorModel
import numpy as np

CATCH_UP_S = 0.25
SEEN_BEFORE_S = 0.1
ROUNDING = 1e-6
MAX_POSES = 2_000_000
NANOSECONDS = 1_000_000_000
ROUNDING_S = 1e-6
EARLIEST_S = 1e-9
"""The earliest time that a stamp can represent, s."""


def as_stamped(time_s: float) -> float:
    """
    Round a time as in a message, so that a hand is the same with messages and without.

    Args:
        time_s: s.

    Returns:
        The time, rounded to nanoseconds, s.

    """
    return round(time_s * NANOSECONDS) / NANOSECONDS


class HandSample(NamedTuple):
    """
    A hand pose to publish.

    Attributes:
        stamp_s: time of the measurement, s, on the clock of the replay.
        position: (3,) m.
        orientation: quaternion x, y, z, w, if recorded.
        frame: frame of the recording; empty for that of the nodes.

    """

    stamp_s: float
    position: Array
    orientation: tuple[float, float, float, float] | None = None
    frame: str = ''


class Replay:
    """A recorded hand on a clock that starts at 0; it rests before its motion and after it."""

    def __init__(self, times: Array, positions: Array) -> None:
        """
        Interpolate a motion.

        Args:
            times: (n,) s, strictly increasing.
            positions: (n, 3) m.

        """
        self._start_s = float(times[0])
        self._duration_s = float(times[-1] - times[0])
        self._spline = interpolate(times, positions)
        self._first, self._last = (np.array(positions[end], dtype=float) for end in (0, -1))

    def __call__(self, elapsed_s: float) -> Array:
        """
        Return the position at any time.

        Args:
            elapsed_s: time since the first sample, s.

        Returns:
            The position, (3,) m.

        """
        if elapsed_s <= 0.0:
            return self._first
        if elapsed_s >= self._duration_s:
            return self._last
        return np.asarray(self._spline(self._start_s + elapsed_s))


class TrackedHand:
    """
    The poses that a tracker publishes while a recording is played back.

    The tracker measures at integer multiples of its period, so the poses do not depend on the
    times of the queries. The hand rests at its first position before the start of the replay, and
    at its last one after the end.
    """

    def __init__(
        self,
        hand: Callable[[float], Array],
        sensor: SensorModel | None = None,
        *,
        tells_lost: bool = False,
    ) -> None:
        """
        Take the recording and the tracker.

        Args:
            hand: its position, (3,) m, at any time in s after the start, as a `Replay`.
            sensor: rate, noise, delay, faults; jitter and duplicates are ignored here.
            tells_lost: whether a lost pose is published as NaN instead of being dropped, so that
                nodes in lockstep do not wait for it.

        """
        self._position_at = hand
        self._tells_lost = tells_lost
        self._sensor = sensor or SensorModel()
        self._start_s = math.inf
        self._hidden = False
        self._next: int | None = None

    @property
    def start_s(self) -> float:
        """Start time of the replay, s; infinite until it is set."""
        return self._start_s

    def start(self, at_s: float) -> None:
        """
        Start the replay; a hand seen at the end of a previous one disappears until shortly before.

        Args:
            at_s: time of its first sample, s.

        """
        self._hidden = math.isfinite(self._start_s)
        self._start_s = at_s

    def due(self, now_s: float) -> list[HandSample]:
        """
        Return the poses that arrive now.

        Args:
            now_s: the time, s; after a jump back or far ahead, the tracker continues from there.

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
        seen = (self._measure(number) for number in numbers)
        return [sample for sample in seen if sample is not None]

    def _measure(self, number: int) -> HandSample | None:
        sensor = self._sensor
        stamp_s = as_stamped(number / sensor.rate_hz)
        if number < 0 or (number == 0 and sensor.delay_s > 0.0):
            # measured before time 0 or at 0, which is invalid as a stamp
            return HandSample(EARLIEST_S, np.full(3, np.nan)) if self._tells_lost else None
        position = self._seen(number, stamp_s - self._start_s)
        if position is None and not self._tells_lost:
            return None
        hidden = self._hidden and stamp_s < self._start_s - SEEN_BEFORE_S
        if position is None or hidden:
            position = np.full(3, np.nan)
        return HandSample(as_stamped(stamp_s + sensor.clock_s), position)

    def _seen(self, number: int, elapsed_s: float) -> Array | None:
        """Return a position of the tracker at a time after the start; None if it has none."""
        sensor = self._sensor
        if sensor.is_dead(elapsed_s):
            return None
        seen_s = sensor.seen_at(elapsed_s)
        if seen_s < elapsed_s:
            number = max(math.floor((self._start_s + seen_s) * sensor.rate_hz + ROUNDING), 0)
            elapsed_s = number / sensor.rate_hz - self._start_s
        position = self._position_at(elapsed_s) + sensor.off_by(elapsed_s)
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
        return position


class StartSignals:
    """The partner's signals of a recording that is played back."""

    _signals: Sequence[float] = ()

    def signals(self) -> list[float]:
        """Return the new start times of handovers, s."""
        signals, self._signals = self._signals, ()
        return list(signals)


class PlayedTrial(StartSignals):
    """A trial seen by trackers: at rest before, in motion, at rest after."""

    def __init__(
        self,
        trial: HandoverTrial,
        sensors: Sequence[SensorModel] = (SensorModel(),),
        *,
        tells_lost: bool = False,
    ) -> None:
        """
        Take the recording and the trackers.

        Args:
            trial: the recording.
            sensors: model of each tracker.
            tells_lost: whether a lost pose is published as NaN.

        """
        self._truth = Replay(trial.times, trial.partner)
        self._demonstrator = Replay(trial.times, trial.demonstrator)
        self._hands = [
            TrackedHand(self._truth, sensor, tells_lost=tells_lost) for sensor in sensors
        ]

    @property
    def start_s(self) -> float:
        """Start time of the trial, s; infinite until it is set."""
        return self._hands[0].start_s

    def start(self, at_s: float) -> None:
        """Start the trial at a time, s."""
        for hand in self._hands:
            hand.start(at_s)
        self._signals = (at_s,)

    def hands(self, now_s: float) -> list[list[HandSample]]:
        """Return for each tracker the poses that arrived since the last call, at a time, s."""
        return [hand.due(now_s) for hand in self._hands]

    def truth(self, now_s: float) -> list[HandSample]:
        """Return the true position of the hand at a time, s."""
        return [HandSample(now_s, self._truth(now_s - self.start_s))]

    def demonstrator(self, now_s: float) -> list[HandSample]:
        """Return the position of the recorded demonstrator at a time, s."""
        return [HandSample(now_s, self._demonstrator(now_s - self.start_s))]


class PlayedBag(StartSignals):
    """
    The poses of a bag, stamped with the times at which they are due, without interpolation.

    Before the first pose the hand rests there, so that subscribers know it. The handover starts at
    the first signal of the bag or, without one, at its first pose.
    """

    def __init__(self, path: Path | str) -> None:
        """
        Read the bag.

        Args:
            path: a rosbag2 folder, an MCAP file or the folder of a run. The times of its poses are
                their stamps or, if these are zero, their recording times.

        Raises:
            DataError: there is no such bag, it is damaged, or it has no poses of a hand.

        """
        seen, signals = _read(path)
        if not seen[HAND_POSE.name]:
            raise DataError(f'{path}: 0 poses on {HAND_POSE.name}')
        zero_s = min(pose.stamp_s for pose in seen[HAND_POSE.name])
        self._hand, self._demonstrator = (_PlayedPoses(poses, zero_s) for poses in seen.values())
        self._signal_s = signals[0] - zero_s if signals else 0.0
        self.start_s = math.inf

    def start(self, at_s: float) -> None:
        """Start the bag with its first pose of the hand at a time, s."""
        self.start_s = at_s
        self._signals = (at_s + self._signal_s,)

    def hands(self, now_s: float) -> list[list[HandSample]]:
        """Return the poses of one tracker that became due since the last call, at a time, s."""
        return [self._hand.due(now_s, self.start_s)]

    def truth(self, _now_s: float) -> list[HandSample]:
        """Return nothing: the true position is unknown."""
        return []

    def demonstrator(self, now_s: float) -> list[HandSample]:
        """Return the poses of the recorded demonstrator that became due since the last call."""
        return self._demonstrator.due(now_s, self.start_s)


class _PlayedPoses:
    """The poses of one topic; `zero_s` is the start on the clock of their stamps."""

    def __init__(self, poses: Sequence[HandSample], zero_s: float) -> None:
        poses = sorted(poses, key=lambda pose: pose.stamp_s)
        self._poses = [pose._replace(stamp_s=pose.stamp_s - zero_s) for pose in poses]
        self._due_s = [pose.stamp_s for pose in self._poses]
        self._asked_s = -math.inf

    def due(self, now_s: float, start_s: float) -> list[HandSample]:
        # skip poses that are long past, after a stall or a late start
        after_s, self._asked_s = max(self._asked_s, now_s - CATCH_UP_S), now_s
        if not self._poses:
            return []
        if now_s < start_s + self._due_s[0] - ROUNDING_S:
            return [self._poses[0]._replace(stamp_s=now_s)]
        first, end = (
            bisect_right(self._due_s, time_s - start_s + ROUNDING_S) for time_s in (after_s, now_s)
        )
        return [pose._replace(stamp_s=start_s + pose.stamp_s) for pose in self._poses[first:end]]


def _read(path: Path | str) -> tuple[dict[str, list[HandSample]], list[float]]:
    """Return the poses of both topics and the times of the signals, s, all on one clock."""
    # imported here: playing trials does not need the libraries for bags
    from handover_dmp.recording import read_bag, recorded_namespace

    seen: dict[str, list[HandSample]] = {HAND_POSE.name: [], DEMONSTRATOR_POSE.name: []}
    signals: list[float] = []
    zero_ns: int | None = None
    space = recorded_namespace(path, [HAND_POSE])
    topics = {one.within(space): one.name for one in (HAND_POSE, DEMONSTRATOR_POSE, SIGNAL)}
    for name, message, log_time_ns in read_bag(path, topics):
        topic = topics[name]
        try:
            header = message if topic == SIGNAL.name else message.header
            time_ns = header.stamp.sec * NANOSECONDS + header.stamp.nanosec or log_time_ns
            # as seconds since 1970, a double only resolves some tenths of a microsecond
            zero_ns = time_ns if zero_ns is None else zero_ns
            time_s = (time_ns - zero_ns) / NANOSECONDS
            if topic == SIGNAL.name:
                signals.append(time_s)
            else:
                place, turn = message.pose.position, message.pose.orientation
                position = np.array([place.x, place.y, place.z])
                rotation = (turn.x, turn.y, turn.z, turn.w)
                seen[topic].append(HandSample(time_s, position, rotation, header.frame_id))
        except AttributeError as error:
            raise DataError(f'{path}: messages of another type on {topic}') from error
        if len(seen.get(topic, signals)) > MAX_POSES:
            raise DataError(f'{path}: more than {MAX_POSES} messages on {topic}')
    return seen, signals
