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

"""What `demo` and `simulate` share: options, progress, the report in the terminal."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from handover_dmp.cli.robot_arguments import add_robot_arguments, chosen_arm
from handover_dmp.common.errors import UsageError

Tell = Callable[[str, float], None]
RunGraph = Callable[[Path, Any, dict[str, Any], Tell, list[Any]], None]


def add_run_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that both verbs have."""
    parser.add_argument('-o', '--output', type=Path, help='folder of the run; default: in runs/')
    add_robot_arguments(parser, 'lwr4')
    parser.add_argument(
        '--partner-model',
        choices=['auto', 'off'],
        help='expect of the hand what the model knows of it, or not (default: as in config/)',
    )
    parser.add_argument(
        '--object',
        default='rod',
        metavar='NAME',
        help='what is carried: rod, cup, knife, box, or a .yaml file with one like those of '
        'config/objects.yaml (default: %(default)s)',
    )
    parser.add_argument('--seed', type=int, default=0, help='of the synthetic data')
    parser.add_argument('--scale', type=float, default=1.0, help='factor on the recorded motion')
    parser.add_argument(
        '--tracker',
        action='append',
        metavar='NAME',
        help='how the hand is seen: mocap, depth_camera, webcam, or a .yaml file like theirs; '
        'several times: by several at once; default: perfectly',
    )
    parser.add_argument('--json', type=Path, help='write the report there too')


def run_and_report(
    options: argparse.Namespace, trial: Path | None, model: Path | None, run_graph: RunGraph
) -> int:
    """
    Set up a run, conduct it, report on it.

    Args:
        options: those of `add_run_arguments`.
        trial: the handover to replay; none: the example.
        model: the learnt movement; none: learnt on the way.
        run_graph: runs the handover and leaves its bag in the folder.

    Returns:
        0 if the object changed hands, else 1.

    Raises:
        HandoverError: something is wrong with the request, the data or the run.

    """
    from handover_dmp.cli.progress import progress_bar
    from handover_dmp.handover.object_profile import object_profile
    from handover_dmp.handover.scenario import make_scenario
    from handover_dmp.runs.folder import finish, keep_inputs, new_run_folder, run_info, save_json
    from handover_dmp.tracking.tracker_preset import read_trackers

    if not 0.01 <= options.scale <= 100.0:
        raise UsageError(f'--scale {options.scale:g} is not between 0.01 and 100')
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
        for remark in scenario.robot.remarks:
            bar.console.print(
                f'{scenario.robot.urdf_path}: {remark}', style='yellow', soft_wrap=True
            )
        folder = new_run_folder(options.output, scenario.trial)
        keep_inputs(folder, scenario)
        topics = {one.name: one.absolute_topic for one in trackers}
        info = run_info(scenario, options.scale, topics)
        run_graph(folder, scenario, info, tell, trackers)
        tell('drawing and reporting', 0.95)
        report = finish(folder, scenario)
    save_json(report, options.json)
    return _show(report, folder)


def _show(report: dict[str, Any], folder: Path) -> int:
    """Say how it went, in a few lines."""
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
        ('gap at the least', _quantity(report['exchange_gap_least_m'], 'mm', 1e3)),
        ('lag behind the moving hand', moving or 'the hand was still'),
        ('peak speed of the wrist', _quantity(report['wrist_peak_speed_m_s'], 'm/s')),
        ('distance to the person (RMS)', _quantity(report['to_human']['rms_m'], 'mm', 1e3)),
        ('joint limits', f'{"kept" if limits["met"] else "NOT KEPT"} (used: {held})'),
    ):
        table.add_row(name, value)
    console = Console(soft_wrap=True)
    handed_over = bool(report['handed_over'])
    console.print(
        '[bold green]handed over[/]' if handed_over else '[bold red]not handed over[/]',
        'on the ROS 2 graph' if report['nodes'] else 'in lockstep, without ROS',
    )
    console.print(table)
    console.print(f'report: {folder / "index.html"}', highlight=False)
    return 0 if handed_over else 1


def _quantity(value: float | None, unit: str, factor: float = 1.0) -> str:
    return '–' if value is None else f'{factor * value:.3g} {unit}'
