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


from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.posture import Posture
from handover_dmp.robot.tasks import IkInput, WristTarget
import numpy as np
import pytest


def test_posture_goes_home_and_is_pushed_off_the_limits():
    arm = RobotModel.load('lwr4')
    fastest = 0.5 * arm.limits.velocity
    posture = Posture(arm, 1.0, 0.2)

    def velocity(q):
        target = WristTarget(np.zeros(3))
        period = IkInput(arm, q, q.tolist(), target, None, 0.005, ([], []))
        return np.array(posture.velocity(period))

    np.testing.assert_allclose(velocity(arm.home), 0.0)
    aside = arm.home + 0.1
    np.testing.assert_allclose(velocity(aside), -0.1)
    near = arm.home.copy()
    near[0] = arm.limits.upper[0] - 0.05
    wanted = -(near[0] - arm.home[0]) - 20.0 * 0.15
    assert velocity(near)[0] == pytest.approx(max(wanted, -fastest[0]))
    assert np.all(np.abs(velocity(arm.limits.lower)) <= fastest)
