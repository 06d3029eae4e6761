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

"""
Options, progress and terminal report of `demo` and `simulate`.

Both run one handover, or with `--session` a whole session.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from handover_dmp.cli.options import add_setting, save_json
from handover_dmp.cli.robot_arguments import add_robot_arguments, chosen_arm
from handover_dmp.common.errors import UsageError

Tell = Callable[[str, float], None]
RunGraph = Callable[[Path, Any, dict[str, Any], Tell, list[Any]], None]
TOOL = 'rod'
"""Default object."""
HEAVIEST_KG = 7.0
"""Maximum mass that the arm can carry, kg."""


def add_run_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of both verbs."""
    parser.add_argument(
        '-o', '--output', type=Path, help='folder of the run (default: a new one in runs/)'
    )
    add_robot_arguments(parser, 'lwr4')
    parser.add_argument(
        '--partner-model',
        choices=['auto', 'off'],
        help='whether to use the partner model of the learnt movement (default: as in config/)',
    )
    carried = (
        'object: rod, cup, knife, box, or a .yaml file with one like those of config/objects.yaml'
    )
    add_setting(parser, '--object', TOOL, 'NAME', carried)
    add_setting(parser, '--seed', 0, None, 'seed of the synthetic data')
    add_setting(parser, '--scale', 1.0, None, 'scale factor of the recorded motion')
    parser.add_argument(
        '--tracker',
        action='append',
        metavar='NAME',
        help='tracker that sees the hand: mocap, depth_camera, webcam, or a .yaml file like '
        'theirs; may be repeated (default: a perfect tracker)',
    )
    parser.add_argument('--json', type=Path, help='also write the report as JSON')
    parser.add_argument(
        '--session',
        action='store_true',
        help='run a whole session: give, wait while the object is used, take back, go home; the '
        'trial is then a recorded session, see synthesize --sessions; also writes a film and '
        'a page',
    )
    parser.add_argument(
        '--take-model',
        type=Path,
        metavar='MODEL.json',
        help='learnt movement of the take of a session (default: learnt from the recording)',
    )
    parser.add_argument(
        '--mass',
        type=float,
        metavar='KG',
        help='mass of the object of a session; 0: no object (default: as in config/objects.yaml)',
    )
    parser.add_argument(
        '--no-pick-up',
        action='store_true',
        help='begin a session with the object in the gripper (default: the arm picks it up where '
        'the recorded person did, if that was recorded)',
    )


def run_and_report(
    options: argparse.Namespace,
    trial: Path | None,
    model: Path | None,
    run_graph: RunGraph,
    run_session: RunGraph,
) -> int:
    """
    Set up a run, carry it out and report on it.

    Args:
        options: those of `add_run_arguments`.
        trial: handover or session to replay; None: a synthetic one.
        model: learnt movement (of a session, that of the give); None: learnt now.
        run_graph: runs the handover and writes its bag into the folder.
        run_session: runs the session and writes its bag into the folder.

    Returns:
        0 if the object was handed over, in a session given and taken back, else 1.

    Raises:
        HandoverError: something is wrong with the request, the data or the run.

    """
    if options.session:
        return _run_session(options, trial, model, run_session)
    for word, value in (
        ('--take-model', options.take_model),
        ('--mass', options.mass),
        ('--no-pick-up', options.no_pick_up or None),
    ):
        if value is not None:
            raise UsageError(f'{word} needs --session')
    from handover_dmp.cli.progress import progress_bar
    from handover_dmp.handover.object_profile import object_profile
    from handover_dmp.handover.scenario import make_scenario
    from handover_dmp.runs.folder import finish, keep_inputs, new_run_folder, run_info
    from handover_dmp.tracking.tracker_preset import read_trackers

    if not 0.01 <= options.scale <= 100.0:
        raise UsageError(f'--scale is {options.scale:g}; it must be from 0.01 to 100')
    trackers = read_trackers(options.tracker or (), options.seed)
    carried = object_profile(options.object)
    with progress_bar() as bar:
        task = bar.add_task('placing the arm', total=1.0)

        def tell(what: str, share: float) -> None:
            bar.update(task, description=what, completed=share)

        scenario = make_scenario(
            trial,
            model=model,
            arm=chosen_arm(options),
            scale=options.scale,
            seed=options.seed,
            partner_model=options.partner_model,
            carried=carried,
        )
        _remark(bar, scenario.robot)
        replayed = scenario.trial
        folder = new_run_folder(options.output, replayed.direction, replayed.configuration)
        keep_inputs(folder, scenario)
        topics = {one.name: one.absolute_topic for one in trackers}
        info = run_info(scenario, options.scale, topics)
        run_graph(folder, scenario, info, tell, trackers)
        tell('drawing and reporting', 0.95)
        report = finish(folder, scenario)
    save_json(report, options.json)
    return _show(report, folder)


