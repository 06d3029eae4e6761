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

from __future__ import annotations

import subprocess
import sys
from xml.etree import ElementTree

from handover_dmp.robot.errors import RobotDescriptionError, UnreachableError
from handover_dmp.robot.model import BasePlacement, RobotModel
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

ARMS = ('lwr4', 'iiwa14', 'panda', 'ur5')

TWO_JOINTS = """<?xml version="1.0"?>
<robot name="two_joints">
  <link name="base"/>
  <link name="upper"/>
  <link name="lower"/>
  <link name="hand"/>
  <joint name="first" type="{kind}">
    <parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.3" rpy="0 0 0"/><axis xyz="0 0 1"/>
    {first}
  </joint>
  <joint name="second" type="revolute">
    <parent link="upper"/><child link="lower"/>
    <origin xyz="0.4 0 0" rpy="0 0 0"/><axis xyz="0 1 0"/>
    {second}
  </joint>
  <joint name="end" type="fixed">
    <parent link="lower"/><child link="hand"/>
    <origin xyz="0.3 0 0" rpy="0 0 0"/>
  </joint>
  {more}
</robot>
"""
LIMIT = '<limit lower="-1" upper="2" velocity="1.5" effort="10"/>'


@pytest.fixture(scope='module', params=ARMS)
def arm(request):
    return RobotModel.load(request.param)


@pytest.fixture
def urdf(tmp_path):
    def write(kind='revolute', first=LIMIT, second=LIMIT, more=''):
        path = tmp_path / 'arm.urdf'
        path.write_text(TWO_JOINTS.format(kind=kind, first=first, second=second, more=more))
        return path

    return write


def postures(arm, count, seed=0):
    low = np.maximum(arm.limits.lower, -np.pi)
    high = np.minimum(arm.limits.upper, np.pi)
    return np.random.default_rng(seed).uniform(low, high, (count, arm.dof))


def test_kinematics_agree_with_the_chain_multiplied_by_hand(arm):
    for posture in postures(arm, 10):
        position, rotation = arm.wrist_pose(posture)
        expected = _chain_pose(arm, posture)
        np.testing.assert_allclose(position, expected[:3, 3], atol=1e-9)
        np.testing.assert_allclose(rotation, expected[:3, :3], atol=1e-9)


def test_jacobian_agrees_with_finite_differences(arm):
    for posture in postures(arm, 5):
        jacobian = arm.wrist_jacobian(posture).copy()
        _, rotation = arm.wrist_pose(posture)
        for joint, step in enumerate(1e-6 * np.eye(arm.dof)):
            after, before = arm.wrist_pose(posture + step), arm.wrist_pose(posture - step)
            np.testing.assert_allclose(
                jacobian[:3, joint], (after[0] - before[0]) / 2e-6, atol=1e-8
            )
            turn = Rotation.from_matrix(after[1] @ before[1].T).as_rotvec() / 2e-6
            np.testing.assert_allclose(jacobian[3:, joint], turn, atol=1e-7)
        assert rotation.shape == (3, 3)


@pytest.mark.parametrize(
    ('roll', 'pitch', 'yaw'),
    [(0.0, 0.0, 0.8), (np.pi, 0.0, 0.0), (0.0, np.pi / 2, 0.4), (0.3, -0.5, 2.0)],
    ids=['table', 'ceiling', 'wall', 'any'],
)
def test_base_placement_moves_the_whole_arm(arm, roll, pitch, yaw):
    base = BasePlacement((0.5, -0.3, 0.7), yaw, roll, pitch)
    placed = arm.placed(base)
    rotation = Rotation.from_euler('xyz', [roll, pitch, yaw])
    turn = rotation.as_matrix()
    assert np.allclose(
        np.outer(base.quaternion, base.quaternion),
        np.outer(rotation.as_quat(), rotation.as_quat()),
        atol=1e-12,
    )
    for posture in postures(arm, 3):
        position, rotation = arm.wrist_pose(posture)
        moved, turned = placed.wrist_pose(posture)
        np.testing.assert_allclose(moved, turn @ position + [0.5, -0.3, 0.7], atol=1e-12)
        np.testing.assert_allclose(turned, turn @ rotation, atol=1e-12)
    np.testing.assert_allclose(placed.shoulder, turn @ arm.shoulder + [0.5, -0.3, 0.7], atol=1e-12)
    assert placed.reach_m == pytest.approx(arm.reach_m, abs=1e-6)


