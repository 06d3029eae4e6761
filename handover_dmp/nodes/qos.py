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

"""Type and quality of service of topics, as rclpy objects."""

from __future__ import annotations

from importlib import import_module

from handover_dmp.topics import Quality
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy


def message_class(type_name: str) -> type:
    """
    Find the class of a message type.

    Args:
        type_name: e.g. `geometry_msgs/msg/PoseStamped`.

    Returns:
        The class.

    """
    package, folder, name = type_name.split('/')
    kind: type = getattr(import_module(f'{package}.{folder}'), name)
    return kind


def is_installed(type_name: str) -> bool:
    """
    Tell whether a message type is installed; the wheels of ROS 2 lack that of `/tf`.

    Args:
        type_name: e.g. `tf2_msgs/msg/TFMessage`.

    Returns:
        Whether its class can be imported.

    """
    try:
        message_class(type_name)
    except (ImportError, AttributeError, ValueError):
        return False
    return True


def qos_profile(quality: Quality) -> QoSProfile:
    """
    Make the profile of a quality of service.

    Args:
        quality: quality of service.

    Returns:
        The profile.

    """
    reliability, durability, depth = quality.value
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy[reliability.upper()],
        durability=DurabilityPolicy[durability.upper()],
    )
