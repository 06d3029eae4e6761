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

"""Self-check: Pinocchio, which plans, and PyBullet, which simulates, must agree on the robot."""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.robot.model import RobotModel
from handover_dmp.simulation.world import World
import numpy as np
import pinocchio as pin

POSITION_TOLERANCE_M = 1e-6
ROTATION_TOLERANCE_RAD = 5e-6  # PyBullet reports rotations in single precision
MASS_TOLERANCE = 1e-6
POSTURES = 20


class ModelMismatchError(DataError):
    """Pinocchio and PyBullet disagree about a robot; the message says in what and by how much."""


@dataclass(frozen=True)
class ModelAgreement:
    """
    Largest differences between the two engines.

    Attributes:
        position_m: difference in the position of a joint's frame, m.
        position_joint: that joint.
        rotation_rad: difference in the rotation of a joint's frame, rad.
        rotation_joint: that joint.
        mass: difference in an entry of the mass matrix, relative to the largest entry.
        mass_joints: the joints of that entry.

    """

    position_m: float
    position_joint: str
    rotation_rad: float
    rotation_joint: str
    mass: float
    mass_joints: tuple[str, str]


def compare_models(model: RobotModel, world: World) -> ModelAgreement:
    """
    Compare kinematics and inertia of the two engines at random configurations, always the same.

    Args:
        model: the robot in Pinocchio.
        world: the robot in PyBullet; it is in its home configuration afterwards.

    Returns:
        The largest differences.

    """
    random = np.random.default_rng(0)
    low, high = model.limits.one_turn
    names = model.joint_names
    position, rotation = np.zeros(model.dof), np.zeros(model.dof)
    mass = np.zeros((model.dof, model.dof))
    for joints in random.uniform(low, high, (POSTURES, model.dof)):
        world.reset(joints)
        poses, matrix = _planned(model, joints)
        for i, (name, pose) in enumerate(zip(names, poses, strict=True)):
            there, turned = world.joint_pose(name)
            turn = pin.log3(pose.rotation.T @ turned)
            position[i] = max(position[i], float(np.linalg.norm(there - pose.translation)))
            rotation[i] = max(rotation[i], float(np.linalg.norm(turn)))
        difference = np.abs(world.mass_matrix(joints) - matrix) / np.abs(matrix).max()
        mass = np.maximum(mass, difference)
    world.reset(model.home)
    row, column = np.unravel_index(int(np.argmax(mass)), mass.shape)
    return ModelAgreement(
        position_m=float(position.max()),
        position_joint=names[int(position.argmax())],
        rotation_rad=float(rotation.max()),
        rotation_joint=names[int(rotation.argmax())],
        mass=float(mass.max()),
        mass_joints=(names[int(row)], names[int(column)]),
    )


def _planned(model: RobotModel, joints: Array) -> tuple[list[pin.SE3], Array]:
    """Return the frame of each joint and the mass matrix in Pinocchio."""
    chain, data = model.pinocchio_model, model.pinocchio_data
    upper = np.triu(pin.crba(chain, data, joints))
    pin.forwardKinematics(chain, data, joints)
    poses = [data.oMi[chain.getJointId(name)].copy() for name in model.joint_names]
    return poses, upper + np.triu(upper, 1).T


def check_models(model: RobotModel, world: World | None = None) -> ModelAgreement:
    """
    Check that the two engines agree about a robot.

    Args:
        model: the robot in Pinocchio.
        world: the robot in PyBullet; None: a world of its own, from the model's URDF.

    Returns:
        The differences, which are within rounding.

    Raises:
        ModelMismatchError: kinematics or mass matrix differ by more than rounding.
        DataError: PyBullet cannot read the URDF, or reads another robot from it.

    """
    if world is None:
        with World(model) as own:
            return check_models(model, own)
    found = compare_models(model, world)
    faults = []
    if not found.position_m <= POSITION_TOLERANCE_M:
        faults.append(f'{found.position_joint} is {1e3 * found.position_m:.4g} mm off')
    if not found.rotation_rad <= ROTATION_TOLERANCE_RAD:
        faults.append(f'{found.rotation_joint} is rotated by {found.rotation_rad:.4g} rad')
    if not found.mass <= MASS_TOLERANCE:
        first, second = found.mass_joints
        where = first if first == second else f'{first} and {second}'
        faults.append(f'the mass matrix differs by {100 * found.mass:.3g} % at {where}')
    if faults:
        raise ModelMismatchError(
            f'{model.urdf_path}: Pinocchio and PyBullet read different robots: '
            + '; '.join(faults)
        )
    return found