def test_home_is_well_bent_and_well_inside_the_limits(arm):
    assert arm.limits.inside(arm.home, tolerance=-0.2)
    manipulability = np.linalg.svd(arm.wrist_jacobian(arm.home)[:3], compute_uv=False)[-1]
    assert manipulability > 0.2


def test_no_random_posture_reaches_beyond_the_reach(arm):
    distances = [
        np.linalg.norm(arm.wrist_pose(posture)[0] - arm.shoulder)
        for posture in postures(arm, 2000)
    ]
    assert max(distances) <= arm.reach_m + 1e-9
    assert max(distances) > 0.85 * arm.reach_m


@pytest.mark.parametrize('full', [False, True])
def test_inverse_finds_postures_within_the_limits(arm, full):
    for posture in postures(arm, 15, seed=3):
        position, rotation = arm.wrist_pose(0.9 * posture + 0.1 * arm.home)
        found = arm.inverse(position, rotation if full else None)
        assert arm.limits.inside(found)
        reached, turned = arm.wrist_pose(found)
        np.testing.assert_allclose(reached, position, atol=1e-6)
        if full:
            assert np.linalg.norm(Rotation.from_matrix(turned.T @ rotation).as_rotvec()) < 1e-6


def test_inverse_stays_near_the_posture_it_is_given(arm):
    start = postures(arm, 1, seed=5)[0] * 0.5 + 0.5 * arm.home
    position, _ = arm.wrist_pose(start)
    found = arm.inverse(position + [0.0, 0.0, 0.005], q0=start)
    assert np.abs(found - start).max() < 0.1


def test_inverse_names_what_is_missing(arm):
    goal = arm.shoulder + (arm.reach_m + 0.25) * np.array([0.8, 0.0, 0.6])
    with pytest.raises(UnreachableError, match=r'it is 0\.25\d m too far') as caught:
        arm.inverse(goal)
    assert caught.value.missing_m == pytest.approx(0.25, abs=0.01)


def test_overrides_replace_the_placeholders_of_the_iiwa():
    arm = RobotModel.load('iiwa14')
    np.testing.assert_allclose(
        np.rad2deg(arm.limits.velocity), [85, 85, 100, 75, 130, 135, 135], atol=1e-4
    )
    np.testing.assert_allclose(arm.limits.effort, [320, 320, 176, 176, 110, 40, 40])


def test_fingers_of_a_gripper_are_locked():
    arm = RobotModel.load('panda')
    assert arm.dof == 7
    assert 'panda_finger_joint1' in arm.urdf_text
    assert not any('finger' in name for name in arm.joint_names)


def test_a_tool_moves_the_point_that_follows_the_wrist():
    arm, longer = RobotModel.load('lwr4'), RobotModel.load('lwr4', tool=(0.0, 0.0, 0.1))
    position, rotation = arm.wrist_pose(arm.home)
    np.testing.assert_allclose(longer.wrist_pose(arm.home)[0], position + 0.1 * rotation[:, 2])
    assert longer.reach_m == pytest.approx(arm.reach_m + 0.1, abs=1e-6)


def test_loading_does_not_start_pybullet():
    code = (
        'import sys; from handover_dmp.robot.model import RobotModel; RobotModel.load("iiwa14");'
        'assert not {"pybullet", "pybullet_data"} & set(sys.modules)'
    )
    subprocess.run([sys.executable, '-c', code], check=True)


def test_a_small_arm_by_its_path(urdf):
    arm = RobotModel.load(urdf())
    assert (arm.name, arm.dof, arm.wrist_frame) == ('two_joints', 2, 'hand')
    np.testing.assert_allclose(arm.wrist_pose(np.zeros(2))[0], [0.7, 0.0, 0.3])
    np.testing.assert_allclose(arm.limits.velocity, 1.5)
    assert np.all(arm.limits.acceleration > 0.0)


def test_continuous_joints_turn_for_ever(urdf):
    arm = RobotModel.load(urdf(kind='continuous', first='<limit velocity="2" effort="5"/>'))
    assert arm.dof == 2
    assert arm.limits.lower[0] == -np.inf and arm.limits.upper[0] == np.inf
    once, again = (
        arm.wrist_pose(np.array([0.3, 0.2])),
        arm.wrist_pose(np.array([0.3 + 40 * np.pi, 0.2])),
    )
    np.testing.assert_allclose(once[0], again[0], atol=1e-9)
    found = arm.inverse(once[0])
    np.testing.assert_allclose(arm.wrist_pose(found)[0], once[0], atol=1e-6)


