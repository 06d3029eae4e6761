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

"""The graph: periods, drift, latency and speed, compared with the limits of the machine."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
from tempfile import TemporaryDirectory

from handover_dmp.bench.graph_run import (
    IdleRun,
    LockstepRun,
    run_by_the_wall_clock,
    run_idle,
    run_in_lockstep,
    WallClockRun,
)
from handover_dmp.bench.measurement import Measurement
from handover_dmp.common.arrays import Array
from handover_dmp.handover.scenario import make_scenario
import numpy as np

PERIOD_S = 0.005
DURATION_S = float(os.environ.get('HANDOVER_DMP_BENCH_SECONDS', '60'))
MIN_S = 5.0
MAX_LATENCY_MS = 5.0
"""Target of the median latency from a hand pose to joint velocities."""
MESSAGES_IN_TURN = 4
"""Sequential messages of a period in lockstep: joint states, wrist, command, velocities."""
MIN_SPEED = 1.6
MAX_IDLE = 50.0
MAX_GROWTH_KB = 50.0
EMPTY = 'five empty nodes, the same messages'
IN_MOTION = 80.0
"""Least share of periods in motion for meaningful figures, %."""


def run(progress: Callable[[str], None]) -> list[Measurement]:
    """
    Run the five nodes on the wall clock and the probes beside them, all at the same time.

    The arm is nearly always in motion: one handover follows the other. Two further runs take a
    third of the time each: in lockstep at full speed, and idle; each is compared with five empty
    nodes that exchange the same messages.

    Args:
        progress: called with the present step.

    Returns:
        Period errors, drift and latency; speed and lost periods in lockstep; the cost at rest.

    """
    scenario = make_scenario()
    timed = run_by_the_wall_clock(scenario, DURATION_S, progress)
    shorter_s = max(DURATION_S / 3.0, MIN_S)
    with TemporaryDirectory() as folder:
        messages = Path(folder) / 'messages.json'
        simulated = run_in_lockstep(scenario, shorter_s, messages, progress)
        idle = run_idle(scenario, shorter_s, messages, progress)
    return [
        *_motion(timed),
        *_periods(timed),
        *_latency(timed),
        *_lockstep(simulated, float(np.median(timed.probes['ping']))),
        *_idle(idle),
    ]


def _motion(run: WallClockRun) -> list[Measurement]:
    rows = {
        'a handover is on': run.within(run.dmp)[:, 2],
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


def _periods(run: WallClockRun) -> list[Measurement]:
    """Compare the periods of `dmp` with those of the probes."""
    ticks, empty = run.within(run.ticks['dmp']), run.within(run.probes['empty'])
    times, numbers = ticks.T
    # only periods of which the recorder has both ends
    errors = _errors_ms(np.diff(times)[np.diff(numbers) == 1.0])
    floors = _errors_ms(np.diff(empty))
    peers = {'plain sleep loop': _errors_ms(np.diff(run.within(run.probes['sleep'])))}
    found = []
    for share in (50, 99):
        floor = float(np.percentile(floors, share))
        found.append(
            Measurement(
                name=f'period error of dmp, {share} %',
                value=float(np.percentile(errors, share)),
                unit='ms',
                target=1.2 * floor if share == 99 else None,
                floor=floor,
                peers={name: float(np.percentile(peer, share)) for name, peer in peers.items()},
                note='floor: empty rclpy timer beside it, same executor and priority',
            )
        )
    return [*found, *_pace(ticks, empty)]


def _errors_ms(periods: Array) -> Array:
    return np.abs(periods - PERIOD_S) * 1e3


def _pace(ticks: Array, empty: Array) -> list[Measurement]:
    """Measure the drift of `dmp` from the clock, and its lost periods."""
    bare: Array = np.column_stack((empty, np.arange(len(empty))))

    def behind(ticks: Array) -> float:
        """Return the delay of the last tick, relative to the first, in periods."""
        duration_s, periods = ticks[-1] - ticks[0]
        return float(duration_s / PERIOD_S - periods)

    def parts_per_million(periods: float) -> float:
        return float(abs(periods) * PERIOD_S / (ticks[-1, 0] - ticks[0, 0]) * 1e6)

    periods = int(ticks[-1, 1] - ticks[0, 1]) + 1
    return [
        Measurement(
            name='periods lost by dmp',
            value=_lost(ticks),
            unit='periods',
            target=_lost(bare),
            floor=_lost(bare),
            note=f'of {periods}, {periods - len(ticks)} of them unseen by the recorder; '
            'floor and target: empty rclpy timer beside it',
        ),
        Measurement(
            name='drift of dmp from 200 Hz',
            value=parts_per_million(behind(ticks)),
            unit='ppm',
            target=parts_per_million(abs(behind(bare)) + 1.0),
            floor=parts_per_million(behind(bare)),
            note='floor: empty rclpy timer beside it; target: one period more in the whole time',
        ),
    ]


def _lost(ticks: Array) -> float:
    """Count the missing periods between ticks, (n, 2): time in s, number."""
    between_s, numbers = np.diff(ticks, axis=0).T
    return max(float(np.sum(np.rint(between_s / PERIOD_S) - numbers)), 0.0)


def _latency(run: WallClockRun) -> list[Measurement]:
    latency_ms = _latencies_ms(run)
    return [
        Measurement(
            name=f'hand pose to joint velocity, {share} %',
            value=float(np.percentile(latency_ms, share)),
            unit='ms',
            target=MAX_LATENCY_MS if share == 50 else None,
            floor=float(np.percentile(run.probes['ping'], share)) * 1e3,
            note='from publication to reception of the first command that follows from it: three '
            'hops and half a period of dmp; floor: bare round trip of a JointState, two hops',
        )
        for share in (50, 99)
    ]


def _lockstep(run: LockstepRun, round_trip_s: float) -> list[Measurement]:
    return [
        Measurement(
            name='five nodes in lockstep',
            value=run.speed,
            unit='times real time',
            target=MIN_SPEED,
            floor=PERIOD_S / (MESSAGES_IN_TURN / 2 * round_trip_s),
            peers={EMPTY: run.empty_speed},
            higher_is_better=True,
            note=f'as fast as it goes, {run.handovers} handovers, one after the other; {_load()}; '
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


def _idle(run: IdleRun) -> list[Measurement]:
    nodes = ', '.join(f'{node} {share:.1f}' for node, share in run.shares.items())
    return [
        Measurement(
            name='five idle nodes on the wall clock, processor time',
            value=sum(run.shares.values()),
            unit='% of a core',
            target=MAX_IDLE,
            peers={EMPTY: sum(run.empty_shares.values())},
            note=f'{nodes}; {_load()}',
        ),
        Measurement(
            name='bag of an idle graph, growth',
            value=run.growth_kb,
            unit='kB/min',
            target=MAX_GROWTH_KB,
        ),
    ]


def _load() -> str:
    return f'load of the machine {os.getloadavg()[0]:.1f}'


def _latencies_ms(run: WallClockRun) -> Array:
    """
    Follow each hand pose through the periods that used it, during handovers.

    A joint command names the period of `priority_ik` that it answers; that period names the wrist
    command; and the period of `dmp` that made it names the newest pose it knew. The latency is the
    time from the tracker's period that published a pose to the reception of the first joint
    command that follows from this pose or a newer one.
    """
    # equal integers of nanoseconds give equal floats, so these match exactly
    solved = dict(run.ik.tolist())
    stepped = {row[0]: row[1:] for row in run.dmp.tolist()}
    chain = []
    traced = True
    for period_s, heard_s, moves in run.joints.tolist():
        known_s, handing_over = stepped.get(solved.get(period_s), (np.nan, 0.0))
        # after a period that the recorder missed, its answer is unknown
        counts = moves and handing_over and traced
        traced = bool(np.isfinite(known_s))
        if traced:
            chain.append((known_s, heard_s, counts))
    known, heard, moving = np.array(chain).T
    published, stamps = run.within(run.hand).T
    answer = np.searchsorted(np.maximum.accumulate(known), stamps)
    answered = answer < len(known)
    answer, published = answer[answered], published[answered]
    # no command answers a pose from before the start
    begun = run.dmp[np.searchsorted(run.dmp[:, 0], published) - 1, 2]
    shown = (moving[answer] > 0.0) & (begun > 0.0)
    latencies_ms: Array = (heard[answer[shown]] - published[shown]) * 1e3
    return latencies_ms
