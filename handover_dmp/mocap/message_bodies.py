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
The bodies in a message: one body, or several with names or numbers.

Trackers publish standard messages or their own lists. This module identifies bodies by fields,
not by message type: a position (`position`, `point`, `translation`) and beside or around it a
header, a name, an orientation, a covariance. This covers PoseStamped, PointStamped,
TransformStamped, PoseWithCovarianceStamped, Odometry, PoseArray, TFMessage, MarkerArray, the lists
of mocap4r2 (RigidBodies, Markers), NamedPoseArray, and similar types.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from handover_dmp.mocap.no_pose import no_pose

_WRAPPERS = ('pose', 'pose', 'transform')
_PLACES = ('position', 'translation', 'point')
_LISTS = ('rigidbodies', 'rigid_bodies', 'bodies', 'transforms', 'poses', 'markers')
_NAMES = ('child_frame_id', 'rigid_body_name', 'body_name', 'marker_name', 'name', 'subject_name')
_NANOSECONDS = 1_000_000_000


class Body(NamedTuple):
    """
    One body in a message.

    Attributes:
        name: name in the message; empty if it has none.
        stamp_ns: stamp of its header, ns; 0 if it has none.
        frame: frame of its header; empty if it has none.
        position: x, y, z, m, as in the message.
        orientation: quaternion x, y, z, w; None if the message has none.
        covariance: (36,), m² and rad²; None if the message has none.

    """

    name: str
    stamp_ns: int
    frame: str
    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float] | None = None
    covariance: Sequence[float] | None = None

    @property
    def is_lost(self) -> bool:
        """Whether the message says that the body was not seen."""
        return bool(no_pose(self.position, self.orientation, self.covariance))

    @property
    def seen_position(self) -> tuple[float, float, float]:
        """x, y, z, m; NaN if the body was not seen."""
        return (float('nan'),) * 3 if self.is_lost else self.position


def bodies(message: Any) -> list[Body] | None:
    """
    Find the bodies in a message.

    Args:
        message: decoded; its fields are attributes.

    Returns:
        The bodies of a list in order, or the single body; None if the message has no position.

    """
    for name in _LISTS:
        members = getattr(message, name, None)
        if isinstance(members, (list, tuple)):
            found = [_body(member, message) for member in members]
            return None if None in found else [body for body in found if body]
    body = _body(message, message)
    return None if body is None else [body]


def _body(member: Any, message: Any) -> Body | None:
    pose = member
    covariance: Sequence[float] | None = None
    for name in _WRAPPERS:
        pose = getattr(pose, name, pose)
        covariance = getattr(pose, 'covariance', covariance)
    place = next((getattr(pose, name) for name in _PLACES if hasattr(pose, name)), pose)
    header = getattr(member, 'header', None) or getattr(message, 'header', None)
    try:
        position = (float(place.x), float(place.y), float(place.z))
        stamp_ns, frame = 0, ''
        if header is not None:
            stamp_ns = int(header.stamp.sec) * _NANOSECONDS + int(header.stamp.nanosec)
            frame = str(header.frame_id)
    except (AttributeError, TypeError, ValueError):
        return None
    turn = getattr(pose, 'orientation', None) or getattr(pose, 'rotation', None)
    frame = frame.lstrip('/')
    return Body(_name(member), stamp_ns, frame, position, _quaternion(turn), covariance)


def _quaternion(turn: Any) -> tuple[float, float, float, float] | None:
    try:
        return (float(turn.x), float(turn.y), float(turn.z), float(turn.w))
    except (AttributeError, TypeError, ValueError):
        return None


def _name(member: Any) -> str:
    for name in _NAMES:
        value = getattr(member, name, None)
        if isinstance(value, str) and value:
            return value.lstrip('/')
    space, number = getattr(member, 'ns', None), getattr(member, 'id', None)
    if isinstance(number, int) and not isinstance(number, bool):
        return f'{space}/{number}' if space else str(number)
    return ''
