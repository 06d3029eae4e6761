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

"""`handover_dmp calibrate`: find the pose and the delay of a tracker."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, TYPE_CHECKING

from handover_dmp.cli.options import add_json, add_output, add_setting, save_json
from handover_dmp.cli.robot_arguments import add_robot_arguments, chosen_arm
from handover_dmp.common.errors import DataError, GET_ROS, HandoverError, UsageError

if TYPE_CHECKING:
    from handover_dmp.mocap.body_path import BodyPath
    from handover_dmp.tracking.calibration import Calibration

REFERENCE_TOPIC = '/wrist/pose'
TRACKER_TOPIC = '/hand/pose'
DURATION_S = 60.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of `calibrate`.

    Args:
        parser: parser of the verb.

    """
    parser.add_argument(
        'sources',
        nargs='*',
        type=Path,
        metavar='BAG | REFERENCE.csv TRACKER.csv',
        help='a bag with both paths, or two CSV files (t,x,y,z and, if known, qx,qy,qz,qw)',
    )
    parameters = 'parameter file for dmp and priority_ik; the figure is written beside it'
    add_output(parser, 'FILE.yaml', parameters, Path('tracker.yaml'))
    parser.add_argument(
        '--reference',
        default=REFERENCE_TOPIC,
        metavar='TOPIC',
        help='poses of the body in the frame of the nodes; TOPIC:NAME if the messages contain '
        'several bodies (default: %(default)s, published by priority_ik)',
    )
    poses = 'poses of the tracker, TOPIC or TOPIC:NAME'
    add_setting(parser, '--tracker', TRACKER_TOPIC, 'TOPIC', poses)
    parser.add_argument(
        '--frame',
        default='',
        help='frame of the tracker, if its poses do not name one of their own',
    )
    name = 'name of the tracker in the parameters of the nodes'
    add_setting(parser, '--name', 'tracker', None, name)
    parser.add_argument(
        '--marker',
        nargs=3,
        type=float,
        metavar=('X', 'Y', 'Z'),
        help='position of the marker in the axes of the reference, m (default: estimated, as far '
        'as the motion permits)',
    )
    delay = 'maximum delay to search for, in both directions'
    add_setting(parser, '--max-delay', 2.0, 'S', delay)
    clock = 'time of the poses of a bag: their stamps, or the time of recording'
    add_setting(parser, '--clock', 'stamp', None, clock, ('stamp', 'log'))
    parser.add_argument(
        '--part', type=int, metavar='N', help='part of a bag whose clock was set back, from 1'
    )
    add_json(parser, 'also write the result as JSON')
    add_move_arguments(parser)


def add_move_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Declare the options of moving the arm first.

    Args:
        parser: parser of the verb.

    """
    move = parser.add_argument_group('move the arm, record a bag, then calibrate')
    move.add_argument(
        '--move',
        action='store_true',
        help='move the arm of robot_sim, with a simulated tracker, and record both',
    )
    move.add_argument(
        '--running',
        action='store_true',
        help='move the arm that runs in this ROS domain with its tracker, in place of robot_sim',
    )
    move.add_argument(
        '--bag', type=Path, metavar='FOLDER', help='bag to record (default: beside the output)'
    )
    add_setting(move, '--duration', DURATION_S, 'S', 'duration of the motion')
    add_setting(move, '--seed', 0, None, 'seed of the simulated tracker')
    add_robot_arguments(parser, 'lwr4')


def run(options: argparse.Namespace) -> int:
    """
    Calibrate.

    Args:
        options: the parsed arguments.

    Returns:
        0, or 1 if the motion does not determine the pose of the tracker.

    Raises:
        DataError: the paths cannot be read, or are not of one body.
        UsageError: wrong options.

    """
    if not 0.1 <= options.max_delay <= 600.0:
        raise UsageError(f'--max-delay is {options.max_delay:g} s; it must be from 0.1 to 600')
    if options.output.suffix not in {'.yaml', '.yml'}:
        raise UsageError(f'{options.output}: the name of a parameter file must end in .yaml')
    if options.move:
        options.sources = [_moved(options)]
    if not 1 <= len(options.sources) <= 2:
        raise UsageError('calibrate needs a bag, two CSV files, or --move')
    from handover_dmp.tracking.calibration import calibrate

    reference, tracker = _paths(options)
    frame = _tracker_frame(options, reference.frame, tracker.frame)
    found = calibrate(reference, tracker, max_delay_s=options.max_delay, marker=options.marker)
    return _tell(options, found, frame, reference.frame)


def _moved(options: argparse.Namespace) -> Path:
    if options.sources:
        raise UsageError('--move records the bag itself: leave out the other sources')
    try:
        from handover_dmp.nodes.run_calibration import move_and_record
    except ModuleNotFoundError as error:
        raise HandoverError(f'{error.name} is not installed; {GET_ROS}') from error
    from handover_dmp.cli.progress import progress_bar

    bag: Path = options.bag or options.output.with_name(f'{options.output.stem}_bag')
    with progress_bar() as bar:
        task = bar.add_task('starting the nodes', total=1.0)
        move_and_record(
            bag,
            chosen_arm(options),
            duration_s=options.duration,
            running=options.running,
            seed=options.seed,
            tracker_topic=options.tracker.partition(':')[0],
            tell=lambda what, share: bar.update(task, description=what, completed=share),
        )
    return bag


def _paths(options: argparse.Namespace) -> tuple[BodyPath, BodyPath]:
    """Read the reference and the tracker."""
    from handover_dmp.mocap.bag import read_body_paths
    from handover_dmp.mocap.body_path import read_body_csv

    if len(options.sources) == 2:
        first, second = options.sources
        if first.suffix.lower() != '.csv' or second.suffix.lower() != '.csv':
            raise UsageError(f'{first}, {second}: two sources must both be CSV files')
        return read_body_csv(first), read_body_csv(second)
    if options.sources[0].suffix.lower() == '.csv':
        raise UsageError(f'{options.sources[0]}: the CSV file of the tracker is missing')
    reference, tracker = read_body_paths(
        options.sources[0],
        (options.reference, options.tracker),
        part=options.part,
        clock=options.clock,
    )
    return reference, tracker


def _tracker_frame(options: argparse.Namespace, reference: str, tracker: str) -> str:
    """Return the name of the tracker's frame for the nodes."""
    from handover_dmp.topics import FRAME

    frame = str(options.frame or tracker)
    if len(options.sources) == 2 and not frame:
        return 'tracker'
    if frame in ('', reference or FRAME):
        raise DataError(
            f'{options.tracker}: its poses are in the frame {frame!r}, as is the reference, so '
            'the nodes would not transform them; give the tracker a frame of its own, and name it '
            'with --frame if the bag was recorded before that'
        )
    return frame


