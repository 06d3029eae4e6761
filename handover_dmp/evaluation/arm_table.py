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

"""Lays out what an arm did, beside the primitive alone, and says where it lost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from handover_dmp.evaluation.arm import ArmEvaluation
from handover_dmp.evaluation.case_table import CaseTable

HEAD = (
    'configuration', 'exchange', 'trials', '≤3σ, %\nalone', '\narm', 'rms, mm\nalone', '\narm',
    'moved, mm\nalone', '\narm', 'late by, ms\nalone', '\narm', 'apart,\nmm', 'limited,\n%',
    'most by', 'not\nreached',
)  # fmt: skip

NOTE = (
    'alone: the primitive, in the trials that the arm reaches. moved, late by: what remains of '
    'the distance after the best shift in time of each trial, and that shift. apart: between the '
    'two, root mean square. limited: share of the time in which a joint was at a limit of its '
    'position, speed or acceleration; most by: the joints that were most often. not reached: '
    'trials that start where the arm, placed once a case, does not get.'
)
SHOWN_JOINTS = 2
MUCH = 0.2
"""An arm that is at a limit for a greater share of the time is worth a sentence."""
AT_ONCE = 0.1
"""m/s; P2 is moving already who is faster than this where the recording begins."""


def arm_table(evaluation: ArmEvaluation) -> CaseTable:
    """
    Lay it out.

    Args:
        evaluation: of the arm.

    Returns:
        A line a case; those that the arm cannot be placed for say so.

    """
    lines = [_line(case.as_json(), len(case.case)) for case in evaluation.cases]
    lines += [
        [configuration, direction, reason, *[''] * (len(HEAD) - 3)]
        for configuration, direction, reason in evaluation.refused
    ]
    title = f'With the arm: {evaluation.arm}, learn {evaluation.learn}'
    return CaseTable(title, NOTE, HEAD, lines, remarks=arm_remarks(evaluation))


def arm_remarks(evaluation: ArmEvaluation) -> list[str]:
    """
    Say where the arm lost what the primitive had.

    Args:
        evaluation: of the arm.

    Returns:
        A sentence or two for each case in which limits held for more than a fifth of the time.

    """
    found = [
        _remark(case) for case in (one.as_json() for one in evaluation.cases)
        if case['any_limited'] > MUCH
    ]  # fmt: skip
    return found or ['In no case was a joint at a limit for more than a fifth of the time.']


def _remark(case: Mapping[str, Any]) -> str:
    kind = max(case['limits'], key=lambda one: case['limits'][one])
    text = (
        f'{case["configuration"]} {case["exchange"]}: a joint is at a limit in '
        f'{100 * case["any_limited"]:.0f} % of the time, of its {kind} in '
        f'{100 * case["limits"][kind]:.0f} % ({_most_limited(case["limited"])}); half of that is '
        f'over at {case["limited_by"]:.2f} of the duration.'
    )
    possible = case['acceleration_possible']
    if possible is not None and case['acceleration_asked'] > possible:
        text += (
            f' The movement begins with {case["acceleration_asked"]:.0f} m/s², the arm can start '
            f'with {possible:.0f} m/s² in that direction'
        )
        if case['start_speed'] > AT_ONCE:
            text += (
                f': P2 moves at {case["start_speed"]:.2f} m/s where the recordings begin, and the '
                'arm is at rest there'
            )
        text += '.'
    behind_ms = 1e3 * case['slowed_s']
    return f'{text} Waiting for the arm, the movement falls {behind_ms:.0f} ms behind.'


def _line(case: Mapping[str, Any], trials: int) -> Sequence[str]:
    both = case['primitive'], case['arm']
    missing = case['unreached']
    apart = case['apart_m']
    return [
        case['configuration'],
        case['exchange'],
        str(trials - len(missing)),
        *(f'{one["within"]["3"]:.1f}' if one['within'] else '–' for one in both),
        *(_millis(one['rms_m'], '.1f') for one in both),
        *(_millis(one['shifted_rms_m'], '.1f') for one in both),
        *(_millis(one['lateness_s'], '+.0f') for one in both),
        _millis(apart, '.1f'),
        f'{100 * case["any_limited"]:.0f}',
        _most_limited(case['limited']),
        ', '.join(f'#{number}' for number in missing) or '–',
    ]


def _millis(value: float | None, form: str) -> str:
    return '–' if value is None else f'{1e3 * value:{form}}'


def _most_limited(joints: Mapping[str, float]) -> str:
    most = sorted(joints.items(), key=lambda one: -one[1])[:SHOWN_JOINTS]
    return ', '.join(f'{name} {100 * share:.0f} %' for name, share in most)
