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

"""The shapes of a drawn robot: its own, and capsules for missing ones."""

from __future__ import annotations

from xml.etree import ElementTree

from handover_dmp.common.arrays import Array
from handover_dmp.robot.collision import link_capsules
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.plain_description import add_capsule, ends_of
from handover_dmp.robot.published_description import root_link
import numpy as np

ROD_RADIUS_M = 0.03
"""Radius of a rod for a link without any shape, drawn from joint to joint, m."""
GREY = '0.62 0.65 0.70 1'


def drawn_description(model: RobotModel) -> str:
    """
    Write the description for pictures.

    A link without a visual shape or with a missing mesh is drawn by its collision capsules;
    without those, as a rod.

    Args:
        model: the robot.

    Returns:
        Its URDF, with visual shapes and without collision shapes.

    """
    robot = ElementTree.fromstring(model.chain_text)
    links = {link.get('name', ''): link for link in robot.findall('link')}
    chain = model.pinocchio_model
    frames = {name: chain.frames[chain.getFrameId(name)] for name in links}
    shown = {frames[name].parentJoint for name, link in links.items() if link.findall('visual')}
    carriers = _carriers(robot, model)
    for joint in set(range(model.dof + 1)) - shown:
        name = carriers[joint]
        for start, end, radius in _stand_ins(model, joint):
            ends = frames[name].placement.actInv(start), frames[name].placement.actInv(end)
            for piece in add_capsule(links[name], 'visual', *ends, radius):
                material = ElementTree.SubElement(piece, 'material', name='stand-in')
                ElementTree.SubElement(material, 'color', rgba=GREY)
    for link in links.values():
        for shape in link.findall('collision'):
            link.remove(shape)
    return ElementTree.tostring(robot, encoding='unicode')


def _carriers(robot: ElementTree.Element, model: RobotModel) -> list[str]:
    """Return the links for added shapes: a fixed one, then one for each joint."""
    children = {joint.get('name'): ends_of(joint)[1] for joint in robot.findall('joint')}
    return [root_link(model.chain_text), *(children[name] for name in model.joint_names)]


def _stand_ins(model: RobotModel, joint: int) -> list[tuple[Array, Array, float]]:
    """Return ends and radius, m, of substitute shapes of a link, in its joint's frame."""
    capsules = [item for item in link_capsules(model) if item.joint == joint]
    if capsules:
        return [(item.start, item.end, item.radius) for item in capsules]
    chain = model.pinocchio_model
    begin = chain.frames[1].placement.translation if joint == 0 else np.zeros(3)
    if joint < model.dof:
        end = chain.jointPlacements[joint + 1].translation
    else:
        end = chain.frames[model.wrist_frame_id].placement.translation
    return [(begin.copy(), end.copy(), ROD_RADIUS_M)]
