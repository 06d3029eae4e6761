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

"""A folder of trials with its index `trials.csv`."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
import csv
import io
from pathlib import Path
import re
import shutil

from handover_dmp.common.errors import DataError
from handover_dmp.mocap.tables import quote, read_bytes, read_records, save
from handover_dmp.mocap.trial import (
    DIRECTIONS,
    HandoverTrial,
    INDEX_COLUMNS,
    INDEX_NAME,
    read_trial,
    way_back_file,
    write_trial,
)
import numpy as np

# Exchanges of one configuration are within an arm's length of each other; beyond this distance
# the frames differ.
SAME_FRAME_M = 2.0
_COLUMNS = (*INDEX_COLUMNS, 'rate_hz', 'source')


def read_data_set(folder: str | Path) -> list[HandoverTrial]:
    """
    Read every trial that the index of a data set names.

    Args:
        folder: the data set; its `trials.csv` has at least the columns
            `file,configuration,exchange,trial`.

    Returns:
        The trials in the order of the index.

    Raises:
        DataError: the index or a trial is missing or faulty, two trials have the same name, or
            trials of one configuration and exchange are metres apart; names file, line and fault.

    """
    folder = Path(folder)
    if not folder.is_dir():
        raise DataError(f'{folder}: no such folder')
    index = folder / INDEX_NAME
    trials = []
    names: set[tuple[str, str, int]] = set()
    for line, row in read_records(index, INDEX_COLUMNS):
        trial = _read_row(folder, row, f'{index}: line {line}')
        name = (trial.configuration, trial.direction, trial.number)
        if name in names:
            raise DataError(f'{index}: line {line}: {trial.label} is there twice')
        names.add(name)
        trials.append(trial)
    if not trials:
        raise DataError(f'{index}: names no trial')
    _check_frames(folder, trials)
    return trials


def write_data_set(
    trials: Sequence[HandoverTrial],
    folder: str | Path,
    *,
    append: bool = False,
    progress: Callable[[], object] | None = None,
) -> None:
    """
    Write trials and then their index, so that the index never names a missing file.

    Existing files stay unchanged: none is replaced, and an index only gets more lines.

    Args:
        trials: the trials, no two of one configuration, exchange and number.
        folder: output folder; created if missing.
        append: add to the existing data set instead of making a new one.
        progress: called after each trial.

    Raises:
        DataError: two trials have the same name, a file exists already, or the folder cannot be
            written to; nothing is written then.

    """
    folder = Path(folder)
    files = [file_name(trial) for trial in trials]
    repeated = [name for name, count in Counter(files).items() if count > 1]
    if repeated:
        raise DataError(f'{folder}: more than one trial would be written as {repeated[0]}')
    if not append:
        check_no_data_set(folder)
    for file in files:
        for path in (folder / file, way_back_file(folder / file)):
            if path.exists():
                raise DataError(f'{path}: exists already; a trial is never overwritten')
    index = _with_rows(folder / INDEX_NAME if append else None, trials)
    with ExitStack() as undo:
        if not folder.exists():
            undo.callback(shutil.rmtree, folder, ignore_errors=True)
        for trial, file in zip(trials, files, strict=True):
            for path in (way_back_file(folder / file), folder / file):
                undo.callback(_remove, path)
            write_trial(trial, folder / file)
            if progress:
                progress()
        save(folder / INDEX_NAME, index)
        undo.pop_all()


def check_no_data_set(folder: Path) -> None:
    """
    Make sure that a folder is free for a new data set.

    Args:
        folder: folder of the new data set.

    Raises:
        DataError: the folder has a data set already.

    """
    if (folder / INDEX_NAME).exists():
        raise DataError(
            f'{folder / INDEX_NAME}: exists already; a data set is never overwritten '
            '(`import --append` adds to one)'
        )


def file_name(trial: HandoverTrial) -> str:
    """Return the name of a trial's file, `<configuration>_<exchange>_<number>.csv`."""
    configuration = re.sub(r'[^A-Za-z0-9_-]+', '-', trial.configuration).strip('-') or 'unnamed'
    return f'{configuration}_{trial.direction}_{trial.number}.csv'


def _remove(path: Path) -> None:
    with suppress(OSError):
        path.unlink()


def _with_rows(index: Path | None, trials: Sequence[HandoverTrial]) -> str:
    """Return the text of an index (None: an empty one) with trials added in its own columns."""
    old = ','.join(_COLUMNS)
    if index:
        read_records(index, INDEX_COLUMNS)
        old = read_bytes(index).decode('utf-8')
    end = '\r\n' if '\r\n' in old else '\n'
    header = next(csv.reader(old.removeprefix('\ufeff').splitlines()))
    table = io.StringIO()
    writer = csv.DictWriter(
        table, [name.strip() for name in header], extrasaction='ignore', lineterminator=end
    )
    for trial in trials:
        row = (file_name(trial), trial.configuration, trial.direction, trial.number)
        values = (*row, f'{trial.rate_hz:g}', trial.source)
        writer.writerow(dict(zip(_COLUMNS, values, strict=True)))
    return old.rstrip('\r\n ') + end + table.getvalue()


def _read_row(folder: Path, row: dict[str, str], where: str) -> HandoverTrial:
    file = row['file']
    if not file or '\0' in file or Path(file).is_absolute() or '..' in Path(file).parts:
        raise DataError(f'{where}: file {quote(file)} is not the name of a file in this folder')
    if not row['configuration']:
        raise DataError(f'{where}: configuration is empty')
    if row['exchange'] not in DIRECTIONS:
        raise DataError(f"{where}: exchange {quote(row['exchange'])} instead of 'give' or 'take'")
    if not re.fullmatch('[0-9]{1,9}', row['trial'], re.ASCII):
        raise DataError(f'{where}: trial {quote(row["trial"])} is not a number')
    path = folder / file
    if not path.exists():
        raise DataError(f'{where}: names {quote(file)}, which is not there')
    return read_trial(
        path,
        configuration=row['configuration'],
        direction=row['exchange'],
        number=int(row['trial']),
    )


def _check_frames(folder: Path, trials: Sequence[HandoverTrial]) -> None:
    cases: defaultdict[tuple[str, str], list[HandoverTrial]] = defaultdict(list)
    for trial in trials:
        cases[trial.configuration, trial.direction].append(trial)
    for case in cases.values():
        ends = np.array([(trial.partner[-1], trial.demonstrator[-1]) for trial in case])
        # Of two trials neither is the outlier: the second is compared with the first.
        usual = ends[0] if len(case) == 2 else np.median(ends, axis=0)
        distances = np.linalg.norm(ends - usual, axis=2).max(axis=1)
        worst = int(np.argmax(distances))
        if distances[worst] > SAME_FRAME_M:
            raise DataError(
                f'{folder / case[worst].source}: its exchange lies {distances[worst]:.2g} m '
                f'from the others of {case[worst].configuration} {case[worst].direction}; '
                'do all use the same frame?'
            )
