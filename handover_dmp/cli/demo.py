"""`handover_dmp demo`: the main job, one handover on the whole ROS 2 graph."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from handover_dmp.cli.running import add_run_arguments, run_and_report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument('--trial', type=Path, help='CSV file or bag of the handover to replay')
    parser.add_argument('--model', type=Path, help='learnt movement; default: learnt on the way')
    parser.add_argument(
        '--wall-clock', action='store_true', help='in real time instead of in lockstep'
    )
    add_run_arguments(parser)


def run(options: argparse.Namespace) -> int:
    """Run the verb."""
    from handover_dmp.nodes.conduct import conduct

    in_time = partial(conduct, lockstep=not options.wall_clock)
    return run_and_report(options, options.trial, options.model, in_time)
