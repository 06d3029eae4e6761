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
A robot description for others to show: its meshes found, its root not the frame of the room.

RViz and Foxglove look for `package://` among the packages that are installed, and know nothing of
paths that are relative to a file which they never see. So each mesh and texture that is on this
machine is told by its absolute `file://`. And a description whose root is called as the frame that
the arm stands in would need a transform from that frame to itself: its root is renamed.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from handover_dmp.robot.chain import ends_of
from handover_dmp.robot.mesh_files import find_mesh
from handover_dmp.robot.plain_description import parse_xml


def root_link(text: str) -> str:
    """
    Find the link of a description that no joint carries.

    Args:
        text: of a URDF that `RobotModel` has loaded.

    Returns:
        Its name.

    """
    tree = parse_xml(text)
    carried = {ends_of(joint)[1] for joint in tree.findall('joint')}
    names = [link.get('name', '') for link in tree.findall('link')]
    return next(name for name in names if name not in carried)


def shown_root(text: str, frame: str) -> str:
    """
    Name the root of an arm for those who show it.

    Args:
        text: of its URDF.
        frame: that it stands in.

    Returns:
        The name of its root, another one if that is the name of the frame.

    """
    root = root_link(text)
    names = {link.get('name', '') for link in parse_xml(text).findall('link')}
    while root in (frame, *(names - {root_link(text)})):
        root = f'arm_{root}'
    return root


def published_description(text: str, folder: Path, frame: str) -> str:
    """
    Make a description that others can show.

    Args:
        text: of the URDF.
        folder: where it lies.
        frame: that the arm stands in.

    Returns:
        The same URDF with the meshes and textures that are found by their `file://`, and with
        another root if that is called as the frame; unchanged if nothing has to be.

    """
    tree = parse_xml(text)
    changed = False
    for part in [*tree.iter('mesh'), *tree.iter('texture')]:
        name = part.get('filename', '')
        found = find_mesh(name, folder)
        if found is not None and name != found.as_uri():
            part.set('filename', found.as_uri())
            changed = True
    old, new = root_link(text), shown_root(text, frame)
    if new != old:
        changed = True
        for link in tree.findall('link'):
            if link.get('name') == old:
                link.set('name', new)
        for joint in tree.findall('joint'):
            for parent in joint.findall('parent'):
                if parent.get('link') == old:
                    parent.set('link', new)
    return ElementTree.tostring(tree, encoding='unicode') if changed else text
