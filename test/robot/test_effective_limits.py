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

import ast
import dataclasses
from pathlib import Path
import re
from xml.etree import ElementTree

import handover_dmp
from handover_dmp.bench.zoo import file_limits
from handover_dmp.robot.chain import described_limits
from handover_dmp.robot.descriptions import known_arms, urdf_file
from handover_dmp.robot.errors import RobotDescriptionError
from handover_dmp.robot.model import BasePlacement, RobotModel
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

PACKAGE = Path(handover_dmp.__file__).parent
ARMS = tuple(known_arms())
PAIR = """<robot name="pair">
  <link name="base"/><link name="upper"/><link name="hand"/>
  <joint name="first" type="{kind}"><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/>{first}</joint>
  <joint name="second" type="revolute"><parent link="upper"/><child link="hand"/>
    <origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" velocity="1.5" effort="10"/></joint>
</robot>"""


@pytest.fixture
def pair(tmp_path):
    def load(first, kind='revolute'):
        path = tmp_path / 'pair.urdf'
        path.write_text(PAIR.format(first=first, kind=kind))
        return RobotModel.load(path)

    return load


def limits_in(text, names):
    """Read the limits of a URDF with nothing but the parser of XML."""
    joints = {
        j.get('name'): j.find('limit') for j in ElementTree.fromstring(text).findall('joint')
    }
    return {
        key: np.array([float(joints[name].get(key)) for name in names])
        for key in ('lower', 'upper', 'velocity', 'effort')
    }


@pytest.mark.parametrize('factor', [0.07, 0.5, 1.0, 3.0])
@pytest.mark.parametrize('name', ARMS)
def test_no_limit_of_a_file_is_ever_widened(tmp_path, name, factor):
    # the same arm as a stranger has it: another file, under the name that the table knows
    text = urdf_file(name).read_text()
    for key in ('lower', 'upper', 'velocity', 'effort'):
        text = re.sub(
            rf'\b{key}="([-0-9.e]+)"', lambda m, k=key: f'{k}="{factor * float(m[1])!r}"', text
        )
    path = tmp_path / 'arm.urdf'
    path.write_text(text)
    arm, table = RobotModel.load(path), known_arms()[name].limits
    own = limits_in(text, arm.joint_names)
    assert np.all(arm.limits.lower >= own['lower']) and np.all(arm.limits.upper <= own['upper'])
    for key in ('velocity', 'effort'):
        expected = np.minimum(own[key], table.get(key, np.inf))
        np.testing.assert_array_equal(getattr(arm.limits, key), expected)
    assert arm.limits.inside(arm.home, tolerance=-1e-3)
    assert arm.placed(arm.base).limits.velocity.tolist() == arm.limits.velocity.tolist()


@settings(max_examples=12, deadline=None)
@given(name=st.sampled_from(ARMS), seed=st.integers(0, 10**6))
def test_no_limit_of_any_joint_of_a_known_arm_is_widened(tmp_path_factory, name, seed):
    """Each limit of each joint is made smaller or greater by itself."""
    rng = np.random.default_rng(seed)
    text = urdf_file(name).read_text()
    for key in ('lower', 'upper', 'velocity', 'effort'):
        text = re.sub(
            rf'\b{key}="([-0-9.e]+)"',
            lambda m, k=key: f'{k}="{float(rng.choice([0.05, 0.4, 1.0, 7.0])) * float(m[1])!r}"',
            text,
        )
    path = tmp_path_factory.getbasetemp() / 'known.urdf'
    path.write_text(text)
    kept_within(RobotModel.load(path), text)


VALUES = st.sampled_from([None, '0', '-1', '0.03', '0.5', '2', '90', '999', '1e3', '1e16', 'inf'])
JOINT = st.fixed_dictionaries(
    {
        'kind': st.sampled_from(['revolute', 'continuous', 'prismatic']),
        'limit': st.fixed_dictionaries(
            {
                'lower': st.sampled_from([None, '-3', '-1', '0', '0.2', '-1e16', '-inf']),
                'upper': st.sampled_from([None, '3', '1', '0', '0.4', '1e16', 'inf']),
                **dict.fromkeys(('velocity', 'effort', 'acceleration', 'jerk'), VALUES),
            }
        ),
        'soft': st.fixed_dictionaries(
            {
                'soft_lower_limit': st.sampled_from([None, '0', '-0.6', '-9']),
                'soft_upper_limit': st.sampled_from([None, '0', '0.7', '9']),
            }
        ),
    }
)


