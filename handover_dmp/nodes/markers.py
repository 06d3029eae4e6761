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

"""The scene for RViz and Foxglove: hand, wrist, their trails, the learnt path, the exchange."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.topics import FRAME, MARKERS
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

RED = (0.84, 0.15, 0.16)
BLUE = (0.12, 0.47, 0.71)
GREY = (0.5, 0.5, 0.5)
GOLD = (0.9, 0.7, 0.1)
TRAIL_LENGTH = 200
EVERY = 10

Position = Sequence[float]


class Markers:
    """Publishes the scene at a tenth of the rate that it is fed at."""

    def __init__(self, node: HandoverNode, learnt_path: Sequence[Position]) -> None:
        """
        Take what never changes.

        Args:
            node: publishes them.
            learnt_path: the learnt movement, (n, 3), m.

        """
        self._publisher = node.advertise(MARKERS)
        self._learnt_path = [_point(place) for place in learnt_path]
        self._hand_trail: deque[Point] = deque(maxlen=TRAIL_LENGTH)
        self._wrist_trail: deque[Point] = deque(maxlen=TRAIL_LENGTH)
        self._exchange: Position | None = None
        self._count = 0

    def update(
        self, time: Time, hand: Position | None, wrist: Position | None, exchange: Position | None
    ) -> None:
        """
        Show where all is now.

        Args:
            time: stamp of the markers.
            hand: of the partner, m.
            wrist: of the robot, m.
            exchange: where the object changed hands, m.

        """
        self._count += 1
        if self._count % EVERY:
            return
        markers = [self._line(time, 'learnt path', self._learnt_path, GREY)]
        if self._exchange is not None and exchange is None:  # another handover
            self._hand_trail.clear()
            self._wrist_trail.clear()
            markers.append(Marker(ns='exchange', action=Marker.DELETE))
        self._exchange = exchange
        for name, place, trail, colour in (
            ('hand', hand, self._hand_trail, RED),
            ('wrist', wrist, self._wrist_trail, BLUE),
        ):
            if place is not None:
                trail.append(_point(place))
                markers.append(self._ball(time, name, place, colour))
                markers.append(self._line(time, f'{name} trail', trail, colour))
        if exchange is not None:
            markers.append(self._ball(time, 'exchange', exchange, GOLD))
        self._publisher.publish(MarkerArray(markers=markers))

    def _marker(
        self, time: Time, name: str, kind: int, colour: tuple[float, float, float], size_m: float
    ) -> Marker:
        marker = Marker(ns=name, type=kind, action=Marker.ADD)
        marker.header.stamp = time
        marker.header.frame_id = FRAME
        marker.pose.orientation.w = 1.0
        marker.scale.x = marker.scale.y = marker.scale.z = size_m
        red, green, blue = colour
        marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
        return marker

    def _ball(
        self, time: Time, name: str, place: Position, colour: tuple[float, float, float]
    ) -> Marker:
        marker = self._marker(time, name, Marker.SPHERE, colour, 0.05)
        marker.pose.position = _point(place)
        return marker

    def _line(
        self,
        time: Time,
        name: str,
        path: Iterable[Point],
        colour: tuple[float, float, float],
    ) -> Marker:
        marker = self._marker(time, name, Marker.LINE_STRIP, colour, 0.008)
        marker.points = list(path)
        return marker


def _point(place: Position) -> Point:
    x, y, z = map(float, place)
    return Point(x=x, y=y, z=z)
