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

"""Which link is the wrist, where an arm begins, and what of a robot stands still."""

from __future__ import annotations

from handover_dmp.robot.errors import RobotDescriptionError
from handover_dmp.robot.model import RobotModel
import numpy as np
import pytest

LIMIT = '<limit lower="-2" upper="2" velocity="1" effort="{effort}"/>'


def joint(name, parent, child, kind='revolute', more='', effort=50, axis='0 1 0', limit=LIMIT):
    inner = '' if kind == 'fixed' else f'<axis xyz="{axis}"/>{limit.format(effort=effort)}{more}'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0 0.2"/>{inner}</joint><link name="{child}"/>'
    )


def arm(prefix='', base='base', count=5):
    """Write a chain of joints j1, j2, ... that end in a link l<count>."""
    links = [base, *(f'{prefix}l{i + 1}' for i in range(count))]
    axes = ['0 0 1', '0 1 0']
    return ''.join(
        joint(f'{prefix}j{i + 1}', links[i], links[i + 1], axis=axes[i % 2]) for i in range(count)
    )


@pytest.fixture
def load(tmp_path):
    def read(body, name='mine', **frames):
        path = tmp_path / 'robot.urdf'
        path.write_text(f'<robot name="{name}"><link name="base"/>{body}</robot>')
        return RobotModel.load(path, **frames)

    return read


@pytest.mark.parametrize(
    ('more', 'wrist'),
    [
        ('', 'l5'),
        (joint('t', 'l5', 'tool0', 'fixed') + joint('f', 'l5', 'force_sensor', 'fixed'), 'tool0'),
        (joint('t', 'l5', 'a_tcp', 'fixed') + joint('c', 'base', 'camera', 'fixed'), 'a_tcp'),
        # what stands still is no end of an arm
        (joint('c', 'base', 'camera', 'fixed'), 'l5'),
        (
            joint('t', 'l5', 'panda_hand_tcp', 'fixed')
            + joint('one', 'l5', 'left_finger', 'prismatic')
            + joint('two', 'l5', 'right_finger', 'prismatic', '<mimic joint="one"/>'),
            'panda_hand_tcp',
        ),
    ],
)
def test_the_wrist_of_an_arm_that_shows_it(load, more, wrist):
    found = load(arm() + more)
    assert found.wrist_frame == wrist
    assert found.joint_names == ('j1', 'j2', 'j3', 'j4', 'j5')
    assert found.placed(found.base).remarks == found.remarks
    several = 'force_sensor' in more or 'finger' in more
    assert any(f'wrist link: {wrist},' in remark for remark in found.remarks) == several


@pytest.mark.parametrize(
    ('more', 'candidates'),
    [
        (joint('x', 'l5', 'moving_jaw'), "'moving_jaw', which joint 'x' moves, .*: l5, moving"),
        (joint('gripper', 'l5', 'part'), r'may be the jaw of a gripper.*: l5, part'),
        (joint('x', 'l5', 'part', effort=1), r'may be the jaw of a gripper.*: l5, part'),
        (
            joint('x', 'l5', 'part', 'prismatic', limit=LIMIT.replace('2"', '0.01"')),
            r'may be the jaw of a gripper.*: l5, part',
        ),
        (joint('a', 'l5', 'f1') + joint('b', 'l5', 'f2'), 'wrist_frame: f1, f2'),
        (
            joint('a', 'l5', 'tool0', 'fixed') + joint('b', 'l5', 'ee_link', 'fixed'),
            'wrist_frame: tool0, ee_link',
        ),
        (arm('left_') + joint('t', 'left_l5', 'left_tcp', 'fixed')
         + joint('u', 'l5', 'right_tcp', 'fixed'), 'wrist_frame: left_tcp, right_tcp'),
    ],
)  # fmt: skip
def test_a_wrist_that_could_be_several_is_asked_for(load, more, candidates):
    with pytest.raises(RobotDescriptionError, match=candidates) as caught:
        load(arm() + more)
    assert '\n' not in str(caught.value) and '--wrist-frame' in str(caught.value)


