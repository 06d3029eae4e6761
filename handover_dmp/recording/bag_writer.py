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

"""Writing bags: a folder with MCAP files and `metadata.yaml`, in the format of rosbag2."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from time import monotonic

from handover_dmp import __version__
from handover_dmp.common.closing import Closing
from handover_dmp.common.errors import DataError, UsageError
from handover_dmp.common.plain_yaml import dump_plain
from handover_dmp.common.settings import defaults
from handover_dmp.recording.bag_metadata import (
    FileStatistics,
    NO_TIME,
    rosbag2_information,
    TopicMetadata,
    write_metadata,
)
from handover_dmp.recording.message_definitions import message_definition, MessageDefinition
from handover_dmp.recording.messages import encoder, Message
from handover_dmp.recording.qos import COMMAND, dump_profiles, Qos
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, LIBRARY_IDENTIFIER, Writer

COMPRESSIONS = {
    'zstd': CompressionType.ZSTD,
    'lz4': CompressionType.LZ4,
    'none': CompressionType.NONE,
}
LIBRARY = f'handover_dmp {__version__}; {LIBRARY_IDENTIFIER}'
# name of the record with rosbag2's metadata within each file
METADATA_RECORD = 'rosbag2'


class BagWriter(Closing):
    """
    Writes one bag. It needs no running ROS, only the definitions of the messages.

    Not thread-safe. Messages reach the file when a chunk is full or when the oldest message of the
    open chunk is `flush_period_s` old; a recorder of topics that may fall silent calls `flush`
    from a timer. A killed process loses no more than that.

    Args:
        folder: folder of the bag; must not exist, because a recording is never overwritten.
        compression: compression of the chunks, `zstd`, `lz4` or `none`.
        chunk_size: size before compression at which a chunk is closed, bytes.
        flush_period_s: age at which a chunk is closed even if it is not full, s.
        split_size: size at which a new file is begun, bytes; 0: never.
        split_duration_s: log time after which a new file is begun, s; 0: never.
        custom_data: pairs of text for `metadata.yaml`.

    The defaults are the parameters of the node `recorder`.

    Raises:
        DataError: the folder exists or cannot be made.
        UsageError: the compression is unknown.

    """

    def __init__(
        self,
        folder: Path | str,
        *,
        compression: str | None = None,
        chunk_size: int | None = None,
        flush_period_s: float | None = None,
        split_size: int | None = None,
        split_duration_s: float | None = None,
        custom_data: dict[str, str] | None = None,
    ) -> None:
        def chosen(value: object, name: str) -> object:
            return defaults('recorder')[name] if value is None else value

        self.folder = Path(folder)
        self._compression = str(chosen(compression, 'compression'))
        self._chunk_size = int(str(chosen(chunk_size, 'chunk_size')))
        self._flush_period_s = float(str(chosen(flush_period_s, 'flush_period_s')))
        self._split_size = int(str(chosen(split_size, 'split_size')))
        split_s = float(str(chosen(split_duration_s, 'split_duration_s')))
        self._split_duration_ns = round(split_s * 1e9)
        self._custom_data = dict(custom_data or {})
        if self._compression not in COMPRESSIONS:
            raise UsageError(
                f'compression {self._compression!r}: not one of {", ".join(COMPRESSIONS)}'
            )
        self._topics: dict[str, TopicMetadata] = {}
        self._splits = bool(self._split_size or self._split_duration_ns)
        self._ended: list[FileStatistics] = []
        self._failure: str | None = None
        self._closed = False
        try:
            self.folder.mkdir(parents=True)
        except FileExistsError as error:
            raise DataError(
                f'{self.folder}: exists already; a bag is never overwritten'
            ) from error
        except OSError as error:
            raise DataError(f'{self.folder}: cannot be made: {error.strerror}') from error
        self._file = self._begin_file()

    @property
    def topics(self) -> tuple[str, ...]:
        """Names of the topics added so far."""
        return tuple(self._topics)

    @property
    def message_count(self) -> int:
        """Return the number of messages written so far."""
        return sum(file.message_count for file in (*self._ended, self._file.statistics))

    def add_topic(self, name: str, type_name: str, qos: Qos | Iterable[Qos] = COMMAND) -> None:
        """
        Add a topic; an existing topic is left unchanged.

        Args:
            name: name of the topic.
            type_name: type of its messages, e.g. `geometry_msgs/msg/PoseStamped`.
            qos: quality of service offered by its publishers.

        Raises:
            DataError: no package on this machine defines the type, or the file cannot be written.

        """
        if name in self._topics:
            return
        definition = message_definition(type_name)
        profiles = (qos,) if isinstance(qos, Qos) else tuple(qos)
        self._topics[name] = TopicMetadata(name, type_name, definition.type_hash, profiles)
        self._check_usable()
        try:
            self._file.add_topic(self._topics[name], definition)
        except OSError as error:
            raise self._failed(error) from error

    def set_offered(self, name: str, profiles: Iterable[Qos]) -> None:
        """
        Correct the quality of service of a topic; unknown topics are ignored.

        The change appears in `metadata.yaml` and in later files; the entry in the present file
        stays.

        Args:
            name: name of the topic.
            profiles: profiles of its publishers.

        """
        if name in self._topics:
            self._topics[name] = replace(self._topics[name], qos=tuple(profiles))

    def write(self, topic: str, data: bytes, log_time_ns: int) -> None:
        """
        Write one message.

        Args:
            topic: name of a topic that was added.
            data: the message, CDR with its header, as from a raw subscription.
            log_time_ns: time of reception, ns; kept as the time of publication, too.

        Raises:
            DataError: the topic is unknown, the time is negative or beyond 64 bits, or the file
                cannot be written, e.g. because the disk is full. After that nothing more can be
                written; the file stays readable.

        """
        self._check_usable()
        if not 0 <= log_time_ns < NO_TIME:
            raise DataError(f'{self.folder}: {topic}: time out of range: {log_time_ns} ns')
        try:
            if self._splits and self._must_split(log_time_ns):
                self._end_file()
                self._file = self._begin_file()
            self._file.write(topic, data, log_time_ns, self._flush_period_s)
        except OSError as error:
            raise self._failed(error) from error
        except KeyError as error:
            raise DataError(f'{self.folder}: topic {topic} was not added') from error

    def write_message(self, topic: str, message: Message, log_time_ns: int) -> None:
        """
        Encode and write one message.

        Args:
            topic: name of a topic that was added.
            message: nested dictionaries of its fields, as from `handover_dmp.recording.messages`.
            log_time_ns: time of reception, ns.

        Raises:
            DataError: as in `write`.

        """
        if topic not in self._topics:
            raise DataError(f'{self.folder}: topic {topic} was not added')
        data = encoder(self._topics[topic].type_name)(message)
        self.write(topic, data, log_time_ns)

    def flush(self) -> None:
        """
        Pass everything written so far to the operating system.

        Raises:
            DataError: the file cannot be written.

        """
        self._check_usable()
        try:
            self._file.flush()
        except OSError as error:
            raise self._failed(error) from error

    def close(self) -> None:
        """
        Write the indexes and `metadata.yaml`; a second call does nothing.

        Raises:
            DataError: the file cannot be written.

        """
        if self._closed:
            return
        self._closed = True
        if self._failure is not None:
            # the error was raised when it occurred; here only the file is closed
            self._file.abandon()
            return
        try:
            self._end_file()
            write_metadata(self.folder, self._information(self._ended))
        except OSError as error:
            raise self._failed(error) from error

    def _information(self, files: list[FileStatistics]) -> dict[str, object]:
        return rosbag2_information(list(self._topics.values()), files, self._custom_data)

    def _begin_file(self) -> _BagFile:
        name = f'{self.folder.name}_{len(self._ended)}.mcap'
        try:
            file = _BagFile(self.folder / name, self._compression, self._chunk_size)
            # without it, a reader of an unclosed bag does not know the version, which sets the
            # format of the quality of service
            file.add_metadata(self._describe(file.statistics))
            for topic in self._topics.values():
                file.add_topic(topic, message_definition(topic.type_name))
        except OSError as error:
            raise self._failed(error) from error
        return file

    def _end_file(self) -> None:
        self._file.finish(self._describe)
        self._ended.append(self._file.statistics)

    def _describe(self, file: FileStatistics) -> str:
        return dump_plain(self._information([file]))

    def _must_split(self, log_time_ns: int) -> bool:
        first_ns = self._file.statistics.first_ns
        if first_ns == NO_TIME:
            return False
        if self._split_size and self._file.size >= self._split_size:
            return True
        elapsed_ns = log_time_ns - first_ns
        return bool(self._split_duration_ns) and elapsed_ns >= self._split_duration_ns

    def _check_usable(self) -> None:
        if self._failure is not None:
            raise DataError(self._failure)
        if self._closed:
            raise DataError(f'{self.folder}: the bag is closed')

    def _failed(self, error: OSError) -> DataError:
        self._failure = (
            f'{self.folder}: recording stopped: {error.strerror}; earlier messages are kept '
            f'(handover_dmp bag repair {self.folder})'
        )
        return DataError(self._failure)


class _BagFile:
    """One MCAP file of a bag while it is written."""

    def __init__(self, path: Path, compression: str, chunk_size: int) -> None:
        self.statistics = FileStatistics(path.name)
        self._flushed_s = monotonic()
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._sink = _Sink(path)
        self._writer = Writer(
            self._sink,  # type: ignore[arg-type]
            chunk_size=chunk_size,
            compression=COMPRESSIONS[compression],
        )
        self._writer.start('ros2', LIBRARY)

    @property
    def size(self) -> int:
        return self._sink.tell()

    def add_metadata(self, text: str) -> None:
        pairs = {'serialized_metadata': text}
        self._writer.add_metadata(METADATA_RECORD, pairs)

    def add_topic(self, topic: TopicMetadata, definition: MessageDefinition) -> None:
        if topic.type_name not in self._schemas:
            self._schemas[topic.type_name] = self._writer.register_schema(
                topic.type_name, SchemaEncoding.ROS2, definition.text.encode()
            )
        profiles = tuple(qos for qos in topic.qos if isinstance(qos, Qos))
        self._channels[topic.name] = self._writer.register_channel(
            topic.name,
            MessageEncoding.CDR,
            self._schemas[topic.type_name],
            {
                'offered_qos_profiles': dump_profiles(profiles),
                'topic_type_hash': topic.type_hash,
            },
        )

    def write(self, topic: str, data: bytes, log_time_ns: int, age_s: float) -> None:
        self._writer.add_message(self._channels[topic], log_time_ns, data, log_time_ns)
        self.statistics.add(topic, log_time_ns)
        if monotonic() - self._flushed_s > age_s:
            self.flush()

    def flush(self) -> None:
        self._flushed_s = monotonic()
        self._writer.flush()  # type: ignore[no-untyped-call]

    def finish(self, metadata: Callable[[FileStatistics], str]) -> None:
        # after all messages, because the metadata describe them
        self._writer.flush()  # type: ignore[no-untyped-call]
        self.add_metadata(metadata(self.statistics))
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._sink.close()

    def abandon(self) -> None:
        self._sink.close()


class _Sink:
    """
    An unbuffered file.

    It receives whole chunks, so a buffer would save nothing, but a killed process would lose its
    content.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open('xb', buffering=0)
        self._size = 0

    def write(self, data: bytes) -> None:
        remaining = memoryview(data)
        while remaining:
            written = self._file.write(remaining)
            self._size += written
            remaining = remaining[written:]

    def tell(self) -> int:
        return self._size

    def flush(self) -> None:
        """Do nothing; there is no buffer."""

    def close(self) -> None:
        self._file.close()
