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

"""Tables that compare an arm with the primitive alone, and remarks on where it is worse."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from handover_dmp.common.digits import rounded
from handover_dmp.evaluation.arm import ArmEvaluation
from handover_dmp.evaluation.case_table import case_name, CaseTable, name_of

HEAD = (
    'case', 'trials', '≤3σ, %\nalone', '\narm', 'rms, mm\nalone', '\narm',
    'shifted, mm\nalone', '\narm', 'late by, ms\nalone', '\narm', 'apart,\nmm',
)  # fmt: skip
LIMITS_HEAD = (
    'case', 'limited,\n%', 'most by', 'half of it\nbefore', 'asked,\nm/s²', 'possible,\nm/s²',
    'behind,\nms', 'not\nreached',
)  # fmt: skip

NOTE = (
    'alone: the primitive, in the trials that the arm reaches. shifted: distance after the best '
    'shift in time of each trial; late by: that shift. apart: root-mean-square distance between '
    'arm and primitive.'
)
LIMITS_NOTE = (
    'limited: share of the time in which a joint was at a limit of its position, speed or '
    'acceleration; most by: the joints with the largest shares; half of it before: fraction of '
    'the duration at which half of that time had passed. asked: initial acceleration of the '
    'movement; possible: greatest acceleration of the arm in that direction. behind: time lost '
    'by waiting for the arm. not reached: trials whose start the arm, placed once per case, '
    'cannot reach.'
)
SHOWN_JOINTS = 2
MUCH = 0.2
"""Cases with a larger share of time at a limit get a remark."""
AT_ONCE = 0.1
"""Above this speed at the start of a recording, P2 is already moving, m/s."""


def arm_tables(evaluation: ArmEvaluation) -> list[CaseTable]:
    """
    Make the tables of an arm: its distances, and the limits that slowed it.

    Args:
        evaluation: evaluation of the arm.

    Returns:
        Two tables with one line per case; cases without a placement are named below.

    """
    cases = [(case.as_json(), len(case.case)) for case in evaluation.cases]
    refused = [
        f'{case_name(configuration, direction)}: {reason.rstrip(".")}.'
        for configuration, direction, reason in evaluation.refused
    ]
    title = f'With the arm: {evaluation.arm}, learn {evaluation.learn}'
    everything = evaluation.total()
    total = _line(everything, 'all', everything['trials']) if cases else ()
    lines = [_line(case, name_of(case), number - len(case['unreached'])) for case, number in cases]
    near = CaseTable(title, NOTE, HEAD if cases else (), lines, total, refused)
    if not cases:
        return [near]
    limits = CaseTable(
        f'What limited the arm: {evaluation.arm}',
        LIMITS_NOTE,
        LIMITS_HEAD,
        [_limits_line(case) for case, _ in cases],
        remarks=arm_remarks(evaluation),
    )
    return [near, limits]


def arm_remarks(evaluation: ArmEvaluation) -> list[str]:
    """
    Describe where limits slowed the arm.

    Args:
        evaluation: evaluation of the arm.

    Returns:
        One or two sentences for each case with active limits in more than a fifth of the time.

    """
    found = [
        _remark(case) for case in (one.as_json() for one in evaluation.cases)
        if case['any_limited'] > MUCH
    ]  # fmt: skip
    return found or ['In no case was a joint at a limit for more than a fifth of the time.']


def _remark(case: Mapping[str, Any]) -> str:
    kind = max(case['limits'], key=lambda one: case['limits'][one])
    text = (
        f'{name_of(case)}: a joint is at a limit in '
        f'{100 * case["any_limited"]:.0f} % of the time, at its {kind} limit in '
        f'{100 * case["limits"][kind]:.0f} % ({_most_limited(case["limited"])}); half of that '
        f'time has passed at {case["limited_by"]:.2f} of the duration.'
    )
    possible = case['acceleration_possible']
    if possible is not None and case['acceleration_asked'] > possible:
        text += (
            f' The movement begins with {case["acceleration_asked"]:.0f} m/s², but the arm can '
            f'only start with {possible:.0f} m/s² in that direction'
        )
        if case['start_speed'] > AT_ONCE:
            text += (
                f': P2 already moves at {case["start_speed"]:.2f} m/s when the recordings begin, '
                'and the arm starts at rest'
            )
        text += '.'
    behind_ms = 1e3 * case['slowed_s']
    return f'{text} The movement waits for the arm and loses {behind_ms:.0f} ms.'


def _line(case: Mapping[str, Any], name: str, trials: int) -> list[str]:
    both = case['primitive'], case['arm']
    return [
        name,
        str(trials),
        *(f'{one["within"]["3"]:.1f}' if one['within'] else '–' for one in both),
        *(_millis(one['rms_m'], 1) for one in both),
        *(_millis(one['shifted_rms_m'], 1) for one in both),
        *(_millis(one['lateness_s'], 0, '+') for one in both),
        _millis(case['apart_m'], 1),
    ]


def _limits_line(case: Mapping[str, Any]) -> list[str]:
    by, possible = case['limited_by'], case['acceleration_possible']
    asked, behind_s = case['acceleration_asked'], case['slowed_s']
    return [
        name_of(case),
        f'{100 * case["any_limited"]:.0f}',
        _most_limited(case['limited']) or '–',
        '–' if by is None else f'{by:.2f}',
        '–' if asked is None else f'{asked:.0f}',
        '–' if possible is None else f'{possible:.0f}',
        _millis(behind_s, 0),
        ', '.join(f'#{number}' for number in case['unreached']) or '–',
    ]


def _millis(value: float | None, digits: int, sign: str = '-') -> str:
    return '–' if value is None else rounded(1e3 * value, digits, sign)


def _most_limited(joints: Mapping[str, float]) -> str:
    most = sorted(joints.items(), key=lambda one: -one[1])[:SHOWN_JOINTS]
    most = [(name, share) for name, share in most if share >= 0.005]
    return ', '.join(f'{name} {100 * share:.0f} %' for name, share in most)