def _run_session(
    options: argparse.Namespace, recording: Path | None, model: Path | None, run_graph: RunGraph
) -> int:
    """Run a session, report on it and film it."""
    from handover_dmp.cli.progress import progress_bar
    from handover_dmp.handover.object_profile import object_profile
    from handover_dmp.handover.session_scenario import make_session_scenario
    from handover_dmp.runs.folder import finish, keep_session, new_run_folder, session_info
    from handover_dmp.tracking.tracker_preset import read_trackers

    profile = object_profile(options.object)
    mass_kg = profile.mass_kg if options.mass is None else options.mass
    if not 0.0 <= mass_kg <= HEAVIEST_KG:
        raise UsageError(f'--mass is {mass_kg:g} kg; it must be from 0 to {HEAVIEST_KG:g}')
    if options.scale != 1.0:
        raise UsageError('--scale cannot be combined with --session')
    trackers = read_trackers(options.tracker or (), options.seed)
    with progress_bar() as bar:
        task = bar.add_task('placing the arm', total=1.0)

        def tell(what: str, share: float) -> None:
            bar.update(task, description=what, completed=share)

        scenario = make_session_scenario(
            recording,
            model=model,
            take_model=options.take_model,
            arm=chosen_arm(options),
            seed=options.seed,
            partner_model=options.partner_model,
            profile=profile,
            pick_up=mass_kg > 0.0 and not options.no_pick_up,
        )
        _remark(bar, scenario.robot)
        folder = new_run_folder(options.output, 'session', scenario.session.configuration)
        keep_session(folder, scenario)
        info = session_info(scenario, mass_kg, {one.name: one.absolute_topic for one in trackers})
        run_graph(folder, scenario, info, tell, trackers)
        tell('drawing and reporting', 0.6)
        report = finish(folder, scenario, lambda share: tell('filming', 0.6 + 0.4 * share))
    save_json(report, options.json)
    return _show_session(report, folder)


def _remark(bar: Any, robot: Any) -> None:
    for remark in robot.remarks:
        bar.console.print(f'{robot.urdf_path}: {remark}', style='yellow', soft_wrap=True)


def _show_session(report: dict[str, Any], folder: Path) -> int:
    """Print the outcome of a session, with one column per leg."""
    from handover_dmp.report.cells import look_up
    from handover_dmp.view.session_film import FILM, PAGE
    from rich.console import Console
    from rich.table import Table

    session = report['session']
    legs, limits = session['legs'], report['limits']
    table = Table(box=None, padding=(0, 2, 0, 0))
    for head in ('', *(leg['direction'] for leg in legs)):
        table.add_column(head)
    for name, keys, unit, factor in (
        ('reach', ('reach_duration_s',), 's', 1.0),
        ('gap when the exchange began', ('exchange_gap_m',), 'mm', 1e3),
        ('peak speed of the wrist', ('wrist_peak_speed_m_s',), 'm/s', 1.0),
        ('distance to the person (RMS)', ('to_human', 'rms_m'), 'mm', 1e3),
        ('both held the object for', ('release', 'both_s'), 's', 1.0),
    ):
        table.add_row(name, *(_quantity(look_up(leg, *keys), unit, factor) for leg in legs))
    table.add_row('released by', *(str(leg['release']['rule'] or '–') for leg in legs))
    console = Console(soft_wrap=True)
    done = _tell_outcome(console, report, 'given and taken back')
    console.print(table)
    verdict = {True: 'DROPPED', False: 'never dropped', None: 'not simulated'}[session['dropped']]
    early = ', RELEASED EARLY' if session['released_early'] else ''
    console.print(
        f'object: {verdict}{early}; joint limits {"kept" if limits["met"] else "NOT KEPT"}'
    )
    for what, name in (('report', 'index.html'), ('film', FILM), ('page', PAGE)):
        console.print(f'{what}: {folder / name}', highlight=False)
    return 0 if done and not session['dropped'] else 1


def _show(report: dict[str, Any], folder: Path) -> int:
    """Print the outcome of a handover."""
    from rich.console import Console
    from rich.table import Table

    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    lag, limits = report['lag'], report['limits']
    moving = (
        '' if lag['time_ms'] is None else f'{lag["time_ms"]:.1f} ms, {lag["distance_mm"]:.1f} mm'
    )
    held = ', '.join(
        f'{name} {limits[name]["share"]:.0%}'
        for name in ('position', 'velocity', 'acceleration')
        if limits.get(name)
    )
    for name, value in (
        ('reach', _quantity(report['reach_duration_s'], 's')),
        ('gap when the exchange began', _quantity(report['exchange_gap_m'], 'mm', 1e3)),
        ('smallest gap', _quantity(report['exchange_gap_least_m'], 'mm', 1e3)),
        ('lag behind the moving hand', moving or 'the hand was at rest'),
        ('peak speed of the wrist', _quantity(report['wrist_peak_speed_m_s'], 'm/s')),
        ('distance to the person (RMS)', _quantity(report['to_human']['rms_m'], 'mm', 1e3)),
        *(
            (name, _quantity(report[key], 'deg'))
            for name, key in (
                (f'tilt of the {report["object"]}', 'object_tilt_max_deg'),
                (f'handle of the {report["object"]} off the hand', 'handle_angle_deg'),
            )
            if report[key] is not None
        ),
        ('joint limits', f'{"kept" if limits["met"] else "NOT KEPT"} (used: {held})'),
    ):
        table.add_row(name, value)
    console = Console(soft_wrap=True)
    handed_over = _tell_outcome(console, report, 'handed over')
    console.print(table)
    console.print(f'report: {folder / "index.html"}', highlight=False)
    return 0 if handed_over else 1


def _tell_outcome(console: Any, report: dict[str, Any], success: str) -> bool:
    """Print whether the run succeeded, and where; return whether it did."""
    done = bool(report['handed_over'])
    outcome = f'[bold green]{success}[/]' if done else f'[bold red]not {success}[/]'
    console.print(outcome, 'on the ROS 2 graph' if report['nodes'] else 'in lockstep, without ROS')
    return done


def _quantity(value: float | None, unit: str, factor: float = 1.0) -> str:
    return '–' if value is None else f'{factor * value:.3g} {unit}'
