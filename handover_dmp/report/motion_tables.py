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

"""Tables of the measures of motions, robot and people side by side."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from handover_dmp.report.cells import look_up, quantity
from handover_dmp.report.page import Table

MEASURES: tuple[tuple[str, str, float, str, int], ...] = (
    ('path_m', 'path length', 1e3, 'mm', 0),
    ('path_ratio', 'path length / straight line', 1.0, '', 3),
    ('peak_speed', 'peak speed', 1.0, 'm/s', 2),
    ('time_to_peak_s', 'time from onset to peak speed', 1.0, 's', 2),
    ('duration_s', 'time from onset to rest', 1.0, 's', 2),
    ('peaks', 'number of speed peaks', 1.0, '', 0),
    ('spectral_arc_length', 'spectral arc length', 1.0, '', 2),
    ('log_dimensionless_jerk', 'log dimensionless jerk', 1.0, '', 2),
)
"""Name in `report.json`, label, factor, unit, digits."""

WHO = {
    'robot': 'robot',
    'person': 'demonstrator (P2)',
    'partner': 'partner (P1)',
}


def motion_tables(motions: Mapping[str, Any]) -> tuple[Table, Table]:
    """
    Lay the measures out.

    Args:
        motions: what `compare_motions` gives.

    Returns:
        The measures of each motion, and the measures of robot and partner together.

    """
    rows = []
    for key, words, factor, unit, digits in MEASURES:
        cells = [_cell(motions[who], key, factor, unit, digits) for who in WHO]
        rows.append((words, *cells))
    for key, words, factor, unit, digits in (
        ('lag_s', "lag of its speed behind the partner's", 1e3, 'ms', 0),
        ('correlation', 'correlation of the two speeds at that lag', 1.0, '', 2),
    ):
        cells = [
            _cell(motions['synchrony'][who], key, factor, unit, digits)
            for who in ('robot', 'person')
        ]
        rows.append((words, *cells, ''))
    fluent = motions['fluency']
    facts = [
        ('least distance between wrist and hand', _cell(motions, 'distance_min_m', 1e3, 'mm', 0)),
        (
            'relative speed when the exchange began',
            _cell(motions, 'relative_speed_m_s', 1.0, 'm/s', 3),
        ),
        ('partner idle, share of the run', _cell(fluent, 'person_idle', 100.0, '%', 0)),
        ('robot idle', _cell(fluent, 'robot_idle', 100.0, '%', 0)),
        ('both moving', _cell(fluent, 'concurrent', 100.0, '%', 0)),
        ('functional delay', _cell(fluent, 'functional_delay', 100.0, '%', 0)),
    ]
    return Table(('', *WHO.values()), tuple(rows)), Table((), tuple(facts))


def _cell(found: Any, key: str, factor: float, unit: str, digits: int) -> str:
    return quantity(look_up(found, key), factor, unit, digits)
