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

"""One file of a bag, of any storage and compression, as MCAP records."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
import tempfile

from handover_dmp.common.errors import DataError
from handover_dmp.recording.mcap_file import is_complete, read_mcap_records, RECORD_LIMIT
from handover_dmp.recording.sqlite3_file import read_sqlite3
from mcap.records import McapRecord, Message
import zstandard

MCAP = '.mcap'
SQLITE3 = '.db3'
COMPRESSED = '.zstd'
STORAGES = {'mcap': MCAP, 'sqlite3': SQLITE3}
FILE_LIMIT = 8 * 2**30
_BUFFER = 2**20
# First bytes of a zstd frame; a message begins with a zero.
_ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'


def is_bag_file(path: Path) -> bool:
    """Tell by its name whether a file may belong to a bag."""
    return storage_suffix(path) in STORAGES.values()


def storage_suffix(path: Path) -> str:
    """Return the suffix of a file's storage, without the suffix of its compression."""
    return Path(path.name.removesuffix(COMPRESSED)).suffix


def is_whole(path: Path) -> bool:
    """Return whether the end of the file shows that its recorder closed it."""
    return path.suffix != MCAP or is_complete(path)


def read_bag_file(path: Path) -> Iterator[McapRecord]:
    """
    Read the records of a file of a bag.

    Args:
        path: MCAP or sqlite3, compressed with zstd as a whole, by message or not at all.

    Yields:
        Its records in the order of the file.

    Raises:
        DataError: the file is missing or damaged.

    """
    with _unpacked(path) as plain:
        for record in read_sqlite3(plain) if plain.suffix == SQLITE3 else read_mcap_records(plain):
            if isinstance(record, Message) and record.data[:4] == _ZSTD_MAGIC:
                record = replace(record, data=_inflated(record.data, path))
            yield record


@contextmanager
def _unpacked(path: Path) -> Iterator[Path]:
    """Yield the file itself, or a file with its decompressed content."""
    if path.suffix != COMPRESSED:
        yield path
        return
    with tempfile.TemporaryDirectory(prefix='handover_dmp_bag_') as folder:
        plain = Path(folder) / path.name.removesuffix(COMPRESSED)
        try:
            _inflate_file(path, plain)
        except zstandard.ZstdError as error:
            raise DataError(f'{path}: not compressed with zstd, or damaged: {error}') from error
        yield plain


def _inflate_file(path: Path, plain: Path) -> None:
    written = 0
    inflator = zstandard.ZstdDecompressor()
    with path.open('rb') as packed, plain.open('wb') as stream:
        # rosbag2 writes one frame, but several frames are legal.
        reader = inflator.stream_reader(packed, read_across_frames=True)
        while piece := reader.read(_BUFFER):
            written += len(piece)
            if written > FILE_LIMIT:
                raise DataError(f'{path}: more than {FILE_LIMIT >> 30} GB when inflated')
            stream.write(piece)


def _inflated(data: bytes, path: Path) -> bytes:
    try:
        with zstandard.ZstdDecompressor().stream_reader(data) as frame:
            message = frame.read(RECORD_LIMIT + 1)
    except zstandard.ZstdError as error:
        raise DataError(f'{path}: a compressed message is damaged: {error}') from error
    if len(message) > RECORD_LIMIT:
        raise DataError(f'{path}: a message of more than {RECORD_LIMIT >> 20} MB')
    return message
