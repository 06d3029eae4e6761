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

"""Move the wrist of an arm along a circle, within all limits, without ROS."""

from __future__ import annotations

from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.priority_ik import PriorityIk
from handover_dmp.robot.tasks import WristTarget
from handover_dmp.simulation.arm import SimulatedArm
import numpy as np

PERIOD_S, RADIUS_M, TURN_S = 0.005, 0.1, 3.0


def main() -> None:
    """Print the tracking error and the share of its velocity limit that each joint used."""
    robot = RobotModel.load('lwr4')  # or iiwa14, panda, ur5, or the path of a URDF file
    centre = robot.wrist_pose(robot.home)[0] - [RADIUS_M, 0.0, 0.0]
    ik = PriorityIk(robot)
    errors, fastest, command = [], np.zeros(robot.dof), np.zeros(robot.dof)
    with SimulatedArm(robot) as arm:
        for time_s in np.arange(0.0, 2 * TURN_S, PERIOD_S):
            angle = 2 * np.pi * time_s / TURN_S
            outward = np.array([np.cos(angle), np.sin(angle), 0.0])
            along = np.array([-np.sin(angle), np.cos(angle), 0.0]) * 2 * np.pi / TURN_S
            target = WristTarget(centre + RADIUS_M * outward, RADIUS_M * along)
            command = ik.solve(arm.joint_positions, command, target, PERIOD_S).joint_velocity
            arm.command(command)
            errors.append(robot.wrist_pose(arm.joint_positions)[0] - target.position)
            fastest = np.maximum(fastest, np.abs(arm.joint_velocities))
            arm.advance(PERIOD_S)
    second_turn = np.linalg.norm(errors, axis=1)[len(errors) // 2:]  # fmt: skip
    print(f'at most {1e3 * second_turn.max():.2f} mm off in the second turn')
    print('share of the velocity limits:', np.round(fastest / robot.limits.velocity, 2))


if __name__ == '__main__':
    main()
