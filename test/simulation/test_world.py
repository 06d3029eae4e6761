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

"""PyBullet moves the robot that the URDF describes, as it is told, and says nothing."""

from __future__ import annotations

from dataclasses import replace
import subprocess
import sys

from handover_dmp.common.errors import DataError
from handover_dmp.common.resources import share_path
from handover_dmp.robot.model import BasePlacement, RobotModel
from handover_dmp.simulation.partner_figure import PartnerFigure
from handover_dmp.simulation.self_check import check_models
from handover_dmp.simulation.world import moving_masses, World
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

ROBOTS = ('lwr4', 'iiwa14', 'panda', 'ur5')


@pytest.mark.parametrize('robot', ROBOTS)
def test_reads_joints_in_the_order_of_the_model(robot):
    model = RobotModel.load(robot)
    posture = model.home + 0.01 * np.arange(1, model.dof + 1)
    with World(model) as world:
        world.reset(posture)
        positions, velocities = world.read()
    assert positions == pytest.approx(posture, abs=1e-12)
    assert velocities == [0.0] * model.dof


@pytest.mark.parametrize('robot', ROBOTS)
def test_stands_on_its_base(robot):
    base = BasePlacement((0.4, -1.2, 0.7), 2.0, roll=np.pi, pitch=0.3)
    model = RobotModel.load(robot, base=base)
    unplaced = RobotModel.load(robot)
    name = model.joint_names[-1]
    posture = model.home + 0.1
    with World(model) as world, World(unplaced) as reference:
        world.reset(posture)
        reference.reset(posture)
        position, rotation = world.joint_pose(name)
        before, turned = reference.joint_pose(name)
    turn = Rotation.from_euler('xyz', [np.pi, 0.3, 2.0]).as_matrix()
    assert position == pytest.approx(turn @ before + [0.4, -1.2, 0.7], abs=1e-6)
    assert rotation == pytest.approx(turn @ turned, abs=1e-6)


@settings(deadline=None, max_examples=30)
@given(st.lists(st.floats(-1.0, 1.0), min_size=7, max_size=7))
def test_motors_make_the_velocity_they_are_told(share):
    model = RobotModel.load('lwr4')
    wanted = np.array(share) * model.limits.velocity
    with World(model) as world:
        # Effort limits allow no arbitrary jump from rest.
        for k in range(1, 301):
            world.drive((wanted * k / 300).tolist())
            world.step()
        positions, velocities = world.read()
    assert velocities == pytest.approx(wanted, abs=1e-9)
    expected = model.home + wanted * 1e-3 * sum(range(1, 301)) / 300
    assert positions == pytest.approx(expected, abs=1e-9)


def test_worlds_side_by_side_do_not_know_of_each_other():
    model = RobotModel.load('lwr4')
    with World(model) as one, World(model) as other:
        one.drive([0.3] * 7)
        for _ in range(50):
            one.step()
        assert other.read()[0] == pytest.approx(model.home, abs=1e-12)
        one.close()
        other.step()
        one.close()
    with pytest.raises(Exception, match='physics server'):
        one.read()


@pytest.mark.parametrize('filler', range(0, 50, 11))
def test_a_description_in_one_long_line_is_read_as_it_is(tmp_path, filler):
    """Such lines PyBullet breaks, and what stands there; a xacro is often expanded to one."""
    text = share_path('urdf/lwr4.urdf').read_text(encoding='utf-8')
    weights = [
        f'<link name="weight_{i:03d}"><inertial><mass value="0.0{i + 11}"/><inertia ixx="0.001" '
        'ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial></link>'
        f'<joint name="fixed_{i:03d}" type="fixed"><parent link="wrist"/><child '
        f'link="weight_{i:03d}"/><origin xyz="0.0{i + 11} 0.0{i + 12} 0.0{i + 13}"/></joint>'
        for i in range(40)
    ]
    text = text.replace('</robot>', ''.join(weights) + '</robot>')
    text = text.replace('name="lwr4"', f'name="{"m" * (1 + filler)}"', 1)
    path = tmp_path / 'line.urdf'
    path.write_text(' '.join(text.split()).replace('> <', '><'))
    model = RobotModel.load(path, wrist_frame='wrist')
    assert len(moving_masses(model)) > 2 * 8192
    check_models(model)


def run(world, seed):
    random = np.random.default_rng(seed)
    velocity = np.zeros(world.model.dof)
    seen = []
    for _ in range(200):
        velocity += random.uniform(-0.01, 0.01, world.model.dof)
        world.drive(velocity.tolist())
        world.step()
        seen.append(world.read())
    return np.array(seen)


def test_same_commands_give_same_motion_bit_for_bit():
    model = RobotModel.load('lwr4')
    path = np.linspace([0.9, 0.1, 0.9], [0.6, 0.0, 1.1], 20)
    with World(model) as one, World(model, figure=PartnerFigure(path, np.zeros(3))) as other:
        first = run(one, 1)
        run(one, 2)
        one.reset(model.home)
        again = run(one, 1)
        with_figure = run(other, 1)
    assert np.array_equal(first, again)
    assert np.array_equal(first, with_figure)


def test_writes_nothing_to_the_terminal():
    script = (
        'from handover_dmp.robot.model import RobotModel, BasePlacement\n'
        'from handover_dmp.simulation.world import World\n'
        'from handover_dmp.simulation.partner_figure import PartnerFigure\n'
        'for robot in ("lwr4", "panda"):\n'
        '    figure = PartnerFigure([1, 0, 1], [0, 0, 1])\n'
        '    with World(RobotModel.load(robot), figure=figure) as world:\n'
        '        world.step()\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', script], capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout + done.stderr == ''


def test_what_pybullet_cannot_read_is_one_clear_line():
    model = replace(RobotModel.load('lwr4'), chain_text='<robot/>')
    with pytest.raises(DataError, match=r'lwr4\.urdf: PyBullet cannot load it'):
        World(model)


def test_description_without_one_of_the_joints_is_one_clear_line():
    model = RobotModel.load('lwr4')
    model = replace(model, chain_text=model.chain_text.replace('"joint_3"', '"joint_x"'))
    with pytest.raises(DataError, match=r'lwr4\.urdf: PyBullet has no moving joint joint_3'):
        World(model)


def test_file_that_is_gone_after_it_was_read_is_not_missed(tmp_path):
    copy = tmp_path / 'robot.urdf'
    copy.write_text(RobotModel.load('lwr4').urdf_text)
    model = RobotModel.load(copy)
    copy.unlink()
    with World(model) as world:
        assert world.read()[0] == pytest.approx(model.home)
