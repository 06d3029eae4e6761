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

"""The graph: periods, drift, latency and speed beside what the machine can do at best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import os

from handover_dmp.bench.graph_run import (
    Array,
    LockstepRun,
    run_by_the_wall_clock,
    run_in_lockstep,
    WallClockRun,
)
from handover_dmp.bench.measurement import Measurement
from handover_dmp.handover.scenario import make_scenario
import numpy as np

PERIOD_S = 0.005
DURATION_S = float(os.environ.get('HANDOVER_DMP_BENCH_SECONDS', '60'))
MIN_S = 5.0
BESIDE_EACH_OTHER_HZ = {'dmp': 200.4, 'priority_ik': 201.1}
"""Rates of timers that pass through every offset from each other and from the hand's 200 Hz."""
MESSAGES_IN_TURN = 4
"""Of a period in lockstep: joint states, wrist, its command, joint velocities."""
IN_MOTION = 80.0
"""Share of the periods that is to be in motion for the figures to tell anything, %."""


@dataclass(frozen=True)
class _Answers:
    """
    How long poses of the hand took to become joint velocities, while a handover was on.

    Attributes:
        latency_ms: from the tracker's period that published a pose to the reception of the first
            joint command that follows from this pose or a newer one.
        waiting_ms: of that, how long the pose lay in `dmp` and the wrist command in `priority_ik`
            until their timers fired.

    """

    latency_ms: Array
    waiting_ms: Array


def run(progress: Callable[[str], None]) -> list[Measurement]:
    """
    Run the five nodes on the wall clock and the probes beside them, all at the same time.

    The arm is in motion nearly all the time: one handover follows the other. For a third of the
    time more, the same is run with timers that are not moved behind their input, and for another
    third in lockstep, as fast as it goes.

    Args:
        progress: is told what goes on.

    Returns:
        Period errors, drift and latency; speed and lost periods in lockstep.

    """
    scenario = make_scenario()
    locked = run_by_the_wall_clock(scenario, DURATION_S, {}, progress)
    alone = {
        node: {'phase_lock': False, 'rate_hz': rate} for node, rate in BESIDE_EACH_OTHER_HZ.items()
    }
    shorter_s = max(DURATION_S / 3.0, MIN_S)
    free = run_by_the_wall_clock(scenario, shorter_s, alone, progress)
    simulated = run_in_lockstep(scenario, shorter_s, progress)
    return [
        *_motion(locked),
        *_periods('dmp', locked, locked.dmp),
        *_periods('priority_ik', locked, locked.ik),
        *_latency(locked, free),
        *_lockstep(simulated, float(np.median(locked.probes['ping']))),
    ]


def _motion(run: WallClockRun) -> list[Measurement]:
    rows = {
        'a handover is on': run.within(run.dmp)[:, 3],
        'the arm moves': run.within(run.joints)[:, 2],
    }
    return [
        Measurement(
            name=f'share of the measured periods in which {what}',
            value=100.0 * float(np.mean(share)),
            unit='%',
            target=IN_MOTION,
            higher_is_better=True,
            note=f'{run.handovers} handovers, one after the other',
        )
        for what, share in rows.items()
    ]


def _periods(node: str, run: WallClockRun, rows: Array) -> list[Measurement]:
    """Compare the periods of a node with those of the probes and of its own input."""
    ticks = run.within(run.ticks[node])
    empty, ordinary, slept = (run.within(run.probes[p]) for p in ('urgent', 'empty', 'sleep'))
    errors = [_errors_ms(np.diff(each)) for each in (empty, ordinary, slept)]
    errors.insert(0, _errors_ms(_recorded_periods(ticks)))
    errors.append(_errors_ms(_input_periods(run.within(rows))))
    found = []
    for share in (50, 99):
        value, floor, at_ordinary_priority, plain, on_arrival = (
            float(np.percentile(e, share)) for e in errors
        )
        found.append(
            Measurement(
                name=f'period error of {node}, {share} %',
                value=value,
                unit='ms',
                target=1.2 * floor if share == 99 else None,
                floor=floor,
                peers={
                    'empty timer, ordinary priority': at_ordinary_priority,
                    'plain sleep loop': plain,
                    'if it answered on arrival': on_arrival,
                },
                note='floor: empty rclpy timer beside it, same executor and priority',
            )
        )
    return [*found, *_pace(node, ticks, empty)]


def _errors_ms(periods: Array) -> Array:
    return np.abs(periods - PERIOD_S) * 1e3


def _recorded_periods(ticks: Array) -> Array:
    """Return the times between the beginnings of periods, s; only where both were recorded."""
    times, numbers = ticks.T
    recorded: Array = np.diff(times)[np.diff(numbers) == 1.0]
    return recorded


def _input_periods(rows: Array) -> Array:
    """Return the times between arrivals of one input and the next, s; between those used alone."""
    stamps, arrivals = rows[:, 1], rows[:, 0] - rows[:, 2]
    new = np.flatnonzero(np.diff(stamps)) + 1
    neighbours = np.diff(stamps[new]) < 1.5 * PERIOD_S
    return np.diff(arrivals[new])[neighbours]


