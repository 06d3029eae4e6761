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

"""The graph in real time: periods, drift and latency beside what the machine can do at best."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import subprocess
import sys
from tempfile import TemporaryDirectory

from handover_dmp.bench.measurement import Measurement
from handover_dmp.recording import read_bag
from handover_dmp.run import keep_inputs
from handover_dmp.scenario import make_scenario
from handover_dmp.topics import HAND_POSE, IK_STATUS, POSE_COMMAND
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PERIOD_S = 0.005
DURATION_S = float(os.environ.get('HANDOVER_DMP_BENCH_SECONDS', '60'))
START_AND_END_S = 2.0
PROBES = ('empty', 'urgent', 'sleep', 'echo', 'ping')


def run(progress: Callable[[str], None]) -> list[Measurement]:
    """
    Run the five nodes on the wall clock and the probes beside them, all at the same time.

    Args:
        progress: is told what goes on.

    Returns:
        Period errors, drift and latency.

    """
    from handover_dmp.nodes.conduct import graph_parameters
    from handover_dmp.nodes.graph import Graph

    with TemporaryDirectory() as name:
        folder = Path(name)
        scenario = make_scenario()
        keep_inputs(folder, scenario)
        parameters = graph_parameters(folder, scenario, {}, lockstep=False)
        progress('starting the graph')
        with Graph(folder, parameters, lockstep=False) as graph:
            progress(f'measuring for {DURATION_S:.0f} s')
            probes = [_start(probe, folder) for probe in PROBES]
            graph.call('/hand_tracker/replay')
            while any(probe.poll() is None for probe in probes):
                graph.spin()
        progress('reading the bag')
        ordinary, empty, slept = (_times(folder / probe) for probe in PROBES[:3])
        span = empty[0] + START_AND_END_S, empty[-1] - START_AND_END_S
        hand, command, solved = (
            times[(times > span[0]) & (times < span[1])] for times in _recorded(folder / 'bag')
        )
        round_trip = _times(folder / 'ping')
    return [
        *_periods('dmp', command, empty, ordinary, slept),
        *_periods('priority_ik', solved, empty, ordinary, slept),
        *_latency(hand, command, solved, round_trip),
    ]


def _start(probe: str, folder: Path) -> subprocess.Popen[bytes]:
    words = [sys.executable, '-m', 'handover_dmp.nodes.probes']
    return subprocess.Popen([*words, probe, str(DURATION_S), str(folder / probe)])


def _times(file: Path) -> Array:
    return np.array(file.read_text(encoding='utf-8').split(), dtype=float)


def _recorded(bag: Path) -> tuple[Array, Array, Array]:
    """Stamps of the hand and of the wrist commands, and when the joints were solved for, s."""
    found: dict[str, list[float]] = {t.name: [] for t in (HAND_POSE, POSE_COMMAND, IK_STATUS)}
    for topic, message, _ in read_bag(bag, list(found)):
        if topic == IK_STATUS.name:
            found[topic].append(message.data[0])
        else:
            stamp = message.header.stamp
            found[topic].append(stamp.sec + stamp.nanosec * 1e-9)
    hand, command, solved = (np.array(times) for times in found.values())
    return hand, command, solved


def _periods(
    node: str, times: Array, empty: Array, ordinary: Array, slept: Array
) -> list[Measurement]:
    def errors_ms(of: Array) -> Array:
        return np.abs(np.diff(of) - PERIOD_S) * 1e3

    errors = [errors_ms(each) for each in (times, empty, ordinary, slept)]
    rows = []
    for share in (50, 99):
        value, floor, at_ordinary_priority, plain = (
            float(np.percentile(e, share)) for e in errors
        )
        rows.append(
            Measurement(
                name=f'period error of {node}, {share} %',
                value=value,
                unit='ms',
                target=1.2 * floor if share == 99 else None,
                floor=floor,
                peers={
                    'empty timer, ordinary priority': at_ordinary_priority,
                    'plain sleep loop': plain,
                },
                note='floor: empty rclpy timer beside it, same executor and priority',
            )
        )
    rate = (len(times) - 1) / (times[-1] - times[0])
    bare_rate = (len(empty) - 1) / (empty[-1] - empty[0])
    return [
        *rows,
        Measurement(
            name=f'drift of {node} from 200 Hz',
            value=abs(rate * PERIOD_S - 1.0) * 1e6,
            unit='ppm',
            floor=abs(bare_rate * PERIOD_S - 1.0) * 1e6,
            note='floor: empty rclpy timer beside it',
        ),
    ]


def _latency(hand: Array, command: Array, solved: Array, round_trip: Array) -> list[Measurement]:
    """From the stamp of a hand pose to the solution for the next wrist command."""
    following = np.searchsorted(command, hand)
    answered = following < len(command)
    answers = np.searchsorted(solved, command[following[answered]])
    in_time = answers < len(solved)
    latency = (solved[answers[in_time]] - hand[answered][in_time]) * 1e3
    return [
        Measurement(
            name=f'hand pose to joint velocity, {share} %',
            value=float(np.percentile(latency, share)),
            unit='ms',
            floor=float(np.percentile(round_trip, share)) * 1e3,
            note='floor: bare round trip of a JointState between two processes',
        )
        for share in (50, 99)
    ]
