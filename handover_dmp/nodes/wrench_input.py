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
Input of the force on the wrist: `wrist/wrench`, turned to the frame of the room.

A wrench is in the frame of the room, or in the frame of a sensor that moves with the wrist,
which the parameters name. In any other frame its direction is unknown.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite

from geometry_msgs.msg import WrenchStamped
from handover_dmp.common.arrays import Vector
from handover_dmp.common.errors import UsageError
from handover_dmp.common.quaternions import normalized, Quaternion, rotated
from handover_dmp.nodes.conversions import NANOSECONDS, nanoseconds
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.nodes.parameters import fixed
from handover_dmp.topics import WRIST_WRENCH

NOTHING: Vector = (0.0, 0.0, 0.0)
OF_WRENCH = (
    fixed(
        'session.wrench_frame',
        'Frame of a wrench that is not given in the frame of the room; it must move with the '
        'wrist',
    ),
    fixed(
        'session.wrench_quaternion',
        "Rotation from the axes of that frame to those of the wrist's link, as x, y, z, w",
    ),
)


class WrenchInput:
    """Keeps the newest force on the wrist."""

    def __init__(
        self, node: HandoverNode, come: Callable[[], object], refuse: Callable[[str], object]
    ) -> None:
        """
        Subscribe.

        Args:
            node: with the parameters `OF_WRENCH`.
            come: called in lockstep when a wrench has arrived that a period may wait for.
            refuse: gets a sentence for each wrench in an unknown frame.

        Raises:
            UsageError: the quaternion does not have four numbers, or has norm 0.

        """
        mounted = list(node.values['session.wrench_quaternion'])
        if len(mounted) != 4 or not all(map(isfinite, mounted)) or not any(mounted):
            raise UsageError(
                f'session.wrench_quaternion is {mounted}; it must be a rotation x, y, z, w'
            )
        self._node = node
        self._come = come
        self._refuse = refuse
        self._mounted = normalized(mounted)
        self._force: Vector | None = None
        self._in_room = True
        self._arrival_s = 0.0
        self._stamp_ns: int | None = None
        node.subscribe(WRIST_WRENCH, self._on_wrench)

    def _on_wrench(self, message: WrenchStamped) -> None:
        node, frame = self._node, message.header.frame_id
        x, y, z = message.wrench.force.x, message.wrench.force.y, message.wrench.force.z
        stamp_ns = nanoseconds(message.header.stamp)
        self._stamp_ns = stamp_ns
        in_room = frame in ('', node.frame)
        if not in_room and frame != node.values['session.wrench_frame']:
            # received, but unusable: as from a sensor that has died
            self._force, self._arrival_s, self._in_room = NOTHING, -inf, True
            self._refuse(
                f'{node.named(WRIST_WRENCH)} is in frame {frame!r}, neither {node.frame!r} nor '
                'session.wrench_frame: ignored, and nothing is released; if that frame moves '
                'with the wrist, set session.wrench_frame to it'
            )
        elif all(map(isfinite, (x, y, z))):
            self._arrival_s = stamp_ns / NANOSECONDS if node.lockstep else node.arrival_s()
            self._force = (x, y, z) if in_room else rotated(self._mounted, (x, y, z))
            self._in_room = in_room
        if node.lockstep:
            self._come()

    def is_there(self, tick_ns: int, timeout_s: float) -> bool:
        """
        Tell, in lockstep, whether no wrench has to be waited for.

        Args:
            tick_ns: time of the period, ns.
            timeout_s: age at which it is given up, s.

        Returns:
            Whether that of the period has arrived or is given up, or there never was one.

        """
        if self._stamp_ns is None:
            return True
        return not 0 < tick_ns - self._stamp_ns < timeout_s * NANOSECONDS

    def newest(self, turned: Quaternion | None) -> tuple[Vector, float] | None:
        """
        Return the newest force.

        Args:
            turned: quaternion x, y, z, w of the wrist's link, with which the frame of the sensor
                moves; None: unknown.

        Returns:
            (3,), N, in the axes of the room, and its time of arrival, s; None if there is none.

        """
        if self._force is None:
            return None
        if self._in_room:
            return self._force, self._arrival_s
        return None if turned is None else (rotated(turned, self._force), self._arrival_s)
