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
Where the hand is, in messages of the types that trackers publish.

By the names of their fields alone, so that a type whose package is not installed does no harm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple


class SeenPose(NamedTuple):
    """
    One body in a message.

    Attributes:
        name: of the body; its number in a `PoseArray`; empty where there is only one.
        position: x, y, z in m, in the frame of the message.
        orientation: quaternion x, y, z, w; None where the message has none.
        covariance: (36,), m² and rad²; None where the message has none.

    """

    name: str
    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float] | None = None
    covariance: Sequence[float] | None = None


BodyReader = Callable[[Any], list[SeenPose]]


def _xyz(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def _pose(name: str, pose: Any, covariance: Sequence[float] | None = None) -> SeenPose:
    turn = pose.orientation
    return SeenPose(name, _xyz(pose.position), (turn.x, turn.y, turn.z, turn.w), covariance)


def _transform(message: Any) -> SeenPose:
    turn = message.transform.rotation
    place = _xyz(message.transform.translation)
    return SeenPose(message.child_frame_id, place, (turn.x, turn.y, turn.z, turn.w))


READERS: dict[str, BodyReader] = {
    'geometry_msgs/msg/PoseStamped': lambda m: [_pose('', m.pose)],
    'geometry_msgs/msg/PoseWithCovarianceStamped': lambda m: [
        _pose('', m.pose.pose, m.pose.covariance)
    ],
    'geometry_msgs/msg/PointStamped': lambda m: [SeenPose('', _xyz(m.point))],
    'geometry_msgs/msg/TransformStamped': lambda m: [_transform(m)],
    'geometry_msgs/msg/PoseArray': lambda m: [
        _pose(str(number), pose) for number, pose in enumerate(m.poses)
    ],
    'mocap4r2_msgs/msg/RigidBodies': lambda m: [
        _pose(body.rigid_body_name, body.pose) for body in m.rigidbodies
    ],
    'motion_capture_tracking_interfaces/msg/NamedPoseArray': lambda m: [
        _pose(body.name, body.pose) for body in m.poses
    ],
}


class BodyChooser:
    """
    Picks the hand among the bodies of messages; never a wrong one where several could be meant.

    Attributes:
        names: of the bodies that were seen.

    """

    def __init__(self, wanted: str) -> None:
        """
        Take the choice.

        Args:
            wanted: name or number of the body; empty where there is only one.

        """
        self._wanted = wanted
        self.names: set[str] = set()

    def choose(self, bodies: Sequence[SeenPose]) -> SeenPose | str:
        """
        Pick the hand.

        Args:
            bodies: of one message.

        Returns:
            It, or in a word why there is none: `other_body` where others are seen, `ambiguous`
            where several are and none is chosen, `absent` where the list is empty.

        """
        self.names.update(body.name for body in bodies)
        if self._wanted:
            found = [body for body in bodies if body.name == self._wanted]
            return found[0] if found else 'other_body' if bodies else 'absent'
        if len(self.names) > 1:
            return 'ambiguous'
        return bodies[0] if bodies else 'absent'
