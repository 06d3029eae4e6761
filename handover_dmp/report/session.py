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

"""Measures of a recorded session as a whole: states, object, releases."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.mocap.fluency import fluency_of_motions
from handover_dmp.report.legs import legs_of, SessionLeg
from handover_dmp.report.metrics import measure, Numbers
from handover_dmp.report.motion import resample
from handover_dmp.report.motions import compare_motions, low_passed_track
from handover_dmp.report.recorded_run import RunRecord
import numpy as np

OF_SESSIONS = ('picking_up', 'released', 'withdrawing', 'waiting')
"""States that a single handover does not have."""
OF_THE_WHOLE = ('states', 'topics', 'nodes', 'trackers', 'simulated_clock', 'duration_s')
"""Measures of a run that are reported once, not for each leg."""
RECEIVER = {'give': 'partner', 'take': 'robot'}
"""Holder of the object after a leg."""
FELT_S = 0.06
"""Time before a release at which the force on the wrist is evaluated, s."""
AT_REST_S = 0.2
"""Time before a reach over which the weight is measured, s."""
WEIGHTLESS_N = 0.1
"""Least weight of an object whose shares can be measured, N."""


def is_session(run: RunRecord) -> bool:
    """
    Tell whether a run is a session.

    Args:
        run: the run.

    Returns:
        Whether the run says so, or contains a state that a single handover does not have.

    """
    said = run.info.get('exchange') == 'session'
    return said or any(state in OF_SESSIONS for _, state in run.states)


def session_facts(run: RunRecord) -> Numbers:
    """
    Measure a session.

    Args:
        run: the session.

    Returns:
        `legs`, each with the measures of a single handover and `release`, how the object changed
        hands; `timeline` of the states; `fluency` of partner and `robot`, and of partner and
        `person` (the demonstrator), from the first reach on; `holders` of the object and
        `gripper` commands over time; `dropped` and `released_early`, None if no object was
        simulated.

    """
    return {
        'legs': [_leg_facts(run, leg) for leg in legs_of(run)],
        'timeline': _timeline(run),
        'fluency': _fluency(run),
        'gripper': [{'time_s': time_s, 'closed': closed} for time_s, closed in run.gripper],
        'holders': [{'time_s': time_s, 'holder': holder} for time_s, holder in run.holders],
        'dropped': any(who == 'nobody' for _, who in run.holders) if run.holders else None,
        'released_early': _released_early(run),
    }


def _leg_facts(run: RunRecord, leg: SessionLeg) -> Numbers:
    found = {name: v for name, v in measure(leg.run).items() if name not in OF_THE_WHOLE}
    span = leg.run.exchange_span_s
    return {
        'direction': leg.direction,
        'begin_s': leg.run.reaching_time_s,
        'exchange_ends_s': span[1] if span else None,
        'home_s': leg.home_s,
        **found,
        'release': release_of(run, leg),
        'motions': compare_motions(leg.run),
    }


def release_of(run: RunRecord, leg: SessionLeg) -> Numbers:
    """
    Find when and why the object changed hands in a leg.

    The partner's share of the weight and the pull are computed from the force on the wrist just
    before the release, minus the force at rest before the reach. The rule is the first of the two
    that exceeds the run's threshold, otherwise the distance.

    Args:
        run: the session.
        leg: one of its legs.

    Returns:
        `gripper_s`, when the gripper was told to open (give) or to close (take); `passed_s`, when
        the receiver alone had the object; `both_s`, for how long both had it; `rule` (`share`,
        `pull` or `distance`), `share` and `pull_n` at the release of a give. None if unknown.

    """
    found: Numbers = dict.fromkeys(('gripper_s', 'passed_s', 'both_s', 'rule', 'share', 'pull_n'))
    span = leg.run.exchange_span_s
    if span is None:
        return found
    until_s = leg.end_s
    closes = leg.direction == 'take'
    found['gripper_s'] = next(
        (at for at, closed in run.gripper if closed is closes and span[0] <= at <= until_s), None
    )
    held = [(at, who) for at, who in run.holders if at <= until_s]
    found['passed_s'] = next(
        (at for at, who in held if at >= span[0] and who == RECEIVER[leg.direction]), None
    )
    if found['passed_s'] is not None:
        both = [at for at, who in held if who == 'both' and at <= found['passed_s']]
        found['both_s'] = found['passed_s'] - both[-1] if both else 0.0
    if found['gripper_s'] is None:
        return found
    found['rule'] = 'distance'
    felt = None if closes else _taker_force(run, leg, float(found['gripper_s']))
    if felt is not None:
        found['share'], found['pull_n'] = felt
        limits = run.info.get('release') or {}
        for name, value in (('pull', felt[1]), ('share', felt[0])):
            limit = limits.get('pull_n' if name == 'pull' else name)
            if isinstance(limit, int | float) and value is not None and value > limit:
                found['rule'] = name
    return found


def _taker_force(
    run: RunRecord, leg: SessionLeg, at_s: float
) -> tuple[float | None, float] | None:
    """Return the taker's share of the weight and the pull, N, at a time."""
    begin_s = leg.run.reaching_time_s
    times = run.wrench_times
    if begin_s is None:
        return None
    rest = run.wrench_forces[(times > begin_s - AT_REST_S) & (times <= begin_s)]
    felt = run.wrench_forces[(times > at_s - FELT_S) & (times <= at_s)]
    if not len(rest) or not len(felt):
        return None
    alone: Array = rest.mean(axis=0)
    taker: Array = np.median(felt, axis=0) - alone
    when = np.array([at_s])
    hand = resample(run.hand_times, run.hand_positions, when)[0]
    towards = hand - resample(run.wrist_times, run.wrist_positions, when)[0]
    pull_n = float(taker @ towards / max(float(np.linalg.norm(towards)), 1e-9))
    weight_n = -float(alone[2])
    return (float(taker[2]) / weight_n if weight_n > WEIGHTLESS_N else None), pull_n


def _timeline(run: RunRecord) -> list[dict[str, Any]]:
    ends = [*(time_s for time_s, _ in run.states[1:]), run.end_time_s]
    return [
        {'state': state, 'begin_s': begin_s, 'duration_s': max(0.0, end_s - begin_s)}
        for (begin_s, state), end_s in zip(run.states, ends, strict=True)
    ]


def _fluency(run: RunRecord) -> Numbers:
    """Measure the fluency from the first reach on, where the robot begins."""
    partner = low_passed_track(run.hand_times, run.hand_positions)
    met = [time_s for time_s, state in run.states if state == 'exchange']
    found: Numbers = {}
    for name, times, positions in (
        ('robot', run.wrist_times, run.wrist_positions),
        ('person', run.demonstrator_times, run.demonstrator_positions),
    ):
        other, begin_s = low_passed_track(times, positions), run.reaching_time_s
        found[name] = None
        if partner is None or other is None or begin_s is None:
            continue
        measured = fluency_of_motions(partner[::2], other[::2], begin_s, met)
        found[name] = None if measured is None else asdict(measured)
    return found


def _released_early(run: RunRecord) -> bool | None:
    """Whether the gripper was told to open while the robot alone had the object."""
    if not run.holders:
        return None
    was_closed = False
    for time_s, closed in run.gripper:
        if was_closed and not closed:
            before = [who for at, who in run.holders if at <= time_s]
            if before and before[-1] == 'robot':
                return True
        was_closed = closed
    return False
