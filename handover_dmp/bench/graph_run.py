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

"""Runs of the graph with probes beside it, and the data from their bags."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, ExitStack
from dataclasses import dataclass
from pathlib import Path
import subprocess
import sys
from tempfile import TemporaryDirectory
from time import monotonic, time
from typing import Any

from handover_dmp.bench.empty_graph import EmptyGraph, keep_messages
from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import HandoverError
from handover_dmp.handover.scenario import Scenario
from handover_dmp.nodes.graph import Graph
from handover_dmp.nodes.run_graph import graph_parameters
from handover_dmp.recording import read_bag
from handover_dmp.runs.folder import keep_inputs
from handover_dmp.topics import (
    DEMONSTRATOR_POSE,
    HAND_POSE,
    IK_STATUS,
    names_of_values,
    PHASE,
    STATE,
)
import numpy as np
from psutil import Process

KEEPING_S = 10.0
SETTLING_S = 3.0
"""Time until the graph runs evenly with the probes beside it, s."""
MAX_WAIT_S = 60.0
ROUNDING_S = 1e-6
PROBES = ('empty', 'sleep', 'echo', 'ping', 'listener')
CONDUCTOR = 'conductor'
HAND_RATE_HZ = 199.0
"""Rate of the hand: its poses come at every phase of the periods of `dmp`, as a tracker's do."""
LEAD_S = 0.1
"""Time from the return of the hand until its next start, s."""


@dataclass(frozen=True)
class WallClockRun:
    """
    Data of a run on the wall clock; all times are wall-clock times.

    Attributes:
        hand: (n, 2) time of publication of a pose, and its stamp, s.
        dmp: (n, 3) start of a period, stamp of the newest known pose, s; 1 during a handover.
        ik: (n, 2) start of a period, stamp of the wrist command that it used, s.
        joints: (n, 3) period that a joint command answers, time of reception, s; 1 if it moves.
        ticks: by node, (n, 2) start of a period, s, and its number.
        probes: by name, the data of the probe.
        handovers: number of completed handovers, including those outside the measured time.
        span: start and end of the measured time, s.

    """

    hand: Array
    dmp: Array
    ik: Array
    joints: Array
    ticks: dict[str, Array]
    probes: dict[str, Array]
    handovers: int
    span: tuple[float, float]

    def within(self, rows: Array) -> Array:
        """Return the rows whose first column is within the measured time."""
        times = rows if rows.ndim == 1 else rows[:, 0]
        return rows[(times > self.span[0]) & (times < self.span[1])]


@dataclass(frozen=True)
class LockstepRun:
    """
    Data of a run on simulated time.

    Attributes:
        speed: speed of simulated time, in multiples of real time.
        ticks: by node, (n, 2) start of a period, s of simulated time, and its number.
        handovers: number of completed handovers.
        empty_speed: the same speed for five empty nodes that exchange the same messages.

    """

    speed: float
    ticks: dict[str, Array]
    handovers: int
    empty_speed: float


@dataclass(frozen=True)
class IdleRun:
    """
    The cost of a graph that waits for a handover, on the wall clock.

    Attributes:
        shares: processor time by node, % of a core.
        empty_shares: the same for five empty nodes that exchange the same messages meanwhile.
        growth_kb: growth of the bag per minute, kB.

    """

    shares: dict[str, float]
    empty_shares: dict[str, float]
    growth_kb: float


def run_by_the_wall_clock(
    scenario: Scenario,
    duration_s: float,
    progress: Callable[[str], None],
) -> WallClockRun:
    """
    Run the five nodes and the probes beside them, one handover after the other.

    Args:
        scenario: the scenario.
        duration_s: measured time, s.
        progress: called with the present step.

    Returns:
        The data of the run.

    Raises:
        HandoverError: no handover was completed, or a probe does not run.

    """
    with TemporaryDirectory() as name:
        folder = Path(name)
        with _graph(folder, scenario, progress) as graph, ExitStack() as running:
            for probe in PROBES:
                running.enter_context(_probe(probe, folder))
            _wait_for_probes(graph, folder)
            progress(f'measuring for {duration_s:.0f} s')
            graph.linger(SETTLING_S)
            begun_s = time()
            graph.linger(duration_s)
            span = begun_s, time()
        progress('reading the bag')
        return _read(folder, span)


