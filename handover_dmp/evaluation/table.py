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

"""Table I: its rows, and its formats for people, spreadsheets and programs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import csv
from dataclasses import dataclass
import io
import math
from typing import Any

from handover_dmp.common.digits import rounded
from handover_dmp.evaluation import LEARN, METHODS
from handover_dmp.evaluation.case_table import CaseTable, heading, table_with_columns
from handover_dmp.evaluation.scores import BANDS, Summary
from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

PAPER = {
    'single': {1: 13.3, 2: 50.4, 3: 79.1},
    'mean': {1: 25.6, 2: 62.2, 3: 90.0},
}
"""The summary row of the paper's Table I, percent, on its own recordings."""

TITLES = {
    'decoupled': 'decoupled DMP',
    'partner_model': 'partner model',
    'classical': 'classical DMP',
    'minimum_jerk': 'minimum jerk',
    'human': 'P2 itself',
}
LEARNING_METHODS = ('decoupled', 'partner_model', 'classical')
"""Methods with one row per source of learning."""

TITLE = 'Table I: curves of the decoupled DMP within kσ of P2, %'
METHODS_TITLE = 'All cases, every method; with 95 % intervals'
TIMING_TITLE = 'Distance after the best shift in time, and that shift'
NOTE = (
    "rms: root-mean-square distance to P2 in the same trial; end: mean distance to P2's position "
    'at the exchange; shifted: distance after the best shift in time of each motion; late by: '
    'that shift, mean ± standard deviation. P2 itself: compared with mean and band of the other '
    'trials.'
)

WIDTH = 98
"""Width of the table, characters."""


@dataclass(frozen=True)
class Row:
    """
    One line of the table.

    Attributes:
        configuration: configuration of the trials; empty in the summary.
        direction: `give` or `take`; empty in the summary.
        learn: one of `LEARN`.
        method: one of `METHODS`.
        trials: number of trials.
        curves: number of tested curves; 0 if there were too few trials.
        figures: the percentages, distances and intervals.

    """

    configuration: str
    direction: str
    learn: str
    method: str
    trials: int
    curves: int
    figures: Summary

    def as_json(self) -> dict[str, Any]:
        """Return the row as plain types; figures that do not exist are None."""
        place = {'configuration': self.configuration, 'exchange': self.direction}
        figures = self.figures
        return {
            **(place if self.configuration else {}),
            'learn': self.learn,
            'method': self.method,
            'trials': self.trials,
            'curves': self.curves,
            'within': {str(k): _number(figures.within[k]) for k in BANDS},
            'within_interval': {str(k): _numbers(figures.within_interval[k]) for k in BANDS},
            'rms_m': _number(figures.rms_m),
            'rms_interval_m': _numbers(figures.rms_interval_m),
            'final_gap_m': _number(figures.final_gap_m),
            'shifted_rms_m': _number(figures.shifted_rms_m),
            'lateness_s': _number(figures.lateness_s),
            'lateness_deviation_s': _number(figures.lateness_deviation_s),
        }