def _tell(
    options: argparse.Namespace, found: Calibration, frame: str, reference_frame: str
) -> int:
    from handover_dmp.common.files import write_text
    from handover_dmp.tracking.calibration_figure import draw_calibration
    from handover_dmp.tracking.calibration_file import node_parameters, outcome, tells_delay
    from rich.console import Console

    figure = options.output.with_suffix('.png')
    draw_calibration(found, figure)
    console = Console(soft_wrap=True, highlight=False)
    _show(console, found)
    if 'delay' not in found.undetermined and not tells_delay(found):
        console.print(
            f'the clock of the tracker is {abs(found.delay_s):.1f} s off, more than the nodes '
            'accept: set the clock, or start the nodes with hand_stamps:=arrival',
            style='yellow',
        )
    for warning in found.warnings:
        console.print(warning, style='yellow')
    determined = not {'rotation', 'position'} & set(found.undetermined)
    result: dict[str, Any] = outcome(found) | {'figure': str(figure)}
    if determined:
        topic, _, body = options.tracker.partition(':')
        parameters = node_parameters(found, options.name, topic, body, frame, reference_frame)
        write_text(options.output, parameters)
        result['parameters'] = str(options.output)
        console.print(f'parameters: {options.output}, figure: {figure}')
    else:
        console.print(f'pose not determined, no parameters written; figure: {figure}', style='red')
    save_json(result, options.json, indent=1)
    return 0 if determined else 1


def _show(console: Any, found: Calibration) -> None:
    from rich.table import Table
    from scipy.spatial.transform import Rotation

    def millimetres(values: Any) -> str:
        return ', '.join(f'{1e3 * value:.1f}' for value in values)

    roll, pitch, yaw = Rotation.from_quat(found.quaternion).as_euler('xyz', degrees=True)
    table = Table(box=None, padding=(0, 2, 0, 0))
    for heading in ('', 'found', '95 %'):
        table.add_column(heading)
    table.add_row(
        "tracker's frame, mm",
        millimetres(found.position),
        f'± {millimetres(found.position_interval_m)}',
    )
    table.add_row(
        'roll, pitch, yaw, °',
        f'{roll:.2f}, {pitch:.2f}, {yaw:.2f}',
        f'± {found.rotation_interval_deg:.3f} about any axis',
    )
    table.add_row(
        'delay of the stamps, ms',
        f'{1e3 * found.delay_s:.2f}',
        f'± {1e3 * found.delay_interval_s:.2f}',
    )
    table.add_row(
        'marker on the body, mm',
        millimetres(found.marker),
        f'± {millimetres(found.marker_interval_m)}' if found.marker_estimated else 'given',
    )
    table.add_row(
        'residual, mm',
        f'{1e3 * found.residual_m:.2f} (root mean square)',
        f'95 % within {1e3 * found.residual_95_m:.2f}',
    )
    left_out = int((~found.counted).sum())
    table.add_row('poses', f'{len(found.times)}, {left_out} of them left out', '')
    console.print(table)
