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
The legs of a recorded session: the give and the take, each as a separate handover.

A leg lasts from a little before its reach until the wrist is home again. As a run it ends, `done`,
with its exchange, so that all measures of a handover apply to a leg.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.mocap.trial import DIRECTIONS
from handover_dmp.report.recorded_run import RunRecord
import numpy as np

BEFORE_S = 0.3
"""Time before a reach that belongs to its leg, s."""
AFTER_S = 0.2
"""Time after an exchange that belongs to its leg, s."""
WITHDRAWN = ('released', 'withdrawing', 'waiting', 'done')
"""States that follow an exchange if the object has changed hands."""
TRACKS = (
    ('hand_times', 'hand_positions'),
    ('fused_times', 'fused_positions'),
    ('demonstrator_times', 'demonstrator_positions'),
    ('wrist_times', 'wrist_positions'),
    ('command_times', 'command_positions'),
    ('twist_times', 'twist_velocities'),
    ('joint_times', 'joint_positions', 'joint_velocities'),
    ('joint_command_times', 'joint_commands'),
    ('wrench_times', 'wrench_forces'),
    ('object_times', 'object_positions'),
)


@dataclass(frozen=True, eq=False)
class SessionLeg:
    """
    A handover of a session.

    Attributes:
        direction: `give` or `take`.
        run: the recorded reach and exchange, as a separate run.
        end_s: time at which the wrist is home or the next leg begins, s.
        home_s: time at which the wrist was home again, s; None if it never was.

    """

    direction: str
    run: RunRecord
    end_s: float
    home_s: float | None


def legs_of(run: RunRecord) -> list[SessionLeg]:
    """
    Find the handovers of a session.

    Args:
        run: the session.

    Returns:
        One leg per reach, in order, of all recorded sessions.

    """
    begins = [time_s for time_s, state in run.states if state == 'reaching']
    ends = [*(begin - BEFORE_S for begin in begins[1:]), run.end_time_s]
    legs = []
    for number, (begin_s, end_s) in enumerate(zip(begins, ends, strict=True)):
        direction = DIRECTIONS[number % len(DIRECTIONS)]
        within = [one for one in run.states if begin_s <= one[0] < max(end_s, begin_s + BEFORE_S)]
        home_s = next((at for at, state in within if state in ('waiting', 'done')), None)
        states = _states_of_leg(within)
        until_s = states[-1][0] + AFTER_S if states[-1][1] == 'done' else end_s
        leg = _cut(run, begin_s - BEFORE_S, min(until_s, end_s))
        leg = replace(leg, states=states, info=_info_of_leg(run.info, direction))
        legs.append(SessionLeg(direction, leg, end_s if home_s is None else home_s, home_s))
    return legs


def _states_of_leg(within: list[tuple[float, str]]) -> tuple[tuple[float, str], ...]:
    """Return the states until the end of the exchange, then done, unless it was aborted."""
    found: list[tuple[float, str]] = []
    for time_s, state in within:
        if found and found[-1][1] == 'exchange' and state in WITHDRAWN:
            return (*found, (time_s, 'done'))
        found.append((time_s, state))
    return tuple(found)


def _info_of_leg(info: Mapping[str, Any], direction: str) -> dict[str, Any]:
    """Replace the facts of the whole session by those of one leg."""
    own = (info.get('legs') or {}).get(direction) or {}
    return {**info, 'exchange': direction, **own}


def _cut(run: RunRecord, begin_s: float, end_s: float) -> RunRecord:
    parts: dict[str, Any] = {}
    for times, *values in TRACKS:
        within = _within(getattr(run, times), begin_s, end_s)
        for name in (times, *values):
            parts[name] = getattr(run, name)[within]
    for times, values_by_name in (('phase_times', 'phase'), ('ik_times', 'ik')):
        within = _within(getattr(run, times), begin_s, end_s)
        parts[times] = getattr(run, times)[within]
        named = getattr(run, values_by_name)
        parts[values_by_name] = {name: values[within] for name, values in named.items()}
    parts['trackers'] = {
        name: tuple(values[_within(times, begin_s, end_s)] for values in (times, positions))
        for name, (times, positions) in run.trackers.items()
    }
    return replace(run, **parts)


def _within(times: Array, begin_s: float, end_s: float) -> Any:
    return np.flatnonzero((times >= begin_s) & (times <= end_s))
