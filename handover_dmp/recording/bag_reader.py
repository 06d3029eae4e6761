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

"""Reading bags of this package or of rosbag2, complete or truncated, without ROS."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import redirect_stderr
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
import re
import struct
from typing import Any, NamedTuple

from handover_dmp.common.errors import DataError
from handover_dmp.common.plain_yaml import load_plain
from handover_dmp.recording.bag_file import (
    COMPRESSED,
    is_bag_file,
    is_whole,
    MCAP,
    read_bag_file,
    STORAGES,
)
from handover_dmp.recording.bag_metadata import METADATA_FILE, read_metadata
from mcap.records import Channel, Metadata, Schema
from mcap.records import Message as McapMessage
from mcap_ros2.decoder import DecoderFactory

# far above the largest real definition, far below the size at which the parser gets slow
DEFINITION_LINES = 4000
LINE_LENGTH = 1000
# exceptions of the decoder for bytes that do not fit the definition; the errors of its parser have
# no common base
MISFIT = (Exception,)


class BagMessage(NamedTuple):
    """
    One message of a bag.

    Attributes:
        topic: its topic.
        message: the decoded message; its fields are attributes, as in ROS.
        log_time_ns: time of recording, ns.

    """

    topic: str
    message: Any
    log_time_ns: int


@dataclass
class TopicInformation:
    """
    The content of a bag on one topic.

    Attributes:
        type_name: type of its messages.
        count: number of messages.
        first_ns: least log time, ns.
        last_ns: greatest log time, ns.

    """

    type_name: str
    count: int = 0
    first_ns: int = 0
    last_ns: int = 0

    @property
    def rate_hz(self) -> float:
        """Mean rate, Hz; 0 if there are fewer than two messages."""
        elapsed_s = (self.last_ns - self.first_ns) * 1e-9
        return (self.count - 1) / elapsed_s if self.count > 1 and elapsed_s > 0 else 0.0


@dataclass(frozen=True)
class BagInformation:
    """
    The content of a bag.

    Attributes:
        files: its files.
        topics: information by topic.
        complete: whether the recorder closed every file and wrote `metadata.yaml`.
        size: size of all files, bytes.

    """

    files: tuple[Path, ...]
    topics: dict[str, TopicInformation]
    complete: bool
    size: int

    @property
    def message_count(self) -> int:
        """Return the number of messages."""
        return sum(topic.count for topic in self.topics.values())

    @property
    def first_ns(self) -> int:
        """Log time of the first message, ns; 0 for an empty bag."""
        return min((topic.first_ns for topic in self.topics.values() if topic.count), default=0)

    @property
    def last_ns(self) -> int:
        """Log time of the last message, ns; 0 for an empty bag."""
        return max((topic.last_ns for topic in self.topics.values()), default=0)

    @property
    def duration_s(self) -> float:
        """Time from the first to the last message, s."""
        return (self.last_ns - self.first_ns) * 1e-9


def bag_files(path: Path | str) -> list[Path]:
    """
    Find the files of a bag.

    Args:
        path: a file or the folder of a bag, or the folder of a run with its bag in `bag/`.

    Returns:
        The files, in the order of writing.

    Raises:
        DataError: there is no bag, or its storage is neither MCAP nor sqlite3.

    """
    path = Path(path)
    if path.is_file():
        if not is_bag_file(path):
            raise DataError(f'{path}: not an MCAP file, nor a sqlite3 file of rosbag2')
        return [path]
    if not path.is_dir():
        raise DataError(f'{path}: no such bag')
    if (path / METADATA_FILE).is_file():
        return _listed_files(path)
    files = numbered_files(path) or numbered_files(path, '*.db3')
    if files:
        return files
    if (path / 'bag').is_dir():
        return bag_files(path / 'bag')
    raise DataError(f'{path}: no bag in this folder')


def read_bag(path: Path | str, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
    """
    Read and decode the messages of a bag.

    Args:
        path: a file or the folder of a bag, or the folder of a run with its bag in `bag/`.
        topics: topics to read; default: all. Other topics are not decoded, so errors in them do
            not matter.

    Yields:
        Messages in the order of the bag, which is the order of reception.

    Raises:
        DataError: the bag is missing or damaged. A bag whose recorder was killed is not damaged;
            it just ends.

    """
    for file in bag_files(path):
        yield from _read_file(file, topics)


def bag_information(path: Path | str) -> BagInformation:
    """
    Summarise the content of a bag by reading all of it.

    Args:
        path: a file or the folder of a bag, or the folder of a run with its bag in `bag/`.

    Returns:
        Its topics with their counts and times.

    Raises:
        DataError: there is no such bag, or it is damaged.

    """
    files = bag_files(path)
    topics: dict[str, TopicInformation] = {}
    for file in files:
        types: dict[int, str] = {}
        channels: dict[int, TopicInformation] = {}
        for record in read_bag_file(file):
            if isinstance(record, Schema):
                types[record.id] = record.name
            elif isinstance(record, Channel):
                type_name = types.get(record.schema_id, '')
                channels[record.id] = topics.setdefault(record.topic, TopicInformation(type_name))
            elif isinstance(record, McapMessage):
                topic = _known(channels, record.channel_id, file)
                topic.first_ns = min(
                    topic.first_ns if topic.count else record.log_time, record.log_time
                )
                topic.last_ns = max(topic.last_ns, record.log_time)
                topic.count += 1
    closed = all(is_whole(file) for file in files)
    described = Path(path).is_file() or (files[0].parent / METADATA_FILE).is_file()
    size = sum(file.stat().st_size for file in files)
    return BagInformation(tuple(files), topics, closed and described, size)


def bag_custom_data(path: Path | str) -> dict[str, str]:
    """
    Read the pairs of text that a bag contains.

    Args:
        path: a file or the folder of a bag, or the folder of a run with its bag in `bag/`.

    Returns:
        The `custom_data` of its first file; empty if there is none.

    Raises:
        DataError: there is no such bag, or it is damaged.

    """
    file = bag_files(path)[0]
    for record in read_bag_file(file):
        if isinstance(record, Metadata):
            return custom_data(record)
    if Path(path).is_dir() and (file.parent / METADATA_FILE).is_file():
        # sqlite3 files have no other place for it.
        pairs = read_metadata(file.parent).get('custom_data')
        return {str(key): str(value) for key, value in dict(pairs or {}).items()}
    return {}


def custom_data(record: Metadata) -> dict[str, str]:
    """Return the pairs of text in the metadata record of rosbag2."""
    try:
        information = load_plain(record.metadata.get('serialized_metadata', ''))
        pairs = information['custom_data'] or {}
        return {str(key): str(value) for key, value in pairs.items()}
    except (DataError, KeyError, TypeError, AttributeError):
        return {}


def numbered_files(folder: Path, pattern: str = f'*{MCAP}') -> list[Path]:
    """Return the files of a folder, sorted by the number at the end of their names."""
    return sorted(folder.glob(pattern), key=_file_number)


def _read_file(file: Path, topics: Collection[str] | None) -> Iterator[BagMessage]:
    factory = DecoderFactory()
    schemas: dict[int, Schema] = {}
    names: dict[int, str] = {}
    decoders: dict[int, Callable[[bytes], Any] | None] = {}
    for record in read_bag_file(file):
        if isinstance(record, McapMessage):
            decode = _known(decoders, record.channel_id, file)
            if decode is None:
                continue
            topic = names[record.channel_id]
            try:
                message = decode(_Checked(record.data))
            except MISFIT as error:
                fault = f'a message that does not fit its type: {error!r}'[:200]
                raise DataError(f'{file}: {_plain(topic)}: {fault}') from error
            yield BagMessage(topic, message, record.log_time)
        elif isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel) and record.id not in decoders:
            names[record.id] = record.topic
            wanted = topics is None or record.topic in topics
            decoders[record.id] = _decoder(factory, schemas, record, file) if wanted else None


def _decoder(
    factory: DecoderFactory, schemas: dict[int, Schema], channel: Channel, file: Path
) -> Callable[[bytes], Any]:
    schema = schemas.get(channel.schema_id)
    if schema is None:
        raise DataError(f'{file}: {_plain(channel.topic)}: the definition of its type is missing')
    try:
        # the parser prints its errors to the terminal before it raises them
        with redirect_stderr(StringIO()):
            plain = replace(schema, data=_without_comments(schema.data))
            decode = factory.decoder_for(channel.message_encoding, plain)
    except MISFIT as error:
        raise DataError(
            f'{file}: {_plain(channel.topic)}: no proper definition of {_plain(schema.name)}: '
            f'{error!r}'[:300]
        ) from error
    if decode is None:
        raise DataError(
            f'{file}: {_plain(channel.topic)}: encoded as {_plain(channel.message_encoding)} with '
            f'a definition in {_plain(schema.encoding)}, only cdr with ros2msg can be read'
        )
    return decode  # type: ignore[no-any-return]


def _without_comments(definition: bytes) -> bytes:
    """Return a definition without comments, which would take most of the parser's time."""
    lines = [line.split('#')[0].rstrip() for line in definition.decode().splitlines()]
    lines = [line for line in lines if line]
    if len(lines) > DEFINITION_LINES or max(map(len, lines), default=0) > LINE_LENGTH:
        raise ValueError('too long')
    return '\n'.join(lines).encode()


