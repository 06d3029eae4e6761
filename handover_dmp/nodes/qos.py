"""A topic's type and quality of service in the terms of rclpy."""

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


def qos_profile(quality: Quality) -> QoSProfile:
    """
    Make the profile of a quality of service.

    Args:
        quality: which.

    Returns:
        The profile.

    """
    reliability, durability, depth = quality.value
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy[reliability.upper()],
        durability=DurabilityPolicy[durability.upper()],
    )
