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

"""The frames of the links, held against Pinocchio on the description as it is published."""

from __future__ import annotations

from collections.abc import Iterable

from handover_dmp.robot.link_frames import LinkFrames, LinkTransform
from handover_dmp.robot.model import BasePlacement, RobotModel
from handover_dmp.robot.published_description import published_description
import numpy as np
import pinocchio as pin
import pytest

FRAME = 'world'
BASE = BasePlacement((0.4, -0.3, 0.8), yaw=0.7, roll=0.2, pitch=-0.1)


def chained(links: Iterable[LinkTransform]) -> dict[str, pin.SE3]:
    """Put transforms together as tf2 does: each frame in the one that has no parent."""
    carried = {
        link.child: (link.parent, pin.XYZQUATToSE3(np.array([*link.position, *link.quaternion])))
        for link in links
    }

    def place(frame: str) -> pin.SE3:
        if frame not in carried:
            assert frame == FRAME
            return pin.SE3.Identity()
        parent, placement = carried[frame]
        return place(parent) * placement

    return {frame: place(frame) for frame in carried}


@pytest.mark.parametrize('robot', ['lwr4', 'iiwa14', 'panda', 'ur5'])
def test_every_link_is_where_pinocchio_has_it(robot: str) -> None:
    model = RobotModel.load(robot, base=BASE)
    frames = LinkFrames(model, FRAME)
    # the whole robot, fingers and all, from what viewers get
    text = published_description(model.urdf_text, model.urdf_path.parent, FRAME)
    whole = pin.buildModelFromXML(text)
    data = whole.createData()
    base = pin.SE3(BASE.rotation, np.array(BASE.position))
    rng = np.random.default_rng(0)
    low, high = model.limits.one_turn
    for _ in range(5):
        q = rng.uniform(low, high)
        everything = pin.neutral(whole)
        for joint, value in zip(model.joint_names, q, strict=True):
            at = whole.joints[whole.getJointId(joint)]
            everything[at.idx_q: at.idx_q + at.nq] = (
                [value] if at.nq == 1 else [np.cos(value), np.sin(value)]
            )  # fmt: skip
        pin.framesForwardKinematics(whole, data, everything)
        found = chained([*frames.fixed, *frames.moving(q)])
        links = [f for f in whole.frames if f.type == pin.FrameType.BODY and f.name != 'universe']
        assert {f.name for f in links} == set(found)
        for frame in links:
            expected = base * data.oMf[whole.getFrameId(frame.name, pin.FrameType.BODY)]
            assert found[frame.name].isApprox(expected, 1e-9), frame.name


def test_moving_are_the_joints_of_the_arm_alone() -> None:
    model = RobotModel.load('panda')
    frames = LinkFrames(model, FRAME)
    assert len(frames.moving(model.home)) == model.dof == 7
    fixed = {link.child for link in frames.fixed}
    assert {'panda_link0', 'panda_hand', 'panda_leftfinger'} <= fixed
    assert frames.fixed[0].parent == FRAME


def test_a_prefix_is_before_every_link_and_not_before_the_room() -> None:
    model = RobotModel.load('ur5')
    plain, left = LinkFrames(model, FRAME), LinkFrames(model, FRAME, 'left/')
    for one, two in zip(
        [*plain.fixed, *plain.moving(model.home)],
        [*left.fixed, *left.moving(model.home)],
        strict=True,
    ):
        assert two.child == f'left/{one.child}'
        assert two.parent == (FRAME if one.parent == FRAME else f'left/{one.parent}')
        assert two[2:] == one[2:]
