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
A robot description for viewers: with mesh paths resolved, and a root that is not the room's frame.

RViz and Foxglove look for `package://` among the installed packages, and cannot resolve paths
relative to a file that they never see. So each mesh and texture found on this machine is given by
its absolute `file://` path. If the root has the name of the frame of the base placement, a
transform from that frame to itself would be needed: the root is renamed instead.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from handover_dmp.robot.mesh_files import find_mesh
from handover_dmp.robot.plain_description import ends_of, parse_xml


def root_link(text: str) -> str:
    """
    Find the root link of a description.

    Args:
        text: text of a URDF that `RobotModel` has loaded.

    Returns:
        Its name.

    """
    tree = parse_xml(text)
    carried = {ends_of(joint)[1] for joint in tree.findall('joint')}
    names = [link.get('name', '') for link in tree.findall('link')]
    return next(name for name in names if name not in carried)


def shown_root(text: str, frame: str) -> str:
    """
    Return the published name of an arm's root.

    Args:
        text: text of its URDF.
        frame: frame of the base placement.

    Returns:
        The name of its root; another name if the frame has the same.

    """
    own = root = root_link(text)
    names = {link.get('name', '') for link in parse_xml(text).findall('link')}
    while root in (frame, *(names - {own})):
        root = f'arm_{root}'
    return root


def published_description(text: str, folder: Path, frame: str) -> str:
    """
    Make a description for viewers.

    Args:
        text: text of the URDF.
        folder: its folder.
        frame: frame of the base placement.

    Returns:
        The URDF with `file://` paths for all found meshes and textures, and with a renamed root
        if necessary; otherwise unchanged.

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
        for path, key in (('link', 'name'), ('joint/parent', 'link')):
            for element in tree.findall(path):
                if element.get(key) == old:
                    element.set(key, new)
    return ElementTree.tostring(tree, encoding='unicode') if changed else text