def test_one_arm_of_two(load):
    body = joint('lift', 'base', 'torso', 'prismatic') + arm('l_', 'torso') + arm('r_', 'torso')
    left = load(body, wrist_frame='l_l5')
    assert left.joint_names == ('lift', 'l_j1', 'l_j2', 'l_j3', 'l_j4', 'l_j5')
    right = load(body, wrist_frame='r_l4', base_frame='torso')
    assert right.joint_names == ('r_j1', 'r_j2', 'r_j3', 'r_j4')
    assert (right.wrist_frame, right.base_frame) == ('r_l4', 'torso')
    assert right.pinocchio_model.nq == 4
    again = right.placed(right.base)
    assert (again.joint_names, again.base_frame) == (right.joint_names, 'torso')
    # the base is the root still
    np.testing.assert_allclose(
        right.wrist_pose(np.zeros(4))[0], left.wrist_pose(np.zeros(6))[0] - [0.1, 0.0, 0.2]
    )


def test_what_does_not_belong_to_the_arm_stands_still_at_its_neutral_value(load):
    range_of_lift = '<limit lower="0.3" upper="0.9" velocity="1" effort="9"/>'
    lift = joint('lift', 'base', 'torso', 'prismatic', limit=range_of_lift, axis='0 0 2')
    turn = joint(
        'turn', 'torso', 'chest', more='<mimic joint="lift" multiplier="2" offset="0.1"/>'
    )
    held = load(lift + turn + arm('', 'chest'), wrist_frame='l5', base_frame='chest')
    moving = load(lift + joint('turn', 'torso', 'chest') + arm('', 'chest'), wrist_frame='l5')
    q = np.array([0.4, -0.3, 0.2, 0.5, -0.1])
    for found, expected in zip(
        held.wrist_pose(q), moving.wrist_pose(np.array([0.3, 0.7, *q])), strict=True
    ):
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_an_entry_of_the_table_needs_the_links_of_its_arm(load):
    other = load(arm(), name='panda')
    assert other.wrist_frame == 'l5'
    assert 'treated as an unknown arm' in other.remarks[0]


@pytest.mark.parametrize(
    ('body', 'frames', 'complaint'),
    [
        (arm(), {'wrist_frame': 'l6'}, "no link 'l6' for the wrist; it has l"),
        (arm(), {'base_frame': 'l6'}, "no link 'l6' for the base; it has l"),
        (arm() + arm('x_'), {'wrist_frame': 'l5', 'base_frame': 'x_l1'}, 'does not carry'),
        (arm(), {'wrist_frame': 'l1'}, "only joint 'j1' moves 'l1'; an arm needs at least 2"),
        (arm(), {'wrist_frame': 'base'}, "no joint moves 'base'"),
        (arm() + joint('j6', 'l5', 'l6', axis='0 0 0'), {}, "'j6' has an axis of zero length"),
        (arm() + joint('j6', 'l5', 'l6', 'ball'), {}, "'j6' is of type ball"),
        (arm() + joint('j6', 'l5', 'l6', 'floating'), {}, 'behind it, set --base-frame'),
        (
            arm() + joint('j6', 'l4', 'l6').replace('<link name="l6"/>', ''),
            {},
            "'l6', which is no",
        ),
        (
            arm() + joint('j6', 'l4', 'l3').replace('<link name="l3"/>', ''),
            {},
            "'l3' has two parents",
        ),
        (arm() + joint('j5', 'l5', 'l6'), {}, 'several joints are named j5'),
        (arm() + '<link name="loose"/>', {}, 'no joint connects base, loose'),
        (
            arm() + joint('back', 'l5', 'base').replace('<link name="base"/>', ''),
            {},
            'form a loop',
        ),
    ],
)
def test_what_is_no_arm_is_said_in_one_line(load, body, frames, complaint):
    with pytest.raises(RobotDescriptionError, match=complaint) as caught:
        load(body, **frames)
    assert '\n' not in str(caught.value) and 'robot.urdf' in str(caught.value)