def as_csv(rows: Sequence[Row]) -> str:
    """
    Write rows as CSV.

    Args:
        rows: rows of cases and of the summary; the latter have no configuration.

    Returns:
        The text, with a header; percentages to a hundredth, distances to a hundredth of a
        millimetre; cells of missing figures are empty.

    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    header = ['configuration', 'exchange', 'learn', 'method', 'trials', 'curves']
    for k in BANDS:
        header += [f'within_{k}_percent', f'within_{k}_low_percent', f'within_{k}_high_percent']
    header += ['rms_m', 'rms_low_m', 'rms_high_m', 'final_gap_m']
    writer.writerow([*header, 'shifted_rms_m', 'lateness_s', 'lateness_deviation_s'])
    for row in rows:
        line: list[object] = [row.configuration or 'all', row.direction or 'all']
        line += [row.learn, row.method, row.trials, row.curves]
        for k in BANDS:
            percentages = (row.figures.within[k], *row.figures.within_interval[k])
            line += [_cell(value, 2) for value in percentages]
        figures = row.figures
        metres = (figures.rms_m, *figures.rms_interval_m, figures.final_gap_m)
        times = (figures.lateness_s, figures.lateness_deviation_s)
        line += [_cell(value, 5) for value in (*metres, figures.shifted_rms_m, *times)]
        writer.writerow(line)
    return text.getvalue()


def as_text(
    rows: Sequence[Row],
    summary: Sequence[Row],
    tables: Sequence[CaseTable] = (),
    *,
    width: int = WIDTH,
) -> str:
    """
    Write the tables for people.

    Args:
        rows: rows of the cases.
        summary: rows over all cases.
        tables: further tables.
        width: least width of a line, characters; wider tables extend it.

    Returns:
        Plain text.

    """
    console = Console(file=io.StringIO(), width=width, color_system=None, force_terminal=False)
    console.print(renderable(rows, summary))
    for table in tables:
        table.show(console)
    assert isinstance(console.file, io.StringIO)
    lines = console.file.getvalue().splitlines()
    return '\n'.join(line.rstrip() for line in lines) + '\n'


def renderable(rows: Sequence[Row], summary: Sequence[Row]) -> Group:
    """
    Make the table in the paper's layout, and the tables that the paper lacks below it.

    Args:
        rows: rows of the cases.
        summary: rows over all cases.

    Returns:
        A renderable of rich.

    """
    return Group(
        heading(TITLE),
        _paper_table(rows, summary),
        heading(METHODS_TITLE),
        _methods_table(summary),
        heading(TIMING_TITLE),
        _timing_table(summary),
        Text(f'{NOTE}\n'),
    )


@dataclass(frozen=True)
class PaperTable:
    """
    The cells of the paper's table.

    Attributes:
        learns: sources of learning, with one column per band each.
        cases: configuration, exchange, number of trials and percentages of each case.
        trials: number of all trials.
        total: percentages over all cases.
        paper: percentages of the paper; empty where it has none.

    """

    learns: list[str]
    cases: list[tuple[str, str, int, list[str]]]
    trials: int
    total: list[str]
    paper: list[str]


def paper_table(rows: Sequence[Row], summary: Sequence[Row]) -> PaperTable:
    """
    Arrange the decoupled primitive as in the paper.

    Args:
        rows: rows of the cases.
        summary: rows over all cases.

    Returns:
        The cells.

    """
    learns = [learn for learn in LEARN if any(row.learn == learn for row in summary)]
    ours = {
        (row.configuration, row.direction, row.learn): row.figures.within
        for row in (*rows, *summary)
        if row.method == 'decoupled'
    }

    def within(configuration: str, direction: str) -> list[str]:
        found = [ours[configuration, direction, learn] for learn in learns]
        return [f'{one[k]:.1f}' for one in found for k in BANDS]

    cases = dict.fromkeys((row.configuration, row.direction, row.trials) for row in rows)
    return PaperTable(
        learns,
        [(*case, within(*case[:2])) for case in cases],
        sum(trials for _, _, trials in cases),
        within('', ''),
        [f'{PAPER[learn][k]:.1f}' if learn in PAPER else '' for learn in learns for k in BANDS],
    )


def _paper_table(rows: Sequence[Row], summary: Sequence[Row]) -> Table:
    shown = paper_table(rows, summary)
    table = table_with_columns(['configuration'])
    table.add_column('exchange')
    table.add_column('n', justify='right')
    for learn in shown.learns:
        for k in BANDS:
            head = learn if k == 1 else ''
            table.add_column(f'{head}\n≤{k}σ', justify='right', no_wrap=True)
    for configuration, direction, trials, cells in shown.cases:
        table.add_row(configuration, direction, str(trials), *cells)
    table.add_section()
    table.add_row('all', '', str(shown.trials), *shown.total, style='bold')
    table.add_row('the paper', '', '30', *shown.paper, style='dim')
    return table


def _methods_table(summary: Sequence[Row]) -> Table:
    bands = [f'≤{k}σ, %' for k in BANDS]
    table = table_with_columns(['method', 'learn'], ['curves', *bands, 'rms,\nmm', 'end,\nmm'])
    for row, learn in each_once(summary):
        figures = row.figures
        table.add_row(
            TITLES[row.method],
            learn,
            str(row.curves),
            *(_with_interval(figures.within[k], figures.within_interval[k]) for k in BANDS),
            _with_interval(1e3 * figures.rms_m, [1e3 * end for end in figures.rms_interval_m]),
            millis(figures.final_gap_m),
        )
    return table


def _with_interval(value: float, ends: Sequence[float]) -> str:
    if math.isnan(value):
        return '–'
    return f'{value:.1f} {ends[0]:.0f}–{ends[1]:.0f}'


def _timing_table(summary: Sequence[Row]) -> Table:
    table = table_with_columns(['method', 'learn'], ['rms, mm', 'shifted, mm', 'late by, ms'])
    for row, learn in each_once(summary):
        figures = row.figures
        table.add_row(
            TITLES[row.method],
            learn,
            millis(figures.rms_m, 1),
            millis(figures.shifted_rms_m, 1),
            _lateness(figures),
        )
    return table


def each_once(summary: Sequence[Row]) -> Iterator[tuple[Row, str]]:
    """
    Order rows by method.

    Args:
        summary: rows over all cases.

    Yields:
        Each row, and its source of learning; methods that do not learn have one row.

    """
    shown = set()
    for row in sorted(summary, key=lambda row: METHODS.index(row.method)):
        learns = row.method in LEARNING_METHODS
        if learns or row.method not in shown:
            yield row, row.learn if learns else '–'
        shown.add(row.method)


def millis(value: float, digits: int = 0) -> str:
    """Return metres in mm, or seconds in ms."""
    return '–' if math.isnan(value) else rounded(1e3 * value, digits)


def _lateness(figures: Summary) -> str:
    if math.isnan(figures.lateness_s):
        return '–'
    late_ms = rounded(1e3 * figures.lateness_s, 0, '+')
    return f'{late_ms} ± {1e3 * figures.lateness_deviation_s:.0f}'


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _numbers(values: Sequence[float]) -> list[float | None]:
    return [_number(value) for value in values]


def _cell(value: float, digits: int) -> str:
    return f'{value:.{digits}f}' if math.isfinite(value) else ''
