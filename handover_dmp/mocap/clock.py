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
Clocks that are set back during a recording.

When a simulation is reset or a computer's clock is set, the stamps of the messages jump back. The
following motion then has the same times as the one before; sorted by stamp, the two would be
mixed. This differs from a few late messages: after those, the stamps are ahead again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

# Largest number of late messages, and largest lateness.
_MAX_LATE = 3
_MAX_LATE_NS = 250_000_000
# If several clocks are set at once: longest time between the first and the last.
_AT_ONCE_NS = 1_000_000_000
# Number of messages in the blocks whose delays are compared, and largest usual difference.
_BLOCK = 10
STEP_NS = 100_000_000
# Largest sensible number of parts.
_MAX_JUMPS = 1000


def jumps_back(times_ns: NDArray[np.int64]) -> list[int]:
    """
    Find where a clock was set back.

    Args:
        times_ns: (n,) stamps in the order of recording.

    Returns:
        Index of the first time after each jump.

    """
    jumps: list[int] = []
    begin = 0
    while len(jumps) < _MAX_JUMPS:
        part = times_ns[begin:]
        ahead = np.maximum.accumulate(part)
        back = np.flatnonzero(part[1:] < ahead[:-1]) + 1
        jump = next((int(at) for at in back if _stays_back(part, ahead, int(at))), None)
        if jump is None:
            break
        begin += jump
        jumps.append(begin)
    return jumps


def clock_step(delays_ns: NDArray[np.int64]) -> int:
    """
    Find a step of the stamps relative to the times of recording.

    A step means that a clock was set forward, or set back by less than the accompanying silence,
    or that a simulation stood still. Delayed messages that arrive in a burst are no step: later
    delays are as before. A simulated clock that constantly runs fast or slow is no step either.

    Args:
        delays_ns: (n,) from stamp to recording, in the order of recording.

    Returns:
        The step, ns, positive if the stamps jumped ahead; 0 if there was none.

    """
    blocks = [delays_ns[at: at + _BLOCK] for at in range(0, len(delays_ns), _BLOCK)]  # fmt: skip
    if len(blocks) < 3:
        return 0
    usual = np.array([np.median(block) for block in blocks])
    usual -= np.median(np.diff(usual)) * np.arange(len(usual))
    for number in np.flatnonzero(np.abs(usual[2:] - usual[:-2]) > STEP_NS) + 1:
        after = number + 1
        step = np.median(usual[:number]) - np.median(usual[after:])
        if abs(step) > STEP_NS:
            return int(step)
    return 0


def parts_of(
    logs_ns: Sequence[NDArray[np.int64]], jumps: Sequence[Sequence[int]]
) -> list[list[slice]]:
    """
    Cut several streams at the jumps of any of them.

    Args:
        logs_ns: for each stream, the times of recording.
        jumps: for each stream, the index of the first message after each of its jumps.

    Returns:
        For each part, a slice of each stream.

    """
    edges = [[0, *indices, len(log_ns)] for log_ns, indices in zip(logs_ns, jumps, strict=True)]
    if len({len(edge) for edge in edges}) > 1:
        # Streams whose clocks were not set are cut at the same moments.
        moments: list[int] = []
        for moment in sorted(
            int(log_ns[index])
            for log_ns, indices in zip(logs_ns, jumps, strict=True)
            for index in indices
        ):
            if not moments or moment - moments[-1] > _AT_ONCE_NS:
                moments.append(moment)
        edges = [
            [0, *np.searchsorted(log_ns, moments).tolist(), len(log_ns)] for log_ns in logs_ns
        ]
    return [
        [slice(edge[part], edge[part + 1]) for edge in edges] for part in range(len(edges[0]) - 1)
    ]


def _stays_back(part: NDArray[np.int64], ahead: NDArray[np.int64], at: int) -> bool:
    before = ahead[at - 1]
    if before - part[at] > _MAX_LATE_NS:
        return True
    following = part[at:][: _MAX_LATE + 1]
    return len(following) > _MAX_LATE and bool((following < before).all())
