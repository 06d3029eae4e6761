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

from xml.etree import ElementTree

from handover_dmp.common.resources import share_path
from handover_dmp.robot.collision import CollisionModel
from handover_dmp.robot.model import RobotModel
import numpy as np
import pytest
from scipy.integrate import quad


@pytest.fixture(scope='module')
def arm() -> RobotModel:
    return RobotModel.load('lwr4')


@pytest.fixture(scope='module')
def tree() -> ElementTree.Element:
    return ElementTree.parse(share_path('urdf/lwr4.urdf')).getroot()


def test_has_the_published_lengths(arm):
    heights = [pose.translation[2] for pose in _placements(arm, np.zeros(7))]
    shoulder, elbow, wrist = heights[1], heights[3], heights[5]
    assert shoulder == pytest.approx(0.310)
    assert elbow - shoulder == pytest.approx(0.400)
    assert wrist - elbow == pytest.approx(0.390)
    flange, _ = arm.wrist_pose(np.zeros(7))
    np.testing.assert_allclose(flange, [0.0, 0.0, 0.310 + 0.400 + 0.390 + 0.078], atol=1e-12)
    assert arm.reach_m == pytest.approx(0.868, abs=1e-6)
    np.testing.assert_allclose(arm.shoulder, [0.0, 0.0, 0.310], atol=1e-12)


def test_has_a_spherical_shoulder_and_a_spherical_wrist(arm):
    jacobian = arm.wrist_jacobian(np.zeros(7))
    np.testing.assert_allclose(
        np.abs(jacobian[3:]), [[0] * 7, [0, 1, 0, 1, 0, 1, 0], [1, 0, 1, 0, 1, 0, 1]], atol=1e-12
    )


def test_has_the_published_limits(arm):
    np.testing.assert_allclose(
        np.rad2deg(arm.limits.upper), [170, 120, 170, 120, 170, 120, 170], atol=1e-5
    )
    np.testing.assert_allclose(arm.limits.lower, -arm.limits.upper)
    np.testing.assert_allclose(
        np.rad2deg(arm.limits.velocity), [100, 110, 100, 112, 130, 180, 180], atol=1e-5
    )
    np.testing.assert_allclose(arm.limits.effort, [176, 176, 100, 100, 100, 30, 30])


def test_weighs_what_the_data_sheet_says(tree):
    masses = [float(mass.get('value')) for mass in tree.iter('mass')]
    assert sum(masses) == pytest.approx(16.0, abs=1e-9)


def test_inertias_are_those_of_the_solid_capsules(tree):
    for link in tree.findall('link'):
        if link.find('collision') is None:
            continue
        low, high, radius = _capsule(link)
        mass = float(link.find('inertial/mass').get('value'))

        def disc(z, low=low, high=high, radius=radius):
            beyond = max(low - z, 0.0, z - high)
            return np.pi * max(radius**2 - beyond**2, 0.0)

        ends = {'limit': 200, 'points': [low, high]}
        span = (low - radius, high + radius)
        volume = quad(disc, *span, **ends)[0]
        centre = quad(lambda z: z * disc(z), *span, **ends)[0] / volume
        axial = quad(lambda z: disc(z) ** 2 / (2 * np.pi), *span, **ends)[0]
        spread = quad(lambda z: disc(z) * z**2, *span, **ends)[0] - volume * centre**2
        written = link.find('inertial/inertia')
        height = float(link.find('inertial/origin').get('xyz').split()[2])
        density = mass / volume
        assert height == pytest.approx(centre, abs=1e-6)
        assert float(written.get('izz')) == pytest.approx(density * axial, rel=1e-5)
        for key in ('ixx', 'iyy'):
            assert float(written.get(key)) == pytest.approx(
                density * (axial / 2 + spread), rel=1e-5
            )


def test_does_not_touch_itself_at_home(arm):
    assert CollisionModel(arm).min_distance(arm.home) > 0.05


def _placements(arm, posture):
    arm.wrist_pose(posture)
    return list(arm.pinocchio_data.oMi)[1:]


def _capsule(link):
    heights, radius = [], None
    for part in link.findall('collision'):
        sphere = part.find('geometry/sphere')
        if sphere is not None:
            heights.append(float(part.find('origin').get('xyz').split()[2]))
            radius = float(sphere.get('radius'))
    return min(heights), max(heights), radius
