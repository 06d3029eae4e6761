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

"""`handover_dmp learn`: learn a movement primitive from one recorded handover or several."""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
from typing import Any, TYPE_CHECKING

from handover_dmp.cli.low_pass import add_low_pass
from handover_dmp.cli.options import add_json, add_output, add_setting, save_json
from handover_dmp.common.errors import UsageError

if TYPE_CHECKING:
    from handover_dmp.mocap import HandoverTrial


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of `learn`.

    Args:
        parser: parser of the verb.

    """
    parser.add_argument(
        'trials',
        nargs='+',
        type=Path,
        metavar='TRIAL',
        help='trial, CSV; from several trials, their time-normalised mean is learnt',
    )
    parser.add_argument(
        '--representative',
        action='store_true',
        help='learn from the trial that is nearest to the mean of all trials',
    )
    add_output(parser, 'MODEL.json', 'model to write')
    parser.add_argument(
        '--parameters',
        type=Path,
        metavar='FILE',
        help='ROS parameter file with a dmp section, as written by `tune`; options override it',
    )
    for name, metavar, purpose in (
        ('--stiffness', 'K', 'K of (8)'),
        ('--damping', 'D', 'D of (8); 0: critical, 2√K'),
        ('--goal-velocity-gain', 'KV', 'K_v of (8), s; negative: Dτ'),
        ('--alpha', 'A', 'decay rate α of the phase (4)'),
        ('--mu', 'MU', 'centre of the goal weight (7), in units of τ'),
        ('--sigma', 'S', 'width of the goal weight (7), in units of τ'),
    ):
        parser.add_argument(name, type=float, metavar=metavar, help=purpose)
    parser.add_argument(
        '--formulation', choices=['stiff', 'printed'], help='K_s of (8): K, or 1 as printed'
    )
    regression = 'regression: sparse Bayesian (rvm) or ridge'
    add_setting(parser, '--regression', 'rvm', None, regression, ['rvm', 'ridge'])
    parser.add_argument(
        '--basis', type=int, metavar='N', help='number of basis functions (default: 100)'
    )
    parser.add_argument(
        '--joint',
        action='store_true',
        help='learn from all samples of all trials at once instead of from their mean',
    )
    parser.add_argument(
        '--classical', action='store_true', help='learn the classical primitive (1)'
    )
    add_low_pass(parser)
    add_json(parser, 'also write the outcome as JSON')


def run(options: argparse.Namespace) -> int:
    """
    Learn and write the model.

    Args:
        options: the parsed arguments.

    Returns:
        0.

    Raises:
        DataError: a trial cannot be learnt from, or a parameter is out of range.
        UsageError: the number of basis functions is out of range.

    """
    from handover_dmp.dmp import ClassicalDmp, DecoupledDmp, save_model
    from handover_dmp.dmp.learning import DEFAULT_BASIS
    from handover_dmp.dmp.parameter_file import read_parameters, TunedParameters
    from handover_dmp.handover.teaching import learn_from_trials, reproduction_error
    from handover_dmp.mocap import read_trial
    from handover_dmp.mocap.typical import demonstrator_curves, nearest_to_mean
    import numpy as np
    from rich.console import Console

    trials = [read_trial(path) for path in options.trials]
    if len(trials) == 1:
        _warn_if_unusual(options.trials[0], trials[0])
    elif options.representative:
        trials = [trials[nearest_to_mean(demonstrator_curves(trials))]]
    tuned = read_parameters(options.parameters) if options.parameters else TunedParameters()
    model = learn_from_trials(
        trials,
        _parameters(options, tuned.primitive),
        regression=options.regression,
        basis=DEFAULT_BASIS if options.basis is None else options.basis,
        jointly=options.joint,
        primitive=ClassicalDmp if options.classical else DecoupledDmp,
        cutoff_hz=options.low_pass,
    )
    if tuned.duration_scale != 1.0:
        model = model.with_duration(tuned.duration_scale * model.duration_s)
    save_model(model, options.output)
    outcome: dict[str, Any] = {
        'model': str(options.output),
        'source': model.source,
        'trials': len(trials),
        'duration_s': model.duration_s,
        'regression': options.regression,
        'basis_functions': model.basis.size,
        'orientation': model.turn is not None,
        'used_basis_functions': np.count_nonzero(model.weights, axis=0).tolist(),
        'reproduction_error_mm': [
            1e3 * reproduction_error(model, trial, options.low_pass) for trial in trials
        ],
        'way_back_s': None if model.way_back is None else model.way_back.duration_s,
    }
    save_json(outcome, options.json, indent=1)
    used = '/'.join(str(count) for count in outcome['used_basis_functions'])
    worst = max(outcome['reproduction_error_mm'])
    way_back = f'; way back of {model.way_back.duration_s:.3f} s' if model.way_back else ''
    Console(highlight=False, markup=False, soft_wrap=True).print(
        f'{options.output}: {model.source}; τ = {model.duration_s:.3f} s, {used} of '
        f'{model.basis.size} basis functions, at most {worst:.2f} mm off '
        f'{"the demonstration" if len(trials) == 1 else "a demonstration"}'
        f'{"" if model.turn is None else "; with orientation"}{way_back}'
    )
    return 0


def _warn_if_unusual(file: Path, trial: HandoverTrial) -> None:
    from handover_dmp.mocap.typical import is_unusual, trials_beside

    if unusual := is_unusual(trial, trials_beside(file, trial)):
        print(
            f'handover_dmp learn: warning: {file} is unusual: {unusual}; learn from several, or '
            'from the nearest to their mean (--representative)',
            file=sys.stderr,
        )


def _parameters(options: argparse.Namespace, tuned: Any) -> Any:
    from dataclasses import replace
    from math import exp, isfinite

    names = ('stiffness', 'damping', 'goal_velocity_gain', 'mu', 'sigma', 'formulation')
    given = {name: getattr(options, name) for name in names if getattr(options, name) is not None}
    if options.alpha is not None:
        if not (isfinite(options.alpha) and options.alpha > 0.0):
            raise UsageError(f'--alpha is {options.alpha}; it must be above 0')
        given['phase_at_end'] = exp(-options.alpha)
    return replace(tuned, **given)
