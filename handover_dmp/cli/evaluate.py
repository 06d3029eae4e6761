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

"""`handover_dmp evaluate`: reproduce Section III of the paper on a data set."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

from handover_dmp.cli.low_pass import add_low_pass
from handover_dmp.cli.options import add_json, add_output, add_setting
from handover_dmp.cli.robot_arguments import add_frame_arguments, WHICH
from handover_dmp.common.errors import UsageError
from handover_dmp.evaluation import LEARN

if TYPE_CHECKING:
    from handover_dmp.evaluation.arm import ArmEvaluation
    from handover_dmp.evaluation.protocol import Evaluation, Protocol
    from handover_dmp.evaluation.rollouts import Learning
    from handover_dmp.evaluation.sessions import SessionOutcome

PATIENCE_S = 2.0
"""Time after which the progress bar appears, s."""

CACHE = 'arm_cache'
"""Folder of the finished trials of an arm."""

PRINTED = {
    'learn': 'single,mean',
    'regression': 'rvm',
    'formulation': 'printed',
    'mu': 0.75,
    'sigma': 0.05,
}
"""What the paper prints; K and D are not among it."""

Update = Callable[[int, int], None]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of `evaluate`.

    Args:
        parser: parser of the verb.

    """
    parser.add_argument(
        'data_set',
        type=Path,
        metavar='DATASET',
        help='folder with trials.csv, or with sessions.csv of recordings',
    )
    add_output(parser, 'DIR', 'folder for the results')
    parser.add_argument(
        '--learn',
        metavar='LIST',
        help=f'demonstrations to learn from, separated by commas (default: {",".join(LEARN)})',
    )
    parser.add_argument(
        '--paper',
        action='store_true',
        help='settings as printed in the paper, unless other options override them: learn '
        'single,mean; relevance vector machine; K_s = 1; mu 0.75 and sigma 0.05',
    )
    for name, use in (
        ('--learnt', 'Figs 4 to 6 learn from (default: nearest to the mean)'),
        ('--tested', 'they test against (default: a middling one)'),
    ):
        number = f'number of the trial that {use}'
        parser.add_argument(name, type=int, metavar='TRIAL', help=number)
    parser.add_argument(
        '--leave-one-out',
        action='store_true',
        help='compute band, mean and model from all other trials, and test on the one left out',
    )
    narrow = 'width of the band of people below which it is a bottleneck, m'
    add_setting(parser, '--min-width', 0.04, 'M', narrow)
    add_learning_arguments(parser)
    parser.add_argument(
        '--partner-model',
        choices=['auto', 'off'],
        nargs='?',
        const='auto',
        default='off',
        help='auto: evaluate the decoupled primitive with the partner model as well, as a '
        'separate method (default: off, since it is not in the paper and takes longer)',
    )
    parser.add_argument(
        '--sessions',
        type=Path,
        action='append',
        default=[],
        metavar='PATH',
        help='recorded sessions, for measures of fluency: a folder with sessions.csv, a CSV file '
        'or a bag; may be repeated (default: those of DATASET)',
    )
    add_running_arguments(parser)
    arm = parser.add_argument_group('arm')
    arm.add_argument(
        '--arm',
        default='',
        metavar='ARM',
        help=f'run a simulated arm through the trials as well: {WHICH}. An interrupted evaluation '
        'continues where it stopped if it is started again',
    )
    add_frame_arguments(arm)
    parser.add_argument('--no-figures', action='store_true', help='write only the tables')
    add_json(parser, 'also write the table as JSON')


