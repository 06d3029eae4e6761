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
The scene for RViz and Foxglove.

Hand, wrist, their trails, the learnt path, the expected goal and the exchange position. A node
publishes it, and a run without ROS has it in its bag: the classes of the messages are given, so
this module needs no ROS.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist
from types import SimpleNamespace
from typing import Any, NamedTuple

from handover_dmp.dmp import DecoupledDmp
import numpy as np

RED = (0.84, 0.15, 0.16)
BLUE = (0.12, 0.47, 0.71)
GREY = (0.5, 0.5, 0.5)
GOLD = (0.9, 0.7, 0.1)
GREEN = (0.17, 0.63, 0.17)
TRAIL_LENGTH = 200
EVERY = 10
AGAIN = 200
"""Periods after which unmoved markers are repeated, for new subscribers."""
MOVED_M = 0.001
BALL_M = 0.05
LINE_M = 0.008
EXCHANGE_M = 0.16
"""Wider than the arm's wrist, which is there, and seen through."""
PATH_POINTS = 51
# as in visualization_msgs/msg/Marker
SPHERE, LINE_STRIP = 2, 4
ADD, DELETE = 0, 2

Position = Sequence[float]
Places = tuple[Position | None, ...]
Colour = tuple[float, float, float]


class MessageClasses(NamedTuple):
    """
    Classes of the messages.

    Attributes:
        marker: `visualization_msgs/Marker`.
        point: `geometry_msgs/Point`.
        colour: `std_msgs/ColorRGBA`.

    """

    marker: Any
    point: Any
    colour: Any


def _plain_marker(**fields: Any) -> SimpleNamespace:
    upright = SimpleNamespace(w=1.0)
    return SimpleNamespace(
        header=SimpleNamespace(),
        pose=SimpleNamespace(orientation=upright),
        scale=SimpleNamespace(),
        points=[],
        **fields,
    )


WITHOUT_ROS = MessageClasses(_plain_marker, SimpleNamespace, SimpleNamespace)


class SceneMarkers:
    """The markers at a tenth of the rate of the updates, while something moves."""

    def __init__(
        self, classes: MessageClasses, frame: str, learnt_path: Sequence[Position]
    ) -> None:
        """
        Set what never changes.

        Args:
            classes: classes of the messages.
            frame: frame of all positions.
            learnt_path: the learnt movement, (n, 3), m.

        """
        self._classes = classes
        self._frame = frame
        # messages are reused, since making them takes half as long as sending them
        self._path = _marker(classes, 'learnt path', LINE_STRIP, GREY, LINE_M)
        self._path.points = [_point(classes, place) for place in learnt_path]
        self._exchange = _marker(classes, 'exchange', SPHERE, GOLD, EXCHANGE_M, opacity=0.5)
        self._meeting = _marker(classes, 'expected meeting point', SPHERE, GREEN, BALL_M)
        self._expecting = False
        self._hand = _Trail(classes, 'hand', RED)
        self._wrist = _Trail(classes, 'wrist', BLUE)
        self._exchanged = False
        self._count = 0
        self._shown_at = -AGAIN
        self._shown: Places = (None,) * 4

    def is_due(self) -> bool:
        """Count a period, and return whether its scene may be shown."""
        self._count += 1
        return self._count % EVERY == 0

    def update(
        self,
        time: Any,
        hand: Position | None,
        wrist: Position | None,
        exchange_position: Position | None,
        meeting_point: Position | None = None,
    ) -> list[Any]:
        """
        Update the scene.

        Args:
            time: stamp of the markers, as message.
            hand: position of the partner's hand, m.
            wrist: position of the robot's wrist, m.
            exchange_position: position of the exchange, m.
            meeting_point: expected goal, m.

        Returns:
            The markers, valid until the next update; none if nothing has moved.

        """
        places = hand, wrist, exchange_position, meeting_point
        if self._count - self._shown_at < AGAIN and not _moved(self._shown, places):
            return []
        self._shown, self._shown_at = places, self._count
        markers = [self._path]
        if self._exchanged and exchange_position is None:  # a new handover
            self._hand.clear()
            self._wrist.clear()
            markers.append(self._classes.marker(ns='exchange', action=DELETE))
        self._exchanged = exchange_position is not None
        markers += self._hand.to(hand) + self._wrist.to(wrist)
        if exchange_position is not None:
            self._exchange.pose.position = _point(self._classes, exchange_position)
            markers.append(self._exchange)
        if meeting_point is not None:
            self._meeting.pose.position = _point(self._classes, meeting_point)
            markers.append(self._meeting)
        elif self._expecting:
            markers.append(self._classes.marker(ns=self._meeting.ns, action=DELETE))
        self._expecting = meeting_point is not None
        for marker in markers:
            marker.header.stamp = time
            marker.header.frame_id = self._frame
        return markers


class _Trail:
    """A ball with its trail."""

    def __init__(self, classes: MessageClasses, name: str, colour: Colour) -> None:
        self._classes = classes
        self._ball = _marker(classes, name, SPHERE, colour, BALL_M)
        self._line = _marker(classes, f'{name} trail', LINE_STRIP, colour, LINE_M)

    def to(self, place: Position | None) -> list[Any]:
        """Move to a position, m, and return the markers; None if it is unknown: no markers."""
        if place is None:
            return []
        self._ball.pose.position = point = _point(self._classes, place)
        if not self._line.points:  # viewers report a line of one point as a fault
            self._line.points.append(point)
        self._line.points.append(point)
        del self._line.points[:-TRAIL_LENGTH]
        return [self._ball, self._line]

    def clear(self) -> None:
        """Clear the trail."""
        self._line.points.clear()


def learnt_path(model: DecoupledDmp) -> list[Position]:
    """Return the positions of a learnt movement towards its own goal, m."""
    times = np.linspace(0.0, model.duration_s, PATH_POINTS)
    path: list[Position] = model.rollout(times, model.goal).positions.tolist()
    return path


def _marker(
    classes: MessageClasses,
    name: str,
    kind: int,
    colour: Colour,
    size_m: float,
    opacity: float = 1.0,
) -> Any:
    marker = classes.marker(ns=name, type=kind, action=ADD)
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = size_m
    red, green, blue = colour
    marker.color = classes.colour(r=red, g=green, b=blue, a=opacity)
    return marker


def _moved(before: Places, now: Places) -> bool:
    return any(
        (one is None) != (other is None)
        or (one is not None and other is not None and dist(one, other) > MOVED_M)
        for one, other in zip(before, now, strict=True)
    )


def _point(classes: MessageClasses, place: Position) -> Any:
    x, y, z = map(float, place)
    return classes.point(x=x, y=y, z=z)
