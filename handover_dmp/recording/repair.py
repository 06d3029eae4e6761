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

"""Repair of bags whose recorder was killed, or that lost data on disk."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from handover_dmp.common.errors import DataError
from handover_dmp.common.files import replacing
from handover_dmp.common.plain_yaml import load_plain
from handover_dmp.recording.bag_file import MCAP
from handover_dmp.recording.bag_metadata import (
    FileStatistics,
    read_metadata,
    rosbag2_information,
    TopicMetadata,
    write_metadata,
)
from handover_dmp.recording.bag_reader import bag_files, custom_data, numbered_files
from handover_dmp.recording.bag_writer import LIBRARY
from handover_dmp.recording.mcap_file import Damage, read_mcap_records
from mcap.records import Attachment, Channel, Footer, McapRecord, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer


@dataclass(frozen=True)
class Repair:
    """
    The result of a repair.

    Attributes:
        files: MCAP files of the bag.
        rewritten: files that had to be rewritten.
        message_count: number of messages in the repaired bag.
        dropped_chunks: number of unreadable chunks, which are lost.
        metadata_written: whether `metadata.yaml` was missing or wrong and has been written.

    """

    files: tuple[Path, ...]
    rewritten: tuple[Path, ...]
    message_count: int
    dropped_chunks: int
    metadata_written: bool


def repair_bag(path: Path | str) -> Repair:
    """
    Repair a bag: give every file its indexes and its end, and write `metadata.yaml`.

    Complete files stay unchanged. The others are rewritten beside the old file, from all readable
    data, and replace it when they are complete. The bag of a killed recorder lacks only the data
    that were still in memory.

    Args:
        path: the folder of a bag, the folder of a run with its bag in `bag/`, or one MCAP file.

    Returns:
        The result of the repair.

    Raises:
        DataError: there is no bag, or it cannot be written.

    """
    files = _files_to_repair(Path(path))
    if other := [file for file in files if file.suffix != MCAP]:
        raise DataError(f'{other[0]}: only MCAP files that are not compressed can be repaired')
    topics: dict[str, TopicMetadata] = {}
    statistics: list[FileStatistics] = []
    rewritten = []
    pairs: dict[str, str] = {}
    dropped = 0
    for file in files:
        damage = Damage()
        content = _File(topics, FileStatistics(file.name))
        for record in read_mcap_records(file, damage):
            content.take(record)
        if not damage.complete or damage.dropped_chunks or not content.closed:
            try:
                _rewrite(file)
            except OSError as error:
                raise DataError(f'{file}: cannot be written: {error.strerror}') from error
            rewritten.append(file)
        pairs |= content.custom_data
        dropped += damage.dropped_chunks
        statistics.append(content.statistics)
    information = rosbag2_information(list(topics.values()), statistics, pairs)
    written = Path(path).is_dir() and (bool(rewritten) or not _described(files[0].parent))
    if written:
        write_metadata(files[0].parent, information)
    return Repair(
        tuple(files), tuple(rewritten), int(information['message_count']), dropped, written
    )


def _files_to_repair(path: Path) -> list[Path]:
    """Find the files of a bag without relying on `metadata.yaml`, which may be damaged."""
    try:
        return bag_files(path)
    except DataError:
        for folder in (path, path / 'bag'):
            files = numbered_files(folder)
            if files:
                return files
        raise


def _described(folder: Path) -> bool:
    try:
        return bool(read_metadata(folder))
    except DataError:
        return False


class _File:
    """The content of one file, collected from its records."""

    def __init__(self, topics: dict[str, TopicMetadata], statistics: FileStatistics) -> None:
        self.statistics = statistics
        self.closed = False
        self.custom_data: dict[str, str] = {}
        self._topics = topics
        self._types: dict[int, str] = {}
        self._names: dict[int, str] = {}

    def take(self, record: McapRecord) -> None:
        if isinstance(record, Schema):
            self._types[record.id] = record.name
        elif isinstance(record, Channel) and record.id not in self._names:
            self._names[record.id] = record.topic
            self._topics.setdefault(record.topic, _topic(record, self._types))
        elif isinstance(record, Message) and record.channel_id in self._names:
            self.statistics.add(self._names[record.channel_id], record.log_time)
        elif isinstance(record, Metadata):
            self.custom_data |= custom_data(record)
        elif isinstance(record, Footer):
            self.closed = True


def _topic(channel: Channel, types: dict[int, str]) -> TopicMetadata:
    profiles = []
    with suppress(DataError):
        loaded = load_plain(channel.metadata.get('offered_qos_profiles', ''))
        profiles = [one for one in loaded or () if isinstance(one, dict)]
    return TopicMetadata(
        channel.topic,
        types.get(channel.schema_id, ''),
        channel.metadata.get('topic_type_hash', ''),
        tuple(profiles),
    )


def _rewrite(file: Path) -> None:
    with replacing(file) as temporary, temporary.open('wb') as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, chunk_size=2**16)
        writer.start(profile='ros2', library=LIBRARY)
        schemas = {0: 0}
        channels: dict[int, int] = {}
        for record in read_mcap_records(file, Damage()):
            if isinstance(record, Schema) and record.id not in schemas:
                schemas[record.id] = writer.register_schema(
                    record.name, record.encoding, record.data
                )
            elif isinstance(record, Channel) and record.id not in channels:
                if record.schema_id in schemas:
                    channels[record.id] = writer.register_channel(
                        record.topic,
                        record.message_encoding,
                        schemas[record.schema_id],
                        record.metadata,
                    )
            elif isinstance(record, Message) and record.channel_id in channels:
                writer.add_message(
                    channels[record.channel_id],
                    record.log_time,
                    record.data,
                    record.publish_time,
                    record.sequence,
                )
            elif isinstance(record, Metadata):
                writer.add_metadata(record.name, record.metadata)
            elif isinstance(record, Attachment):
                writer.add_attachment(
                    record.create_time,
                    record.log_time,
                    record.name,
                    record.media_type,
                    record.data,
                )
        # the writer finishes the file but does not close it
        writer.finish()  # type: ignore[no-untyped-call]
