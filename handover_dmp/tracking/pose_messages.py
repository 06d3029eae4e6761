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

"""Selection of the hand among the bodies of a message, and the supported message types."""

from __future__ import annotations

from collections.abc import Sequence

from handover_dmp.mocap.message_bodies import Body

TYPES = (
    'geometry_msgs/msg/PoseStamped',
    'geometry_msgs/msg/PoseWithCovarianceStamped',
    'geometry_msgs/msg/PointStamped',
    'geometry_msgs/msg/TransformStamped',
    'geometry_msgs/msg/PoseArray',
    'mocap4r2_msgs/msg/RigidBodies',
    'motion_capture_tracking_interfaces/msg/NamedPoseArray',
)
"""Types of messages with a hand; their packages need not be installed."""


class BodyChooser:
    """
    Selects the hand among the bodies of messages; none if the choice is ambiguous.

    Attributes:
        names: names of the bodies seen so far; their numbers if they have no names.

    """

    def __init__(self, wanted: str) -> None:
        """
        Choose the body.

        Args:
            wanted: name or number of the body; empty if there is only one.

        """
        self._wanted = wanted
        self.names: set[str] = set()

    def choose(self, bodies: Sequence[Body]) -> Body | str:
        """
        Select the hand.

        Args:
            bodies: bodies of one message.

        Returns:
            The hand, or the reason why there is none: `other_body` if only others are seen,
            `ambiguous` if there are several and none is chosen, `absent` if there are none.

        """
        names = [body.name or str(number) for number, body in enumerate(bodies)]
        self.names.update(names)
        if self._wanted:
            found = [
                body for name, body in zip(names, bodies, strict=True) if name == self._wanted
            ]
            return found[0] if found else 'other_body' if bodies else 'absent'
        if len(self.names) > 1:
            return 'ambiguous'
        return bodies[0] if bodies else 'absent'