@settings(max_examples=50, deadline=None)
@given(
    name=st.sampled_from(['some', 'panda', 'lbr_iiwa', 'lwr4', 'ur5']),
    joints=st.lists(JOINT, min_size=2, max_size=4),
)
def test_no_limit_of_any_file_is_widened(tmp_path_factory, name, joints):
    parts = ['<link name="l0"/>']
    for i, joint in enumerate(joints):
        limit, soft = (
            ' '.join(f'{key}="{value}"' for key, value in joint[part].items() if value is not None)
            for part in ('limit', 'soft')
        )
        parts.append(
            f'<link name="l{i + 1}"/><joint name="j{i}" type="{joint["kind"]}"><parent '
            f'link="l{i}"/><child link="l{i + 1}"/><origin xyz="0.3 0 0.1"/><axis xyz="0 {i % 2} '
            f'1"/><limit {limit}/><safety_controller {soft}/></joint>'
        )
    text = f'<robot name="{name}">{"".join(parts)}</robot>'
    path = tmp_path_factory.getbasetemp() / 'any.urdf'
    path.write_text(text)
    try:
        arm = RobotModel.load(path, wrist_frame=f'l{len(joints)}')
    except RobotDescriptionError as error:
        assert 'position limit' in str(error) and '\n' not in str(error)
        return
    kept_within(arm, text)


def kept_within(arm, text):
    """Hold every limit of an arm against what its file says, read by other code."""
    judged = described_limits(text, arm.joint_names, 'the judge').limits
    for limits in (arm.limits, judged, arm.placed(BasePlacement((1.0, 2.0, 0.5), 1.0)).limits):
        told = file_limits(text, arm.joint_names)
        assert np.all(limits.velocity <= told.velocity)
        assert np.all(limits.lower >= told.lower) and np.all(limits.upper <= told.upper)
        for i, name in enumerate(arm.joint_names):
            element = ElementTree.fromstring(text).find(f"joint[@name='{name}']/limit")
            for key, most in (('effort', np.inf), ('acceleration', 1e3), ('jerk', 1e3)):
                value = float(element.get(key, '0'))
                assert getattr(limits, key)[i] <= value or not 0.0 < value < most
    assert np.all(arm.home > told.lower) and np.all(arm.home < told.upper)


def test_limits_are_made_in_one_place_and_never_changed():
    """Whoever else made limits, or changed them, could make them wider than a file says."""
    made = {
        file.relative_to(PACKAGE).as_posix()
        for file in PACKAGE.rglob('*.py')
        for node in ast.walk(ast.parse(file.read_text(encoding='utf-8')))
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith('JointLimits')
    }
    assert made == {'robot/effective_limits.py'}
    replaced = {
        file.relative_to(PACKAGE).as_posix()
        for file in PACKAGE.rglob('*.py')
        if re.search(r'replace\(\s*\S*limits\b', file.read_text(encoding='utf-8'))
    }
    assert replaced == {'robot/model.py'}
    limits = RobotModel.load('lwr4').limits
    for field in dataclasses.fields(limits):
        with pytest.raises(ValueError, match='read-only'):
            getattr(limits, field.name)[0] = 1e9


def test_the_table_rules_for_an_arm_by_its_name_alone():
    by_name, by_path = RobotModel.load('iiwa14'), RobotModel.load(urdf_file('iiwa14'))
    table = known_arms()['iiwa14'].limits
    np.testing.assert_array_equal(by_name.limits.effort, table['effort'])
    np.testing.assert_array_equal(by_path.limits.effort, np.minimum(table['effort'], 300.0))
    np.testing.assert_array_equal(by_path.limits.velocity, table['velocity'])
    assert set(by_name.limit_sources['effort']) == {'config/robots.yaml (iiwa14)'}
    assert by_path.limit_sources['effort'][0] == 'description'
    assert by_path.limit_origins['velocity'] == 'config/robots.yaml (iiwa14)'
    assert by_name.placed(by_name.base).limits.effort[0] == 320.0


@pytest.mark.parametrize(
    ('limit', 'quantity', 'value', 'said'),
    [
        ('lower="-1" upper="1" effort="5"', 'velocity', 1.0, 'velocity limit missing'),
        ('lower="-1" upper="1" effort="5" velocity="0"', 'velocity', 1.0, 'velocity limit 0 '),
        ('lower="-1" upper="1" effort="5" velocity="1e3"', 'velocity', 1.0, 'limit 1000 is'),
        ('lower="-1" upper="1" effort="5" velocity="inf"', 'velocity', 1.0, 'limit inf is'),
        ('lower="-1" upper="1" effort="5" velocity="-2"', 'velocity', 1.0, 'limit -2 is'),
        ('lower="-1" upper="1" effort="0" velocity="1"', 'effort', 100.0, 'effort limit 0 is'),
        ('lower="0" upper="0" effort="5" velocity="1"', 'upper', np.pi, 'limits 0 to 0 are'),
        ('effort="5" velocity="1"', 'lower', -np.pi, 'position limits missing are'),
        ('lower="-1e16" upper="1e16" effort="5" velocity="1"', 'upper', np.pi, '-1e+16 to 1e+16'),
        ('lower="-2" upper="1000" effort="5" velocity="1"', 'upper', np.pi, '-2 to 1000'),
    ],
)
def test_placeholders_are_named_and_replaced(pair, limit, quantity, value, said):
    arm = pair(f'<limit {limit}/>')
    assert getattr(arm.limits, quantity)[0] == pytest.approx(value)
    (remark,) = [remark for remark in arm.remarks if 'placeholder' in remark]
    assert said in remark and remark.endswith('joint first')
    name = 'position' if quantity in ('lower', 'upper') else quantity
    assert 'default' in arm.limit_sources[name][0]
    assert arm.limit_sources[name][1] == 'description'
    if quantity == 'upper' and '-2' in limit:
        assert arm.limits.lower[0] == -2.0


