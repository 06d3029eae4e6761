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

"""Tables of a session: its states, its two legs side by side, and who had the object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from handover_dmp.report.cells import look_up, quantity
from handover_dmp.report.page import Section, Table

LEG_ROWS: tuple[tuple[str, tuple[str, ...], float, str, int], ...] = (
    ('start of the reach to start of the exchange', ('reach_duration_s',), 1.0, 's', 2),
    ('start of the reach to end of the exchange', ('handover_duration_s',), 1.0, 's', 2),
    ('gap between wrist and goal when the exchange began', ('exchange_gap_m',), 1e3, 'mm', 1),
    ('minimum gap during the exchange', ('exchange_gap_least_m',), 1e3, 'mm', 1),
    ('distance of the hand / demonstrated', ('hand_distance_share',), 100.0, '%', 0),
    ('largest overshoot of the goal', ('beyond_goal_max_m',), 1e3, 'mm', 1),
    ('lag behind the moving hand', ('lag', 'time_ms'), 1.0, 'ms', 1),
    ('lag of the wrist behind its command', ('arm_lag', 'time_ms'), 1.0, 'ms', 1),
    ('peak speed of the wrist', ('wrist_peak_speed_m_s',), 1.0, 'm/s', 2),
    ('peak speed of the demonstrator', ('human_peak_speed_m_s',), 1.0, 'm/s', 2),
    ('distance to the demonstrator, RMS', ('to_human', 'rms_m'), 1e3, 'mm', 0),
    ('gripper command at', ('release', 'gripper_s'), 1.0, 's', 2),
    ('receiver alone holds the object at', ('release', 'passed_s'), 1.0, 's', 2),
    ('both hold it before, for', ('release', 'both_s'), 1.0, 's', 2),
    ("partner's share of the weight at the release", ('release', 'share'), 100.0, '%', 0),
    ("partner's pull at the release", ('release', 'pull_n'), 1.0, 'N', 2),
    ('wrist home again at', ('home_s',), 1.0, 's', 2),
)  # fmt: skip
"""Label, keys in a leg of `report.json`, factor, unit, digits."""
SHARES = (
    ('person_idle', 'partner idle'),
    ('robot_idle', 'robot or demonstrator idle'),
    ('concurrent', 'both active'),
    ('functional_delay', 'functional delay'),
)
WAITS = (('person_s', 'partner'), ('robot_s', 'robot or demonstrator'))
ACTIVE = (
    'Shares of the time from the first reach on, and waits at the exchange position. The recorded '
    'people are replayed: their time stops at each exchange until the object has changed hands.'
)
RULES = {
    'share': 'the share of the weight',
    'pull': 'the pull',
    'distance': 'distance and speed',
}


def session_outcome(facts: Mapping[str, Any], done: bool) -> str:
    """
    Sum a session up.

    Args:
        facts: what `session_facts` gives.
        done: whether it went through to its end.

    Returns:
        A sentence or two.

    """
    text = 'The object was given and taken back.' if done else 'The session did not complete.'
    if facts['dropped']:
        text += ' The object was dropped.'
    if facts['released_early']:
        text += ' The gripper opened while only the robot held the object.'
    return text


def session_sections(facts: Mapping[str, Any]) -> list[Section]:
    """
    Lay a session out.

    Args:
        facts: what `session_facts` gives.

    Returns:
        Sections of a page.

    """
    sections = [
        Section('Give and take', tables=(_legs(facts['legs']),)),
        Section('States', tables=(_states(facts['timeline']),)),
    ]
    if facts['fluency']['robot'] is not None:
        sections.append(Section('Fluency', text=ACTIVE, tables=(_fluency(facts['fluency']),)))
    if facts['holders']:
        sections.append(
            Section('The object', text=_kept(facts), tables=(_holders(facts['holders']),))
        )
    return sections


def _legs(legs: Sequence[Mapping[str, Any]]) -> Table:
    rows = []
    for name, path, factor, unit, digits in LEG_ROWS:
        values = [look_up(leg, *path) for leg in legs]
        if any(value is not None for value in values):
            rows.append((name, *(quantity(value, factor, unit, digits) for value in values)))
    rules = (RULES.get(leg['release']['rule'], '–') for leg in legs)
    rows.append(('gripper command triggered by', *rules))
    return Table(('', *(leg['direction'] for leg in legs)), tuple(rows))


def _fluency(fluency: Mapping[str, Any]) -> Table:
    """Lay out the partner's fluency with the robot and with the demonstrator."""
    who = {name: found for name, found in fluency.items() if found is not None}
    rows = [
        (words, *(f'{100.0 * found["whole"][key]:.0f} %' for found in who.values()))
        for key, words in SHARES
    ]
    for key, words in WAITS:
        cells = (
            ', '.join(f'{wait[key]:.2f} s' for wait in found['waits']) for found in who.values()
        )
        rows.append((f'{words} waited at the exchanges', *cells))
    heads = {'robot': 'partner and robot', 'person': 'partner and demonstrator (P2)'}
    return Table(('', *(heads[name] for name in who)), tuple(rows))


def _states(timeline: Sequence[Mapping[str, Any]]) -> Table:
    rows = [
        (one['state'], f'{one["begin_s"]:.2f}', f'{one["duration_s"]:.2f}') for one in timeline
    ]
    return Table(('state', 'from, s', 'for, s'), tuple(rows))


def _kept(facts: Mapping[str, Any]) -> str:
    dropped = 'It was dropped.' if facts['dropped'] else 'It was never dropped.'
    early = (
        'The gripper opened while only the robot held it.'
        if facts['released_early']
        else 'The gripper never opened while only the robot held it.'
    )
    return f'{dropped} {early}'


def _holders(holders: Sequence[Mapping[str, Any]]) -> Table:
    return Table(
        ('from, s', 'holder'),
        tuple((f'{one["time_s"]:.2f}', str(one['holder'])) for one in holders),
    )
