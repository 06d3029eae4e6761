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

"""Small arms, each with one oddity found in descriptions of drivers and exporters."""

from __future__ import annotations

from collections.abc import Callable
from math import radians
from pathlib import Path

from handover_dmp.bench.zoo import ZooArm

JOINTS = 7
WRIST = 'l7'
INERTIAL = (
    '<inertial><origin xyz="0 0 0.05"/><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" '
    'iyy="0.01" iyz="0" izz="0.01"/></inertial>'
)
SHAPE = '<origin xyz="0 0 0.1"/><geometry><cylinder radius="0.04" length="0.15"/></geometry>'
LIMIT = '<limit lower="-2.6" upper="2.6" velocity="1.5" effort="100"/>'
TOOL = (
    '<link name="{name}"/><joint name="{name}_joint" type="fixed"><parent link="l7"/>'
    '<child link="{name}"/><origin xyz="0 0 0.1"/></joint>'
)
JAW = (
    '<link name="jaw"/><joint name="slider" type="prismatic"><parent link="l7"/>'
    '<child link="jaw"/><axis xyz="1 0 0"/><limit lower="0" upper="0.04" velocity="0.1" '
    'effort="20"/></joint>'
)


def chain(prefix: str = '') -> str:
    """Return the links and joints of a seven-joint arm on the link `base`."""
    parts = []
    for i in range(1, JOINTS + 1):
        parent = f'{prefix}l{i - 1}' if i > 1 else 'base'
        parts.append(
            f'<link name="{prefix}l{i}">{INERTIAL}<visual>{SHAPE}</visual>'
            f'<collision>{SHAPE}</collision></link>'
            f'<joint name="{prefix}j{i}" type="revolute"><parent link="{parent}"/>'
            f'<child link="{prefix}l{i}"/><origin xyz="0 0 {0.2 if i > 1 else 0.1}"/>'
            f'<axis xyz="{"0 0 1" if i % 2 else "0 1 0"}"/>{LIMIT}</joint>'
        )
    return ''.join(parts)


def robot(body: str, name: str = 'odd', more: str = '') -> str:
    """Return a robot whose base has inertia."""
    return f'<robot name="{name}"><link name="base">{INERTIAL}</link>{body}{more}</robot>'


def _meshes(mesh: str) -> str:
    return robot(chain().replace('<cylinder radius="0.04" length="0.15"/>', f'<mesh {mesh}/>'))


ODD_ARMS: dict[str, Callable[[], str]] = {
    'nothing odd': lambda: robot(chain()),
    'limits of its own, under a name that config/robots.yaml knows': lambda: robot(
        chain('lbr_iiwa_')
        .replace('velocity="1.5"', 'velocity="0.2"')
        .replace('"lbr_iiwa_l', '"lbr_iiwa_link_'),
        'lbr_iiwa',
    ),
    'a name that config/robots.yaml knows, links that it does not': lambda: robot(
        chain(), 'panda'
    ),
    'soft limits': lambda: robot(
        chain().replace(
            LIMIT, f'{LIMIT}<safety_controller soft_lower_limit="-2" soft_upper_limit="2"/>'
        )
    ),
    'placeholders for limits': lambda: robot(
        chain().replace('velocity="1.5"', 'velocity="1000"').replace('effort="100"', 'effort="0"')
    ),
    'frames without inertia': lambda: robot(chain(), more=TOOL.format(name='tool0')).replace(
        '<link name="base">',
        '<link name="world"/><joint name="mount" type="fixed"><parent link="world"/>'
        '<child link="base"/></joint><link name="base">',
    ),
    'no inertia at all': lambda: robot(chain()).replace(INERTIAL, ''),
    'inertia that no body can have': lambda: robot(chain().replace('izz="0.01"', 'izz="0.05"', 1)),
    'meshes of a package that is not there': lambda: _meshes(
        'filename="package://nowhere_description/meshes/link.stl"'
    ),
    'a mesh that is no mesh': lambda: _meshes('filename="odd.urdf"'),
    'XML prefixes without a namespace': lambda: robot(
        chain(), more='<sensor:camera name="eye"><parent link="l7"/></sensor:camera>'
    ),
    'two frames at its end': lambda: robot(
        chain(), more=TOOL.format(name='tool0') + TOOL.format(name='force_sensor')
    ),
    'the only jaw of a gripper': lambda: robot(chain(), more=JAW),
    'two arms': lambda: robot(chain('left_') + chain('right_')),
    'an axis of no direction': lambda: robot(chain().replace('"0 1 0"', '"0 0 0"', 1)),
    'a ball joint': lambda: robot(chain().replace('type="revolute"', 'type="ball"', 1)),
    'a loop in place of a tree': lambda: robot(
        chain(),
        more='<joint name="back" type="fixed"><parent link="l7"/><child link="l3"/></joint>',
    ),
    'macros of xacro that are not expanded': lambda: robot(
        chain().replace('"0.2 ', '"${length} ').replace('0 0 0.2"', '0 0 ${length}"')
    ),
}
"""Descriptions by oddity."""