def run_in_lockstep(
    scenario: Scenario, duration_s: float, messages: Path, progress: Callable[[str], None]
) -> LockstepRun:
    """
    Run the five nodes on simulated time at full speed, one handover after the other.

    The same follows with five empty nodes.

    Args:
        scenario: the scenario.
        duration_s: measured time, s of simulated time.
        messages: file to write, with a message of each kind.
        progress: called with the present step.

    Returns:
        The data of the run.

    Raises:
        HandoverError: no handover was completed.

    """
    with TemporaryDirectory() as name:
        folder = Path(name)
        with _graph(folder, scenario, progress, lockstep=True) as graph:
            keep_messages(graph, messages, KEEPING_S)
            progress(f'measuring for {duration_s:.0f} s of simulated time')
            speed = _speed(graph, duration_s)
        progress('reading the bag')
        ticks, handovers = _ticks(folder)
        progress('the same with five empty nodes')
        with EmptyGraph(folder / 'empty', messages, lockstep=True) as empty:
            empty.pause(False)
            empty.linger(SETTLING_S)
            empty_speed = _speed(empty, duration_s)
    return LockstepRun(speed, ticks, handovers, empty_speed)


def run_idle(
    scenario: Scenario, duration_s: float, messages: Path, progress: Callable[[str], None]
) -> IdleRun:
    """
    Run the five nodes on the wall clock without a handover, and five empty nodes beside them.

    Args:
        scenario: the scenario, which is not started.
        duration_s: measured time, s.
        messages: file with a message of each kind.
        progress: called with the present step.

    Returns:
        The cost.

    """
    with TemporaryDirectory() as name:
        folder = Path(name)
        keep_inputs(folder, scenario)
        parameters = graph_parameters(folder, scenario, {}, False)
        parameters['recorder']['rest_s'] = SETTLING_S
        progress('starting an idle graph, and an empty one')
        with (
            Graph(folder, parameters, lockstep=False, namespace='/idle') as idle,
            EmptyGraph(folder / 'empty', messages, lockstep=False, namespace='/empty') as empty,
        ):
            progress(f'measuring for {duration_s:.0f} s')
            idle.linger(2 * SETTLING_S)
            begun_s, size = monotonic(), _size(folder / 'bag')
            used_s = [_processor_s(graph) for graph in (idle, empty)]
            idle.linger(duration_s)
            took_s = monotonic() - begun_s
            shares, empty_shares = (
                {node: 100.0 * (now_s - before[node]) / took_s for node, now_s in now.items()}
                for before, now in zip(used_s, map(_processor_s, (idle, empty)), strict=True)
            )
            growth_kb = (_size(folder / 'bag') - size) / 1e3 * 60.0 / took_s
    return IdleRun(shares, empty_shares, growth_kb)


def _speed(graph: Graph, duration_s: float) -> float:
    """Measure the speed of simulated time, in multiples of real time, over some seconds of it."""
    begun_s, simulated_s = monotonic(), graph.time_s
    graph.linger(duration_s)
    return (graph.time_s - simulated_s) / (monotonic() - begun_s)


def _processor_s(graph: Graph) -> dict[str, float]:
    """Return the processor time that each node has used, s."""
    times = {name: Process(one.pid).cpu_times() for name, one in graph.processes.items()}
    return {name: float(time.user + time.system) for name, time in times.items()}


def _size(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.iterdir())


