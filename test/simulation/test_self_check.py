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

"""Robots that the two engines agree about pass; a changed link does not."""

from __future__ import annotations

from dataclasses import replace
import re

from handover_dmp.robot.model import BasePlacement, RobotModel
from handover_dmp.simulation.self_check import check_models, ModelMismatchError
import pytest


@pytest.mark.parametrize('robot', ['lwr4', 'iiwa14', 'panda', 'ur5'])
def test_engines_agree(robot):
    found = check_models(
        RobotModel.load(robot, base=BasePlacement((0.3, -0.2, 0.5), 0.7, 2.0, -0.4))
    )
    assert found.position_m < 1e-6
    assert found.mass < 1e-8


def changed(pattern, replacement):
    """Change what PyBullet reads, so that it has another robot than Pinocchio."""
    model = RobotModel.load('lwr4')
    other, count = re.subn(pattern, replacement, model.chain_text, count=1, flags=re.DOTALL)
    assert count == 1 and other != model.chain_text
    return replace(model, chain_text=other)


def test_longer_link_is_refused_with_its_name_and_the_distance():
    model = changed(r'(<joint name="joint_4".*?<origin xyz=")0 0 0.2"', r'\g<1>0 0 0.212"')
    with pytest.raises(ModelMismatchError, match=r'lwr4\.urdf: .*joint_\d is 12 mm off'):
        check_models(model)


def test_micrometres_count():
    model = changed(r'(<joint name="joint_4".*?<origin xyz=")0 0 0.2"', r'\g<1>0 0 0.200002"')
    with pytest.raises(ModelMismatchError, match=r'is 0\.002\d* mm off'):
        check_models(model)


def test_other_axis_is_refused():
    model = changed(r'(<joint name="joint_6".*?<axis xyz=")0 -1 0"', r'\g<1>0 1 0"')
    with pytest.raises(ModelMismatchError, match=r'joint_\d is rotated by'):
        check_models(model)


def test_heavier_link_is_refused():
    model = changed(r'(<link name="lwr4_link_4">.*?<mass value=")', r'\g<1>1')
    with pytest.raises(ModelMismatchError, match='mass matrix differs by'):
        check_models(model)
