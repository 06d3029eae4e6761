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
The records of a bag in sqlite3 storage, the default of ROS 2 Humble.

They are returned as records of an MCAP file, in the order of writing, so that callers can read
both. (The library `rosbags` sorts by time of recording, which would mix the parts of a recording
on simulated time that was reset.) Before ROS 2 Iron these files contain no definitions of their
messages; then these come from the packages of this machine, or from `rosbags`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
import sqlite3

from handover_dmp.common.errors import DataError
from handover_dmp.recording.mcap_file import RECORD_LIMIT
from handover_dmp.recording.message_definitions import message_definition
from mcap.records import Channel, McapRecord, Message, Schema

_TABLES = ('topics', 'messages')


def read_sqlite3(path: Path) -> Iterator[McapRecord]:
    """
    Read the records of a sqlite3 file of rosbag2.

    Args:
        path: the file.

    Yields:
        A schema and a channel for each topic, then the messages.

    Raises:
        DataError: the file is missing, damaged, or not of rosbag2.

    """
    # Files that a killed recorder left beside the file belong to it.
    unfinished = path.with_name(f'{path.name}-wal').exists()
    place = path.absolute().as_uri() + ('?mode=ro' if unfinished else '?immutable=1')
    try:
        with closing(sqlite3.connect(place, uri=True)) as connection:
            yield from _read(connection, path)
    except (sqlite3.Error, ValueError, TypeError, OverflowError, MemoryError) as error:
        # The library's errors quote the content of the file, without a limit on the length.
        what = repr(str(error))[1:-1] or 'damaged'
        raise DataError(f'{path}: not a sqlite3 bag that can be read: {what}'[:300]) from error


def _read(connection: sqlite3.Connection, path: Path) -> Iterator[McapRecord]:
    # Only tables: a view could contain an endless query.
    query = "SELECT name FROM sqlite_master WHERE type = 'table'"
    tables = {name for (name,) in connection.execute(query)}
    if not tables.issuperset(_TABLES):
        raise DataError(f'{path}: not a bag of rosbag2, it has no topics and messages')
    definitions: dict[str, tuple[str, str]] = {}
    if 'message_definitions' in tables:
        query = 'SELECT topic_type, encoding, encoded_message_definition FROM message_definitions'
        definitions = {name: (how, text) for name, how, text in connection.execute(query)}
    query = 'SELECT id, name, type, serialization_format FROM topics'
    for number, name, type_name, encoding in connection.execute(query).fetchall():
        # A column of sqlite3 may hold any value, whatever its type.
        if not isinstance(number, int) or not all(
            isinstance(text, str) for text in (name, type_name, encoding)
        ):
            raise DataError(f'{path}: a topic that is none')
        how, text = definitions.get(type_name, ('', '')) or ('', '')
        if not text:
            how, text = 'ros2msg', _known_definition(type_name)
        schema = 0
        if text:
            schema = number
            yield Schema(data=text.encode(), encoding=how, id=schema, name=type_name)
        yield Channel(
            id=number, topic=name, message_encoding=encoding, metadata={}, schema_id=schema
        )
    query = 'SELECT topic_id, timestamp, data FROM messages ORDER BY id'
    for count, (number, time_ns, data) in enumerate(connection.execute(query)):
        whole = isinstance(number, int) and isinstance(time_ns, int) and isinstance(data, bytes)
        if not whole or len(data) > RECORD_LIMIT:
            raise DataError(f'{path}: message {count + 1} is no message')
        yield Message(
            channel_id=number, log_time=time_ns, publish_time=time_ns, sequence=count, data=data
        )


def _known_definition(type_name: str) -> str:
    try:
        return message_definition(type_name).text
    except DataError:
        # A missing definition matters only if its messages are decoded.
        return ''
