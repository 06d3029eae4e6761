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

"""The frames of an arm's links, for `/tf_static` and `/tf`."""

from __future__ import annotations

from typing import NamedTuple

from handover_dmp.common.arrays import Array
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.plain_description import ends_of, parse_xml
from handover_dmp.robot.published_description import root_link, shown_root
import numpy as np
import pinocchio as pin


class LinkTransform(NamedTuple):
    """
    Pose of one frame in another.

    Attributes:
        parent: parent frame.
        child: child frame.
        position: x, y, z in m, of the child's origin in the parent.
        quaternion: x, y, z, w, from the child's axes to the parent's.

    """

    parent: str
    child: str
    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]


class LinkFrames:
    """
    Pose of each link in its parent link.

    Link names are those of the published description: the root is renamed if it has the name of
    the frame of the base placement.
    """

    def __init__(self, model: RobotModel, frame: str, prefix: str = '') -> None:
        """
        Take the arm.

        Args:
            model: the arm, placed.
            frame: frame of the base placement.
            prefix: prefix of every link name, e.g. for one of several arms.

        """
        self._model = model
        root = root_link(model.urdf_text)
        shown = {root: shown_root(model.urdf_text, frame)}
        joints = parse_xml(model.chain_text).findall('joint')
        moving = set(model.joint_names)
        self._moving: list[tuple[str, str, int, int]] = []
        pin.forwardKinematics(model.pinocchio_model, model.pinocchio_data, model.home)
        pin.updateFramePlacements(model.pinocchio_model, model.pinocchio_data)
        base = pin.SE3(model.base.rotation, np.array(model.base.position, dtype=float))
        fixed = [_transform(frame, prefix + shown[root], base)]
        for joint in joints:
            parent, child = ends_of(joint)
            names = prefix + shown.get(parent, parent), prefix + child
            ids = self._frame(parent), self._frame(child)
            if joint.get('name') in moving:
                self._moving.append((*names, *ids))
            else:
                fixed.append(_transform(*names, self._between(*ids)))
        self.fixed: tuple[LinkTransform, ...] = tuple(fixed)
        """The arm in its frame, and the fixed links in their parents."""

    def moving(self, joint_positions: Array) -> list[LinkTransform]:
        """
        Return the transforms of the moving links.

        Args:
            joint_positions: (n,), rad.

        Returns:
            One transform per joint of the arm, beginning at the base.

        """
        model, data = self._model.pinocchio_model, self._model.pinocchio_data
        pin.forwardKinematics(model, data, joint_positions)
        for *_, parent, child in self._moving:
            pin.updateFramePlacement(model, data, parent)
            pin.updateFramePlacement(model, data, child)
        return [
            _transform(parent, child, self._between(parent_id, child_id))
            for parent, child, parent_id, child_id in self._moving
        ]

    def _frame(self, link: str) -> int:
        return int(self._model.pinocchio_model.getFrameId(link, pin.FrameType.BODY))

    def _between(self, parent: int, child: int) -> pin.SE3:
        placements = self._model.pinocchio_data.oMf
        return placements[parent].actInv(placements[child])


def _transform(parent: str, child: str, placement: pin.SE3) -> LinkTransform:
    x, y, z = placement.translation.tolist()
    qx, qy, qz, qw = pin.Quaternion(placement.rotation).coeffs().tolist()
    return LinkTransform(parent, child, (x, y, z), (qx, qy, qz, qw))
