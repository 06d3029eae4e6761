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

"""Publishes the scene for RViz and Foxglove."""

from __future__ import annotations

from collections.abc import Sequence

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from handover_dmp.handover.scene_markers import MessageClasses, Position, SceneMarkers
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.topics import MARKERS
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

ROS = MessageClasses(Marker, Point, ColorRGBA)


class Markers:
    """Publishes the scene if somebody listens."""

    def __init__(self, node: HandoverNode, learnt_path: Sequence[Position]) -> None:
        """
        Set what never changes.

        Args:
            node: node that publishes the markers.
            learnt_path: the learnt movement, (n, 3), m.

        """
        self._publisher = node.advertise(MARKERS)
        self._scene = SceneMarkers(ROS, node.frame, learnt_path)

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
        if not self._scene.is_due() or not self._publisher.get_subscription_count():
            return
        markers = self._scene.update(time, hand, wrist, exchange_position, meeting_point)
        if markers:
            self._publisher.publish(MarkerArray(markers=markers))
