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

"""Summary of why curves were rejected, case by case, from `table.json`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import Any

from handover_dmp.evaluation.case_table import CaseTable, name_of
from handover_dmp.evaluation.rejections import AXES

WHICH = ('case', 'rejected', 'X', 'Y', 'Z', 'learnt from', 'tested against', 'beyond,\nmm')
WHERE = (
    'case', 'rejected', 'leaves\nat', 'farthest\nat', 'narrowest,\nmm', 'in the\nneck',
    'still\nout',
)  # fmt: skip

WHICH_NOTE = (
    'rejected: number of rejected curves, and of all. learnt from, tested against: the trials '
    'with the most rejected curves, and their number. beyond: distance outside 3σ, median and '
    'maximum.'
)
WHERE_NOTE = (
    'leaves at, farthest at: median, as a fraction of the duration. narrowest: least width of the '
    'band from −3σ to 3σ, and where. in the neck: curves whose largest excess is where the band '
    'is narrower than {width:.0f} mm. still out: curves that a band of at least that width '
    'everywhere would still reject.'
)
SHOWN_TRIALS = 2


def explanation(rejections: Sequence[Mapping[str, Any]], learn: str) -> list[dict[str, Any]]:
    """
    Summarise the rejections of each case, and of all.

    Args:
        rejections: `rejections` of `table.json`.
        learn: source of learning.

    Returns:
        One summary per case, then one over all.

    """
    cases = [case for case in rejections if case['learn'] == learn]
    return [*(_summary(learn, [case]) for case in cases), _summary(learn, cases)]


def _summary(learn: str, cases: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    rejected = [curve for case in cases for curve in case['rejected']]
    axes = Counter(curve['dimension'] for curve in rejected)
    width_m, axis, at = min(
        (neck['width_m'], axis, neck['at'])
        for case in cases
        for axis, neck in case['bottlenecks'].items()
    )
    beyond_m = [curve['beyond_m'] for curve in rejected]
    alone = len(cases) == 1
    return {
        'configuration': cases[0]['configuration'] if alone else 'all',
        'exchange': cases[0]['exchange'] if alone else '',
        'learn': learn,
        'rejected': len(rejected),
        'curves': sum(case['curves'] for case in cases),
        'by_dimension': {axis: axes[axis] for axis in AXES},
        'by_learnt': _by_trial(cases, lambda curve: curve['learnt']),
        'by_tested': _by_trial(cases, lambda curve: [curve['tested']]),
        'leaves_at': median(curve['first'] for curve in rejected) if rejected else None,
        'farthest_at': median(curve['worst'] for curve in rejected) if rejected else None,
        'beyond_median_m': median(beyond_m) if rejected else None,
        'beyond_max_m': max(beyond_m) if rejected else None,
        'narrowest': {'dimension': axis, 'width_m': width_m, 'at': at},
        'in_bottleneck': sum(curve['in_bottleneck'] for curve in rejected),
        'rejected_when_widened': sum(curve['rejected_when_widened'] for curve in rejected),
    }


def _by_trial(
    cases: Sequence[Mapping[str, Any]], trials: Callable[[Mapping[str, Any]], Sequence[int]]
) -> dict[str, int]:
    """Count by trial; over several cases or for a mean, trial numbers mean nothing."""
    found = [trials(curve) for case in cases for curve in case['rejected']]
    if len(cases) > 1 or any(len(numbers) > 1 for numbers in found):
        return {}
    counts = Counter(number for numbers in found for number in numbers)
    ranked = sorted(counts, key=lambda number: (-counts[number], number))
    return {str(number): counts[number] for number in ranked}


def _begun(one: Mapping[str, Any]) -> list[str]:
    """Begin a line: which case, and how much of it is rejected."""
    return [name_of(one), f'{one["rejected"]} of {one["curves"]}']


def _which(one: Mapping[str, Any]) -> list[str]:
    beyond = '–'
    if one['rejected']:
        beyond = f'{1e3 * one["beyond_median_m"]:.0f}, {1e3 * one["beyond_max_m"]:.0f}'
    return [
        *_begun(one),
        *(str(one['by_dimension'][axis]) for axis in AXES),
        _most(one['by_learnt']),
        _most(one['by_tested']),
        beyond,
    ]


def _where(one: Mapping[str, Any]) -> list[str]:
    narrowest = one['narrowest']
    times = (one['leaves_at'], one['farthest_at'])
    return [
        *_begun(one),
        *('–' if time is None else f'{time:.2f}' for time in times),
        f'{narrowest["dimension"]} {1e3 * narrowest["width_m"]:.0f} at {narrowest["at"]:.2f}',
        str(one['in_bottleneck']),
        str(one['rejected_when_widened']),
    ]


def _most(counts: Mapping[str, int]) -> str:
    most = [f'#{number} {count}' for number, count in counts.items()][:SHOWN_TRIALS]
    return ', '.join(most) or '–'


def why_tables(rejections: Sequence[Mapping[str, Any]], learns: Sequence[str]) -> list[CaseTable]:
    """
    Make the tables of rejections.

    Args:
        rejections: `rejections` of `table.json`.
        learns: sources of learning, one or more.

    Returns:
        Two tables per source, which curves and where, with one line per case and one over all; the
        first two explain the columns.

    """
    width_mm = 1e3 * rejections[0]['min_width_m']
    found: list[CaseTable] = []
    for learn in learns:
        explained = explanation(rejections, learn)
        for asked, note, head, line in (
            ('Which', WHICH_NOTE, WHICH, _which),
            ('When and where', WHERE_NOTE.format(width=width_mm), WHERE, _where),
        ):
            *cases, everything = map(line, explained)
            title = f'{asked} curves were rejected, learn {learn}'
            shown = '' if len(found) > 1 else note
            found.append(CaseTable(title, shown, head, cases, everything))
    return found
