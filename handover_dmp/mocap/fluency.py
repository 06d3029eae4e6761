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
Activity and waiting times in a session (Hoffman 2019).

A hand sways at rest and pauses briefly during work. A person is therefore active from where the
speed rises above 0.05 m/s to where it falls below, if it exceeds 0.15 m/s in between; pauses
shorter than 0.3 s do not count. docs/method.md has the formulas.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from handover_dmp.common.arrays import Array
from handover_dmp.mocap.filtering import RATE_HZ, smooth
from handover_dmp.mocap.measures import ACTIVE_SPEED, Fluency, fluency_of
from handover_dmp.mocap.session import RecordedSession
import numpy as np
from numpy.typing import NDArray

Activity = NDArray[np.bool_]
TimedVelocities = tuple[Array, Array]
"""Times, (n,) s, and velocities, (n, 3) m/s."""

CERTAIN_SPEED = 0.15
"""Below this peak speed a motion is only sway, m/s."""
MAX_PAUSE_S = 0.3
"""A shorter rest belongs to the activity around it, s."""


@dataclass(frozen=True)
class ExchangeWait:
    """
    Waiting times at the exchange before it began.

    Attributes:
        person_s: time since the end of the person's reach, s; 0 if the hand still moved.
        robot_s: the same for the robot.

    """

    person_s: float
    robot_s: float


@dataclass(frozen=True)
class SessionFluency:
    """
    Fluency of a session.

    Attributes:
        whole: shares of the time of the session.
        duration_s: duration of the session, s.
        waits: waiting times at each exchange, in order.

    """

    whole: Fluency
    duration_s: float
    waits: tuple[ExchangeWait, ...]


def session_fluency(
    person_speed: Array, robot_speed: Array, rate_hz: float, exchanges_s: Sequence[float] = ()
) -> SessionFluency:
    """
    Measure the fluency of a session.

    Source: Hoffman, Evaluating fluency in human-robot collaboration, IEEE Trans. Human-Machine
    Systems 49(3), 2019.

    Args:
        person_speed: (n,) m/s, evenly spaced in time, low-passed.
        robot_speed: (n,) m/s, at the same times: speed of the robot or of the demonstrator.
        rate_hz: sampling rate, Hz.
        exchanges_s: start of each exchange, s from the first sample.

    Returns:
        The measures.

    """
    person, robot = (activity(speed, rate_hz) for speed in (person_speed, robot_speed))
    waits = [
        ExchangeWait(*(_rest_before(active, time_s, rate_hz) for active in (person, robot)))
        for time_s in exchanges_s
    ]
    return SessionFluency(fluency_of(person, robot), len(person) / rate_hz, tuple(waits))


def fluency_of_motions(
    partner: TimedVelocities,
    other: TimedVelocities,
    begin_s: float,
    exchanges_s: Sequence[float] = (),
) -> SessionFluency | None:
    """
    Measure the fluency of a session from two motions.

    Args:
        partner: (n,) s and (n, 3) m/s, the velocity of the person's hand, low-passed.
        other: the same for the robot or the demonstrator.
        begin_s: start of the measurement, s.
        exchanges_s: start of each exchange, s.

    Returns:
        The measures; None if the two motions do not overlap in time.

    """
    begin_s = max(begin_s, float(partner[0][0]), float(other[0][0]))
    times = np.arange(begin_s, min(partner[0][-1], other[0][-1]), 1.0 / RATE_HZ)
    if not len(times):
        return None
    speeds = [
        np.sqrt(sum(np.interp(times, at, column) ** 2 for column in velocities.T))
        for at, velocities in (partner, other)
    ]
    met = [exchange_s - begin_s for exchange_s in exchanges_s]
    return session_fluency(speeds[0], speeds[1], RATE_HZ, met)


def people_fluency(session: RecordedSession) -> SessionFluency:
    """
    Measure the fluency of two people, as a reference for a robot.

    Args:
        session: the recording, without gaps; P1 counts as the person, P2 as the robot.

    Returns:
        The measures from the start of the first reach on, where a robot begins.

    """
    motion = session.motion
    both = np.hstack([motion.partner, motion.demonstrator])
    times, _, velocities = smooth(motion.times, both)
    found = fluency_of_motions(
        (times, velocities[:, :3]),
        (times, velocities[:, 3:]),
        session.exchanges[0].start_s,
        [part.exchange_s for part in session.exchanges],
    )
    assert found is not None
    return found


def activity(speed: Array, rate_hz: float) -> Activity:
    """
    Find when a person or a robot was active.

    Args:
        speed: (n,) m/s, evenly spaced in time.
        rate_hz: sampling rate, Hz.

    Returns:
        (n,) bool, True while active.

    """
    active = np.zeros(len(speed), dtype=bool)
    for begin, end in _stretches(speed > ACTIVE_SPEED):
        active[begin:end] = speed[begin:end].max() > CERTAIN_SPEED
    for begin, end in _stretches(~active):
        inside = begin > 0 and end < len(active)
        if inside and (end - begin) / rate_hz < MAX_PAUSE_S:
            active[begin:end] = True
    return active


def _stretches(true: Activity) -> list[tuple[int, int]]:
    """Return begin and end of each run of True."""
    edges = np.flatnonzero(np.diff(true.astype(np.int8), prepend=0, append=0))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _rest_before(active: Activity, time_s: float, rate_hz: float) -> float:
    """Return the time at rest before a given time, s; 0 while active."""
    row = min(max(round(time_s * rate_hz), 0), len(active) - 1)
    moved = np.flatnonzero(active[: row + 1])
    return (row - (int(moved[-1]) if len(moved) else 0)) / rate_hz
