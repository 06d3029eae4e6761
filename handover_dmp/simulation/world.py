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

"""
A PyBullet world with one robot on its base, stepped by hand, with motors that follow velocities.

It renders nothing and waits for nothing. Several worlds live side by side in one process, and the
same commands give the same motion, bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from handover_dmp.common.errors import DataError
from handover_dmp.common.quiet_pybullet import pybullet, silenced
from handover_dmp.common.settings import setting
from handover_dmp.robot.model import RobotModel
from handover_dmp.simulation.partner_figure import FigureBodies, PartnerFigure
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WorldOptions:
    """
    How the world is stepped.

    Attributes:
        time_step_s: of the physics, s.
        tracking_gain: k of the motors' velocity q̇_ref + k(q_ref − q), 1/s.
        gravity: along z, m/s².

    """

    time_step_s: float = setting('robot_sim', 'time_step_s')
    tracking_gain: float = setting('robot_sim', 'tracking_gain')
    gravity: float = -9.81


class World:
    """
    The robot in PyBullet, and beside it the human figure if there is one.

    Use it as a context manager or call `close`; PyBullet keeps a world until it is told.
    """

    def __init__(
        self,
        model: RobotModel,
        *,
        figure: PartnerFigure | None = None,
        options: WorldOptions | None = None,
        use_file_inertia: bool = True,
    ) -> None:
        """
        Load the robot and put it on its base.

        Args:
            model: the robot.
            figure: the human partner; None: nobody.
            options: how the world is stepped.
            use_file_inertia: take the inertia tensors of the URDF. Without, PyBullet makes its own
                from the collision shapes and the mass matrix is off, by 2 % of its largest entry
                (LWR 4+) to 29 % (UR5); to show just that is what the switch is for.

        Raises:
            DataError: PyBullet cannot read the URDF, or finds another robot in it.

        """
        self.model = model
        self.options = options or WorldOptions()
        with silenced():
            self.client = int(pybullet.connect(pybullet.DIRECT))
        if self.client < 0:
            raise DataError('PyBullet has no room for another world: close some')
        try:
            self._fill(figure, use_file_inertia)
        except BaseException:
            self.close()
            raise
        self.reset(model.home)

    def _fill(self, figure: PartnerFigure | None, use_file_inertia: bool) -> None:
        pybullet.setTimeStep(self.options.time_step_s, physicsClientId=self.client)
        pybullet.setGravity(0, 0, self.options.gravity, physicsClientId=self.client)
        # The motors are equations that hang together, more so the nearer joints are to coaxial.
        # PyBullet's default solver, which iterates, stops up to 1e-3 rad/s beside them; this one
        # is exact, and faster.
        with silenced():
            pybullet.setPhysicsEngineParameter(
                constraintSolverType=pybullet.CONSTRAINT_SOLVER_LCP_DANTZIG,
                physicsClientId=self.client,
            )
        self.robot = load_robot(self.model, self.client, use_file_inertia=use_file_inertia)
        self.joints = joint_numbers(self.model, self.robot, self.client)
        self._forces = [float(effort) for effort in self.model.limits.effort]
        self._hold_other_joints()
        self.bodies = FigureBodies(figure, self.client) if figure is not None else None

    def _hold_other_joints(self) -> None:
        """Fingers and the like stay where they are; nothing in the world touches anything."""
        kwargs = {'physicsClientId': self.client}
        for number in range(pybullet.getNumJoints(self.robot, **kwargs)):
            kind = pybullet.getJointInfo(self.robot, number, **kwargs)[2]
            if number not in self.joints and kind != pybullet.JOINT_FIXED:
                pybullet.setJointMotorControl2(
                    self.robot,
                    number,
                    pybullet.VELOCITY_CONTROL,
                    targetVelocity=0,
                    force=1e3,
                    **kwargs,
                )
        for link in range(-1, pybullet.getNumJoints(self.robot, **kwargs)):
            pybullet.setCollisionFilterGroupMask(self.robot, link, 0, 0, **kwargs)
            pybullet.changeDynamics(
                self.robot, link, linearDamping=0, angularDamping=0, jointDamping=0, **kwargs
            )

    def reset(self, positions: Sequence[float] | Array) -> None:
        """
        Put the robot at rest in a posture.

        Args:
            positions: (n,), rad, in the model's order.

        """
        for joint, position in zip(self.joints, positions, strict=True):
            pybullet.resetJointState(
                self.robot, joint, float(position), 0.0, physicsClientId=self.client
            )

    def drive(self, velocities: Sequence[float]) -> None:
        """
        Set the velocity that the motors make from now on.

        Args:
            velocities: (n,), rad/s, in the model's order.

        """
        pybullet.setJointMotorControlArray(
            self.robot,
            self.joints,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=velocities,
            forces=self._forces,
            physicsClientId=self.client,
        )

    def step(self) -> None:
        """Let one time step pass."""
        pybullet.stepSimulation(physicsClientId=self.client)

    def read(self) -> tuple[list[float], list[float]]:
        """
        Read the joints.

        Returns:
            Positions, rad, and velocities, rad/s, (n,) each, in the model's order.

        """
        states = pybullet.getJointStates(self.robot, self.joints, physicsClientId=self.client)
        return [state[0] for state in states], [state[1] for state in states]

    def show_hand(self, hand: Array) -> None:
        """
        Move the human figure, if there is one, so that its right wrist is on a point.

        Args:
            hand: (3,), m, in `world`.

        """
        if self.bodies is not None:
            self.bodies.show(hand)

    def joint_pose(self, name: str) -> tuple[Array, Array]:
        """
        Say where PyBullet has the frame of a joint.

        Args:
            name: of the joint.

        Returns:
            Position (3,), m, and rotation (3, 3), of the link that the joint moves, in `world`.

        """
        number = self.joints[self.model.joint_names.index(name)]
        state = pybullet.getLinkState(
            self.robot, number, computeForwardKinematics=True, physicsClientId=self.client
        )
        rotation = pybullet.getMatrixFromQuaternion(state[5])
        return np.array(state[4]), np.array(rotation).reshape(3, 3)

    def mass_matrix(self, positions: Sequence[float] | Array) -> Array:
        """
        Compute the joint space mass matrix as PyBullet has it.

        Args:
            positions: (n,), rad, in the model's order.

        Returns:
            (n, n), kg m², in the model's order.

        """
        q: list[float] = []
        columns: list[tuple[int, int]] = []
        wanted = dict(zip(self.joints, positions, strict=True))
        for number in range(pybullet.getNumJoints(self.robot, physicsClientId=self.client)):
            info = pybullet.getJointInfo(self.robot, number, physicsClientId=self.client)
            if info[2] == pybullet.JOINT_FIXED:
                continue
            if number in wanted:
                columns.append((self.joints.index(number), len(q)))
                q.append(float(wanted[number]))
            else:
                state = pybullet.getJointState(self.robot, number, physicsClientId=self.client)
                q.append(state[0])
        matrix = np.array(pybullet.calculateMassMatrix(self.robot, q, physicsClientId=self.client))
        order = [column for _, column in sorted(columns)]
        return matrix[np.ix_(order, order)]

    def close(self) -> None:
        """Let PyBullet forget this world; a second call does nothing."""
        client, self.client = self.client, -1
        if client >= 0:
            pybullet.disconnect(physicsClientId=client)

    def __enter__(self) -> World:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def load_robot(
    model: RobotModel,
    client: int,
    *,
    urdf_path: Path | None = None,
    use_file_inertia: bool = True,
) -> int:
    """
    Load a robot into a world, on its base.

    Args:
        model: the robot.
        client: PyBullet's number of the world.
        urdf_path: a URDF to take in place of the model's.
        use_file_inertia: take the inertia tensors of the URDF.

    Returns:
        PyBullet's number of the robot.

    Raises:
        DataError: PyBullet cannot read the URDF.

    """
    path = urdf_path or model.urdf_path
    half_yaw = 0.5 * model.base.yaw
    try:
        with silenced():
            return int(
                pybullet.loadURDF(
                    str(path),
                    basePosition=[float(x) for x in model.base.position],
                    baseOrientation=[0.0, 0.0, float(np.sin(half_yaw)), float(np.cos(half_yaw))],
                    useFixedBase=True,
                    flags=pybullet.URDF_USE_INERTIA_FROM_FILE if use_file_inertia else 0,
                    physicsClientId=client,
                )
            )
    except pybullet.error as error:
        raise DataError(f'{path}: PyBullet cannot load it ({error})') from error


def joint_numbers(model: RobotModel, robot: int, client: int) -> list[int]:
    """
    Find the joints of a robot by name; PyBullet's order need not be the model's.

    Args:
        model: the robot.
        robot: PyBullet's number of it.
        client: PyBullet's number of the world.

    Returns:
        PyBullet's number of each joint, in the model's order.

    Raises:
        DataError: PyBullet lacks a joint, or has it as one that cannot turn.

    """
    found: dict[str, int] = {}
    for number in range(pybullet.getNumJoints(robot, physicsClientId=client)):
        info: Any = pybullet.getJointInfo(robot, number, physicsClientId=client)
        if info[2] in (pybullet.JOINT_REVOLUTE, pybullet.JOINT_PRISMATIC):
            found[info[1].decode()] = number
    missing = [name for name in model.joint_names if name not in found]
    if missing:
        raise DataError(f'{model.urdf_path}: PyBullet has no moving joint {", ".join(missing)}')
    return [found[name] for name in model.joint_names]