def test_a_continuous_joint_turns_for_ever_at_a_cautious_speed(pair):
    arm = pair('', kind='continuous')
    assert (arm.limits.lower[0], arm.limits.upper[0]) == (-np.inf, np.inf)
    assert arm.limit_sources['position'][0] == 'continuous'
    assert arm.limits.velocity[0] == 1.0


@pytest.mark.parametrize(
    ('soft', 'expected'),
    [
        ('soft_lower_limit="-0.5" soft_upper_limit="0.25"', (-0.5, 0.25)),
        ('soft_lower_limit="-9" soft_upper_limit="0.25"', (-1.0, 0.25)),
        ('soft_upper_limit="0.25"', (-1.0, 0.25)),
        # gains of a controller alone
        ('k_position="100"', (-1.0, 1.0)),
        ('soft_lower_limit="0" soft_upper_limit="0"', (-1.0, 1.0)),
    ],
)
def test_soft_limits_are_limits(pair, soft, expected):
    limit = '<limit lower="-1" upper="1" velocity="1" effort="5"/>'
    arm = pair(f'{limit}<safety_controller k_velocity="10" {soft}/>')
    assert (arm.limits.lower[0], arm.limits.upper[0]) == expected
    is_soft = arm.limit_sources['position'][0] == 'safety_controller'
    assert is_soft == (expected != (-1.0, 1.0))


def test_accelerations_of_a_description_count(pair):
    arm = pair('<limit lower="-1" upper="1" velocity="1" effort="5" acceleration="3" jerk="40"/>')
    np.testing.assert_array_equal(arm.limits.acceleration, [3.0, 10.0])
    np.testing.assert_array_equal(arm.limits.jerk, [40.0, 1000.0])
    assert not any('placeholder' in remark for remark in arm.remarks)


@pytest.mark.parametrize(
    ('first', 'kind', 'complaint'),
    [
        ('<limit lower="1" upper="-1" velocity="1"/>', 'revolute', 'lower position limit is 1, '),
        ('<limit lower="1" upper="1" velocity="1"/>', 'revolute', 'cannot move: its lower'),
        ('<limit lower="nan" upper="1" velocity="1"/>', 'revolute', 'lower="nan" .* not a number'),
        ('<limit velocity="1"/>', 'prismatic', r'no position limits \(missing\)'),
        ('<limit lower="-1e5" upper="1e5"/>', 'prismatic', 'no position limits .-100000 to'),
        (
            '<limit lower="-1" upper="1" velocity="1"/>'
            '<safety_controller soft_lower_limit="2" soft_upper_limit="3"/>',
            'revolute',
            'cannot move: its lower',
        ),
    ],
)
def test_limits_that_leave_no_room(pair, first, kind, complaint):
    with pytest.raises(RobotDescriptionError, match=complaint) as caught:
        pair(first, kind)
    assert "joint 'first'" in str(caught.value) and '\n' not in str(caught.value)


def test_motors_of_unknown_effort_can_hold_a_heavy_arm(tmp_path):
    text = PAIR.format(first='<limit velocity="1"/>', kind='continuous').replace('effort="10"', '')
    inertial = (
        '<link name="hand"><inertial><origin xyz="1 0 0"/><mass value="60"/><inertia ixx="1" '
        'iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
    path = tmp_path / 'heavy.urdf'
    text = text.replace('<link name="hand"/>', inertial)
    path.write_text(text)
    arm = RobotModel.load(path)
    assert arm.limits.effort[1] > 60 * 9.81 * np.cos(0.3)
    assert not any('too low to hold' in remark for remark in arm.remarks)
    # what a description says is not made greater, but that it does not suffice is said
    path.write_text(text.replace('velocity="1.5"', 'velocity="1.5" effort="10"'))
    arm = RobotModel.load(path)
    assert arm.limits.effort[1] == 10.0
    assert re.search(r'too low to hold the arm.*: second 10 of 5\d\d Nm$', arm.remarks[-1])


def test_an_entry_of_another_arm_of_the_same_name_does_not_count(tmp_path):
    path = tmp_path / 'odd.urdf'
    path.write_text(PAIR.format(first='', kind='continuous').replace('"pair"', '"panda"'))
    arm = RobotModel.load(path)
    assert arm.wrist_frame == 'hand'
    assert 'has the name of panda in config/robots.yaml' in arm.remarks[0]
    np.testing.assert_array_equal(arm.limits.acceleration, 10.0)


def test_ranges_that_lie_beyond_a_turn_have_a_home(pair):
    arm = pair('<limit lower="4" upper="6" velocity="1" effort="1"/>')
    assert arm.limits.inside(arm.home, tolerance=-0.01)
    low, high = arm.limits.one_turn
    assert (low[0], high[0]) == (4.0, 6.0)
