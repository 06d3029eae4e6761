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

"""Output of the benchmark: table, JSON file, and the comparison of two JSON files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
import json
import os
from pathlib import Path
import platform
from typing import Any

from handover_dmp import __version__
from handover_dmp.bench.measurement import Measurement
from handover_dmp.common.errors import DataError
from handover_dmp.common.files import write_text
from handover_dmp.common.versions import installed_versions, LIBRARIES
from rich.markup import escape
from rich.table import Table

# Further packages that figures depend on: ROS and the peers.
PEERS = (
    'ros-jazzy-rclpy',
    'movement-primitives',
    'pydmps',
    'scikit-learn',
    'pin-pink',
    'placo',
    'rosbags',
)
TIMES = ('s', 'ms', 'us', 'µs', 'ns')
BEYOND_COMPARE = 1e6
"""Beyond this ratio one value is zero except for rounding, and the ratio means nothing."""


@dataclass(frozen=True)
class Change:
    """
    One figure in two runs.

    Attributes:
        name: name of the figure.
        unit: its unit.
        before: value of the first run.
        after: value of the second run.
        worsening: factor by which the second is worse; below 1 it is better.
        machine: factor by which the machine was slower, by the floors of both runs; 1 if unknown.

    """

    name: str
    unit: str
    before: float
    after: float
    worsening: float
    machine: float

    def is_slowdown(self, tolerance: float) -> bool:
        """Tell whether it got worse by more than `tolerance`, corrected for a slower machine."""
        return self.worsening > tolerance * max(self.machine, 1.0)


def machine() -> dict[str, Any]:
    """
    Describe the machine and the versions of a run.

    Returns:
        Plain types: processor, cores, load, system, Python, date, versions of the libraries.

    """
    return {
        'processor': _processor(),
        'cores': len(os.sched_getaffinity(0)),
        'load': round(os.getloadavg()[0], 2),
        'system': platform.platform(),
        'python': platform.python_version(),
        'date': datetime.now(timezone.utc).isoformat(timespec='seconds'),
        'versions': {'handover_dmp': __version__, **installed_versions(LIBRARIES + PEERS)},
    }


def write_json(path: Path, description: dict[str, Any], results: Sequence[Measurement]) -> None:
    """
    Write a run of the benchmark.

    Args:
        path: file to write.
        description: result of `machine`.
        results: the figures.

    """
    document = {'machine': description, 'results': [asdict(result) for result in results]}
    write_text(path, json.dumps(document, indent=2, ensure_ascii=False) + '\n')


def read_json(path: Path) -> list[Measurement]:
    """
    Read the figures of a run of the benchmark.

    Args:
        path: file from `write_json`.

    Returns:
        The figures.

    Raises:
        DataError: the file is missing or not from `write_json`.

    """
    try:
        document = json.loads(path.read_text(encoding='utf-8'))
        return [Measurement(**result) for result in document['results']]
    except OSError as error:
        raise DataError(f'{path}: {error.strerror}') from error
    except json.JSONDecodeError as error:
        raise DataError(f'{path}, line {error.lineno}: {error.msg}') from error
    except (UnicodeDecodeError, KeyError, TypeError) as error:
        raise DataError(f'{path}: not a file that `bench --json` wrote') from error


def compare(
    before: Iterable[Measurement], after: Iterable[Measurement]
) -> tuple[list[Change], list[str]]:
    """
    Compare the figures of two runs.

    Args:
        before: figures of the first run.
        after: figures of the second run.

    Returns:
        The figures of both runs, in the order of the second; and the names that only one run has.

    """
    first = {result.name: result for result in before}
    second = {result.name: result for result in after}
    changes = [_change(first[name], result) for name, result in second.items() if name in first]
    return changes, sorted(first.keys() ^ second.keys())


def table(results: Sequence[Measurement]) -> Table:
    """
    Make a table of the figures for the terminal.

    Args:
        results: the figures.

    Returns:
        One row per figure, with target and the ratios to the floor and to each peer.

    """
    grid = Table(title='benchmark', title_style='bold', show_lines=True)
    for heading in ('what', 'here', 'target', 'floor', 'peers', 'note'):
        grid.add_column(heading, justify='right' if heading in ('here', 'target') else 'left')
    colours = {True: 'green', False: 'red', None: 'default'}
    for result in results:
        what, here, *rest = map(escape, cells(result))
        grid.add_row(what, f'[{colours[result.reached]}]{here}[/]', *rest)
    return grid


def markdown(results: Sequence[Measurement]) -> str:
    """
    Make a table of the figures for a document.

    Args:
        results: the figures.

    Returns:
        A table in Markdown.

    """
    lines = ['| what | here | target | floor | peers | note |', '|---|---|---|---|---|---|']
    for result in results:
        row = [cell.replace('|', '\\|').replace('\n', '<br>') for cell in cells(result)]
        lines.append(f'| {" | ".join(row)} |')
    return '\n'.join(lines) + '\n'


def comparison_table(changes: Sequence[Change], tolerance: float) -> Table:
    """
    Make a table of a comparison for the terminal.

    Args:
        changes: result of `compare`.
        tolerance: factor above which a figure counts as a slowdown.

    Returns:
        One row per figure, slowdowns in red.

    """
    grid = Table(title='benchmark, before and after', title_style='bold')
    for heading in ('what', 'before', 'after', 'worse by', 'of it the machine'):
        grid.add_column(heading, justify='left' if heading == 'what' else 'right')
    for change in changes:
        colour = 'red' if change.is_slowdown(tolerance) else 'default'
        grid.add_row(
            escape(change.name),
            f'{_number(change.before)} {change.unit}',
            f'{_number(change.after)} {change.unit}',
            f'[{colour}]× {_number(change.worsening)}[/]',
            f'× {_number(change.machine)}' if change.machine != 1.0 else '',
        )
    return grid


def cells(result: Measurement) -> tuple[str, str, str, str, str, str]:
    """
    Format one figure as table cells.

    Args:
        result: the figure.

    Returns:
        Name, value, target, floor and peers with ratios, note.

    """
    unit = result.unit
    mark = {True: ' ✓', False: ' ✗', None: ''}[result.reached]
    bound = 'at least' if result.higher_is_better else 'at most'
    target = '' if result.target is None else f'{bound} {_number(result.target)} {unit}'
    floor = '' if result.floor is None else f'{_number(result.floor)} {unit}'
    if result.floor and not result.higher_is_better:
        floor += f' (here × {_number(result.value / result.floor)})'
    peers = '\n'.join(
        f'{peer}: {_number(value)} {unit}' + _peer_ratio(result, value)
        for peer, value in result.peers.items()
    )
    here = f'{_number(result.value)} {unit}{mark}'
    return result.name, here, target, floor, peers, result.note


def _peer_ratio(result: Measurement, peer: float) -> str:
    ours, theirs = (peer, result.value) if result.higher_is_better else (result.value, peer)
    if theirs > BEYOND_COMPARE * ours:
        return ''
    return f' (× {_number(theirs / ours)})'


def _change(before: Measurement, after: Measurement) -> Change:
    higher_is_better = after.higher_is_better
    is_speed = after.unit in TIMES or higher_is_better
    floors = (before.floor, after.floor)
    return Change(
        name=after.name,
        unit=after.unit,
        before=before.value,
        after=after.value,
        worsening=_worsening(before.value, after.value, higher_is_better),
        machine=_worsening(floors[0], floors[1], higher_is_better)
        if is_speed and floors[0] and floors[1]
        else 1.0,
    )


def _worsening(before: float, after: float, higher_is_better: bool) -> float:
    good, bad = (after, before) if higher_is_better else (before, after)
    if good == bad:
        return 1.0
    return bad / good if good else float('inf')


def _number(value: float) -> str:
    """Format a number with three significant digits."""
    return f'{value:,.0f}' if abs(value) >= 1000 else f'{value:.3g}'


def _processor() -> str:
    for line in Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines():
        if line.startswith('model name'):
            return line.split(':', 1)[1].strip()
    return platform.processor()
