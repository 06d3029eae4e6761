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

"""`handover_dmp demo`: run a handover or a session on the whole ROS 2 graph."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from handover_dmp.cli.running import add_run_arguments, run_and_report
from handover_dmp.common.errors import GET_ROS, HandoverError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument(
        '--trial',
        type=Path,
        help='CSV file or bag of the handover to replay (default: a synthetic one)',
    )
    parser.add_argument(
        '--model', type=Path, help='learnt movement (default: learnt from the trial)'
    )
    parser.add_argument(
        '--wall-clock', action='store_true', help='run in real time instead of in lockstep'
    )
    add_run_arguments(parser)


def run(options: argparse.Namespace) -> int:
    """Run the verb."""
    try:
        from handover_dmp.nodes.run_graph import run_graph
    except ModuleNotFoundError as error:
        raise HandoverError(f'{error.name} is not installed; {GET_ROS}') from error
    run_either = partial(run_graph, lockstep=not options.wall_clock)
    return run_and_report(options, options.trial, options.model, run_either, run_either)
