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
The definition of a ROS message: its full text, and the hash by which ROS 2 identifies the type.

A bag stays readable only if it contains the definitions of its messages. They come from the
message packages: from `share/<package>/msg` below every prefix of a sourced ROS 2
(`AMENT_PREFIX_PATH`) or of this Python environment, where the wheels install them. Without either,
they come from the library `rosbags`, which knows the standard packages.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
import json
import os
from pathlib import Path
import re
import sys
from typing import Any

from handover_dmp.common.errors import DataError, GET_ROS

SEPARATOR = '=' * 80
TYPE_NAME = re.compile(r'([A-Za-z]\w*)/msg/([A-Za-z]\w*)')


@dataclass(frozen=True)
class MessageDefinition:
    """
    A message type as stored in a bag.

    Attributes:
        type_name: e.g. `geometry_msgs/msg/PoseStamped`.
        text: definition of the type and of all nested types, in the encoding `ros2msg`.
        type_hash: REP 2016 hash, `RIHS01_` and 64 hexadecimal digits.

    """

    type_name: str
    text: str
    type_hash: str


@cache
def message_definition(type_name: str) -> MessageDefinition:
    """
    Find the definition of a message type.

    Args:
        type_name: e.g. `geometry_msgs/msg/PoseStamped`.

    Returns:
        Its definition.

    Raises:
        DataError: the name is not that of a message type, or no package on this machine defines
            it.

    """
    if TYPE_NAME.fullmatch(type_name) is None:
        raise DataError(f'{type_name!r} is not the name of a message type, PACKAGE/msg/NAME')
    file = _interface_file(type_name, '.json')
    if file is None:
        return _from_rosbags(type_name)
    description = json.loads(file.read_text(encoding='utf-8'))
    # the first entry is the type itself, the others are nested types
    type_hash = description['type_hashes'][0]['hash_string']
    return MessageDefinition(type_name, _full_text(type_name, description), type_hash)


def search_prefixes() -> list[Path]:
    """Return the search prefixes, those of a sourced ROS 2 first."""
    sourced = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    return [Path(prefix) for prefix in [*sourced, sys.prefix] if prefix]


def _interface_file(type_name: str, suffix: str) -> Path | None:
    package, _, name = type_name.split('/')
    inner = Path('share', package, 'msg', f'{name}{suffix}')
    files = (prefix / inner for prefix in search_prefixes())
    return next((file for file in files if file.is_file()), None)


def _message_text(type_name: str) -> str:
    file = _interface_file(type_name, '.msg')
    if file is None:
        raise DataError(f'{type_name}: its package is installed without {type_name}.msg')
    return file.read_text(encoding='utf-8')


def _full_text(type_name: str, description: dict[str, Any]) -> str:
    """Join the texts in the order of rosbag2: depth first, by name, each once."""
    described = description['type_description_msg']
    members = {
        one['type_name']: sorted(
            {field['type']['nested_type_name'] for field in one['fields']} - {''}
        )
        for one in [described['type_description'], *described['referenced_type_descriptions']]
    }
    seen = {type_name}
    texts = [_message_text(type_name)]

    def append_members(outer: str) -> None:
        for inner in members[outer]:
            if inner not in seen:
                seen.add(inner)
                short_name = inner.replace('/msg/', '/')
                texts.append(f'\n{SEPARATOR}\nMSG: {short_name}\n{_message_text(inner)}')
                append_members(inner)

    append_members(type_name)
    return ''.join(texts)


def _from_rosbags(type_name: str) -> MessageDefinition:
    try:
        from rosbags.typesys import get_typestore, Stores

        store = get_typestore(Stores.ROS2_JAZZY)
        text, _ = store.generate_msgdef(type_name, ros_version=2)
        return MessageDefinition(type_name, text, store.hash_rihs01(type_name))
    except Exception as error:
        # all failures of the library have the same remedy
        raise DataError(
            f'{type_name}: no package on this machine defines it; {GET_ROS}'
        ) from error
