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

"""Reading text files of numbers: a value, or a one-line error that names the fault."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
import csv
import io
import math
from pathlib import Path
import re

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.common.files import write_text
import numpy as np

LARGEST_TEXT_BYTES = 16_000_000
MAX_ROWS = 200_000
LARGEST_RECORDING_BYTES = 150_000_000
MAX_RECORDING_LINES = 500_000
_MAX_LINE_BYTES = 1_000_000
_MAX_QUOTE = 40
# float() accepts more (underscores, digits of other scripts), which is no number in a file.
_NUMBER = re.compile(r'[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?', re.ASCII)
_NOT_FINITE = re.compile(r'[-+]?(nan|inf|infinity)', re.ASCII | re.IGNORECASE)


def read_bytes(path: Path, largest: int = LARGEST_TEXT_BYTES) -> bytes:
    """
    Read a regular file of a bounded size.

    Args:
        path: the file.
        largest: size limit, bytes.

    Returns:
        Its content.

    Raises:
        DataError: the file is missing, not regular, not readable, empty or too large.

    """
    try:
        if not path.exists():
            raise DataError(f'{path}: no such file')
        if not path.is_file():
            raise DataError(f'{path}: not a regular file')
        with path.open('rb') as file:
            content = file.read(largest + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise DataError(f'{str(path)[:200]!r}: cannot be read: {reason}') from error
    if len(content) > largest:
        raise DataError(f'{path}: more than {largest / 1e6:g} MB')
    if not content:
        raise DataError(f'{path}: is empty')
    return content


def read_lines(path: Path) -> list[str]:
    """
    Read the lines of a UTF-8 text, without empty ones at its end.

    Args:
        path: the file.

    Returns:
        At least one line, without line ends.

    Raises:
        DataError: as in `read_bytes`, or the file is no text.

    """
    content = read_bytes(path)
    try:
        text = content.decode('utf-8-sig')
    except UnicodeDecodeError as error:
        line = content.count(b'\n', 0, error.start) + 1
        raise DataError(f'{path}: line {line}: not a text in UTF-8') from error
    lines = text.replace('\r\n', '\n').replace('\r', '\n').rstrip('\n ').split('\n')
    if lines == ['']:
        raise DataError(f'{path}: is empty')
    return lines


def iterate_lines(path: Path) -> Iterator[tuple[int, str]]:
    """
    Read a long recording line by line: UTF-8, UTF-16 or, from older programs, Windows-1252.

    Args:
        path: the file.

    Yields:
        Number of the line, from 1, and its text without the line end.

    Raises:
        DataError: as in `read_bytes`, or a line is too long, or there are too many.

    """
    content = _in_utf_8(read_bytes(path, LARGEST_RECORDING_BYTES))
    for number, raw in enumerate(io.BytesIO(content), start=1):
        if len(raw) > _MAX_LINE_BYTES:
            raise DataError(f'{path}: line {number}: longer than {_MAX_LINE_BYTES} bytes')
        if number > MAX_RECORDING_LINES:
            raise DataError(f'{path}: more than {MAX_RECORDING_LINES} lines')
        try:
            line = raw.decode('utf-8-sig' if number == 1 else 'utf-8')
        except UnicodeDecodeError:
            line = raw.decode('cp1252', errors='replace')
        yield number, line.rstrip('\r\n')


def _in_utf_8(content: bytes) -> bytes:
    """Decode UTF-16, recognised by its byte order mark or the zero of its first letter."""
    start = content[:2]
    wide = {b'\xff\xfe': 'utf-16', b'\xfe\xff': 'utf-16'}.get(start)
    if wide is None and len(start) == 2 and 0 in start:
        wide = 'utf-16-be' if start[0] == 0 else 'utf-16-le'
    if wide is not None:
        content = content.decode(wide, errors='replace').encode()
    # Programs of old Macintoshes end a line with only a carriage return.
    return content if b'\n' in content else content.replace(b'\r', b'\n')


def read_table(path: Path, headers: Sequence[tuple[str, ...]]) -> tuple[tuple[str, ...], Array]:
    """
    Read a CSV file of finite numbers under one of several headers.

    Args:
        path: the file.
        headers: the names that its first line may have; the first ones are usual.

    Returns:
        The names, and (rows, len(names)) numbers; rows may be 0.

    Raises:
        DataError: names file, line and fault.

    """
    lines = read_lines(path)
    names = tuple(name.strip() for name in lines[0].split(','))
    if names not in headers:
        raise DataError(
            f'{path}: line 1: header {quote(lines[0])} instead of {",".join(headers[0])!r}'
        )
    if len(lines) > MAX_ROWS:
        raise DataError(f'{path}: more than {MAX_ROWS} lines')
    values = np.empty((len(lines) - 1, len(names)))
    for number, line in enumerate(lines[1:], start=2):
        values[number - 2] = parse_numbers(line.split(','), names, f'{path}: line {number}')
    return names, values


def read_records(path: Path, columns: Sequence[str]) -> list[tuple[int, dict[str, str]]]:
    """
    Read a CSV file of texts that has at least the given columns.

    Args:
        path: the file.
        columns: required names of its first line, in any order; further columns are allowed.

    Returns:
        For every row, the number of the line, and the texts by column name.

    Raises:
        DataError: names file, line and fault.

    """
    lines = read_lines(path)
    if len(lines) > MAX_ROWS:
        raise DataError(f'{path}: more than {MAX_ROWS} lines')
    rows = csv.reader(lines, strict=True)
    records = []
    try:
        names = [name.strip() for name in next(rows)]
        missing = [name for name in columns if name not in names]
        if missing:
            raise DataError(f'{path}: line 1: no column {missing[0]!r} in {quote(lines[0])}')
        for row in rows:
            where = f'{path}: line {rows.line_num}'
            if len(row) != len(names):
                raise DataError(f'{where}: {len(row)} values instead of {len(names)}')
            cells = [cell.strip() for cell in row]
            records.append((rows.line_num, dict(zip(names, cells, strict=True))))
    except csv.Error as error:
        raise DataError(f'{path}: line {rows.line_num}: {error}') from error
    return records


def save(path: Path, text: str) -> None:
    """
    Write a text file atomically.

    Args:
        path: the file; its folder is created if missing.
        text: its content.

    Raises:
        DataError: it cannot be written there.

    """
    try:
        write_text(path, text)
    except OSError as error:
        raise DataError(f'{path}: cannot be written: {error.strerror or error}') from error


def parse_numbers(cells: Sequence[str], names: Sequence[str], where: str) -> list[float]:
    """
    Turn the cells of a row into finite numbers.

    Args:
        cells: the texts.
        names: name of each column; as many as cells are expected.
        where: file and line, for the error.

    Returns:
        The numbers.

    Raises:
        DataError: the row has too few or too many cells, or a cell is no finite number.

    """
    if len(cells) != len(names):
        raise DataError(f'{where}: {len(cells)} values instead of {len(names)}')
    text = ''.join(cells)
    if text.isascii() and '_' not in text:
        with suppress(ValueError):
            values = [float(cell) for cell in cells]
            if all(map(math.isfinite, values)):
                return values
    # Slow path: find the faulty cell.
    return [parse_number(cell, name, where) for cell, name in zip(cells, names, strict=True)]


def parse_number(cell: str, name: str, where: str) -> float:
    """
    Turn one cell into a finite number.

    Args:
        cell: the text.
        name: name of the value, for the error.
        where: file and line, for the error.

    Returns:
        The number.

    Raises:
        DataError: it is no finite number.

    """
    text = cell.strip(' \t')
    if _NUMBER.fullmatch(text):
        value = float(text)
        if math.isfinite(value):
            return value
    elif not _NOT_FINITE.fullmatch(text):
        raise DataError(f'{where}: {name} is {quote(text)}, not a number')
    raise DataError(f'{where}: {name} is {quote(text)}, not a finite number')


def quote(text: str) -> str:
    """Return a text for an error message, shortened to fit on one line."""
    return repr(text if len(text) <= _MAX_QUOTE else text[:_MAX_QUOTE] + '…')
