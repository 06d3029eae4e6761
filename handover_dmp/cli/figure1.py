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

"""`handover_dmp figure1`: draw Fig. 1 of the paper: one learnt curve, a new goal, three μ."""

from __future__ import annotations

import argparse
from pathlib import Path

from handover_dmp.cli.options import add_json, add_output, add_setting, save_json
from handover_dmp.common.errors import UsageError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of `figure1`.

    Args:
        parser: parser of the verb.

    """
    parser.add_argument(
        'trial',
        nargs='?',
        type=Path,
        metavar='TRIAL.csv',
        help='trial whose P2 is learnt (default: a synthetic one)',
    )
    add_output(parser, 'FILE', 'picture to write, png, svg or pdf', Path('figure1.png'))
    parser.add_argument(
        '--mu',
        type=float,
        nargs=3,
        default=[0.25, 0.5, 0.75],
        metavar='MU',
        help='three centres of the goal weight, in units of τ (default: 0.25 0.5 0.75)',
    )
    shift = 'distance of the new goal beyond the learnt one, as a fraction of the learnt distance'
    add_setting(parser, '--shift', 0.3, 'PART', shift)
    add_json(parser, 'also write the curves as JSON')


def run(options: argparse.Namespace) -> int:
    """
    Draw the figure.

    Args:
        options: the parsed arguments.

    Returns:
        0.

    Raises:
        DataError: the trial cannot be used.
        UsageError: the kind of picture is unknown, or the shift is not finite.

    """
    from math import isfinite

    from handover_dmp.evaluation.figure1 import draw_figure1
    from handover_dmp.mocap import condition, read_trial, synthesize

    if options.output.suffix not in {'.png', '.svg', '.pdf'}:
        raise UsageError(
            f'{options.output}: the file name of a picture must end in .png, .svg or .pdf'
        )
    if not isfinite(options.shift):
        raise UsageError('--shift must be a finite number')
    trial = condition(read_trial(options.trial) if options.trial else synthesize(trials=1)[0])
    motions = draw_figure1(
        trial.times, trial.demonstrator, options.output, mu=options.mu, shift=options.shift
    )
    outcome = {
        'output': str(options.output),
        'mu': list(motions),
        'positions_m': [motion.tolist() for motion in motions.values()],
    }
    save_json(outcome, options.json, indent=None)
    print(options.output)
    return 0
