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
A PyBullet world with one robot on its base, stepped explicitly, with velocity-controlled motors.

It does not render, and is not tied to the wall clock. Several worlds can exist in one process, and
the same commands give bitwise the same motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

from handover_dmp.common.arrays import Array
from handover_dmp.common.closing import Closing
from handover_dmp.common.errors import DataError
from handover_dmp.common.quiet_pybullet import pybullet, silenced
from handover_dmp.common.settings import setting
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.plain_description import ends_of, moved_links
from handover_dmp.simulation.engine import Engine
from handover_dmp.simulation.partner_figure import FigureBodies, PartnerFigure
import numpy as np


@dataclass(frozen=True)
class WorldOptions:
    """
    Options of the physics.

    Attributes:
        gravity: gravity along z, m/s².

    """

    time_step_s: float = setting('robot_sim', 'time_step_s', 'Time step of the physics, s')
    tracking_gain: float = setting(
        'robot_sim', 'tracking_gain', 'Gain k of the motor velocity q̇_ref + k(q_ref − q), 1/s'
    )
    gravity: float = -9.81


class World(Closing):
    """
    The robot in PyBullet, and the human figure if there is one.

    Use it as a context manager or call `close`; otherwise PyBullet keeps the world.
    """

    def __init__(
        self,
        model: RobotModel,
        *,
        figure: PartnerFigure | None = None,
        options: WorldOptions | None = None,
    ) -> None:
        """
        Load the robot and put it on its base.

        Args:
            model: the robot.
            figure: the human partner; None: no partner.
            options: options of the physics.

        Raises:
            DataError: PyBullet cannot read the URDF, or reads another robot from it.

        """
        self.model = model
        self.options = options or WorldOptions()
        self.engine = Engine()
        try:
            self._fill(figure)
        except BaseException:
            self.close()
            raise
        self.reset(model.home)

    def _fill(self, figure: PartnerFigure | None) -> None:
        engine = self.engine
        engine.setTimeStep(self.options.time_step_s)
        engine.setGravity(0, 0, self.options.gravity)
        # The equations of the motors are coupled, more so for nearly coaxial joints. PyBullet's
        # default iterative solver stops with errors of up to 1e-3 rad/s; this one is exact, and
        # faster.
        with silenced():
            engine.setPhysicsEngineParameter(
                constraintSolverType=pybullet.CONSTRAINT_SOLVER_LCP_DANTZIG
            )
        self.robot = load_robot(self.model, moving_masses(self.model), engine)
        self.joints = joint_numbers(self.model, self.robot, engine)
        self._forces = [float(effort) for effort in self.model.limits.effort]
        for link in range(-1, engine.getNumJoints(self.robot)):
            engine.changeDynamics(
                self.robot, link, linearDamping=0, angularDamping=0, jointDamping=0
            )
        self.bodies = FigureBodies(figure, engine) if figure is not None else None

    def reset(self, positions: Sequence[float] | Array) -> None:
        """
        Put the robot at rest in a configuration.

        Args:
            positions: (n,), rad, in the model's order.

        """
        for joint, position in zip(self.joints, positions, strict=True):
            self.engine.resetJointState(self.robot, joint, float(position), 0.0)

    def drive(self, velocities: Sequence[float]) -> None:
        """
        Set the velocity of the motors.

        Args:
            velocities: (n,), rad/s, in the model's order.

        """
        self.engine.setJointMotorControlArray(
            self.robot,
            self.joints,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=velocities,
            forces=self._forces,
        )

    def step(self) -> None:
        """Make one time step."""
        self.engine.stepSimulation()

    def read(self) -> tuple[list[float], list[float]]:
        """
        Read the joints.

        Returns:
            Positions, rad, and velocities, rad/s, (n,) each, in the model's order.

        """
        states = self.engine.getJointStates(self.robot, self.joints)
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
        Return the frame of a joint in PyBullet.

        Args:
            name: name of the joint.

        Returns:
            Position, (3,), m, and rotation, (3, 3), of the link that the joint moves, in `world`.

        """
        number = self.joints[self.model.joint_names.index(name)]
        state = self.engine.getLinkState(self.robot, number, computeForwardKinematics=True)
        rotation = pybullet.getMatrixFromQuaternion(state[5])
        return np.array(state[4]), np.array(rotation).reshape(3, 3)

    def mass_matrix(self, positions: Sequence[float] | Array) -> Array:
        """
        Compute the joint-space mass matrix in PyBullet.

        Args:
            positions: (n,), rad, in the model's order.

        Returns:
            (n, n), kg m², in the model's order.

        Raises:
            DataError: PyBullet cannot compute it.

        """
        order = np.argsort(self.joints)
        in_its_order = [float(positions[i]) for i in order]
        try:
            with silenced():
                found = self.engine.calculateMassMatrix(self.robot, in_its_order)
        except (pybullet.error, SystemError) as error:
            path = self.model.urdf_path
            raise DataError(f'{path}: PyBullet cannot compute the mass matrix') from error
        back = np.argsort(order)
        return np.array(found)[np.ix_(back, back)]

    def close(self) -> None:
        """Delete this world from PyBullet; a second call does nothing."""
        self.engine.close()


def moving_masses(model: RobotModel) -> str:
    """
    Reduce the description of a robot to what matters without contacts.

    That is the chain, and the links with mass that it carries. PyBullet supports up to 128 links.

    Args:
        model: the robot.

    Returns:
        Its URDF without shapes, and without links that neither move nor have mass.

    """
    robot = ElementTree.fromstring(model.chain_text)
    links = {link.get('name', ''): link for link in robot.findall('link')}
    joints = {ends_of(joint)[1]: joint for joint in robot.findall('joint')}
    kept: set[str] = set()

    def keep(name: str) -> None:
        """Keep a link and its parents."""
        while name not in kept:
            kept.add(name)
            if name in joints:
                name = ends_of(joints[name])[0]

    chain = [joint for joint in joints.values() if joint.get('name') in model.joint_names]
    for joint in chain:
        keep(ends_of(joint)[1])
    for name in moved_links(robot, chain):
        mass = links[name].find('inertial/mass')
        if mass is not None and float(mass.get('value', '0')) > 0.0:
            keep(name)
    for name, link in links.items():
        for shape in link.findall('visual') + link.findall('collision'):
            link.remove(shape)
        if name not in kept:
            robot.remove(link)
            robot.remove(joints[name])
    return ElementTree.tostring(robot, encoding='unicode')


def load_robot(model: RobotModel, description: str, engine: Engine) -> int:
    """
    Load a robot into a world, on its base.

    Args:
        model: the robot.
        description: its URDF for PyBullet.
        engine: the world.

    Returns:
        PyBullet's number of the robot.

    Raises:
        DataError: PyBullet cannot read the URDF.

    """
    robot = ElementTree.fromstring(description)
    # PyBullet splits lines of more than 8,191 characters anywhere
    ElementTree.indent(robot)
    try:
        with silenced(), TemporaryDirectory() as folder:
            file = Path(folder) / 'robot.urdf'
            file.write_text(ElementTree.tostring(robot, encoding='unicode'), encoding='utf-8')
            return int(
                engine.loadURDF(
                    str(file),
                    basePosition=[float(x) for x in model.base.position],
                    baseOrientation=model.base.quaternion,
                    useFixedBase=True,
                    # otherwise it computes inertia from the shapes
                    flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
                )
            )
    except pybullet.error as error:
        raise DataError(f'{model.urdf_path}: PyBullet cannot load it ({error})') from error


def joint_numbers(model: RobotModel, robot: int, engine: Engine) -> list[int]:
    """
    Find the joints of a robot by name; PyBullet's order may differ from the model's.

    Args:
        model: the robot.
        robot: PyBullet's number of it.
        engine: the world.

    Returns:
        PyBullet's number of each joint, in the model's order.

    Raises:
        DataError: PyBullet lacks a joint, or treats it as fixed.

    """
    found: dict[str, int] = {}
    for number in range(engine.getNumJoints(robot)):
        info = engine.getJointInfo(robot, number)
        if info[2] in (pybullet.JOINT_REVOLUTE, pybullet.JOINT_PRISMATIC):
            found[info[1].decode()] = number
    missing = [name for name in model.joint_names if name not in found]
    if missing:
        raise DataError(f'{model.urdf_path}: PyBullet has no moving joint {", ".join(missing)}')
    return [found[name] for name in model.joint_names]
