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

"""`metadata.yaml` of a bag, in the format of rosbag2 of ROS 2 Jazzy (version 9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
import os
from pathlib import Path
from typing import Any

from handover_dmp.common.errors import DataError
from handover_dmp.common.files import write_text
from handover_dmp.common.plain_yaml import dump_plain, load_plain
from handover_dmp.recording.qos import Qos

METADATA_FILE = 'metadata.yaml'
ROOT = 'rosbag2_bagfile_information'
VERSION = 9
# rosbag2 writes this for the time of the first message if there is none
NO_TIME = 2**63 - 1


@dataclass(frozen=True)
class TopicMetadata:
    """
    A topic of a bag.

    Attributes:
        name: e.g. `/hand/pose`.
        type_name: e.g. `geometry_msgs/msg/PoseStamped`.
        type_hash: `RIHS01_…`; empty if unknown.
        qos: quality of service offered by its publishers.

    """

    name: str
    type_name: str
    type_hash: str = ''
    qos: tuple[Qos | dict[str, Any], ...] = ()

    def as_rosbag2(self) -> dict[str, Any]:
        """Return the entry of the file."""
        return {
            'name': self.name,
            'type': self.type_name,
            'serialization_format': 'cdr',
            'offered_qos_profiles': [
                profile.as_rosbag2() if isinstance(profile, Qos) else profile
                for profile in self.qos
            ],
            'type_description_hash': self.type_hash,
        }


@dataclass
class FileStatistics:
    """
    Statistics of one file of a bag, updated while it is written.

    Attributes:
        name: name of the file, within the folder of the bag.
        first_ns: least log time, ns; `NO_TIME` if there is no message.
        last_ns: greatest log time, ns.
        counts: number of messages by topic.

    """

    name: str
    first_ns: int = NO_TIME
    last_ns: int = 0
    counts: dict[str, int] = field(default_factory=dict)

    def add(self, topic: str, log_time_ns: int) -> None:
        """Count one message."""
        self.counts[topic] = self.counts.get(topic, 0) + 1
        if log_time_ns < self.first_ns:
            self.first_ns = log_time_ns
        if log_time_ns > self.last_ns:
            self.last_ns = log_time_ns

    @property
    def message_count(self) -> int:
        """Return the number of messages."""
        return sum(self.counts.values())

    @property
    def duration_ns(self) -> int:
        """Time from the first to the last message, ns."""
        return max(0, self.last_ns - self.first_ns) if self.counts else 0


def rosbag2_information(
    topics: Sequence[TopicMetadata],
    files: Sequence[FileStatistics],
    custom_data: dict[str, str] | None = None,
) -> dict[str, Any]:
    """
    Compose the content of `metadata.yaml`, in the order of rosbag2.

    Args:
        topics: topics of the bag.
        files: files of the bag.
        custom_data: pairs of text kept with the bag.

    Returns:
        The content below the key `rosbag2_bagfile_information`.

    """
    first = min((file.first_ns for file in files), default=NO_TIME)
    last = max((file.last_ns for file in files), default=0)
    counts = {
        topic.name: sum(file.counts.get(topic.name, 0) for file in files) for topic in topics
    }
    return {
        'version': VERSION,
        'storage_identifier': 'mcap',
        'duration': {'nanoseconds': max(0, last - first)},
        'starting_time': {'nanoseconds_since_epoch': first},
        'message_count': sum(counts.values()),
        'topics_with_message_count': [
            {'topic_metadata': topic.as_rosbag2(), 'message_count': counts[topic.name]}
            for topic in topics
        ],
        # compression of whole files and of single messages; chunks declare their own
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': [file.name for file in files],
        'files': [
            {
                'path': file.name,
                'starting_time': {'nanoseconds_since_epoch': file.first_ns},
                'duration': {'nanoseconds': file.duration_ns},
                'message_count': file.message_count,
            }
            for file in files
        ],
        'custom_data': custom_data or None,
        'ros_distro': os.environ.get('ROS_DISTRO', 'jazzy'),
    }


def write_metadata(folder: Path, information: dict[str, Any]) -> None:
    """Write `metadata.yaml` atomically."""
    write_text(folder / METADATA_FILE, dump_plain({ROOT: information}))


def read_metadata(folder: Path) -> dict[str, Any]:
    """
    Read `metadata.yaml`.

    Args:
        folder: folder of the bag.

    Returns:
        The content below the key `rosbag2_bagfile_information`.

    Raises:
        DataError: the file is not readable, not YAML, or not the metadata of a bag.

    """
    path = folder / METADATA_FILE
    try:
        tree = load_plain(path.read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError, DataError) as error:
        raise DataError(f'{path}: not the metadata of a bag: {error}') from error
    information = tree.get(ROOT) if isinstance(tree, dict) else None
    if not isinstance(information, dict):
        raise DataError(f'{path}: not the metadata of a bag: no {ROOT}')
    return information
