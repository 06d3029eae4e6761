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

Hand, wrist, their trails, the learnt path, the expected goal and the exchange position.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.topics import MARKERS
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

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

Position = Sequence[float]
Places = tuple[Position | None, ...]
Colour = tuple[float, float, float]


class Markers:
    """Publishes the scene at a tenth of the rate of its updates, while something moves."""

    def __init__(self, node: HandoverNode, learnt_path: Sequence[Position]) -> None:
        """
        Set what never changes.

        Args:
            node: node that publishes the markers.
            learnt_path: the learnt movement, (n, 3), m.

        """
        self._publisher = node.advertise(MARKERS)
        self._frame = node.frame
        # messages are reused, since making them takes half as long as sending them
        self._path = _marker('learnt path', Marker.LINE_STRIP, GREY, LINE_M)
        self._path.points = [_point(place) for place in learnt_path]
        self._exchange = _marker('exchange', Marker.SPHERE, GOLD, BALL_M)
        self._meeting = _marker('expected meeting point', Marker.SPHERE, GREEN, BALL_M)
        self._expecting = False
        self._hand = _Trail('hand', RED)
        self._wrist = _Trail('wrist', BLUE)
        self._exchanged = False
        self._count = 0
        self._shown_at = -AGAIN
        self._shown: Places = (None,) * 4

    def update(
        self,
        time: Time,
        hand: Position | None,
        wrist: Position | None,
        exchange_position: Position | None,
        meeting_point: Position | None = None,
    ) -> None:
        """
        Update the scene.

        Args:
            time: stamp of the markers.
            hand: position of the partner's hand, m.
            wrist: position of the robot's wrist, m.
            exchange_position: position of the exchange, m.
            meeting_point: expected goal, m.

        """
        self._count += 1
        if self._count % EVERY or not self._publisher.get_subscription_count():
            return
        places = hand, wrist, exchange_position, meeting_point
        if self._count - self._shown_at < AGAIN and not _moved(self._shown, places):
            return
        self._shown, self._shown_at = places, self._count
        markers = [self._path]
        if self._exchanged and exchange_position is None:  # a new handover
            self._hand.clear()
            self._wrist.clear()
            markers.append(Marker(ns='exchange', action=Marker.DELETE))
        self._exchanged = exchange_position is not None
        markers += self._hand.to(hand) + self._wrist.to(wrist)
        if exchange_position is not None:
            self._exchange.pose.position = _point(exchange_position)
            markers.append(self._exchange)
        if meeting_point is not None:
            self._meeting.pose.position = _point(meeting_point)
            markers.append(self._meeting)
        elif self._expecting:
            markers.append(Marker(ns=self._meeting.ns, action=Marker.DELETE))
        self._expecting = meeting_point is not None
        for marker in markers:
            marker.header.stamp = time
            marker.header.frame_id = self._frame
        self._publisher.publish(MarkerArray(markers=markers))


class _Trail:
    """A ball with its trail."""

    def __init__(self, name: str, colour: Colour) -> None:
        self._ball = _marker(name, Marker.SPHERE, colour, BALL_M)
        self._line = _marker(f'{name} trail', Marker.LINE_STRIP, colour, LINE_M)

    def to(self, place: Position | None) -> list[Marker]:
        """Move to a position, m, and return the markers; None if it is unknown: no markers."""
        if place is None:
            return []
        self._ball.pose.position = point = _point(place)
        self._line.points.append(point)
        del self._line.points[:-TRAIL_LENGTH]
        return [self._ball, self._line]

    def clear(self) -> None:
        """Clear the trail."""
        self._line.points.clear()


def _marker(name: str, kind: int, colour: Colour, size_m: float) -> Marker:
    marker = Marker(ns=name, type=kind, action=Marker.ADD)
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = size_m
    red, green, blue = colour
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
    return marker


def _moved(before: Places, now: Places) -> bool:
    return any(
        (one is None) != (other is None)
        or (one is not None and other is not None and dist(one, other) > MOVED_M)
        for one, other in zip(before, now, strict=True)
    )


def _point(place: Position) -> Point:
    x, y, z = map(float, place)
    return Point(x=x, y=y, z=z)
