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

"""`handover_dmp compare`: runs side by side, with their paired differences."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from handover_dmp.cli.options import add_json, save_json
from handover_dmp.common.errors import UsageError

if TYPE_CHECKING:
    from handover_dmp.report.comparison import Difference
    from rich.table import Table

MAX_WIDTH = 400
"""Characters that are left out of tables."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of `compare`.

    Args:
        parser: parser of the verb.

    """
    parser.add_argument(
        'runs',
        nargs='+',
        type=Path,
        metavar='RUN',
        help='two or more runs or bags; or folders of runs, paired by their names',
    )
    add_json(parser, 'also write the figures as JSON')


def run(options: argparse.Namespace) -> int:
    """
    Compare runs.

    Args:
        options: the parsed arguments.

    Returns:
        0.

    Raises:
        UsageError: there is only one run.
        DataError: one of them is not a run, or no run of one folder has its pair in another.

    """
    if len(options.runs) < 2:
        raise UsageError('compare needs two or more runs, or two or more folders of runs')
    from dataclasses import asdict

    from handover_dmp.report.comparison import compare_runs
    from rich.console import Console

    differences, pairs = compare_runs(options.runs)
    outcome = {
        'runs': [str(run) for run in options.runs],
        'pairs': pairs,
        'measures': [asdict(difference) for difference in differences],
    }
    save_json(outcome, options.json, indent=1)
    console = Console(highlight=False)
    table = _table(options.runs, differences)
    needed = console.measure(table, options=console.options.update(width=MAX_WIDTH)).maximum
    console.width = max(console.width, needed)
    console.print(table)
    if pairs > 1:
        console.print(
            f'Means of {pairs} pairs; mean difference to the first with its 95 % interval, where '
            'two pairs or more have the measure.'
        )
    return 0


def _names(runs: list[Path]) -> list[str]:
    """Name runs by the parts in which their paths differ."""
    places = [place.resolve() for place in runs]
    common = Path(os.path.commonpath(places))
    if common in places:
        return [str(place) for place in runs]
    return [str(place.relative_to(common)) for place in places]


def _table(runs: list[Path], differences: list[Difference]) -> Table:
    from handover_dmp.common.digits import rounded
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 0, 0, 1))
    table.add_column('', no_wrap=True)
    for name in _names(runs):
        table.add_column(name, justify='right', overflow='fold')
    for number in range(2, len(runs) + 1):
        table.add_column('difference' if len(runs) == 2 else f'{number} − 1', justify='right')
    for one in differences:
        cells = [
            '–' if mean is None else f'{rounded(mean, one.digits)} {one.unit}'.strip()
            for mean in one.means
        ]
        for value, interval in zip(one.differences, one.intervals, strict=True):
            text = '–' if value is None else rounded(value, one.digits, '+')
            if interval is not None:
                text += f' ({" to ".join(rounded(end, one.digits) for end in interval)})'
            cells.append(text)
        table.add_row(one.name, *cells)
    return table
