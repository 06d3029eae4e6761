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

"""Arms of strangers: they work, within the limits of their files, or say in one line why not."""

from __future__ import annotations

from pathlib import Path

from handover_dmp.bench.odd_arms import lbr, LBRS, odd_arm, ODD_ARMS
from handover_dmp.bench.zoo import file_limits, zoo, ZooArm
from handover_dmp.bench.zoo_outcome import examine
from handover_dmp.robot.descriptions import example_robot_data_folder
from handover_dmp.robot.model import RobotModel
from handover_dmp.simulation.self_check import check_models
import numpy as np
import pytest

ARMS = {arm.name: arm for arm in zoo()}
REASONS = {'pendulum5.urdf': 'its wrist can hardly leave a surface'}
"""Arms that cannot hand over, and why."""
REFUSED = {
    'an axis of no direction': "joint 'j2' has an axis of zero length",
    'a ball joint': "joint 'j1' is of type ball; only revolute, continuous, prismatic joints",
    'a loop in place of a tree': "'l3' has two parents, 'l2' and 'l7'",
    'macros of xacro that are not expanded': 'an unexpanded xacro',
}
ASKED_FOR = {
    'the only jaw of a gripper': "say which link is the wrist ('jaw', which joint 'slider' moves",
    'two arms': 'say which link is the wrist, with --wrist-frame',
}
SAID = {
    'a name that config/robots.yaml knows, links that it does not': 'treated as an unknown arm',
    'placeholders for limits': 'velocity limit 1000 is a placeholder',
    'no inertia at all': 'no moving part has inertia, 1 kg assumed',
    'inertia that no body can have': 'l1: physically impossible inertia',
    'meshes of a package that is not there': 'package://nowhere_description/meshes/link.stl',
    'a mesh that is no mesh': '1 of 1 meshes cannot be read',
    'two frames at its end': 'wrist link: tool0',
}
LIMIT_TOLERANCE = 1e-6
MOTION_TOLERANCE = 0.01
"""What the noise of simulated joints may add."""


def test_the_zoo_is_found_by_looking() -> None:
    assert len(ARMS) > 45
    for name, joints, wrist in (
        ('ur_description/urdf/ur10_robot.urdf', 6, 'tool0'),
        ('kuka_iiwa/model.urdf', 7, 'lbr_iiwa_link_7'),
        ('so_arm_description/urdf/so100.urdf', 5, 'gripper'),
        ('z1_description/urdf/z1.urdf', 6, 'link06'),
        ('baxter_description/urdf/baxter.urdf', 7, 'right_wrist'),
    ):
        # an older example-robot-data lacks some
        if (example_robot_data_folder() / 'robots' / name).is_file() or name in ARMS:
            assert (len(ARMS[name].joint_names), ARMS[name].wrist_frame) == (joints, wrist)
    assert not any('anymal.urdf' in name or 'laikago' in name for name in ARMS)


@pytest.mark.sample(4)
@pytest.mark.parametrize('name', ARMS)
def test_an_arm_is_read_as_its_file_has_it(name: str) -> None:
    arm = ARMS[name]
    model = RobotModel.load(arm.path, wrist_frame=arm.wrist_frame, base_frame=arm.base_frame)
    assert model.joint_names == arm.joint_names
    assert check_models(model).mass < 1e-6
    _within(model)
    for remark in model.remarks:
        assert '\n' not in remark and len(remark) < 600


def _within(model: RobotModel) -> None:
    """Hold limits and home of an arm against its file."""
    told, limits = file_limits(model.urdf_text, model.joint_names), model.limits
    assert np.all(limits.velocity <= told.velocity)
    assert np.all(limits.lower >= told.lower) and np.all(limits.upper <= told.upper)
    assert np.all(model.home > told.lower) and np.all(model.home < told.upper)


@pytest.mark.parametrize('name', ODD_ARMS)
def test_an_odd_description_works_or_says_what_it_needs(name: str, tmp_path: Path) -> None:
    outcome = examine(odd_arm(name, tmp_path), ik_steps=300, hand_over=False)
    if name in REFUSED:
        assert outcome.fault.startswith(REFUSED[name]) and '\n' not in outcome.fault
        return
    assert outcome.fault == '' and outcome.joints == 7
    assert outcome.needs.startswith(ASKED_FOR.get(name, '')) and '\n' not in outcome.needs
    assert bool(outcome.needs) == (name in ASKED_FOR)
    assert bool(outcome.remarks) == (name in SAID)
    assert any(SAID[name] in remark for remark in outcome.remarks) or name not in SAID
    assert outcome.shares is not None and outcome.unsolved == 0
    assert max(outcome.shares.values()) <= 1.0 + LIMIT_TOLERANCE


def lbr_arm(model: str, folder: Path) -> ZooArm:
    path = folder / f'{model}.urdf'
    path.write_text(lbr(model), encoding='utf-8')
    return ZooArm(model, path, '', '', tuple(f'lbr_A{i}' for i in range(1, 8)))


@pytest.mark.parametrize('name', LBRS)
def test_an_lbr_in_the_form_of_its_stack_needs_nothing(name: str, tmp_path: Path) -> None:
    arm = lbr_arm(name, tmp_path)
    outcome = examine(arm, ik_steps=300, hand_over=False)
    assert (outcome.needs, outcome.fault, outcome.joints) == ('', '', 7)
    assert outcome.shares is not None and max(outcome.shares.values()) <= 1.0 + LIMIT_TOLERANCE
    assert len(outcome.remarks) == 1 and '16 of 16 meshes not found' in outcome.remarks[0]
    model = RobotModel.load(arm.path)
    assert (model.wrist_frame, model.joint_names) == ('lbr_link_ee', arm.joint_names)
    _within(model)


@pytest.mark.slow
@pytest.mark.parametrize('name', [*ARMS, *ODD_ARMS, *LBRS])
def test_an_arm_hands_over_within_the_limits_of_its_file(name: str, tmp_path: Path) -> None:
    written = lbr_arm if name in LBRS else odd_arm
    outcome = examine(ARMS[name] if name in ARMS else written(name, tmp_path))
    if name in REFUSED:
        assert outcome.fault.startswith(REFUSED[name])
        return
    assert outcome.shares is not None and outcome.unsolved == 0
    weak = any('too low to hold the arm' in remark for remark in outcome.remarks)
    assert outcome.shares['velocity'] <= 1.0 + (0.2 if weak else MOTION_TOLERANCE)
    assert outcome.shares['position'] <= 1.0 + MOTION_TOLERANCE
    assert outcome.shares['acceleration'] <= 1.0 + LIMIT_TOLERANCE
    if name in REASONS:
        assert outcome.fault.endswith(REASONS[name])
    else:
        assert outcome.fault == '' and outcome.gap_m is not None and outcome.gap_m < 0.03
