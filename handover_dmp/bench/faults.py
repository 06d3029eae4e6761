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
Faults of a tracker, and the invariants that must hold in spite of them.

For the tests of faults and the soak test: a hand whose tracker fails for a while in a chosen way,
and a checker of the invariants in every period.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import hypot

from handover_dmp.handover.controller import HandoverState
from handover_dmp.handover.lockstep import Period
from handover_dmp.robot.limits import JointLimits
from handover_dmp.tracking.playback import HandSample, TrackedHand
import numpy as np

Samples = list[HandSample]
SampleFault = Callable[[Samples], Samples]

POSITION_TOLERANCE = 1e-3
VELOCITY_TOLERANCE = 1e-2
ROUNDING = 1e-6

NEXT_STATES = {
    HandoverState.IDLE: {HandoverState.REACHING, HandoverState.ABORTED},
    HandoverState.REACHING: {HandoverState.EXCHANGE, HandoverState.ABORTED, HandoverState.IDLE},
    HandoverState.EXCHANGE: {HandoverState.DONE, HandoverState.ABORTED, HandoverState.IDLE},
    HandoverState.DONE: {HandoverState.REACHING, HandoverState.ABORTED, HandoverState.IDLE},
    HandoverState.ABORTED: {HandoverState.REACHING, HandoverState.IDLE},
}
_ENDS = {HandoverState.ABORTED, HandoverState.IDLE}
_BEGINS = {HandoverState.PICKING_UP, HandoverState.REACHING}
STATES_OF_SESSIONS = {
    HandoverState.IDLE: {HandoverState.ABORTED, *_BEGINS},
    HandoverState.PICKING_UP: {HandoverState.REACHING, *_ENDS},
    HandoverState.REACHING: {HandoverState.EXCHANGE, *_ENDS},
    HandoverState.EXCHANGE: {HandoverState.RELEASED, HandoverState.WITHDRAWING, *_ENDS},
    HandoverState.RELEASED: {HandoverState.WITHDRAWING, *_ENDS},
    HandoverState.WITHDRAWING: {HandoverState.WAITING, HandoverState.DONE, *_ENDS},
    HandoverState.WAITING: {HandoverState.REACHING, HandoverState.DONE, *_ENDS},
    HandoverState.DONE: {*_BEGINS, *_ENDS},
    HandoverState.ABORTED: {HandoverState.IDLE, *_BEGINS},
}
"""Permitted successors of each state of a session; docs/topics.md draws them."""


def tracker_faults(seed: int) -> dict[str, SampleFault]:
    """
    Make all faults of a tracker, each with its own state.

    Args:
        seed: seed of the random faults.

    Returns:
        The faults by name; a fault maps the poses of a period to those that arrive.

    """
    random = np.random.default_rng(seed)
    return {
        'stopped': lambda _samples: [],
        'frozen': _Frozen(),
        'jumped by 1 m': lambda samples: [_moved(s, np.array([1.0, 0.0, 0.0])) for s in samples],
        'jumped by 1 m for 50 ms': _Leapt(np.array([1.0, 0.0, 0.0]), 0.05),
        'zeros': lambda samples: [s._replace(position=np.zeros(3)) for s in samples],
        'quaternion of norm 0': lambda samples: [
            s._replace(orientation=(0,) * 4) for s in samples
        ],
        'not a number': lambda samples: [_moved(s, np.array([np.nan, 0, 0])) for s in samples],
        'infinite': lambda samples: [_moved(s, np.array([0, np.inf, 0])) for s in samples],
        'at 5 Hz': _Slow(0.2),
        'stamps from the future': lambda samples: [_restamped(s, 10.0) for s in samples],
        'stamps from the past': lambda samples: [_restamped(s, -10.0) for s in samples],
        'out of order': _Swapped(),
        'duplicated': lambda samples: [s for s in samples for _ in range(2)],
        '30 % dropped': lambda samples: [s for s in samples if random.uniform() > 0.3],
    }


@dataclass(frozen=True)
class FaultyHand(TrackedHand):
    """
    A tracked hand whose tracker fails from one time to another.

    Attributes:
        hand: the hand without faults.
        fault: the fault.
        from_s: start of the fault, s.
        until_s: end of the fault, s.

    """

    hand: TrackedHand
    fault: SampleFault
    from_s: float
    until_s: float

    @property
    def start_s(self) -> float:
        """Start of the replay, s."""
        return self.hand.start_s

    def start(self, at_s: float) -> None:
        """Start the replay at a time, s."""
        self.hand.start(at_s)

    def due(self, now_s: float) -> Samples:
        """Return the poses that arrive at a time, s."""
        samples = self.hand.due(now_s)
        return self.fault(samples) if self.from_s <= now_s < self.until_s else samples