class _Checked(bytes):
    """Bytes that refuse reads beyond their end; the decoder does not check."""

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, slice) and key.stop is not None and key.stop > len(self):
            raise struct.error('it is too short')
        return super().__getitem__(key)


def _known(table: dict[int, Any], channel: int, file: Path) -> Any:
    try:
        return table[channel]
    except KeyError:
        raise DataError(f'{file}: a message of channel {channel}, which is not defined') from None


def _listed_files(folder: Path) -> list[Path]:
    information = read_metadata(folder)
    storage = information.get('storage_identifier')
    if storage not in STORAGES:
        raise DataError(
            f'{folder}: stored as {_plain(str(storage))}, only MCAP and sqlite3 can be read; '
            f'convert it with ros2 bag convert or rosbags-convert'
        )
    if information.get('compression_format') not in (None, '', 'zstd', 'none', 'NONE'):
        raise DataError(
            f'{folder}: compressed with {_plain(str(information["compression_format"]))}, only '
            f'zstd can be read; convert it with ros2 bag convert'
        )
    names = information.get('relative_file_paths')
    if not isinstance(names, list) or not names:
        raise DataError(f'{folder / METADATA_FILE}: names no files')
    files = []
    for name in names:
        # the files of a bag are beside its metadata; others must not be opened
        if not isinstance(name, str) or Path(name).name != name:
            raise DataError(f'{folder / METADATA_FILE}: {name!r} is not the name of a file')
        # Some versions give the name that a file had before compression.
        found = [file for file in (name, name + COMPRESSED) if (folder / file).is_file()]
        if not found:
            raise DataError(f'{folder / _plain(name)}: missing, though {METADATA_FILE} names it')
        files.append(folder / found[0])
    return files


def _file_number(file: Path) -> tuple[int, str]:
    number = re.search(r'_(\d{1,9})$', file.stem)
    return (int(number.group(1)) if number else 0, file.name)


def _plain(text: str) -> str:
    """Return a text from a file as one line without control characters."""
    return repr(text)[1:-1][:100]