LBR_SPEEDS = {
    '7': (98, 98, 100, 130, 140, 180, 180),
    '14': (85, 85, 100, 75, 130, 135, 135),
}
"""Joint speeds from KUKA's data sheets, deg/s."""
LBR_HEIGHTS = {
    '7': (0.15, 0.19, 0.21, 0.19, 0.21, 0.19, 0.081),
    '14': (0.15, 0.21, 0.21, 0.21, 0.21, 0.19, 0.081),
}
"""Distances from joint to joint, m."""
LBR_RANGES = (170, 120, 170, 120, 170, 120, 175)
LBR_AXES = ('0 0 1', '0 1 0', '0 0 1', '0 -1 0', '0 0 1', '0 1 0', '0 0 1')
LBRS = ('iiwa7', 'iiwa14', 'med7', 'med14')


def lbr(model: str) -> str:
    """
    Return an LBR in the form that lbr_fri_ros2_stack publishes.

    It has a prefix before every name, frames without inertia at both ends, meshes of a package,
    and tags for simulators and ros2_control.

    Args:
        model: one of `LBRS`.

    Returns:
        The URDF, expanded by xacro.

    """
    payload = model.removeprefix('iiwa').removeprefix('med')
    mesh = f'<geometry><mesh filename="package://lbr_description/meshes/{model}/{{}}"/></geometry>'
    parts = [
        '<link name="lbr_floating_link"/>',
        '<joint name="lbr_floating_joint" type="fixed"><parent link="lbr_floating_link"/>'
        '<child link="lbr_link_0"/></joint>',
    ]
    for i in range(8):
        visual, collision = (
            mesh.format(f'{kind}/link_{i}.{ending}')
            for kind, ending in (('visual', 'dae'), ('collision', 'stl'))
        )
        parts.append(
            f'<link name="lbr_link_{i}">{INERTIAL}<visual>{visual}</visual>'
            f'<collision>{collision}</collision></link>'
        )
    rows = zip(LBR_RANGES, LBR_SPEEDS[payload], LBR_HEIGHTS[payload], LBR_AXES, strict=True)
    for i, (degrees, speed, height, axis) in enumerate(rows, 1):
        parts.append(
            f'<joint name="lbr_A{i}" type="revolute"><origin rpy="0 0 0" xyz="0 0 {height}"/>'
            f'<parent link="lbr_link_{i - 1}"/><child link="lbr_link_{i}"/><axis xyz="{axis}"/>'
            f'<limit effort="200" lower="{-radians(degrees)}" upper="{radians(degrees)}" '
            f'velocity="{radians(speed)}"/><dynamics damping="10.0" friction="0.1"/></joint>'
        )
    parts.append(
        '<joint name="lbr_joint_ee" type="fixed"><parent link="lbr_link_7"/>'
        '<child link="lbr_link_ee"/><origin xyz="0 0 0.035" rpy="0 0 0"/></joint>'
        '<link name="lbr_link_ee"/><gazebo reference="lbr_link_1"><material>Gazebo/Grey'
        '</material></gazebo><ros2_control name="lbr_system_interface" type="system"><hardware>'
        '<plugin>mock_components/GenericSystem</plugin></hardware><joint name="lbr_A1">'
        '<command_interface name="position"/></joint></ros2_control>'
    )
    return f'<robot name="{model}">{"".join(parts)}</robot>'


def odd_arm(name: str, folder: Path) -> ZooArm:
    """
    Write an arm of `ODD_ARMS`.

    Args:
        name: its name.
        folder: folder for its file.

    Returns:
        The arm.

    """
    path = folder / 'odd.urdf'
    path.write_text(ODD_ARMS[name](), encoding='utf-8')
    prefix = 'left_' if name == 'two arms' else ''
    joints = tuple(f'{prefix}j{i}' for i in range(1, JOINTS + 1))
    return ZooArm(name, path, f'{prefix}{WRIST}', '', joints)
