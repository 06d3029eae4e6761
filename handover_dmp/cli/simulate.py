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

"""`handover_dmp simulate`: a handover or a session in lockstep in this process, without ROS."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, TYPE_CHECKING

from handover_dmp.cli.running import add_run_arguments, run_and_report, Tell
from handover_dmp.common.errors import UsageError

if TYPE_CHECKING:
    from handover_dmp.handover.scenario import Scenario
    from handover_dmp.handover.session_scenario import SessionScenario


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    for name, metavar, purpose in (
        ('model', 'MODEL.json', 'learnt movement (default: learnt from the trial)'),
        ('recorded', 'TRIAL.csv', 'trial to replay (default: a synthetic one)'),
    ):
        parser.add_argument(name, type=Path, nargs='?', metavar=metavar, help=purpose)
    parser.add_argument('--trial', type=Path, help='same as TRIAL.csv')
    add_run_arguments(parser)


def run(options: argparse.Namespace) -> int:
    """Run the verb."""
    if options.recorded is not None and options.trial is not None:
        raise UsageError('give the trial once, as TRIAL.csv or with --trial')
    _check_definitions()
    trial = options.recorded or options.trial
    return run_and_report(options, trial, options.model, _conduct, _conduct_session)


def _check_definitions() -> None:
    """Check that all message definitions are there before the run: no bag without them."""
    from handover_dmp.recording import message_definition
    from handover_dmp.topics import TOPICS

    for topic in TOPICS:
        message_definition(topic.type_name)


def _conduct(
    folder: Path, scenario: Scenario, info: dict[str, Any], tell: Tell, trackers: list[Any]
) -> None:
    from handover_dmp.handover.lockstep import simulate
    from handover_dmp.runs.bag import write_run_bag

    periods = simulate(scenario, lambda share: tell('handing over', share), trackers)
    topics = [one.absolute_topic for one in trackers]
    write_run_bag(folder / 'bag', scenario, periods, info, topics)


def _conduct_session(
    folder: Path,
    scenario: SessionScenario,
    info: dict[str, Any],
    tell: Tell,
    trackers: list[Any],
) -> None:
    from handover_dmp.handover.session_lockstep import simulate_session
    from handover_dmp.runs.bag import write_session_bag

    mass_kg = float(info['object_mass_kg'])
    periods = simulate_session(
        scenario,
        lambda share: tell('giving and taking back', 0.6 * share),
        trackers,
        scenario.carried(mass_kg),
    )
    topics = [one.absolute_topic for one in trackers]
    write_session_bag(folder / 'bag', scenario, periods, info, topics)
