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

"""Dispatch the verbs of `handover_dmp`, and turn errors into one line and an exit code."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from importlib import import_module
import sys

from handover_dmp import __version__
from handover_dmp.common.errors import HandoverError

DESCRIPTION = 'Human-robot handover with a decoupled Dynamic Movement Primitive.'

VERBS = {
    'demo': 'run, record and check one handover on the whole ROS 2 graph, and write a report',
    'synthesize': 'write a synthetic data set',
    'import': 'convert motion capture files of other formats to trials',
    'learn': 'learn a movement primitive from one trial or several',
    'rollout': 'run the movement primitive alone against a recorded hand',
    'simulate': 'run one handover in lockstep in this process, without ROS',
    'evaluate': 'reproduce Section III of the paper: Table I and its figures',
    'why': 'list the rejected curves of an evaluation, with time and size of the excess',
    'tune': 'search for better parameters on some trials, and test them on the others',
    'bag': 'convert trials to bags; inspect and repair bags',
    'calibrate': 'find the pose and the delay of a tracker, from one moved body',
    'robot': 'inspect an arm: joints, limits and their sources, wrist, reach, self-check',
    'compare': 'compare runs side by side, with their paired differences',
    'plot': 'draw the figures of a recorded run',
    'render': 'render a recorded run to a video and an animated image',
    'view': 'show a recorded run in the browser, with a time slider',
    'figure1': 'draw Fig. 1 of the paper: one learnt curve, a new goal, three μ',
    'bench': 'measure speed and accuracy, and compare them with other libraries',
}


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Run the command.

    Args:
        arguments: arguments after `handover_dmp`; default: those of the process.

    Returns:
        0 for success, 1 for bad data or a failed run, 2 for wrong usage.

    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    verb = next((word for word in words if not word.startswith('-')), None)
    parser = argparse.ArgumentParser(prog='handover_dmp', description=DESCRIPTION)
    parser.add_argument('--version', action='version', version=__version__)
    verbs = parser.add_subparsers(dest='verb', metavar='VERB', required=True)
    for name, purpose in VERBS.items():
        verb_parser = verbs.add_parser(name, help=purpose, description=purpose)
        if name == verb:
            # a module cannot have the name `import`
            file = 'import_verb' if name == 'import' else name
            module = import_module(f'handover_dmp.cli.{file}')
            module.add_arguments(verb_parser)
            verb_parser.set_defaults(run=module.run)
    options = parser.parse_args(words)
    try:
        return int(options.run(options))
    except HandoverError as error:
        print(f'handover_dmp {options.verb}: {error}', file=sys.stderr)
        return error.exit_code
    except OSError as error:
        # A file in place of a folder, a full disk, no permission: the user can fix these.
        named = f'{error.filename}: ' if error.filename else ''
        fault = error.strerror or error
        print(f'handover_dmp {options.verb}: {named}{fault}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f'handover_dmp {options.verb}: interrupted', file=sys.stderr)
        return 130