def _pace(node: str, ticks: Array, empty: Array) -> list[Measurement]:
    """Tell whether a node's rate is that of the clock, and whether it loses periods."""
    bare: Array = np.column_stack((empty, np.arange(len(empty))))

    def behind(ticks: Array) -> float:
        """By how many periods the last tick is later than the first one says."""
        duration_s, periods = ticks[-1] - ticks[0]
        return float(duration_s / PERIOD_S - periods)

    def parts_per_million(periods: float) -> float:
        return float(abs(periods) * PERIOD_S / (ticks[-1, 0] - ticks[0, 0]) * 1e6)

    periods = int(ticks[-1, 1] - ticks[0, 1]) + 1
    return [
        Measurement(
            name=f'periods lost by {node}',
            value=_lost(ticks),
            unit='periods',
            target=_lost(bare),
            floor=_lost(bare),
            note=f'of {periods}, {periods - len(ticks)} of them unseen by the recorder; '
            'floor and target: empty rclpy timer beside it',
        ),
        Measurement(
            name=f'drift of {node} from 200 Hz',
            value=parts_per_million(behind(ticks)),
            unit='ppm',
            target=parts_per_million(abs(behind(bare)) + 1.0),
            floor=parts_per_million(behind(bare)),
            note='floor: empty rclpy timer beside it; target: one period more in the whole time',
        ),
    ]


def _lost(ticks: Array) -> float:
    """Count the periods that are missing; a timer that is moved may gain one, and loses none."""
    between_s, numbers = np.diff(ticks, axis=0).T
    return max(float(np.sum(np.rint(between_s / PERIOD_S) - numbers)), 0.0)


def _latency(locked: WallClockRun, free: WallClockRun) -> list[Measurement]:
    answers, left_alone = _answers(locked), _answers(free)
    names = {
        'hand pose to joint velocity': (locked, answers),
        'hand pose to joint velocity, timers left alone': (free, left_alone),
    }
    notes = (
        'from publication to reception of the first command that follows from it: three hops; '
        'floor: bare round trip of a JointState between two processes, two hops',
        'the same, timers not moved behind their input, at every offset from it',
    )
    return [
        Measurement(
            name=f'{name}, {share} %',
            value=float(np.percentile(found.latency_ms, share)),
            unit='ms',
            floor=float(np.percentile(run.probes['ping'], share)) * 1e3,
            peers={
                'on arrival, without waiting for a timer': float(
                    np.percentile(found.latency_ms - found.waiting_ms, share)
                )
            },
            note=note,
        )
        for (name, (run, found)), note in zip(names.items(), notes, strict=True)
        for share in (50, 99)
    ]


def _lockstep(run: LockstepRun, round_trip_s: float) -> list[Measurement]:
    return [
        Measurement(
            name='five nodes in lockstep',
            value=run.speed,
            unit='times real time',
            target=1.0,
            floor=PERIOD_S / (MESSAGES_IN_TURN / 2 * round_trip_s),
            higher_is_better=True,
            note=f'as fast as it goes, {run.handovers} handovers, one after the other; '
            'floor: nothing but the four messages of a period that wait for each other',
        ),
        *(
            Measurement(
                name=f'periods lost by {node} in lockstep',
                value=_lost(rows),
                unit='periods',
                target=0.0,
                note=f'of {rows[-1, 1] - rows[0, 1] + 1.0:.0f}',
            )
            for node, rows in run.ticks.items()
        ),
    ]


def _answers(run: WallClockRun) -> _Answers:
    """
    Follow each pose of the hand through the periods that used it.

    A joint command names the period of `priority_ik` that it answers, that period the wrist
    command, and the period of `dmp` which made that names the newest pose it knew.
    """
    # the same whole number of nanoseconds gives the same float, so these match exactly
    solved = {row[0]: row[1:] for row in run.ik.tolist()}
    stepped = {row[0]: row[1:] for row in run.dmp.tolist()}
    chain = []
    traced = True
    for period_s, heard_s, moves in run.joints.tolist():
        stamp_s, command_age_s = solved.get(period_s, (None, 0.0))
        known_s, hand_age_s, handing_over = stepped.get(stamp_s, (np.nan, 0.0, 0.0))
        # after a period that the recorder missed, nobody knows what was answered in that
        counts = moves and handing_over and traced
        traced = bool(np.isfinite(known_s))
        if traced:
            chain.append((known_s, heard_s, hand_age_s + command_age_s, counts))
    known, heard, waiting, moving = np.array(chain).T
    published, stamps = run.within(run.hand).T
    answer = np.searchsorted(np.maximum.accumulate(known), stamps)
    answered = answer < len(known)
    answer, published = answer[answered], published[answered]
    # a pose from before the start has nothing to answer it
    begun = run.dmp[np.searchsorted(run.dmp[:, 0], published) - 1, 3]
    shown = (moving[answer] > 0.0) & (begun > 0.0)
    answer, published = answer[shown], published[shown]
    return _Answers((heard[answer] - published) * 1e3, waiting[answer] * 1e3)
