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

"""A bag that is still being written, read on from where it was last read to."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import breakup_chunk, StreamReader
from mcap_ros2.decoder import DecoderFactory

MAGIC_SIZE = 8
# of a record: what it is, and its length
HEAD_SIZE = 9


class WrittenBag:
    """What the recorder has closed so far; reading it again costs what has come since."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._position = MAGIC_SIZE
        self._schemas: dict[int, Schema] = {}
        self._topics: dict[int, str] = {}
        self._decoders: dict[str, Any] = {}
        self._factory = DecoderFactory()
        self._messages: dict[str, list[Message]] = {}

    def read_on(self) -> None:
        with self._path.open('rb') as stream:
            stream.seek(self._position)
            records = StreamReader(stream, skip_magic=True, emit_chunks=True).records
            while self._next_is_whole():
                record = next(records)
                self._position = stream.tell()
                for part in breakup_chunk(record) if isinstance(record, Chunk) else [record]:
                    self._take(part)

    def _next_is_whole(self) -> bool:
        with self._path.open('rb') as stream:
            stream.seek(self._position)
            head = stream.read(HEAD_SIZE)
            size = self._path.stat().st_size
        if len(head) < HEAD_SIZE:
            return False
        return self._position + HEAD_SIZE + int.from_bytes(head[1:], 'little') <= size

    def last_ns(self, topic: str) -> int:
        """Tell when the last message of a topic was recorded, ns; 0 where there is none yet."""
        self.read_on()
        return max((one.log_time for one in self._messages.get(topic, [])), default=0)

    def read(self, topic: str, from_ns: int = 0) -> Iterator[tuple[Any, int]]:
        """Give the messages of a topic from a time of recording on, with these times, ns."""
        for one in self._messages.get(topic, []):
            if one.log_time >= from_ns:
                yield self._decoders[topic](one.data), one.log_time

    def _take(self, record: Any) -> None:
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            self._topics[record.id] = record.topic
            schema = self._schemas[record.schema_id]
            self._decoders[record.topic] = self._factory.decoder_for('cdr', schema)
        elif isinstance(record, Message):
            self._messages.setdefault(self._topics[record.channel_id], []).append(record)
