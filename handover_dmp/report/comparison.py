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

"""Comparison of runs: the same measures of each, and their paired differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.report.cells import look_up
from handover_dmp.report.metrics import measure
from handover_dmp.report.motions import compare_motions
from handover_dmp.report.recorded_run import load_run
import numpy as np

CONFIDENCE = 0.95

COMPARED: tuple[tuple[str, tuple[str, ...], float, str, int], ...] = (
    ('gap when the exchange began', ('exchange_gap_m',), 1e3, 'mm', 1),
    ('reach until the exchange', ('reach_duration_s',), 1.0, 's', 2),
    ('distance to the demonstrator, RMS', ('to_human', 'rms_m'), 1e3, 'mm', 0),
    ('lag behind the moving hand', ('lag', 'time_ms'), 1.0, 'ms', 1),
    ('lag behind the command', ('arm_lag', 'time_ms'), 1.0, 'ms', 2),
    ('joint speed, share of limit', ('limits', 'velocity', 'share'), 100.0, '%', 0),
    ('joint acceleration, share of limit', ('limits', 'acceleration', 'share'), 100.0, '%', 0),
    ('path length', ('motions', 'robot', 'path_m'), 1e3, 'mm', 0),
    ('path length / straight line', ('motions', 'robot', 'path_ratio'), 1.0, '', 3),
    ('peak speed', ('motions', 'robot', 'peak_speed'), 1.0, 'm/s', 2),
    ('onset to peak speed', ('motions', 'robot', 'time_to_peak_s'), 1.0, 's', 2),
    ('number of speed peaks', ('motions', 'robot', 'peaks'), 1.0, '', 1),
    ('spectral arc length', ('motions', 'robot', 'spectral_arc_length'), 1.0, '', 2),
    ('log dimensionless jerk', ('motions', 'robot', 'log_dimensionless_jerk'), 1.0, '', 2),
    ('lag behind the hand’s speed', ('motions', 'synchrony', 'robot', 'lag_s'), 1e3, 'ms', 0),
    ('correlation of the speeds', ('motions', 'synchrony', 'robot', 'correlation'), 1.0, '', 2),
    ('least distance to the hand', ('motions', 'distance_min_m'), 1e3, 'mm', 0),
    ('relative speed at the exchange', ('motions', 'relative_speed_m_s'), 1.0, 'm/s', 3),
    ('partner idle', ('motions', 'fluency', 'person_idle'), 100.0, '%', 0),
    ('robot idle', ('motions', 'fluency', 'robot_idle'), 100.0, '%', 0),
    ('both active', ('motions', 'fluency', 'concurrent'), 100.0, '%', 0),
    ('functional delay', ('motions', 'fluency', 'functional_delay'), 100.0, '%', 0),
)  # fmt: skip
"""Label, keys in `report.json`, factor, unit, digits."""


@dataclass(frozen=True)
class Difference:
    """
    A measure of several sets of runs, and how they differ from the first.

    Attributes:
        name: of the measure.
        unit: of all figures.
        digits: number of decimal places to show.
        means: one per set; None if no run has the measure.
        differences: mean paired difference of each further set to the first; None likewise.
        intervals: their 95 % intervals, by Student's t; None for fewer than two pairs.

    """

    name: str
    unit: str
    digits: int
    means: tuple[float | None, ...]
    differences: tuple[float | None, ...]
    intervals: tuple[tuple[float, float] | None, ...]


def find_runs(place: Path) -> dict[str, Path]:
    """
    Find the runs of a set.

    Args:
        place: a run, a bag, or a folder of runs.

    Returns:
        The runs by name; a single run has the name ``.``.

    Raises:
        DataError: there is no run.

    """
    if place.is_file() or (place / 'bag').is_dir() or list(place.glob('*.mcap')):
        return {'.': place}
    runs = {path.parent.name: path.parent for path in sorted(place.glob('*/bag'))}
    if not runs:
        raise DataError(f'{place}: neither a run nor a folder of runs')
    return runs


def compare_runs(places: Sequence[Path]) -> tuple[list[Difference], int]:
    """
    Compare sets of runs.

    Args:
        places: two or more sets; runs of the same name form a pair.

    Returns:
        The measures, and how many pairs there are.

    Raises:
        DataError: a set has no runs, or the sets have no run in common.

    """
    sets = [find_runs(place) for place in places]
    names = [name for name in sets[0] if all(name in runs for runs in sets)]
    if not names:
        listed = '; '.join(
            f'{place}: {", ".join(runs)}' for place, runs in zip(places, sets, strict=True)
        )
        raise DataError(f'no run has the same name in all sets ({listed})')
    figures = [[_figures(runs[name]) for name in names] for runs in sets]
    return [
        _difference(name, unit, digits, _values(figures, path, factor))
        for name, path, factor, unit, digits in COMPARED
    ], len(names)


def _figures(place: Path) -> dict[str, Any]:
    run = load_run(place)
    return {**measure(run), 'motions': compare_motions(run)}


def _values(
    figures: Sequence[Sequence[Mapping[str, Any]]], path: Sequence[str], factor: float
) -> Array:
    """Look a measure up, (sets, pairs); NaN if a run has none."""
    found = [[look_up(one, *path) for one in runs] for runs in figures]
    return factor * np.array(found, dtype=np.float64)


def _difference(name: str, unit: str, digits: int, values: Array) -> Difference:
    from scipy.stats import t

    means: list[float | None] = []
    differences: list[float | None] = []
    intervals: list[tuple[float, float] | None] = []
    for row in values:
        known = row[np.isfinite(row)]
        means.append(float(known.mean()) if len(known) else None)
    for row in values[1:]:
        pairs = (row - values[0])[np.isfinite(row - values[0])]
        differences.append(float(pairs.mean()) if len(pairs) else None)
        if len(pairs) < 2:
            intervals.append(None)
            continue
        half = t.ppf(0.5 + CONFIDENCE / 2, len(pairs) - 1) * pairs.std(ddof=1) / len(pairs) ** 0.5
        intervals.append((float(pairs.mean() - half), float(pairs.mean() + half)))
    return Difference(name, unit, digits, tuple(means), tuple(differences), tuple(intervals))
