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

"""`handover_dmp tune`: search for better parameters, and test them on unseen trials."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, TYPE_CHECKING

from handover_dmp.cli.evaluate import (
    add_learning_arguments,
    add_running_arguments,
    check_running_options,
    read_learning,
    work_bar,
)
from handover_dmp.cli.options import add_json, add_output, add_setting, save_json
from handover_dmp.common.errors import UsageError

if TYPE_CHECKING:
    from handover_dmp.evaluation.tuning import Tuning
    from rich.console import Group


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of `tune`.

    Args:
        parser: parser of the verb.

    """
    parser.add_argument('data_set', type=Path, metavar='DATASET', help='folder with trials.csv')
    tuned = 'parameter file to write, for --params-file of the dmp node and for --parameters'
    add_output(parser, 'PARAMS.yaml', tuned)
    add_learning_arguments(parser)
    add_setting(parser, '--candidates', 192, 'N', 'number of parameter sets to try')
    add_running_arguments(parser)
    add_json(parser, 'also write the result as JSON')


def run(options: argparse.Namespace) -> int:
    """
    Search, report on unseen trials, write the parameter file.

    Args:
        options: the parsed arguments.

    Returns:
        0.

    Raises:
        UsageError: the number of candidates or processes, or the seed, is out of range.
        DataError: the data set cannot be used.

    """
    check_running_options(options)
    if options.candidates < 1:
        raise UsageError(f'--candidates is {options.candidates}; it must be above 0')
    from dataclasses import asdict

    from handover_dmp.dmp.parameter_file import TunedParameters, write_parameters
    from handover_dmp.evaluation.tuning import tune
    from handover_dmp.mocap import read_data_set
    from rich.console import Console

    default = read_learning(options)
    trials = read_data_set(options.data_set)
    with work_bar() as progress:
        tuning = tune(
            trials,
            default,
            candidates=options.candidates,
            seed=options.seed,
            jobs=options.jobs,
            progress=progress('trying parameters'),
        )
    best = TunedParameters(tuning.best.parameters, tuning.best.duration_scale)
    write_parameters(best, options.output, _comment(tuning, options.data_set.name))
    save_json(asdict(tuning), options.json, indent=1)
    console = Console()
    console.width = max(console.width, 96)
    console.print(_show(tuning))
    console.print(_starts(tuning), highlight=False)
    for warning in _warnings(tuning):
        console.print(warning, style='yellow', highlight=False)
    console.print(options.output, soft_wrap=True, highlight=False)
    return 0


def _comment(tuning: Tuning, data_set: str) -> str:
    lines = [
        f'Tuned on {tuning.trials} trials of {data_set}, {tuning.candidates} sets tried.',
        'On trials that each choice had not seen, in place of the defaults:',
    ]
    for compared in tuning.comparisons:
        low, high = (1e3 * end for end in compared.gain_interval_m)
        lines.append(
            f'learn {compared.learn}: distance to P2 {1e3 * compared.default.rms_m:.1f} -> '
            f'{1e3 * compared.tuned.rms_m:.1f} mm (gain {1e3 * compared.gain_m:.1f}, '
            f'95 %: {low:.1f} to {high:.1f}), within 3 sigma {compared.default.within[3]:.1f} -> '
            f'{compared.tuned.within[3]:.1f} %'
        )
    return '\n'.join([*lines, _starts(tuning), *_warnings(tuning)])


def _starts(tuning: Tuning) -> str:
    """Tell for which trials the choice holds."""
    if tuning.start_at_rest == tuning.trials:
        return 'All trials start at rest; for trials that start in motion, tune again.'
    return (
        f'{tuning.trials - tuning.start_at_rest} of {tuning.trials} trials start in motion; '
        'for trials that start at rest, tune again.'
    )


def _warnings(tuning: Tuning) -> list[str]:
    return [
        f'Keep the defaults for learn {compared.learn}: fewer curves within 3 sigma, '
        f'{compared.within_change:+.1f} points '
        f'({compared.within_change_interval[0]:+.1f} to {compared.within_change_interval[1]:+.1f})'
        for compared in tuning.comparisons
        if compared.within_change_interval[1] < 0.0
    ]


def _show(tuning: Tuning) -> Group:
    from rich import box
    from rich.console import Group
    from rich.table import Table

    def table(title: str, *columns: str) -> Table:
        made = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
        for number, column in enumerate(columns):
            made.add_column(column, justify='right' if number else 'left', no_wrap=True)
        return made

    found = table('Parameters', '', 'default', 'chosen', 'in the folds')
    for name in ('stiffness', 'mu', 'sigma', 'goal_velocity_gain', 'duration_scale'):
        each = [_value(learning, name) for learning in tuning.folds]
        found.add_row(
            name,
            f'{_value(tuning.default, name):.3g}',
            f'{_value(tuning.best, name):.3g}',
            f'{min(each):.3g} to {max(each):.3g}',
        )
    unseen = table('On unseen trials', 'learn', '', 'rms, mm', '≤1σ', '≤2σ', '≤3σ, %')
    for compared in tuning.comparisons:
        for name, worth in (('default', compared.default), ('tuned', compared.tuned)):
            unseen.add_row(compared.learn, name, *_cells(worth))
        low, high = (1e3 * end for end in compared.gain_interval_m)
        less, more = compared.within_change_interval
        unseen.add_row(
            '',
            'gain, 95 %',
            f'{1e3 * compared.gain_m:.1f}  {low:.1f} to {high:.1f}',
            '',
            '',
            f'{compared.within_change:+.1f}  {less:+.1f} to {more:+.1f}',
            style='bold',
        )
    tried = table(
        'One change at a time, on unseen trials, learn single',
        '',
        'rms, mm',
        'gain, 95 %',
        '≤1σ',
        '≤2σ',
        '≤3σ, %',
        'end, mm',
    )
    for attempt in tuning.attempts:
        error, *within = _cells(attempt.worth)
        low, high = (1e3 * end for end in attempt.gain_interval_m)
        gain = f'{1e3 * attempt.gain_m:+.1f}  {low:+.1f} to {high:+.1f}'
        gap = f'{1e3 * attempt.worth.final_gap_m:.0f}'
        tried.add_row(attempt.what, error, gain, *within, gap)
    return Group(tried, unseen, found)


def _value(learning: Any, name: str) -> float:
    if name == 'duration_scale':
        return float(learning.duration_scale)
    return float(getattr(learning.parameters, name))


def _cells(worth: Any) -> list[str]:
    return [f'{1e3 * worth.rms_m:.1f}', *(f'{share:.1f}' for share in worth.within.values())]
