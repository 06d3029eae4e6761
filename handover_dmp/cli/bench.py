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

"""`handover_dmp bench`: speed and accuracy, with targets, floors and other libraries."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from handover_dmp.cli.options import add_json, add_setting
from handover_dmp.common.errors import GET_ROS, HandoverError, UsageError

if TYPE_CHECKING:
    from rich.console import Console

SUBJECTS = {
    'startup': 'time to start the command',
    'dmp': 'the movement primitive: step, rollouts, learning, error, lag',
    'rvm': 'sparse Bayesian learning',
    'ik': 'prioritised inverse kinematics',
    'sim': 'the handover in lockstep with PyBullet',
    'ros': 'rate, jitter and latency of the ROS 2 graph',
    'bag': 'recording',
    'evaluate': 'Table I',
    'soak': '30 minutes of handovers with random faults; only when named',
    'session_faults': 'every fault at every stage of a session, in one process; only when named',
    'fuzz': 'a million damaged files for every reader; only when named',
}
WHEN_NAMED = ('soak', 'session_faults', 'fuzz')
LIMITED = ('soak', 'fuzz')
COMPARE = 'compare'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of `bench`.

    Args:
        parser: parser of the verb.

    """
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.usage = (
        '%(prog)s [SUBJECT ...] [--json FILE] [--markdown FILE]\n'
        '       %(prog)s compare BEFORE.json AFTER.json [--tolerance TIMES]'
    )
    parser.epilog = 'subjects:\n' + '\n'.join(
        f'  {name:<16}{purpose}' for name, purpose in SUBJECTS.items()
    )
    parser.add_argument(
        'words',
        nargs='*',
        metavar='SUBJECT',
        help='subject to measure (default: all except those marked "only when named"), or '
        '`compare` and two files',
    )
    add_json(parser, 'write the figures as JSON')
    parser.add_argument(
        '--markdown', type=Path, metavar='FILE', help='write the table as Markdown'
    )
    parser.add_argument(
        '--minutes',
        type=float,
        metavar='MIN',
        help='duration of soak, and maximum duration of fuzz (default: 30 and 60)',
    )
    tolerance = 'factor by which a figure may get worse before `compare` fails'
    add_setting(parser, '--tolerance', 1.25, 'TIMES', tolerance)


def run(options: argparse.Namespace) -> int:
    """
    Measure, or compare two runs.

    Args:
        options: the parsed arguments.

    Returns:
        0, or 1 if a comparison found a slowdown.

    Raises:
        UsageError: a subject does not exist, or there are not two files to compare.
        HandoverError: a named subject needs a package that is not installed.

    """
    if options.words[:1] == [COMPARE]:
        return _compare(options)
    return _measure(options)


def _measure(options: argparse.Namespace) -> int:
    from importlib import import_module

    from handover_dmp.bench.measurement import Measurement
    from handover_dmp.bench.report import machine, markdown, table, write_json
    from handover_dmp.cli.progress import progress_bar
    from handover_dmp.common.files import write_text

    unknown = [word for word in options.words if word not in SUBJECTS]
    if unknown:
        raise UsageError(f'unknown subject {unknown[0]!r}; choose from {", ".join(SUBJECTS)}')
    subjects = options.words or [subject for subject in SUBJECTS if subject not in WHEN_NAMED]
    if options.minutes is not None and not 0.0 < options.minutes < 1e5:
        raise UsageError(f'--minutes is {options.minutes:g}; it must be above 0')

    description = machine()
    results: list[Measurement] = []
    skipped: list[str] = []
    with progress_bar() as bar:
        task = bar.add_task('', total=len(subjects))
        for subject in subjects:
            try:
                measure = import_module(f'handover_dmp.bench.{subject}').run
                limited = options.minutes is not None and subject in LIMITED
                results += measure(
                    lambda what, subject=subject: bar.update(
                        task, description=f'{subject}: {what}'
                    ),
                    **({'minutes': options.minutes} if limited else {}),
                )
            except ModuleNotFoundError as error:
                if str(error.name).startswith('handover_dmp'):
                    raise
                remedy = GET_ROS if subject == 'ros' else "run: pip install 'handover_dmp[bench]'"
                absent = f'{subject}: {error.name} is not installed; {remedy}'
                if options.words:
                    raise HandoverError(absent) from error
                skipped.append(absent)
            bar.advance(task)
            # After every subject, so that a later failure does not lose long measurements.
            if options.json:
                write_json(options.json, description, results)

    if options.markdown:
        write_text(options.markdown, markdown(results))
    console = _wide_console()
    console.print(table(results))
    versions = ', '.join(f'{name} {number}' for name, number in description['versions'].items())
    console.print(
        f'{description["processor"]}, {description["cores"]} cores, load {description["load"]}; '
        f'{description["system"]}; Python {description["python"]}; {versions}',
        style='dim',
        highlight=False,
    )
    for reason in skipped:
        console.print(f'left out: {reason}')
    return 0


def _compare(options: argparse.Namespace) -> int:
    from handover_dmp.bench.report import compare, comparison_table, read_json

    if len(options.words) != 3:
        raise UsageError('compare takes two files: compare BEFORE.json AFTER.json')
    before, after = (read_json(Path(word)) for word in options.words[1:])
    changes, single = compare(before, after)
    console = _wide_console()
    console.print(comparison_table(changes, options.tolerance))
    for name in single:
        console.print(f'only in one of the two files: {name}')
    slower = [change.name for change in changes if change.is_slowdown(options.tolerance)]
    if slower:
        console.print(f'[red]worse by more than × {options.tolerance:g}:[/] {", ".join(slower)}')
    else:
        console.print(f'nothing is worse by more than × {options.tolerance:g}')
    return 1 if slower else 0


def _wide_console() -> Console:
    """Return a console that does not squeeze the table if there is no terminal."""
    from rich.console import Console

    console = Console()
    return console if console.is_terminal else Console(width=160)
