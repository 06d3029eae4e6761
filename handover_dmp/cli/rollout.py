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

"""`handover_dmp rollout`: run the movement primitive alone against a recorded hand."""

from __future__ import annotations

import argparse
from pathlib import Path

from handover_dmp.cli.options import add_json, add_output, add_setting, save_json
from handover_dmp.common.errors import UsageError

HEADER = 't,x,y,z,vx,vy,vz,wg,s'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of `rollout`.

    Args:
        parser: parser of the verb.

    """
    parser.add_argument('model', type=Path, metavar='MODEL.json', help='learnt movement')
    parser.add_argument(
        'trial', type=Path, metavar='TRIAL.csv', help='trial: P1 is the hand, P2(0) the start'
    )
    add_output(parser, 'OUT.csv', f'CSV file to write, with columns {HEADER}')
    add_setting(parser, '--rate', 200.0, 'HZ', 'rate of the samples')
    parser.add_argument(
        '--duration', type=float, metavar='S', help='duration τ in place of that of the model'
    )
    parser.add_argument(
        '--partner-model',
        choices=['auto', 'off'],
        default='off',
        help='auto: use the partner model, if the learnt movement has one (default: off)',
    )
    parser.add_argument(
        '--deviation',
        action='store_true',
        help='add the columns sx,sy,sz: standard deviation by the posterior, m',
    )
    add_json(parser, 'also write the outcome as JSON')


def run(options: argparse.Namespace) -> int:
    """
    Roll out and write the motion.

    Args:
        options: the parsed arguments.

    Returns:
        0.

    Raises:
        DataError: the model or the trial cannot be used.
        UsageError: the rate is out of range.

    """
    from handover_dmp.common.files import write_text
    from handover_dmp.dmp import load_model
    from handover_dmp.handover.teaching import rollout_against
    from handover_dmp.mocap import read_trial
    from handover_dmp.tracking.partner_model import PartnerOptions
    import numpy as np
    from rich.console import Console

    if not 1.0 <= options.rate <= 100_000.0:
        raise UsageError(f'--rate is {options.rate:g} Hz; it must be from 1 to 100,000')
    if options.deviation and options.partner_model == 'auto':
        raise UsageError('--deviation cannot be combined with --partner-model auto')
    model = load_model(options.model)
    if options.duration is not None:
        model = model.with_duration(options.duration)
    trial = read_trial(options.trial)
    partner = PartnerOptions() if options.partner_model == 'auto' else None
    rollout = rollout_against(
        model, trial, options.rate, deviation=options.deviation, partner=partner
    )
    columns = [
        rollout.times,
        rollout.positions,
        rollout.velocities,
        rollout.goal_weight,
        rollout.phase,
    ]
    header = HEADER
    if rollout.deviation is not None:
        columns.append(rollout.deviation)
        header += ',sx,sy,sz'
    lines = [','.join(f'{value:.12g}' for value in row) for row in np.column_stack(columns)]
    write_text(options.output, '\n'.join([header, *lines]) + '\n')
    away = rollout.positions[-1] - trial.partner[-1] - model.goal_offset
    outcome = {
        'output': str(options.output),
        'samples': len(rollout.times),
        'rate_hz': options.rate,
        'duration_s': float(rollout.times[-1] - rollout.times[0]),
        'final_position_m': rollout.positions[-1].tolist(),
        'final_distance_to_goal_mm': 1e3 * float(np.linalg.norm(away)),
    }
    save_json(outcome, options.json, indent=1)
    Console(highlight=False, markup=False, soft_wrap=True).print(
        f'{options.output}: {outcome["samples"]} samples at {options.rate:g} Hz, '
        f'{outcome["final_distance_to_goal_mm"]:.1f} mm from the goal at the end'
    )
    return 0
