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

"""Measures of P2 and of what replaces P2: medians and paired differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.digits import rounded
from handover_dmp.evaluation.bootstrap import draw_samples, interval
from handover_dmp.evaluation.case_table import CaseTable
import numpy as np

PERSON = 'P2'
"""Column name of the person."""

NOTE = (
    'Medians, and the mean paired difference to P2 with its 95 % interval from resampled '
    '{what}. Formulas: docs/method.md.'
)


@dataclass(frozen=True)
class Beside:
    """
    One measure of P2 and of what replaces P2.

    Attributes:
        name: name in `table.json`.
        words: label with unit.
        digits: decimal places.
        values: by mover, (n,), the measure in each trial, session or exchange; NaN if there is
            none. The last mover is P2.

    """

    name: str
    words: str
    digits: int
    values: Mapping[str, Array]

    @property
    def pairs(self) -> Array:
        """(m, k), one column per mover, one row per trial for which all have the measure."""
        columns = np.column_stack(list(self.values.values()))
        return np.asarray(columns[np.isfinite(columns).all(axis=1)])

    def medians(self) -> list[float]:
        """Return the median of each mover, NaN if none has the measure."""
        pairs = self.pairs
        return [float(np.median(column)) if len(column) else float('nan') for column in pairs.T]

    def differences(self, seed: int) -> list[tuple[float, float, float]]:
        """
        Return the difference of each to P2.

        Args:
            seed: seed of the bootstrap.

        Returns:
            Mean and both ends of its 95 % interval; NaN if none has the measure.

        """
        pairs = self.pairs
        if not len(pairs):
            return [(float('nan'),) * 3] * (len(self.values) - 1)
        apart = pairs[:, :-1] - pairs[:, -1:]
        counts = draw_samples(len(pairs), np.random.SeedSequence(seed))
        means = counts @ apart / counts.sum(axis=1, keepdims=True)
        return [
            (float(column.mean()), *interval(drawn))
            for column, drawn in zip(apart.T, means.T, strict=True)
        ]

    def as_json(self, seed: int) -> dict[str, Any]:
        """
        Summarise the measure in plain types.

        Args:
            seed: seed of the bootstrap.

        Returns:
            Number of pairs, medians, differences to P2 and their intervals.

        """
        names = list(self.values)
        found = dict(zip(names, self.differences(seed), strict=False))
        return {
            'measure': self.name,
            'pairs': len(self.pairs),
            'median': {
                who: _finite(value) for who, value in zip(names, self.medians(), strict=True)
            },
            'difference': {who: _finite(values[0]) for who, values in found.items()},
            'interval': {who: list(map(_finite, values[1:])) for who, values in found.items()},
        }


def beside_table(title: str, note: str, measures: Sequence[Beside], seed: int) -> CaseTable:
    """
    Make a table of measures.

    Args:
        title: heading of the table.
        note: explanation of the measures.
        measures: measures, all with the same movers.
        seed: seed of the bootstrap.

    Returns:
        One line per measure; measures without values are left out.

    """
    names = list(measures[0].values)
    lines = []
    for one in measures:
        if not len(one.pairs):
            continue
        line = [one.words, *(rounded(value, one.digits) for value in one.medians())]
        for values in one.differences(seed):
            mean, low, high = (rounded(value, one.digits, '+') for value in values)
            line += [mean, f'{low} to {high}']
        lines.append(line)
    head = ['measure', *names]
    for name in names[:-1]:
        head += [f'{name}\n− {names[-1]}', '\n95 %']
    return CaseTable(title, note, tuple(head), lines)


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
