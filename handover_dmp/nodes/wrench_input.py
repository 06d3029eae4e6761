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

"""What a node needs to feel what the wrist holds: `wrist/wrench`, turned into the room's frame."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite

from geometry_msgs.msg import WrenchStamped
from handover_dmp.common.arrays import Vector
from handover_dmp.common.quaternions import Quaternion, rotated
from handover_dmp.nodes.conversions import NANOSECONDS, nanoseconds
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.topics import WRIST_WRENCH


class WrenchInput:
    """Keeps the newest force on the wrist."""

    def __init__(self, node: HandoverNode, come: Callable[[], object]) -> None:
        """
        Subscribe.

        Args:
            node: with the parameters of all nodes.
            come: is called in lockstep when one has come that a period may wait for.

        """
        self._node = node
        self._come = come
        self._force: Vector | None = None
        self._frame = ''
        self._arrival_s = 0.0
        self._stamp_ns: int | None = None
        node.subscribe(WRIST_WRENCH, self._on_wrench)

    def _on_wrench(self, message: WrenchStamped) -> None:
        force = message.wrench.force
        stamp_ns = nanoseconds(message.header.stamp)
        self._stamp_ns = stamp_ns
        if all(map(isfinite, (force.x, force.y, force.z))):
            lockstep = self._node.lockstep
            self._arrival_s = stamp_ns / NANOSECONDS if lockstep else self._node.arrival_s()
            self._force, self._frame = (force.x, force.y, force.z), message.header.frame_id
        if self._node.lockstep:
            self._come()

    def is_there(self, tick_ns: int, timeout_s: float) -> bool:
        """
        Tell, in lockstep, whether there is no wrench to be waited for.

        Args:
            tick_ns: time of the period, ns.
            timeout_s: age at which it is given up, s.

        Returns:
            Whether that of the period is there, or given up, or there never was one.

        """
        if self._stamp_ns is None:
            return True
        return not 0 < tick_ns - self._stamp_ns < timeout_s * NANOSECONDS

    def newest(self, turned: Quaternion | None) -> tuple[Vector, float] | None:
        """
        Give the newest force.

        Args:
            turned: quaternion x, y, z, w of the wrist's link, in whose axes a force is that is
                not in the room's; None: not known.

        Returns:
            (3,), N, in the room's axes, and when it arrived, s; None where there is none.

        """
        if self._force is None:
            return None
        if self._frame in ('', self._node.frame):
            return self._force, self._arrival_s
        return None if turned is None else (rotated(turned, self._force), self._arrival_s)
