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
import json

from handover_dmp.cli.outputs import add_json, add_output

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
    parser.add_argument(
        '--seed', type=int, default=0, help='seed of the random numbers (default: 0)'
    )
    parser.add_argument(
        '--trials',
        type=int,
        default=5,
        metavar='N',
        help='number of trials of each configuration and direction, or of sessions of each '
        'configuration (default: 5)',
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
    parser.add_argument(
        '--noise',
        type=float,
        default=1e-4,
        metavar='M',
        help='standard deviation of the noise on each axis (default: 0.0001)',
    )
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
    if options.sessions:
        return _run_sessions(options)
    from handover_dmp.cli.progress import progress_bar
    from handover_dmp.mocap.data_set import file_name, write_data_set
    from handover_dmp.mocap.garage import CONFIGURATIONS
    from handover_dmp.mocap.synthetic import synthesize
    from handover_dmp.mocap.tables import save
    from rich.console import Console

    configurations = options.configuration or CONFIGURATIONS
    trials = synthesize(
        options.seed,
        options.trials,
        configurations=configurations,
        rate_hz=options.rate,
        noise_m=options.noise,
        orientation=options.orientation,
    )
    with progress_bar(hidden=len(trials) < SHORT_TRIALS) as bar:
        task = bar.add_task('writing', total=len(trials))
        write_data_set(trials, options.output, progress=lambda: bar.advance(task))
    if options.json:
        made = {
            'data_set': str(options.output),
            'seed': options.seed,
            'rate_hz': options.rate,
            'noise_m': options.noise,
            'orientation': options.orientation,
            'trials': [
                {
                    'file': file_name(trial),
                    'configuration': trial.configuration,
                    'exchange': trial.direction,
                    'trial': trial.number,
                    'duration_s': trial.duration_s,
                }
                for trial in trials
            ],
        }
        save(options.json, json.dumps(made, indent=2) + '\n')
    Console(soft_wrap=True).print(
        f'{options.output}: {len(trials)} synthetic trials of {", ".join(configurations)}, '
        f'give and take, seed {options.seed}',
        highlight=False,
        markup=False,
    )
    return 0


def _run_sessions(options: argparse.Namespace) -> int:
    from handover_dmp.cli.progress import progress_bar
    from handover_dmp.mocap.garage import CONFIGURATIONS
    from handover_dmp.mocap.session import write_sessions
    from handover_dmp.mocap.synthetic_session import synthesize_sessions
    from handover_dmp.mocap.tables import save
    from rich.console import Console

    configurations = options.configuration or CONFIGURATIONS
    sessions = synthesize_sessions(
        options.seed,
        options.trials,
        configurations=configurations,
        rate_hz=options.rate,
        noise_m=options.noise,
        orientation=options.orientation,
    )
    with progress_bar(hidden=len(sessions) < SHORT_SESSIONS) as bar:
        task = bar.add_task('writing', total=len(sessions))
        write_sessions(sessions, options.output, progress=lambda: bar.advance(task))
    if options.json:
        made = {
            'folder': str(options.output),
            'seed': options.seed,
            'rate_hz': options.rate,
            'noise_m': options.noise,
            'orientation': options.orientation,
            'sessions': [
                {
                    'file': session.file_name,
                    'configuration': session.configuration,
                    'trial': session.number,
                    'duration_s': float(session.motion.times[-1]),
                    'exchanges': [part._asdict() for part in session.exchanges],
                }
                for session in sessions
            ],
        }
        save(options.json, json.dumps(made, indent=2) + '\n')
    word = 'session' if len(sessions) == 1 else 'sessions'
    Console(soft_wrap=True).print(
        f'{options.output}: {len(sessions)} synthetic {word} of {", ".join(configurations)}, '
        f'a give and a take each, seed {options.seed}',
        highlight=False,
        markup=False,
    )
    return 0