def add_running_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Declare the options for the seed and the number of processes.

    Args:
        parser: parser of a verb.

    """
    add_setting(parser, '--seed', 0, None, 'seed of the random numbers')
    jobs = 'number of processes; -1: one per processor; changes no result'
    add_setting(parser, '--jobs', 1, 'N', jobs)


def check_running_options(options: argparse.Namespace) -> None:
    """
    Check the options of `add_running_arguments`.

    Args:
        options: the parsed arguments.

    Raises:
        UsageError: the seed is negative, or the number of processes is invalid.

    """
    if options.seed < 0:
        raise UsageError(f'--seed is {options.seed}; it must not be negative')
    if options.jobs == 0 or options.jobs < -1:
        raise UsageError(f'--jobs is {options.jobs}; it must be above 0, or -1 for all processors')


def add_learning_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Declare the parameters of the primitive and of the learning.

    Args:
        parser: parser of a verb that learns.

    """
    parser.add_argument(
        '--parameters', type=Path, metavar='FILE', help='ROS parameter file with a dmp section'
    )
    group = parser.add_argument_group(
        'movement primitive (override the parameter file and the defaults)'
    )
    group.add_argument('--stiffness', type=float, metavar='K', help='K of (8)')
    group.add_argument('--damping', type=float, metavar='D', help='D of (8); 0: critical')
    group.add_argument(
        '--goal-velocity-gain', type=float, metavar='KV', help='K_v of (8), s; negative: D tau'
    )
    group.add_argument('--mu', type=float, help='centre of the goal weight (7), in units of tau')
    group.add_argument('--sigma', type=float, help='width of the goal weight (7), in units of tau')
    group.add_argument('--formulation', choices=['stiff', 'printed'], help='K_s = K, or K_s = 1')
    parser.add_argument(
        '--regression',
        choices=['rvm', 'ridge'],
        help='regression: sparse Bayesian (rvm) or ridge; the table is the same (default: ridge)',
    )
    add_setting(parser, '--basis', 50, 'N', 'number of candidate basis functions')
    add_low_pass(parser)


def read_learning(options: argparse.Namespace) -> Learning:
    """
    Convert the options of `add_learning_arguments` to parameters.

    Args:
        options: the parsed arguments.

    Returns:
        The parameters of the primitive and of the learning.

    Raises:
        DataError: a parameter is out of range, or the file is faulty.

    """
    from dataclasses import replace

    from handover_dmp.dmp.parameter_file import read_parameters
    from handover_dmp.evaluation.rollouts import Learning

    learning = Learning(
        regression=options.regression or 'ridge', basis=options.basis, cutoff_hz=options.low_pass
    )
    if options.parameters is not None:
        tuned = read_parameters(options.parameters)
        learning = replace(
            learning, parameters=tuned.primitive, duration_scale=tuned.duration_scale
        )
    names = ('stiffness', 'damping', 'goal_velocity_gain', 'mu', 'sigma', 'formulation')
    given = {name: getattr(options, name) for name in names if getattr(options, name) is not None}
    return replace(learning, parameters=replace(learning.parameters, **given))


def run(options: argparse.Namespace) -> int:
    """
    Evaluate a data set and write table, figures and page.

    Args:
        options: the parsed arguments.

    Returns:
        0.

    Raises:
        UsageError: `--learn` has an unknown word, or the seed or number of processes is invalid.
        DataError: the data set cannot be evaluated.

    """
    check_running_options(options)
    if not options.min_width >= 0.0:
        raise UsageError(
            f'--min-width is {options.min_width}; it must be a width in metres, not negative'
        )
    if options.paper:
        _as_printed(options)
    learn = _demonstrations(options.learn)
    from handover_dmp.common.files import write_text
    from handover_dmp.evaluation.report import write_evaluation

    evaluation, arm, sessions, figures = _evaluate(options, _protocol(options, learn))
    text = write_evaluation(
        evaluation, options.data_set.name, options.output, figures, arm, sessions
    )
    if options.json is not None:
        write_text(options.json, text)
    _show(evaluation, arm, sessions, text)
    print(options.output / 'index.html')
    return 0


def _demonstrations(listed: str | None) -> tuple[str, ...]:
    """Read what to learn from; all ways if it is left out."""
    words = LEARN if listed is None else listed.split(',')
    learn = tuple(dict.fromkeys(word.strip() for word in words))
    unknown = [word for word in learn if word not in LEARN]
    if unknown:
        raise UsageError(f'--learn: unknown word {unknown[0]!r}; choose from {", ".join(LEARN)}')
    return learn


