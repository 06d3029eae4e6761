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

"""`handover_dmp synthesize`: write a synthetic data set."""

from __future__ import annotations

import argparse
from collections.abc import Callable
import json
from typing import Any, TYPE_CHECKING

from handover_dmp.cli.options import add_json, add_output, add_setting

if TYPE_CHECKING:
    from handover_dmp.mocap import HandoverTrial
    from handover_dmp.mocap.session import RecordedSession

SHORT_TRIALS, SHORT_SESSIONS = 300, 50
"""Below these numbers, the work is done before one could read a progress bar."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.

    Args:
        parser: parser of the verb.

    """
    parser.description = (
        'Write a synthetic data set; no person was recorded for it. Mechanic and assistant give '
        'and take at an engine bay, under a car and at a hydraulic lift, in minimum-jerk reaches '
        'with the spread of people and sensor noise. The same seed gives the same files '
        'everywhere. With --sessions, write whole recordings, in which the assistant picks up the '
        'tool, gives it and takes it back; their reaches are those of the data set of the same '
        'seed.'
    )
    add_output(parser, 'DATASET', 'folder to write')
    parser.add_argument(
        '--sessions',
        action='store_true',
        help='write whole recordings, with index sessions.csv, for `import csv DATASET --segment`',
    )
    add_setting(parser, '--seed', 0, None, 'seed of the random numbers')
    add_setting(
        parser,
        '--trials',
        5,
        'N',
        'number of trials of each configuration and direction, or of sessions of each '
        'configuration',
    )
    parser.add_argument(
        '--configuration',
        action='append',
        metavar='NAME',
        help='configuration to write; may be repeated (default: all three)',
    )
    parser.add_argument(
        '--rate', type=float, default=200.0, metavar='HZ', help='rate of the sensor (default: 200)'
    )
    noise = 'standard deviation of the noise on each axis'
    add_setting(parser, '--noise', 1e-4, 'M', noise)
    parser.add_argument(
        '--orientation',
        action='store_true',
        help='add columns for the orientation of the wrists; the others stay the same',
    )
    add_json(parser, 'write a summary of the outputs as JSON')


def run(options: argparse.Namespace) -> int:
    """
    Make the data set and write it.

    Args:
        options: the parsed arguments.

    Returns:
        0.

    """
    from handover_dmp.cli.progress import progress_bar
    from handover_dmp.mocap.data_set import write_data_set
    from handover_dmp.mocap.garage import CONFIGURATIONS
    from handover_dmp.mocap.session import write_sessions
    from handover_dmp.mocap.synthetic import synthesize
    from handover_dmp.mocap.synthetic_session import synthesize_sessions
    from handover_dmp.mocap.tables import save
    from rich.console import Console

    make: Callable[..., list[Any]] = synthesize
    write: Callable[..., None] = write_data_set
    describe: Callable[[Any], dict[str, Any]] = trial_facts
    place, what, legs, short = 'data_set', 'trials', 'give and take', SHORT_TRIALS
    if options.sessions:
        make, write, describe = synthesize_sessions, write_sessions, _session_facts
        place, what, legs, short = 'folder', 'sessions', 'a give and a take each', SHORT_SESSIONS
    configurations = options.configuration or CONFIGURATIONS
    how = {'rate_hz': options.rate, 'noise_m': options.noise, 'orientation': options.orientation}
    made = make(options.seed, options.trials, configurations=configurations, **how)
    with progress_bar(hidden=len(made) < short) as bar:
        task = bar.add_task('writing', total=len(made))
        write(made, options.output, progress=lambda: bar.advance(task))
    if options.json:
        summary = {
            place: str(options.output),
            'seed': options.seed,
            **how,
            what: [describe(one) for one in made],
        }
        save(options.json, json.dumps(summary, indent=2) + '\n')
    words = what.removesuffix('s') if len(made) == 1 else what
    Console(highlight=False, markup=False, soft_wrap=True).print(
        f'{options.output}: {len(made)} synthetic {words} of {", ".join(configurations)}, '
        f'{legs}, seed {options.seed}'
    )
    return 0


def trial_facts(trial: HandoverTrial) -> dict[str, Any]:
    """
    Describe a trial of a data set for `--json`.

    Args:
        trial: the trial.

    Returns:
        Its file, what it is and how long it lasts, s.

    """
    from handover_dmp.mocap.data_set import file_name

    return {
        'file': file_name(trial),
        'configuration': trial.configuration,
        'exchange': trial.direction,
        'trial': trial.number,
        'duration_s': trial.duration_s,
    }


def _session_facts(session: RecordedSession) -> dict[str, Any]:
    return {
        'file': session.file_name,
        'configuration': session.configuration,
        'trial': session.number,
        'duration_s': float(session.motion.times[-1]),
        'exchanges': [part._asdict() for part in session.exchanges],
    }
