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

"""`handover_dmp import`: convert motion capture files of other formats to trials."""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import replace
from importlib import import_module
import json
from pathlib import Path
import re
from typing import TYPE_CHECKING

from handover_dmp.cli.low_pass import add_low_pass
from handover_dmp.cli.options import add_json, add_output
from handover_dmp.cli.synthesize import trial_facts
from handover_dmp.common.errors import DataError, UsageError

if TYPE_CHECKING:
    from handover_dmp.mocap.markers import MarkerRecording
    from handover_dmp.mocap.review import Review
    from handover_dmp.mocap.segmentation import SegmentedMotion
    from handover_dmp.mocap.trial import HandoverTrial
    from handover_dmp.mocap.wrists import WristMotion

FORMATS = {
    'csv': 'CSV of both wrists, with the header of a trial, of any length; or a folder of them',
    'qualisys': 'TSV of Qualisys Track Manager, 3D trajectories or 6D rigid bodies',
    'c3d': 'C3D',
    'motive': 'CSV of OptiTrack Motive, format 1.2 and later',
    'vicon': 'CSV or text of Vicon Nexus, or of the objects of Vicon Tracker',
    'trc': 'TRC of OpenSim or Cortex',
    'bag': 'rosbag2 folder, MCAP or sqlite3, with topics of poses',
}
# In file names, these words hint at who gives, but are no proof.
_MAY_TELL = 'giv|gave|tak|took|receiv'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.

    Args:
        parser: parser of the verb.

    """
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = '\n'.join(
        [
            'formats:',
            *(f'  {name:<9}{what}' for name, what in FORMATS.items()),
            '',
            'P1 is the partner who stays human, P2 the demonstrator whose role the robot takes.',
            'Each SOURCE is one handover or, with --segment, a recording of any number of them.',
        ]
    )
    parser.add_argument('format', choices=FORMATS, metavar='FORMAT', help=', '.join(FORMATS))
    parser.add_argument('sources', nargs='+', type=Path, metavar='SOURCE', help='files to read')
    add_output(parser, 'DATASET', 'folder to write')
    parser.add_argument(
        '--append',
        action='store_true',
        help='add to an existing data set, which stays as it is, in place of a new one',
    )
    for partner in ('p1', 'p2'):
        parser.add_argument(
            f'--{partner}',
            action='append',
            metavar='NAME',
            help=f"marker or rigid body of {partner.upper()}'s wrist (repeated: the centre of "
            'several), or topic of a bag, TOPIC:BODY if it has several bodies',
        )
    parser.add_argument(
        '--unit',
        metavar='UNIT',
        help='m, cm, mm, in or ft; overrides the file (default: as the file says)',
    )
    parser.add_argument(
        '--up',
        choices=('x', 'y', 'z', '-x', '-y', '-z'),
        metavar='AXIS',
        help='axis that points up (x, y, z, -x, -y, -z); overrides the file (default: as the file '
        'says; if it says nothing, the axis along which the wrists rest at a plausible '
        'height)',
    )
    add_low_pass(parser, default='none')
    parser.add_argument(
        '--dry-run', action='store_true', help='show what would be written, but write nothing'
    )
    default = 'default: as the bag says, else by the file name <configuration>_<exchange>_<number>'
    parser.add_argument('--configuration', metavar='NAME', help=f'configuration ({default})')
    parser.add_argument('--exchange', choices=('give', 'take'), help=f'direction ({default})')
    bags = parser.add_argument_group('bags')
    bags.add_argument(
        '--part', type=int, metavar='N', help='part of a bag whose clock was set back, from 1'
    )
    bags.add_argument(
        '--clock',
        choices=('stamp', 'log'),
        help='time of the poses: their stamps, or the time of recording (default: stamp)',
    )
    cutting = parser.add_argument_group('segmentation of long recordings')
    cutting.add_argument(
        '--segment',
        action='store_true',
        help='cut the recording into handovers, by distance and speed',
    )
    cutting.add_argument(
        '--giver',
        choices=('first_mover', 'p2', 'p1', 'p2_then_p1', 'p1_then_p2'),
        help='who gives: whoever moves first, always the same person, or both in turn (default: '
        'as in the index of sessions, else first_mover)',
    )
    cutting.add_argument(
        '--way-back',
        action='store_true',
        help="keep P2's way back after each exchange, in the folder way_back of the data set; "
        '`learn` then adds it to the model',
    )
    for threshold, metavar, purpose in (
        ('--near', 'M', 'distance of the wrists within which they may exchange, m'),
        ('--apart', 'M', 'distance beyond which the wrists have parted, m'),
        ('--moving', 'SPEED', 'speed below which a wrist is at rest, m/s'),
        ('--reach', 'SPEED', 'speed that a reach must exceed, m/s'),
    ):
        cutting.add_argument(threshold, type=float, metavar=metavar, help=purpose)
    cutting.add_argument(
        '--figure',
        type=Path,
        metavar='FILE',
        help='draw the handovers that were found (.png, .svg)',
    )
    add_json(parser, 'also write the result as JSON')


def run(options: argparse.Namespace) -> int:
    """
    Read the sources and write the data set.

    Args:
        options: the parsed arguments.

    Returns:
        0.

    Raises:
        DataError: a source cannot be read, or contains no handover.
        UsageError: the options do not fit together.

    """
    from handover_dmp.cli.progress import progress_bar
    from handover_dmp.mocap.data_set import check_no_data_set, read_data_set, write_data_set
    from handover_dmp.mocap.filtering import condition
    from handover_dmp.mocap.review import review
    from handover_dmp.mocap.review_page import review_page
    from handover_dmp.mocap.tables import save

    _check(options)
    if not options.append:
        check_no_data_set(options.output)
    old = read_data_set(options.output) if options.append else []
    new: list[HandoverTrial] = []
    motions: list[tuple[WristMotion, float]] = []
    segmented: list[SegmentedMotion] = []
    sources = _sources(options)
    with progress_bar() as bar:
        for source in bar.track(sources, description='reading'):
            motion = _read(options, source)
            if options.segment:
                segmented.append(_segment(options, source, motion))
                configuration = options.configuration or _told(options, source)[0]
                new += segmented[-1].trials(configuration, way_back=options.way_back)
                motions += [(motion, part.start_s) for part in segmented[-1].segments]
            else:
                new.append(_whole(options, source, motion))
                motions.append((motion, float(motion.times[0])))
    if options.figure and not options.dry_run:
        from handover_dmp.mocap.segmentation_figure import draw_segmentation

        draw_segmentation(segmented[0], options.figure)
    if options.low_pass is not None:
        new = [condition(trial, trial.rate_hz, options.low_pass) for trial in new]
    if not new:
        passages = [passage for part in segmented for passage in part.passages]
        why = f': at {passages[0].at_s:.2f} s, {passages[0].reason}' if passages else ''
        raise DataError(f'{", ".join(map(str, sources))}: no handover found{why}')
    new = _numbered(old, new)
    reviews = [review(trial, *motion) for trial, motion in zip(new, motions, strict=True)]
    if not options.segment:
        reviews = [
            _with_direction(options, source, one)
            for source, one in zip(sources, reviews, strict=True)
        ]
    if not options.dry_run:
        write_data_set(new, options.output, append=options.append)
        page = review_page(reviews, f'Imported into {options.output.name}')
        save(options.output / 'import.html', page)
    if options.json and not options.dry_run:
        found = {
            'data_set': str(options.output),
            'trials': [
                trial_facts(trial) | {'rate_hz': trial.rate_hz, 'source': trial.source}
                for trial in new
            ],
            'left_out': [
                {'source': part.motion.source, 'at_s': at_s, 'reason': reason}
                for part in segmented
                for at_s, reason in part.passages
            ],
        }
        save(options.json, json.dumps(found, indent=2) + '\n')
    _report(options, reviews, segmented)
    return 0


def _check(options: argparse.Namespace) -> None:
    from handover_dmp.mocap.units import METRES, unit_of

    if options.figure and not (options.segment and len(_sources(options)) == 1):
        raise UsageError(
            '--figure shows how one SOURCE was segmented: it needs one SOURCE and --segment'
        )
    if options.segment and options.exchange:
        raise UsageError('--exchange is for single handovers; with --segment use --giver')
    if not options.segment:
        for name in ('giver', 'near', 'apart', 'moving', 'reach'):
            if getattr(options, name) is not None:
                raise UsageError(f'--{name} needs --segment')
        if options.way_back:
            raise UsageError('--way-back needs --segment')
    both = set(options.p1 or []) & set(options.p2 or [])
    if both and options.format != 'bag':
        raise UsageError(f'--p1 and --p2 both name {min(both)!r}; they must be two people')
    if options.format == 'csv':
        if options.p1 or options.p2:
            raise UsageError(
                '--p1 and --p2 are not for a CSV of both wrists: its columns have these names'
            )
        if options.unit or options.up:
            raise UsageError(
                '--unit and --up are not for a CSV of both wrists: it is in metres, z up'
            )
    if options.format == 'bag':
        if max(len(options.p1 or []), len(options.p2 or [])) > 1:
            raise UsageError('a bag has one topic for each wrist: give --p1 and --p2 once each')
    elif options.part is not None or options.clock:
        raise UsageError('--part and --clock are for bags')
    if options.unit and unit_of(options.unit) is None:
        raise UsageError(f'--unit {options.unit!r} is not one of {", ".join(METRES)}')


def _sources(options: argparse.Namespace) -> list[Path]:
    """Replace each folder by the recordings in it, without their index."""
    if options.format != 'csv':
        return list(options.sources)
    from handover_dmp.mocap.session import session_files, SESSIONS_NAME

    found: list[Path] = []
    for source in options.sources:
        found += session_files(source) if source.is_dir() else [source]
    return [source for source in found if source.name != SESSIONS_NAME]


def _read(options: argparse.Namespace, source: Path) -> WristMotion:
    if options.format == 'csv':
        from handover_dmp.mocap.session import read_csv_wrists

        return read_csv_wrists(source)
    if options.format == 'bag':
        from handover_dmp.mocap.bag import DEMONSTRATOR_TOPIC, PARTNER_TOPIC, read_bag_wrists

        return read_bag_wrists(
            source,
            (options.p1 or [PARTNER_TOPIC])[0],
            (options.p2 or [DEMONSTRATOR_TOPIC])[0],
            part=options.part,
            clock=options.clock or 'stamp',
            unit=options.unit,
            up=options.up,
        )
    module = import_module(f'handover_dmp.mocap.{options.format}')
    read = getattr(module, f'read_{options.format}')
    markers = [*(options.p1 or []), *(options.p2 or [])]
    recording: MarkerRecording = read(source, markers)
    if not (options.p1 and options.p2):
        raise UsageError(
            f'--p1 and --p2 must name markers or bodies; {source} has {recording.known}'
        )
    return recording.wrists(options.p1, options.p2, unit=options.unit, up=options.up)


def _segment(options: argparse.Namespace, source: Path, motion: WristMotion) -> SegmentedMotion:
    from handover_dmp.mocap.segmentation import segment, Segmentation
    from handover_dmp.mocap.session import giver_of

    told = {
        'giver': options.giver or (giver_of(source) if options.format == 'csv' else None),
        'near_m': options.near,
        'apart_m': options.apart,
        'moving_speed': options.moving,
        'reach_speed': options.reach,
    }
    return segment(
        motion, Segmentation(**{name: value for name, value in told.items() if value is not None})
    )


def _whole(options: argparse.Namespace, source: Path, motion: WristMotion) -> HandoverTrial:
    configuration, direction, number = _told(options, source)
    direction = options.exchange or direction
    if direction is None and re.search(_MAY_TELL, source.stem, re.IGNORECASE):
        raise UsageError(
            f'{source}: does its name tell whether P2 gives or takes? Say --exchange give '
            'or take, or name it <configuration>_give_<number> or <configuration>_take_<number>'
        )
    return motion.trial(
        0,
        len(motion.times),
        configuration=options.configuration or configuration,
        direction=direction or 'give',
        number=number,
    )


def _told(options: argparse.Namespace, source: Path) -> tuple[str, str | None, int]:
    from handover_dmp.mocap.bag import describe_bag
    from handover_dmp.mocap.session import describe_session
    from handover_dmp.mocap.trial import describe

    if options.format == 'bag':
        return describe_bag(source)
    told = describe_session(source) if options.format == 'csv' else None
    return (told[0], None, told[1]) if told else describe(source)


def _with_direction(options: argparse.Namespace, source: Path, one: Review) -> Review:
    """Warn about recordings that do not say their direction."""
    if options.exchange or _told(options, source)[1]:
        return one
    line = (
        'the file does not say whether P2 gives or takes; give is assumed (otherwise: '
        '--exchange take)'
    )
    return replace(one, warnings=(line, *one.warnings))


def _numbered(old: list[HandoverTrial], new: list[HandoverTrial]) -> list[HandoverTrial]:
    """Keep the numbers of trials if they are free, else use the next free ones."""
    taken = {(trial.configuration, trial.direction, trial.number) for trial in old}
    highest: Counter[tuple[str, str]] = Counter()
    for trial in old:
        case = trial.configuration, trial.direction
        highest[case] = max(highest[case], trial.number)
    numbered = []
    for trial in new:
        case = trial.configuration, trial.direction
        number = trial.number if (*case, trial.number) not in taken else highest[case] + 1
        highest[case] = max(highest[case], number)
        taken.add((*case, number))
        numbered.append(replace(trial, number=number))
    return numbered


def _report(
    options: argparse.Namespace, reviews: list[Review], segmented: list[SegmentedMotion]
) -> None:
    from handover_dmp.mocap.data_set import file_name
    from rich.console import Console
    from rich.table import Table

    table = Table('file', 'from', box=None, pad_edge=False)
    for title in ('s', 'Hz', 'unit', 'up', 'P1 m/s', 'P2 m/s', 'nearest m', 'gaps'):
        table.add_column(title, justify='right')
    for one in reviews:
        trial = one.trial
        numbers = (*one.peak_speeds, one.nearest_m)
        table.add_row(
            file_name(trial), trial.source, f'{trial.duration_s:.2f}', f'{trial.rate_hz:.4g}',
            one.unit, one.up, *(f'{number:.2f}' for number in numbers), str(len(one.gaps)),
        )  # fmt: skip
    console = Console(soft_wrap=True, markup=False, highlight=False)
    if not console.is_terminal:
        console.width = 200
    console.print(table)
    for one in reviews:
        for warning in one.warnings:
            console.print(f'{file_name(one.trial)}: {warning}', style='yellow')
    for part in segmented:
        for at_s, reason in part.passages:
            console.print(f'{part.motion.source}: at {at_s:.2f} s left out: {reason}')
    count = f'{len(reviews)} trial' if len(reviews) == 1 else f'{len(reviews)} trials'
    end = 'nothing written (--dry-run)' if options.dry_run else 'written'
    console.print(f'{options.output}: {count} {end}')
    if not options.dry_run:
        console.print(f'{options.output / "import.html"}')