@contextmanager
def _graph(
    folder: Path,
    scenario: Scenario,
    progress: Callable[[str], None],
    *,
    lockstep: bool = False,
) -> Iterator[Graph]:
    """Run the five nodes, one handover after the other; the block starts after the first."""
    keep_inputs(folder, scenario)
    parameters = graph_parameters(folder, scenario, {}, lockstep)
    # the conductor starts each handover once the hand is back
    parameters['dmp']['start'] = 'service'
    parameters['hand_tracker'] |= {'lead_s': LEAD_S, 'replay_at_s': -1.0}
    if not lockstep:
        parameters['hand_tracker']['rate_hz'] = HAND_RATE_HZ
    progress('starting the graph')
    with Graph(folder, parameters, lockstep=lockstep) as graph, _probe(CONDUCTOR, folder):
        if lockstep:
            graph.pause(False)
        if not graph.wait_for_state(('done',), MAX_WAIT_S, lambda: None):
            raise HandoverError(f'no handover within {MAX_WAIT_S:.0f} s')
        yield graph


@contextmanager
def _probe(name: str, folder: Path) -> Iterator[None]:
    words = [sys.executable, '-m', 'handover_dmp.bench.probes', name, str(folder / name)]
    process = subprocess.Popen(words)
    try:
        yield
    finally:
        process.terminate()
        process.wait()


def _wait_for_probes(graph: Graph, folder: Path) -> None:
    deadline_s = monotonic() + MAX_WAIT_S
    while absent := [name for name in PROBES if not (folder / name).exists()]:
        graph.spin()
        if monotonic() > deadline_s:
            raise HandoverError(f'{absent[0]} does not run within {MAX_WAIT_S:.0f} s')


def _read(folder: Path, span: tuple[float, float]) -> WallClockRun:
    """Combine the data of the probes and the recorder."""
    stamps: dict[str, list[float]] = {HAND_POSE.name: [], DEMONSTRATOR_POSE.name: []}
    dmp, ik = [], []
    for topic, message, _ in read_bag(folder / 'bag', [*stamps, PHASE.name, IK_STATUS.name]):
        if topic in stamps:
            stamp = message.header.stamp
            stamps[topic].append((stamp.sec * 10**9 + stamp.nanosec) / 1e9)
        elif topic == PHASE.name:
            dmp.append(_float_array(message, 'time_s', 'hand_stamp_s', 'phase'))
        else:
            ik.append(_float_array(message, 'time_s', 'command_stamp_s'))
    ticks, handovers = _ticks(folder)
    hand, person = map(np.array, stamps.values())
    # `hand_tracker` stamps the person's pose with its own time, the hand's with the pose's time
    published = np.searchsorted(person, hand - ROUNDING_S)
    seen = published < len(person)
    probes = {
        name: np.array((folder / name).read_text(encoding='utf-8').split(), dtype=float)
        for name in PROBES
    }
    return WallClockRun(
        hand=np.column_stack((person[published[seen]], hand[seen])),
        dmp=_with_motion(np.array(dmp)),
        ik=np.array(ik),
        joints=probes['listener'].reshape(-1, 3),
        ticks=ticks,
        probes=probes,
        handovers=handovers,
        span=span,
    )


def _ticks(folder: Path) -> tuple[dict[str, Array], int]:
    """Read the periods of each node: times, s, and numbers; and count the handovers."""
    nodes = {PHASE.name: 'dmp', IK_STATUS.name: 'priority_ik'}
    ticks: dict[str, list[list[float]]] = {node: [] for node in nodes.values()}
    handovers = 0
    for topic, message, _ in read_bag(folder / 'bag', [*nodes, STATE.name]):
        if topic == STATE.name:
            handovers += message.data == 'done'
        else:
            ticks[nodes[topic]].append(_float_array(message, 'time_s', 'period'))
    return {node: np.array(rows) for node, rows in ticks.items()}, handovers


def _float_array(message: Any, *names: str) -> list[float]:
    values = dict(zip(names_of_values(message), message.data, strict=True))
    return [values[name] for name in names]


def _with_motion(dmp: Array) -> Array:
    """Replace the last column by whether a handover is active, which moves the phase."""
    falls = np.diff(dmp[:, 2], prepend=np.inf) < 0.0
    return np.column_stack((dmp[:, :2], falls))
