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
The records of an MCAP file, read so that no file can do harm.

Python's MCAP library trusts every length in a file. This reader compares each length with the
available data before it allocates memory, inflates chunks only up to a limit, and verifies check
sums. A file of a killed recorder is not an error: it just ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
import os
from pathlib import Path
import struct
from typing import cast, IO
import zlib

from handover_dmp.common.errors import DataError
import lz4.frame  # type: ignore[import-untyped]
from mcap.exceptions import McapError
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import StreamReader
import zstandard

MAGIC = b'\x89MCAP0\r\n'
# rosbag2 closes a chunk at 768 kB, so a chunk of this size holds a message of this size
RECORD_LIMIT = 128 * 2**20
# exceptions of a chunk that cannot be inflated or has a wrong check sum
DAMAGE = (McapError, ValueError, struct.error, zstandard.ZstdError, RuntimeError, OverflowError)


class EndOfDataError(Exception):
    """A read beyond the end: the file ends here, or a length in it is wrong."""


@dataclass
class Damage:
    """
    Damage found while reading, for callers that continue in spite of it.

    Attributes:
        dropped_chunks: number of unreadable chunks.
        complete: whether the writer closed the file.

    """

    dropped_chunks: int = 0
    complete: bool = False


def is_complete(path: Path) -> bool:
    """Return whether the file has a complete end."""
    with _opened(path) as stream:
        if stream.seek(0, os.SEEK_END) < 2 * len(MAGIC):
            return False
        stream.seek(-len(MAGIC), os.SEEK_END)
        return stream.read(len(MAGIC)) == MAGIC


def read_mcap_records(path: Path, damage: Damage | None = None) -> Iterator[McapRecord]:
    """
    Read the records of an MCAP file from its beginning to its end or truncation.

    Args:
        path: the file.
        damage: if given, unreadable chunks are skipped and counted here, and everything after an
            invalid position is skipped, too; otherwise both are errors, unless the writer never
            closed the file.

    Yields:
        Records in the order of the file; chunks are replaced by their records.

    Raises:
        DataError: the file is not MCAP or damaged; names file and position.

    """
    complete = is_complete(path)
    tolerant = damage is not None
    damage = damage if damage is not None else Damage()
    damage.complete = complete
    with _opened(path) as stream:
        if not MAGIC.startswith(stream.read(len(MAGIC))):
            raise DataError(f'{path}: not an MCAP file')
        stream.seek(0)
        bounded = _Bounded(stream, os.fstat(stream.fileno()).st_size)
        reader = StreamReader(
            cast(IO[bytes], bounded), emit_chunks=True, record_size_limit=RECORD_LIMIT
        )
        records = reader.records
        while True:
            position = bounded.position
            try:
                record = next(records, None)
                if record is None:
                    return
            except (EndOfDataError, *DAMAGE) as error:
                broken_off = isinstance(error, EndOfDataError) and not complete
                if broken_off or tolerant:
                    damage.complete = False
                    return
                raise DataError(f'{path}: damaged at byte {position}: {_reason(error)}') from error
            if not isinstance(record, Chunk):
                yield record
                continue
            try:
                yield from _read_chunk(record)
            except (EndOfDataError, *DAMAGE) as error:
                if not tolerant:
                    raise DataError(
                        f'{path}: damaged chunk at byte {position}: {_reason(error)}'
                    ) from error
                damage.dropped_chunks += 1


def _read_chunk(chunk: Chunk) -> Iterator[McapRecord]:
    data = _inflate(chunk)
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError('wrong check sum')
    stream = _Bounded(BytesIO(data), len(data))
    # a chunk within a chunk is illegal and is skipped
    records = StreamReader(cast(IO[bytes], stream), skip_magic=True, emit_chunks=True).records
    while stream.position < len(data):
        yield next(records)


def _inflate(chunk: Chunk) -> bytes:
    size = chunk.uncompressed_size
    if size > RECORD_LIMIT:
        raise ValueError(f'{size} bytes are more than the limit of {RECORD_LIMIT}')
    if chunk.compression == '':
        data = bytes(chunk.data)
    elif chunk.compression == 'zstd':
        with zstandard.ZstdDecompressor().stream_reader(chunk.data) as frame:
            data = frame.read(size + 1)
    elif chunk.compression == 'lz4':
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    else:
        raise ValueError(f'unknown compression {chunk.compression[:20]!r}')
    if len(data) != size:
        raise ValueError(f'inflates to another size than {size} bytes')
    return data


class _Bounded:
    """A stream that refuses to read beyond its end, whatever length a file claims."""

    def __init__(self, stream: IO[bytes], size: int) -> None:
        self._stream = stream
        self._size = size
        self.position = 0

    def read(self, length: int) -> bytes:
        if length > self._size - self.position:
            raise EndOfDataError
        self.position += length
        return self._stream.read(length)


@contextmanager
def _opened(path: Path) -> Iterator[IO[bytes]]:
    try:
        stream = path.open('rb')
    except OSError as error:
        raise DataError(f'{path}: cannot be read: {error.strerror}') from error
    with stream:
        yield stream


def _reason(error: Exception) -> str:
    if isinstance(error, EndOfDataError):
        return 'a length in it is wrong'
    return str(error).splitlines()[0] if str(error) else type(error).__name__