class _Frozen:
    """The first pose repeatedly, with advancing stamps."""

    def __init__(self) -> None:
        self._first: HandSample | None = None

    def __call__(self, samples: Samples) -> Samples:
        if self._first is None and samples:
            self._first = samples[0]
        first = self._first
        return [s._replace(position=first.position) for s in samples] if first else []


class _Leapt:
    """Poses that are displaced for a moment."""

    def __init__(self, offset: np.ndarray, duration_s: float) -> None:
        self._offset = offset
        self._duration_s = duration_s
        self._begun_s: float | None = None

    def __call__(self, samples: Samples) -> Samples:
        moved = []
        for sample in samples:
            if self._begun_s is None:
                self._begun_s = sample.stamp_s
            leapt = sample.stamp_s - self._begun_s < self._duration_s
            moved.append(_moved(sample, self._offset) if leapt else sample)
        return moved


class _Slow:
    """Poses at a low rate."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._next_s = -np.inf

    def __call__(self, samples: Samples) -> Samples:
        kept = []
        for sample in samples:
            if sample.stamp_s >= self._next_s:
                self._next_s = sample.stamp_s + self._period_s
                kept.append(sample)
        return kept


class _Swapped:
    """Pairs of poses, the newer one first."""

    def __init__(self) -> None:
        self._kept: Samples = []

    def __call__(self, samples: Samples) -> Samples:
        self._kept += samples
        if len(self._kept) < 2:
            return []
        swapped, self._kept = self._kept[::-1], []
        return swapped


def _moved(sample: HandSample, offset: np.ndarray) -> HandSample:
    return sample._replace(position=sample.position + offset)


def _restamped(sample: HandSample, offset_s: float) -> HandSample:
    return sample._replace(stamp_s=sample.stamp_s + offset_s)


@dataclass
class InvariantChecker:
    """
    Checks the invariants in every period.

    Commands are finite; joint commands respect the limits of velocity and acceleration; measured
    joints respect those of position and velocity; the wrist command respects its acceleration
    limit; time advances; state transitions are permitted.

    Attributes:
        limits: limits of the joints.
        period_s: length of a period, s.
        wrist_acceleration: acceleration limit of the wrist command, m/s².
        next_states: permitted successors of each state; default: those of a single handover.
        checked: number of checked periods.

    """

    limits: JointLimits
    period_s: float
    wrist_acceleration: float
    next_states: Mapping[HandoverState, set[HandoverState]] = field(
        default_factory=lambda: NEXT_STATES
    )
    checked: int = 0
    _before: Period | None = None

    def check(self, period: Period) -> list[str]:
        """
        Check one period.

        Args:
            period: the next period.

        Returns:
            One line per violation.

        """
        before, self._before = self._before, period
        self.checked += 1
        broken = [*self._of_the_arm(period), *self._of_the_command(period)]
        if before is not None:
            broken += self._since(before, period)
        return [f'at {period.time_ns * 1e-9:.3f} s: {line}' for line in broken]

    def _of_the_arm(self, period: Period) -> list[str]:
        limits, broken = self.limits, []
        q, v = period.joint_positions, period.joint_velocities
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            broken.append('joint states are not finite')
        if np.any(q < limits.lower - POSITION_TOLERANCE) or np.any(
            q > limits.upper + POSITION_TOLERANCE
        ):
            broken.append('a joint is beyond its position limits')
        if np.any(np.abs(v) > limits.velocity * (1.0 + VELOCITY_TOLERANCE)):
            broken.append('a joint is faster than its limit')
        return broken

    def _of_the_command(self, period: Period) -> list[str]:
        broken = []
        command, velocities = period.command, period.answer.velocities
        if not np.isfinite([*command.position, *command.velocity]).all():
            broken.append('the wrist command is not finite')
        if velocities is not None:
            if not np.isfinite(velocities).all():
                broken.append('the joint command is not finite')
            elif np.any(np.abs(velocities) > self.limits.velocity * (1.0 + ROUNDING)):
                broken.append('a joint command is over the velocity limit')
        return broken

    def _since(self, before: Period, period: Period) -> list[str]:
        broken = []
        if period.time_ns <= before.time_ns:
            broken.append('time does not go on')
        was, now = before.command.state, period.command.state
        if now is not was and now not in self.next_states[was]:
            broken.append(f'state went from {was.value} to {now.value}')
        change = np.subtract(period.command.velocity, before.command.velocity)
        if hypot(*change) > self.wrist_acceleration * self.period_s * (1.0 + ROUNDING) + 1e-9:
            broken.append('the wrist command accelerates beyond its limit')
        told, tells = before.answer.velocities, period.answer.velocities
        if told is not None and tells is not None:
            maximum = self.limits.acceleration * self.period_s * (1.0 + ROUNDING) + 1e-9
            if np.any(np.abs(tells - told) > maximum):
                broken.append('a joint command accelerates beyond its limit')
        return broken