def test_a_xacro_is_expanded_with_its_arguments(tmp_path):
    path = tmp_path / 'mine.urdf.xacro'
    path.write_text(
        '<robot name="mine" xmlns:xacro="http://wiki.ros.org/xacro"><xacro:arg name="p" '
        'default=""/><xacro:property name="half" value="${pi/2}"/><link name="base"/>'
        + arm('$(arg p)').replace('lower="-2"', 'lower="${-half}"')
        + '</robot>'
    )
    plain = RobotModel.load(path)
    assert plain.wrist_frame == 'l5'
    assert plain.limits.lower[0] == pytest.approx(-np.pi / 2)
    found = RobotModel.load(f'{path} p:=my_')
    assert found.joint_names[0] == 'my_j1'
    assert found.placed(found.base).joint_names == found.joint_names
    assert RobotModel.load(found.description.asked_for).joint_names == found.joint_names
    with pytest.raises(RobotDescriptionError, match="'p=my_' is not an argument name:=value"):
        RobotModel.load(f'{path} p=my_')
    unnamed = tmp_path / 'mine.urdf'
    unnamed.write_text(path.read_text())
    with pytest.raises(RobotDescriptionError, match='an unexpanded xacro'):
        RobotModel.load(unnamed)
    path.write_text(path.read_text().replace('${-half}', '${nonsense}'))
    with pytest.raises(RobotDescriptionError, match=r'cannot expand it: .*nonsense') as caught:
        RobotModel.load(path)
    assert '\n' not in str(caught.value)


def write_package(folder, name):
    """Write a package whose macro another package's xacro includes."""
    (folder / 'urdf').mkdir(parents=True)
    (folder / 'package.xml').write_text(f'<package><name>{name}</name></package>')
    macro = f'<robot xmlns:xacro="x"><xacro:macro name="five">{arm()}</xacro:macro></robot>'
    (folder / 'urdf' / 'five.xacro').write_text(macro)


@pytest.mark.parametrize(
    ('place', 'variable'),
    [
        ('some_arm', None),
        ('repository/some_arm', None),
        ('repository/../macros', None),
        ('elsewhere/share/some_arm', 'AMENT_PREFIX_PATH'),
        ('elsewhere/some_arm', 'ROS_PACKAGE_PATH'),
    ],
)
def test_a_xacro_finds_packages_as_meshes_are_found(tmp_path, monkeypatch, place, variable):
    for name in ('AMENT_PREFIX_PATH', 'ROS_PACKAGE_PATH'):
        monkeypatch.delenv(name, raising=False)
    if variable:
        monkeypatch.setenv(variable, str(tmp_path / 'elsewhere'))
    own = tmp_path / 'repository' / 'my_cell'
    (own / 'urdf').mkdir(parents=True)
    path = own / 'urdf' / 'cell.xacro'
    path.write_text(
        '<robot name="cell" xmlns:xacro="x"><xacro:include filename="$(find some_arm)/urdf/'
        'five.xacro"/><xacro:property name="where" value="$(eval find(\'some_arm\'))"/>'
        '<link name="base"/><xacro:five/></robot>'
    )
    folder = tmp_path / place
    if folder.name == 'macros':  # a package in a folder of another name, and the file in it
        write_package(folder.resolve(), 'some_arm')
        path = path.rename(folder.resolve() / 'urdf' / 'cell.xacro')
    else:
        write_package(folder, 'some_arm')
    assert RobotModel.load(path).joint_names == ('j1', 'j2', 'j3', 'j4', 'j5')


@pytest.mark.parametrize(
    ('part', 'fault'),
    [
        ('<xacro:include filename="$(find not_there)/a.xacro"/>', "package 'not_there' not found"),
        ('<link name="$(arg p)"/>', 'argument p is missing: add p:=value'),
        ('<xacro:include filename="none.xacro"/>', "No such file or directory: '.*none.xacro'"),
        ('<link name="${1/0}"/>', "division by zero when evaluating expression '1/0'"),
        ('<xacro:unknown/>', 'unknown'),
        ('<link name="a">', 'mismatched tag'),
    ],
)
def test_why_a_xacro_cannot_be_expanded_is_said_in_one_line(tmp_path, part, fault):
    path = tmp_path / 'odd.xacro'
    path.write_text(f'<robot name="odd" xmlns:xacro="x">{part}</robot>')
    with pytest.raises(RobotDescriptionError, match=f'cannot expand it: .*{fault}') as caught:
        RobotModel.load(path)
    said = str(caught.value)
    assert '\n' not in said and '<class' not in said and str(path) in said


def test_what_an_expanded_xacro_leaves_behind_is_no_xacro(load):
    leftover = (
        '<gazebo><plugin file="$(find x)/y.yaml" k="${z}"/></gazebo><!-- <xacro:x/> ${y} -->'
    )
    assert load(arm() + leftover).wrist_frame == 'l5'