@pytest.mark.parametrize(
    ('change', 'complaint'),
    [
        ({'kind': 'planar'}, r"'first' is of type planar"),
        ({'second': LIMIT + '<mimic joint="first"/>'}, r"joint 'second' moves, may be the jaw"),
        (
            {
                'more': '<link name="thumb"/><joint name="t" type="fixed"><parent link="lower"/>'
                '<child link="thumb"/></joint>'
            },
            r'say which link is the wrist, .*wrist_frame: hand, thumb',
        ),
        ({'more': '<joint name="loose" type="fixed"/>'}, r"'loose' lacks its parent"),
        (
            {'second': '<limit lower="${-pi}" upper="1" velocity="1"/>'},
            'an unexpanded xacro',
        ),
        (
            {'second': LIMIT + '<origin xyz="0 0 up"/>'},
            r'xyz="0 0 up" of <origin> .* is not 3',
        ),
        ({'second': LIMIT + '<origin rpy="0 0"/>'}, r'rpy="0 0" of <origin> .* is not 3 numbers'),
        ({'more': '<link name="upper"/>'}, 'several links are named upper'),
    ],
)
def test_says_what_a_description_lacks(urdf, capfd, change, complaint):
    with pytest.raises(RobotDescriptionError, match=complaint) as caught:
        RobotModel.load(urdf(**change))
    assert 'arm.urdf' in str(caught.value) and '\n' not in str(caught.value)
    assert capfd.readouterr() == ('', '')


def test_mimic_joints_beside_the_chain_are_locked(urdf):
    more = (
        '<link name="finger"/><joint name="grip" type="prismatic"><parent link="hand"/>'
        '<child link="finger"/><axis xyz="0 1 0"/><mimic joint="first"/></joint>'
    )
    arm = RobotModel.load(urdf(more=more), wrist_frame='hand')
    assert arm.joint_names == ('first', 'second')


def test_a_wrist_that_is_not_there(urdf):
    with pytest.raises(
        RobotDescriptionError,
        match=r"no link 'wirst' for the wrist; it has lower, base, upper",
    ):
        RobotModel.load(urdf(), wrist_frame='wirst')


@pytest.mark.parametrize(
    ('text', 'complaint'),
    [
        ('<robot', 'not XML'),
        ('<sdf/>', 'is it a URDF'),
        ('<robot name="x"/>', 'is it an arm'),
    ],
)
def test_files_that_are_no_arm(tmp_path, text, complaint):
    path = tmp_path / 'odd.urdf'
    path.write_text(text)
    with pytest.raises(RobotDescriptionError, match=complaint):
        RobotModel.load(path)


def test_a_file_in_another_encoding(tmp_path):
    path = tmp_path / 'odd.urdf'
    path.write_bytes('<robot name="é"/>'.encode('latin-1'))
    with pytest.raises(RobotDescriptionError, match=r'odd\.urdf: not UTF-8'):
        RobotModel.load(path)


def test_an_arm_that_is_not_known():
    with pytest.raises(RobotDescriptionError, match='neither a URDF file nor one of lwr4'):
        RobotModel.load('lwr5')


def _chain_pose(arm, posture):
    """Multiply the joints of the URDF from base to wrist, with nothing but SciPy's rotations."""
    tree = ElementTree.fromstring(arm.urdf_text)
    parent_joint = {joint.find('child').get('link'): joint for joint in tree.findall('joint')}
    pose, link = np.eye(4), arm.wrist_frame
    values = dict(zip(arm.joint_names, posture, strict=True))
    while link in parent_joint:
        joint = parent_joint[link]
        origin = joint.find('origin')
        shift = origin.get('xyz', '0 0 0') if origin is not None else '0 0 0'
        turn = origin.get('rpy', '0 0 0') if origin is not None else '0 0 0'
        step = np.eye(4)
        step[:3, 3] = [float(x) for x in shift.split()]
        step[:3, :3] = Rotation.from_euler('xyz', [float(x) for x in turn.split()]).as_matrix()
        if joint.get('name') in values:
            axis = np.array([float(x) for x in joint.find('axis').get('xyz').split()])
            moved = np.eye(4)
            moved[:3, :3] = Rotation.from_rotvec(axis * values[joint.get('name')]).as_matrix()
            step = step @ moved
        pose = step @ pose
        link = joint.find('parent').get('link')
    return pose
