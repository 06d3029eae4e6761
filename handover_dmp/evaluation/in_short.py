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

"""The results of an evaluation in one sentence per question, from `table.json`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from handover_dmp.common.digits import rounded
from handover_dmp.evaluation.case_table import name_of
from handover_dmp.evaluation.rejections import AXES

SHOWN_TRIALS = 3
"""Number of trials named as the farthest."""


def in_short(table: Mapping[str, Any], learn: str) -> dict[str, str]:
    """
    Summarise an evaluation.

    Args:
        table: content of `table.json`.
        learn: source of the movement, one of `LEARN`.

    Returns:
        Answers by question.

    """
    return {
        'How near?': _near(table['summary'], learn),
        'Why not nearer?': _why(table['why'], learn),
        'Which trials?': _trials(table['distances'], learn),
        'With which arm?': _arm(table['arm']),
        'How smooth?': _smooth(table['measures_summary']),
        'How fluent?': _fluent(table['measures_summary'], table['sessions_summary']),
    }


def _near(summary: Sequence[Mapping[str, Any]], learn: str) -> str:
    rows = {one['method']: one for one in summary if one['learn'] == learn}
    own, people = rows['decoupled'], rows['human']
    text = (
        f'Learn {learn}: {_percent(own)} of the curves are within 3σ of P2, at a distance of '
        f'{_rms(own)} mm (RMS), {1e3 * own["shifted_rms_m"]:.0f} mm after the best shift in time'
    )
    others = [('classical', 'the classical primitive')]
    if people['rms_m'] is not None:
        others.append(('human', 'people against each other'))
    beside = '; '.join(f'{words}: {_percent(rows[m])}, {_rms(rows[m])} mm' for m, words in others)
    return f'{text}; {beside}.'


def _percent(row: Mapping[str, Any]) -> str:
    return f'{row["within"]["3"]:.1f} %'


def _rms(row: Mapping[str, Any]) -> str:
    return f'{1e3 * row["rms_m"]:.0f}'


def _why(why: Sequence[Mapping[str, Any]], learn: str) -> str:
    *cases, everything = (one for one in why if one['learn'] == learn)
    if not everything['rejected']:
        return 'No curve leaves the 3σ band.'
    axes = ', '.join(f'{everything["by_dimension"][axis]} in {axis}' for axis in AXES)
    worst = max(cases, key=lambda one: one['rejected'] / one['curves'])
    text = (
        f'{everything["rejected"]} of {everything["curves"]} curves leave the band ({axes}), '
        f'first at {everything["leaves_at"]:.2f} of the duration and by '
        f'{1e3 * everything["beyond_median_m"]:.0f} mm (medians); '
        f'{everything["in_bottleneck"]} of them in a bottleneck. The largest share is in '
        f'{name_of(worst)} ({worst["rejected"]} of {worst["curves"]}'
    )
    against = next(iter(worst['by_tested']), None)
    return text + (f', most against #{against}).' if against else ').')


def _trials(distances: Sequence[Mapping[str, Any]], learn: str) -> str:
    own = [one for one in distances if one['method'] == 'decoupled' and one['learn'] == learn]
    own.sort(key=lambda one: -one['rms_m'])
    far = ', '.join(
        f'{name_of(one)} #{one["trial"]} ({_rms(one)} mm, {_timing(one["lateness_s"])})'
        for one in own[:SHOWN_TRIALS]
    )
    near = own[-1]
    return (
        f'Farthest from P2 are {far}; nearest is {name_of(near)} #{near["trial"]} '
        f'({_rms(near)} mm).'
    )


def _timing(lateness_s: float) -> str:
    late_ms = round(1e3 * lateness_s)
    if not late_ms:
        return 'in time'
    return f'{late_ms} ms late' if late_ms > 0 else f'{-late_ms} ms early'


def _arm(arm: Mapping[str, Any] | None) -> str:
    if arm is None:
        return 'No arm was evaluated (--arm selects one).'
    everything = arm['all']
    if not everything['trials']:
        return f'{arm["arm"]} reaches no trial.'
    alone, moved = everything['primitive'], everything['arm']
    text = (
        f'{arm["arm"]} has {_percent(moved)} within 3σ and a distance of {_rms(moved)} mm; the '
        f'primitive alone has {_percent(alone)} and {_rms(alone)} mm. A joint is at a limit in '
        f'{100 * everything["any_limited"]:.0f} % of the time'
    )
    lost = max(
        (one for one in arm['cases'] if one['arm']['rms_m'] is not None),
        key=lambda one: one['arm']['rms_m'] - one['primitive']['rms_m'],
    )
    if _rms(lost['arm']) != _rms(lost['primitive']):
        text += (
            f'; it loses most in {name_of(lost)}, '
            f'{_rms(lost["primitive"])} → {_rms(lost["arm"])} mm'
        )
    return f'{text}.'


def _smooth(measures: Iterable[Mapping[str, Any]]) -> str:
    found = {one['measure']: one for one in measures}
    return (
        f'Log dimensionless jerk {_medians(found["log_dimensionless_jerk"], 1)}, spectral arc '
        f'length {_medians(found["spectral_arc_length"], 2)} (medians; greater is smoother).'
    )


def _fluent(measures: Iterable[Mapping[str, Any]], sessions: Sequence[Mapping[str, Any]]) -> str:
    found = {one['measure']: one for one in measures}
    text = (
        f'Share of a reach in which both are active: {_medians(found["concurrent"], 2)}; lag '
        f'behind the partner’s speed, s: {_medians(found["lag_s"], 2)} (medians)'
    )
    if not sessions:
        return f'{text}; no sessions were given (--sessions).'
    found = {one['measure']: one for one in sessions}
    return (
        f'{text}. Over a session: idle share of the robot or P2 '
        f'{_medians(found["robot_idle"], 2)}; wait of the partner at the exchange, s: '
        f'{_medians(found["wait_person_s"], 2)}.'
    )


def _medians(measure: Mapping[str, Any], digits: int) -> str:
    return ', '.join(
        f'{"–" if value is None else rounded(value, digits)} ({who})'
        for who, value in measure['median'].items()
    )
