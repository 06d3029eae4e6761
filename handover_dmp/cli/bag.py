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

"""`handover_dmp bag`: convert trials to bags; inspect and repair bags."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, TYPE_CHECKING

from handover_dmp.cli.options import add_json, add_setting, save_json
from handover_dmp.common.errors import UsageError

if TYPE_CHECKING:
    from rich.console import Console

USAGE = """handover_dmp bag DATASET -o DIR [--compression zstd|lz4|none] [--json FILE]
       handover_dmp bag info BAG [--json FILE]
       handover_dmp bag repair BAG [--json FILE]"""
PROGRESS_FROM = 50
"""Fewer trials than this are written in less than 2 s."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of `bag`.

    Args:
        parser: parser of the verb.

    """
    parser.usage = USAGE
    parser.add_argument(
        'words',
        nargs='+',
        metavar='DATASET | info BAG | repair BAG',
        help='data set (or one trial, CSV) to convert to bags; or a bag to inspect or repair: its '
        'folder, an MCAP file, or the folder of a run',
    )
    parser.add_argument('-o', '--output', type=Path, metavar='DIR', help='folder for the bags')
    kinds = ['zstd', 'lz4', 'none']
    add_setting(parser, '--compression', 'zstd', None, 'compression of the bags', kinds)
    add_json(parser, 'also write the outcome as JSON')


def run(options: argparse.Namespace) -> int:
    """
    Write, describe or repair bags.

    Args:
        options: the parsed arguments.

    Returns:
        0.

    Raises:
        UsageError: the words do not fit together.
        DataError: a data set or a bag that cannot be read or written.

    """
    from rich.console import Console

    console = Console()
    match options.words:
        case ['info', bag]:
            outcome = _describe(Path(bag), console)
        case ['repair', bag]:
            outcome = _repair(Path(bag), console)
        case ['info' | 'repair' as word] if not Path(word).exists():
            raise UsageError(f'{word} needs a bag: handover_dmp bag {word} BAG')
        case [source]:
            if options.output is None:
                raise UsageError('-o DIR, the folder for the bags, is missing')
            outcome = _write(Path(source), options.output, options.compression, console)
        case _:
            raise UsageError(f'expected one data set, info BAG or repair BAG, got {options.words}')
    save_json(outcome, options.json)
    return 0


def _write(source: Path, folder: Path, compression: str, console: Console) -> dict[str, Any]:
    from handover_dmp.cli.progress import progress_bar
    from handover_dmp.mocap import read_data_set, read_trial
    from handover_dmp.mocap.trial_bag import write_trial_bags
    from handover_dmp.recording.bag_metadata import read_metadata

    trials = [read_trial(source)] if source.is_file() else read_data_set(source)
    hidden = len(trials) < PROGRESS_FROM
    with progress_bar(hidden=hidden) as bar:
        task = bar.add_task('bags', total=len(trials))
        bags = write_trial_bags(
            trials, folder, compression, lambda done: bar.update(task, completed=done)
        )
    word = 'bag' if len(bags) == 1 else 'bags'
    play = f'ros2 bag play {bags[0]} --delay 2'
    console.print(f'{len(bags)} {word} in {folder}; try: {play}', soft_wrap=True)
    return {
        'bags': [
            {
                'folder': str(bag),
                'trial': trial.label,
                'messages': read_metadata(bag)['message_count'],
            }
            for bag, trial in zip(bags, trials, strict=True)
        ]
    }


def _describe(path: Path, console: Console) -> dict[str, Any]:
    from handover_dmp.recording import bag_information
    from rich.table import Table

    bag = bag_information(path)
    table = Table('topic', 'type', 'messages', 'rate, Hz')
    for column in table.columns[2:]:
        column.justify = 'right'
    for name, topic in sorted(bag.topics.items()):
        table.add_row(name, topic.type_name, str(topic.count), f'{topic.rate_hz:.1f}')
    console.print(f'{path}: {len(bag.files)} file(s), {bag.size / 1e6:.2f} MB', soft_wrap=True)
    console.print(f'{bag.message_count} messages in {bag.duration_s:.3f} s')
    console.print(table)
    if not bag.complete:
        console.print(
            f'its recorder did not close it; run: handover_dmp bag repair {path}', soft_wrap=True
        )
    return {
        'files': [str(file) for file in bag.files],
        'size': bag.size,
        'complete': bag.complete,
        'messages': bag.message_count,
        'start_ns': bag.first_ns,
        'duration_s': bag.duration_s,
        'topics': {
            name: {
                'type': topic.type_name,
                'messages': topic.count,
                'rate_hz': topic.rate_hz,
            }
            for name, topic in sorted(bag.topics.items())
        },
    }


def _repair(path: Path, console: Console) -> dict[str, Any]:
    from handover_dmp.recording import repair_bag

    repair = repair_bag(path)
    for file in repair.rewritten:
        console.print(f'{file}: rewritten', soft_wrap=True)
    if repair.metadata_written:
        console.print(f'{repair.files[0].parent / "metadata.yaml"}: written', soft_wrap=True)
    if not repair.rewritten and not repair.metadata_written:
        console.print('nothing to repair')
    if repair.dropped_chunks:
        console.print(f'{repair.dropped_chunks} chunk(s) in the middle could not be read')
    console.print(f'{repair.message_count} messages')
    return {
        'files': [str(file) for file in repair.files],
        'rewritten': [str(file) for file in repair.rewritten],
        'metadata_written': repair.metadata_written,
        'dropped_chunks': repair.dropped_chunks,
        'messages': repair.message_count,
    }
