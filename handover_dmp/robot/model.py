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

"""The arm as a chain of joints from its base to its wrist, placed in the room."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from handover_dmp.common.errors import UsageError
from handover_dmp.common.quiet_pybullet import silenced
from handover_dmp.robot import descriptions
from handover_dmp.robot.errors import RobotDescriptionError
from handover_dmp.robot.limits import JointLimits
import numpy as np
from numpy.typing import NDArray
import pinocchio as pin

Array = NDArray[np.float64]

TURNS_FOR_EVER = 1e9
"""Position limit, rad, that stands for none while a description is parsed."""
NUMBERS = {'xyz': 3, 'rpy': 3, 'lower': 1, 'upper': 1, 'velocity': 1, 'effort': 1}
"""Attributes of a URDF that are numbers, and how many each holds."""


@dataclass(frozen=True)
class BasePlacement:
    """
    Where the arm stands.

    Attributes:
        position: (3,), m, of its root link in `world`.
        yaw: rad, about the vertical.

    """

    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no place."""
        if len(self.position) != 3 or not np.all(np.isfinite((*self.position, self.yaw))):
            raise UsageError(
                f'a base stands at three finite numbers and a yaw, not at {self.position} and '
                f'{self.yaw}'
            )

    @property
    def rotation(self) -> Array:
        """Return the rotation from the root link's axes to those of `world`, (3, 3)."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class RobotModel:
    """
    An arm: one chain of joints of one degree of freedom each, and where it stands.

    Joints that do not move the wrist (fingers of a gripper) are locked. Made by `load`.

    Attributes:
        name: of the robot, as in its URDF.
        urdf_path: the file.
        urdf_text: its text, unchanged.
        joint_names: along the chain.
        limits: of those joints.
        home: (n,), rad, the posture to come back to.
        wrist_frame: the link that follows the wrist.
        tool: (3,), m, the point that follows the wrist, in the frame of that link.
        base: where it stands.
        pinocchio_model: the chain, its root at `base`, so that all of its poses are in `world`.
        pinocchio_data: scratch space of Pinocchio; one model serves one thread.
        wrist_frame_id: index of the controlled frame in `pinocchio_model`.

    """

    name: str
    urdf_path: Path
    urdf_text: str
    joint_names: tuple[str, ...]
    limits: JointLimits
    home: Array
    wrist_frame: str
    tool: tuple[float, float, float]
    base: BasePlacement
    pinocchio_model: Any
    pinocchio_data: Any
    wrist_frame_id: int
    chain_text: str

    @classmethod
    def load(
        cls,
        robot: str | Path = 'lwr4',
        *,
        base: BasePlacement | None = None,
        wrist_frame: str | None = None,
        tool: tuple[float, float, float] | None = None,
    ) -> RobotModel:
        """
        Read an arm from its URDF.

        Args:
            robot: a name of `config/robots.yaml` (`lwr4`, `iiwa14`, `panda`, `ur5`), or the path
                of a URDF.
            base: where it stands; at the origin if left out.
            wrist_frame: the link that follows the wrist; if left out, the one that
                `config/robots.yaml` names, or else the only link at the end of a chain.
            tool: a point in that link's frame that follows the wrist in its stead, m.

        Returns:
            The arm.

        Raises:
            RobotDescriptionError: the URDF cannot be read, lacks the link or a limit, or has
                joints that cannot be moved one by one.

        """
        path = descriptions.urdf_file(robot)
        text, tree = _read(path)
        name = tree.get('name', path.stem)
        entry = descriptions.entry_for_urdf(name)
        wrist_frame = _wrist_link(tree, wrist_frame or entry.wrist_frame, path)
        chain = _chain(tree, wrist_frame, path)
        limits = _limits(chain, entry, path)
        chain_text = _chain_urdf(tree, chain, limits)
        placement = base or BasePlacement()
        model = _pinocchio_model(chain_text, placement, path)
        tool = tool or (0.0, 0.0, 0.0)
        wrist_id = model.getFrameId(wrist_frame, pin.FrameType.BODY)
        if any(tool):
            wrist_id = _add_tool(model, wrist_id, tool)
        return cls(
            name=name,
            urdf_path=path,
            urdf_text=text,
            joint_names=tuple(joint.get('name', '') for joint in chain),
            limits=limits,
            home=_home(entry, limits, model, wrist_id),
            wrist_frame=wrist_frame,
            tool=tool,
            base=placement,
            pinocchio_model=model,
            pinocchio_data=model.createData(),
            wrist_frame_id=wrist_id,
            chain_text=chain_text,
        )

    @property
    def dof(self) -> int:
        """Return the number of joints."""
        return len(self.joint_names)

    def placed(self, base: BasePlacement) -> RobotModel:
        """
        Put the arm elsewhere.

        Args:
            base: where.

        Returns:
            The same arm, standing there.

        """
        return RobotModel.load(
            self.urdf_path, base=base, wrist_frame=self.wrist_frame, tool=self.tool
        )

    def wrist_pose(self, joint_positions: Array) -> tuple[Array, Array]:
        """
        Compute where the wrist is.

        Args:
            joint_positions: (n,), rad.

        Returns:
            Its position, (3,), m, and rotation, (3, 3), in `world`.

        """
        model, data = self.pinocchio_model, self.pinocchio_data
        pin.forwardKinematics(model, data, np.asarray(joint_positions, dtype=float))
        pose = pin.updateFramePlacement(model, data, self.wrist_frame_id)
        return pose.translation.copy(), pose.rotation.copy()

    def wrist_jacobian(self, joint_positions: Array) -> Array:
        """
        Compute how the wrist moves with the joints.

        Args:
            joint_positions: (n,), rad.

        Returns:
            (6, n), linear velocity above angular velocity, along the axes of `world`.

        """
        jacobian: Array = pin.computeFrameJacobian(
            self.pinocchio_model,
            self.pinocchio_data,
            np.asarray(joint_positions, dtype=float),
            self.wrist_frame_id,
            pin.LOCAL_WORLD_ALIGNED,
        )
        return jacobian

    def inverse(
        self,
        position: Array,
        rotation: Array | None = None,
        q0: Array | None = None,
    ) -> Array:
        """
        Find a posture with the wrist at a pose, within the limits and not far from another one.

        Args:
            position: (3,), m, in `world`.
            rotation: (3, 3), of the wrist in `world`; any if left out.
            q0: (n,), rad, the posture to stay near to; `home` if left out.

        Returns:
            Joint positions, (n,), rad; exact to 1e-6 m and 1e-6 rad.

        Raises:
            UnreachableError: there is none.

        """
        from handover_dmp.robot.inverse import inverse_kinematics

        return inverse_kinematics(self, position, rotation, q0)

    @cached_property
    def shoulder(self) -> Array:
        """Return the point of the first joint's axis that is nearest to the second's, (3,), m."""
        from handover_dmp.robot.inverse import shoulder

        return shoulder(self)

    @cached_property
    def reach_m(self) -> float:
        """How far from `shoulder` the wrist gets at most, m."""
        from handover_dmp.robot.inverse import greatest_reach

        return greatest_reach(self)


def _read(path: Path) -> tuple[str, ElementTree.Element]:
    try:
        text = path.read_text(encoding='utf-8')
        tree = ElementTree.fromstring(text)
    except UnicodeDecodeError as error:
        raise RobotDescriptionError(f'{path}: not UTF-8: save it in that encoding') from error
    except ElementTree.ParseError as error:
        raise RobotDescriptionError(f'{path}: not XML: {error}') from error
    if tree.tag != 'robot':
        raise RobotDescriptionError(f'{path}: no <robot> element; is it a URDF?')
    _check_numbers(tree, path)
    return text, tree


def _check_numbers(tree: ElementTree.Element, path: Path) -> None:
    """Name the first number that is none; Pinocchio only says that something is wrong."""
    for element in tree.iter():
        for key, count in NUMBERS.items():
            text = element.get(key)
            if text is not None and _count_numbers(text) != count:
                wanted = 'a number' if count == 1 else f'{count} numbers'
                raise RobotDescriptionError(
                    f'{path}: {key}="{text}" of <{element.tag}> is not {wanted}; '
                    'if it is a xacro, expand it first: xacro FILE > robot.urdf'
                )


def _count_numbers(text: str) -> int:
    """Count the numbers of a text; 0 where it holds anything else."""
    try:
        return len([float(word) for word in text.split()])
    except ValueError:
        return 0


def _wrist_link(tree: ElementTree.Element, wrist_frame: str | None, path: Path) -> str:
    links = [link.get('name', '') for link in tree.findall('link')]
    if wrist_frame is not None:
        if wrist_frame not in links:
            raise RobotDescriptionError(
                f'{path}: no link {wrist_frame!r} for the wrist; it has {", ".join(links)}'
            )
        return wrist_frame
    parents = {parent for _, parent in _by_child(tree, path).values()}
    ends = [link for link in links if link not in parents]
    if len(ends) != 1:
        raise RobotDescriptionError(
            f'{path}: say which link is the wrist; the chains end in {", ".join(ends)}'
        )
    return ends[0]


def _by_child(
    tree: ElementTree.Element, path: Path
) -> dict[str | None, tuple[ElementTree.Element, str | None]]:
    """Index the joints by the link that they carry, each with the link that it hangs on."""
    by_child = {}
    for joint in tree.findall('joint'):
        child, parent = joint.find('child'), joint.find('parent')
        if child is None or parent is None:
            raise RobotDescriptionError(
                f'{path}: joint {joint.get("name")!r} lacks its parent or its child'
            )
        by_child[child.get('link')] = (joint, parent.get('link'))
    return by_child


def _chain(
    tree: ElementTree.Element, wrist_frame: str, path: Path
) -> tuple[ElementTree.Element, ...]:
    """Find the joints that move the wrist, from the base on."""
    by_child = _by_child(tree, path)
    chain: list[ElementTree.Element] = []
    link: str | None = wrist_frame
    passed = 0
    while link in by_child:
        joint, link = by_child[link]
        passed += 1
        if passed > len(by_child):
            raise RobotDescriptionError(f'{path}: the joints form a loop')
        if joint.get('type') != 'fixed':
            chain.insert(0, joint)
    for joint in chain:
        if joint.get('type') not in ('revolute', 'continuous', 'prismatic'):
            raise RobotDescriptionError(
                f'{path}: joint {joint.get("name")!r} is {joint.get("type")}; '
                'only revolute, continuous and prismatic joints can carry the wrist'
            )
        mimic = joint.find('mimic')
        if mimic is not None:
            raise RobotDescriptionError(
                f'{path}: joint {joint.get("name")!r} mimics {mimic.get("joint")!r}; '
                'the joints that carry the wrist must move one by one'
            )
    if not chain:
        raise RobotDescriptionError(f'{path}: no joint moves {wrist_frame!r}')
    return tuple(chain)


def _limits(
    chain: tuple[ElementTree.Element, ...], entry: descriptions.ArmEntry, path: Path
) -> JointLimits:
    count = len(chain)
    for key in ('velocity', 'effort', 'acceleration', 'jerk', 'home'):
        numbers = getattr(entry, key)
        if numbers is not None and len(numbers) != count:
            raise RobotDescriptionError(
                f'config/robots.yaml: {entry.name} has {len(numbers)} numbers for {key}, '
                f'the chain of {path} has {count} joints'
            )
    lower, upper = np.empty(count), np.empty(count)
    velocity, effort = np.empty(count), np.empty(count)
    for i, joint in enumerate(chain):
        name, kind = joint.get('name'), joint.get('type')
        limit = joint.find('limit')
        given = {} if limit is None else {k: float(v) for k, v in limit.items() if k in NUMBERS}
        lower[i], upper[i] = given.get('lower', 0.0), given.get('upper', 0.0)
        if kind == 'continuous':
            lower[i], upper[i] = -np.inf, np.inf
        elif not lower[i] < upper[i]:
            raise RobotDescriptionError(
                f'{path}: joint {name!r} has no position limits; '
                'give it <limit lower= upper=> or make it continuous'
            )
        velocity[i] = entry.velocity[i] if entry.velocity else given.get('velocity', 0.0)
        if not velocity[i] > 0.0:
            raise RobotDescriptionError(
                f'{path}: joint {name!r} has no velocity limit; give it <limit velocity=> or '
                'an entry in config/robots.yaml'
            )
        effort[i] = entry.effort[i] if entry.effort else given.get('effort', 0.0)
        if not effort[i] > 0.0:
            effort[i] = entry.default_effort
    acceleration = np.array(entry.acceleration or [entry.default_acceleration] * count)
    jerk = np.array(entry.jerk) if entry.jerk else acceleration / entry.default_jerk_time_s
    for array in (lower, upper, velocity, acceleration, effort, jerk):
        array.flags.writeable = False
    return JointLimits(lower, upper, velocity, acceleration, effort, jerk)


def _chain_urdf(
    tree: ElementTree.Element, chain: tuple[ElementTree.Element, ...], limits: JointLimits
) -> str:
    """Write the URDF anew with the joints of the chain alone movable, each within limits."""
    for joint in tree.findall('joint'):
        for part in ('limit', 'mimic', 'safety_controller', 'calibration', 'dynamics'):
            for element in joint.findall(part):
                joint.remove(element)
        if joint not in chain:
            joint.set('type', 'fixed')
            continue
        i = chain.index(joint)
        if joint.get('type') == 'continuous':
            joint.set('type', 'revolute')
        ElementTree.SubElement(
            joint,
            'limit',
            lower=repr(float(max(limits.lower[i], -TURNS_FOR_EVER))),
            upper=repr(float(min(limits.upper[i], TURNS_FOR_EVER))),
            velocity=repr(float(limits.velocity[i])),
            effort=repr(float(limits.effort[i])),
        )
    for element in tree.findall('transmission') + tree.findall('gazebo'):
        tree.remove(element)
    return ElementTree.tostring(tree, encoding='unicode')


def _pinocchio_model(chain_text: str, base: BasePlacement, path: Path) -> Any:
    try:
        with silenced():
            model = pin.buildModelFromXML(chain_text)
    except (ValueError, RuntimeError) as error:
        raise RobotDescriptionError(f'{path}: {error} (check_urdf tells why)') from error
    root = pin.SE3(base.rotation, np.array(base.position, dtype=float))
    for joint in range(1, model.njoints):
        if model.parents[joint] == 0:
            model.jointPlacements[joint] = root * model.jointPlacements[joint]
    for frame in model.frames:
        if frame.parentJoint == 0 and frame.name != 'universe':
            frame.placement = root * frame.placement
    return model


def _add_tool(model: Any, wrist_id: int, tool: tuple[float, float, float]) -> int:
    wrist = model.frames[wrist_id]
    placement = wrist.placement * pin.SE3(np.eye(3), np.array(tool, dtype=float))
    frame = pin.Frame('tool', wrist.parentJoint, wrist_id, placement, pin.FrameType.OP_FRAME)
    return int(model.addFrame(frame))


def _home(entry: descriptions.ArmEntry, limits: JointLimits, model: Any, wrist_id: int) -> Array:
    """Take the posture that the entry names, or the one of many that moves the wrist best."""
    if entry.home is not None:
        home = np.array(entry.home)
    else:
        low = np.maximum(limits.lower, -np.pi)
        high = np.minimum(limits.upper, np.pi)
        middle, half = (low + high) / 2.0, (high - low) / 2.0
        samples = np.random.default_rng(0).uniform(-0.6, 0.6, (300, len(low)))
        samples[0] = 0.0
        data = model.createData()

        def manipulability(q: Array) -> float:
            jacobian = pin.computeFrameJacobian(model, data, q, wrist_id, pin.LOCAL_WORLD_ALIGNED)[
                :3
            ]
            return float(np.linalg.svd(jacobian, compute_uv=False)[-1])

        configurations = middle + samples * half
        home = configurations[int(np.argmax([manipulability(q) for q in configurations]))]
    home.flags.writeable = False
    return home