def _protocol(options: argparse.Namespace, learn: tuple[str, ...]) -> Protocol:
    from dataclasses import replace

    from handover_dmp.evaluation.protocol import Protocol
    from handover_dmp.tracking.partner_model import PartnerOptions

    learning = read_learning(options)
    if options.partner_model == 'auto':
        learning = replace(learning, partner=PartnerOptions())
    return Protocol(
        learning=learning,
        learn=learn,
        leave_one_out=options.leave_one_out,
        seed=options.seed,
        min_width_m=options.min_width,
    )


def _evaluate(
    options: argparse.Namespace, protocol: Protocol
) -> tuple[Evaluation, ArmEvaluation | None, list[SessionOutcome], list[tuple[str, str]]]:
    """Evaluate the primitive and, if asked for, the arm and the sessions; draw the figures."""
    from handover_dmp.evaluation.arm import evaluate_arm
    from handover_dmp.evaluation.cases import index_of, make_cases
    from handover_dmp.evaluation.protocol import evaluate
    from handover_dmp.evaluation.sessions import evaluate_sessions, read_recorded, read_trials
    from handover_dmp.robot.descriptions import ArmChoice

    trials = read_trials(options.data_set)
    recorded = read_recorded(options.data_set, options.sessions)
    for number in (options.learnt, options.tested):
        if number is not None:
            for case in make_cases(trials, cutoff_hz=options.low_pass):
                index_of(case, number)
    cache, jobs = options.output / CACHE, options.jobs
    with work_bar() as progress:
        evaluation = evaluate(
            trials, protocol, jobs=jobs, progress=progress('learning and rolling out')
        )
        arm = choice = None
        if options.arm:
            choice = ArmChoice(options.arm, options.wrist_frame, options.base_frame)
            moving = progress('moving the arm')
            arm = evaluate_arm(evaluation, choice, cache, jobs=jobs, progress=moving)
        sessions = evaluate_sessions(
            recorded,
            protocol.learning,
            choice,
            cache,
            jobs=jobs,
            progress=progress('going through the sessions') if recorded else None,
        )
        figures: list[tuple[str, str]] = []
        if not options.no_figures:
            from handover_dmp.evaluation.panels import write_panels

            figures = write_panels(
                evaluation,
                options.output,
                progress('drawing'),
                learnt=options.learnt,
                tested=options.tested,
                arm=arm,
                sessions=sessions,
            )
    return evaluation, arm, sessions, figures


def _show(
    evaluation: Evaluation, arm: ArmEvaluation | None, sessions: list[SessionOutcome], text: str
) -> None:
    """Print the tables, and the answers of `table.json` in sentences."""
    import json

    from handover_dmp.evaluation.arm_table import arm_tables
    from handover_dmp.evaluation.sessions import sessions_table
    from handover_dmp.evaluation.table import renderable, WIDTH
    from rich.console import Console
    from rich.markup import escape

    console = Console()
    console.width = max(console.width, WIDTH)
    console.print(renderable(evaluation.rows, evaluation.summary))
    for table in () if arm is None else arm_tables(arm):
        table.show(console)
    if sessions:
        sessions_table(sessions, evaluation.protocol.seed).show(console)
    for question, answer in json.loads(text)['in_short'].items():
        console.print(f'[bold]{question}[/bold] {escape(answer)}', highlight=False)


def _as_printed(options: argparse.Namespace) -> None:
    """Set the options that were not given to the values of the paper."""
    for name, value in PRINTED.items():
        if getattr(options, name) is None:
            setattr(options, name, value)


@contextmanager
def work_bar() -> Iterator[Callable[[str], Update]]:
    """
    Show progress on standard error, if the work takes longer than a moment.

    Yields:
        A function from the name of a work to a function that takes how much of it is done.

    """
    from handover_dmp.cli.progress import progress_bar

    bar = progress_bar()
    began = monotonic()

    def start(what: str) -> Update:
        task = bar.add_task(what, total=None)

        def update(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)
            if not bar.live.is_started and monotonic() - began > PATIENCE_S:
                bar.start()

        return update

    try:
        yield start
    finally:
        bar.stop()
