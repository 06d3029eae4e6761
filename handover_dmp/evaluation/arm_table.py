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

"""Lays out what an arm did, beside the primitive alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from handover_dmp.evaluation.arm import ArmEvaluation
from handover_dmp.evaluation.case_table import CaseTable

HEAD = (
    'configuration', 'exchange', 'trials', '≤3σ, %\nalone', '\narm', 'rms, mm\nalone', '\narm',
    'apart,\nmm', 'limited,\n%', 'most by', 'not\nreached',
)  # fmt: skip

NOTE = (
    'alone: the primitive, in the trials that the arm reaches. apart: between the two, root mean '
    'square. limited: share of the time in which a joint was at a limit of its position, speed or '
    'acceleration; most by: the joints that were most often. not reached: trials that start where '
    'the arm, placed once a case, does not get.'
)
SHOWN_JOINTS = 2


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
    return CaseTable(title, NOTE, HEAD, lines)


def _line(case: Mapping[str, Any], trials: int) -> Sequence[str]:
    alone, arm = case['primitive'], case['arm']
    joints = sorted(case['limited'].items(), key=lambda one: -one[1])[:SHOWN_JOINTS]
    missing = case['unreached']
    return [
        case['configuration'],
        case['exchange'],
        str(trials - len(missing)),
        *(f'{one["within"]["3"]:.1f}' if one['within'] else '–' for one in (alone, arm)),
        *(f'{1e3 * one["rms_m"]:.1f}' if one['within'] else '–' for one in (alone, arm)),
        f'{1e3 * case["apart_m"]:.1f}',
        f'{100 * case["any_limited"]:.0f}',
        ', '.join(f'{name} {100 * share:.0f} %' for name, share in joints),
        ', '.join(f'#{number}' for number in missing) or '–',
    ]
