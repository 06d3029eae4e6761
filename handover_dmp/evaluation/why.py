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

"""Sums up why curves were rejected, case by case, out of `table.json`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from handover_dmp.evaluation.case_table import CaseTable
from handover_dmp.evaluation.rejections import AXES

HEAD = (
    'configuration', 'exchange', 'rejected', 'X', 'Y', 'Z', 'learnt from', 'leaves\nat',
    'farthest\nat', 'beyond,\nmm', 'narrowest,\nmm', 'there', 'still\nout',
)  # fmt: skip

NOTE = (
    'rejected: of how many curves. learnt from: the trials whose models have the most rejected '
    'curves. leaves at, farthest at: median, as a fraction of the duration. beyond: median and '
    'maximum, how far beyond 3σ. narrowest: least width of the band from −3σ to 3σ, and where. '
    'there: farthest beyond where the band is narrower than {width:.0f} mm. still out: rejected '
    'also by a band that is at least so wide everywhere.'
)
SHOWN_SOURCES = 2


def explanation(rejections: Sequence[Mapping[str, Any]], learn: str) -> list[list[str]]:
    """
    Sum up the rejections of each case, and of all.

    Args:
        rejections: `rejections` of `table.json`.
        learn: what was learnt from.

    Returns:
        A line a case, then one over all: the cells that `HEAD` names.

    """
    cases = [case for case in rejections if case['learn'] == learn]
    lines = [_line(case['configuration'], case['exchange'], [case]) for case in cases]
    return [*lines, _line('all', '', cases)]


def _line(configuration: str, direction: str, cases: Sequence[Mapping[str, Any]]) -> list[str]:
    rejected = [curve for case in cases for curve in case['rejected']]
    curves = sum(case['curves'] for case in cases)
    axes = Counter(curve['dimension'] for curve in rejected)
    counts = [str(axes[axis]) for axis in AXES]
    head = [configuration, direction, f'{len(rejected)} of {curves}', *counts]
    if not rejected:
        return [*head, '–', '–', '–', '–', _narrowest(cases), '0', '0']
    beyond_mm = [1e3 * curve['beyond_m'] for curve in rejected]
    return [
        *head,
        _sources(cases),
        f'{median(curve["first"] for curve in rejected):.2f}',
        f'{median(curve["worst"] for curve in rejected):.2f}',
        f'{median(beyond_mm):.0f}, {max(beyond_mm):.0f}',
        _narrowest(cases),
        str(sum(curve['in_bottleneck'] for curve in rejected)),
        str(sum(curve['rejected_when_widened'] for curve in rejected)),
    ]


def _sources(cases: Sequence[Mapping[str, Any]]) -> str:
    """Name the trials behind most rejections; over several cases their numbers mean nothing."""
    rejected = [curve for case in cases for curve in case['rejected']]
    if len(cases) > 1 or any(len(curve['learnt']) > 1 for curve in rejected):
        return '–'
    counts = Counter(curve['learnt'][0] for curve in rejected)
    ranked = sorted(counts, key=lambda number: (-counts[number], number))
    return ', '.join(f'#{number}: {counts[number]}' for number in ranked[:SHOWN_SOURCES])


def _narrowest(cases: Sequence[Mapping[str, Any]]) -> str:
    width_m, axis, at = min(
        (neck['width_m'], axis, neck['at'])
        for case in cases
        for axis, neck in case['bottlenecks'].items()
    )
    return f'{axis} {1e3 * width_m:.0f} at {at:.2f}'


def why_table(rejections: Sequence[Mapping[str, Any]], learn: str) -> CaseTable:
    """
    Lay the explanation out.

    Args:
        rejections: `rejections` of `table.json`.
        learn: what was learnt from.

    Returns:
        A line a case, and one over all.

    """
    *cases, everything = explanation(rejections, learn)
    note = NOTE.format(width=1e3 * rejections[0]['min_width_m'])
    return CaseTable(f'Why curves were rejected, learn {learn}', note, HEAD, cases, everything)
