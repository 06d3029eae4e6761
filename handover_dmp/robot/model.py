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

"""The arm as a chain of joints from its base to its wrist, with its base placement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import UsageError
from handover_dmp.common.quiet_pybullet import silenced
from handover_dmp.robot import inverse
from handover_dmp.robot.chain import (
    chain_between,
    check_link,
    check_tree,
    hold_still,
    known_arm,
    parse_description,
)
from handover_dmp.robot.descriptions import default_limits, Description, read_description
from handover_dmp.robot.effective_limits import (
    DEFAULT,
    effective_limits,
    EffectiveLimits,
    source_summary,
)
from handover_dmp.robot.errors import RobotDescriptionError
from handover_dmp.robot.limits import JointLimits
from handover_dmp.robot.plain_description import (
    assume_inertia,
    immovable_joints,
    make_plain,
    Meshes,
)
from handover_dmp.robot.wrist import choose_wrist
import numpy as np
import pinocchio as pin

TURNS_FOR_EVER = 1e9
"""Position limit, rad, that stands for no limit while a description is parsed."""
SAMPLED = 30
"""Number of configurations sampled for the effort that an arm needs."""
HOME_INSET = 0.02
"""Distance of a joint at home from either limit, as a share of its range."""


@dataclass(frozen=True)
class BasePlacement:
    """
    Placement of the base.

    Attributes:
        position: (3,), m, position of the root link in `world`.
        yaw: rad, about the vertical; applied last.
        roll: rad, about the x axis of `world`; applied first; pi: hanging from a ceiling.
        pitch: rad, about the y axis of `world`; applied second; pi / 2: mounted on a wall.

    """

    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        angles = (self.roll, self.pitch, self.yaw)
        if len(self.position) != 3 or not np.all(np.isfinite((*self.position, *angles))):
            raise UsageError(
                f'a base placement needs a position of three finite numbers and three finite '
                f'angles, not {self.position} and {angles}'
            )

    @property
    def rotation(self) -> Array:
        """Return the rotation from the root link's axes to those of `world`, (3, 3)."""
        rotation: Array = pin.rpy.rpyToMatrix(self.roll, self.pitch, self.yaw)
        return rotation

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """Return the same rotation as a quaternion x, y, z, w."""
        x, y, z, w = pin.Quaternion(self.rotation).coeffs().tolist()
        return x, y, z, w


@dataclass(frozen=True, eq=False)
class RobotModel:
    """
    An arm: a chain of joints with one degree of freedom each, and its base placement.

    Joints that do not move the wrist (fingers of a gripper) are locked. Use `load` to make one.

    Attributes:
        name: name of the robot in its URDF.
        description: the URDF and its origin.
        joint_names: names along the chain.
        limits: limits of those joints.
        limit_sources: `position`, `velocity`, … to the source of that limit for each joint.
        home: (n,), rad, the configuration to which the arm returns.
        wrist_frame: the wrist link.
        base_frame: first link of the chain; empty for the root.
        tool: (3,), m, the controlled point, in the frame of the wrist link.
        base: base placement.
        pinocchio_model: the chain, its root at `base`, so that all of its poses are in `world`.
        pinocchio_data: scratch space of Pinocchio; one model serves one thread.
        wrist_frame_id: index of the controlled frame in `pinocchio_model`.
        chain_text: the URDF for all engines: in plain form, only the chain movable, meshes by
            the paths of their files.
        meshes: meshes of the URDF.
        remarks: changes and assumptions that a user should know, limits first.

    """

    name: str
    description: Description
    joint_names: tuple[str, ...]
    limits: JointLimits
    limit_sources: Mapping[str, tuple[str, ...]]
    home: Array
    wrist_frame: str
    base_frame: str
    tool: tuple[float, float, float]
    base: BasePlacement
    pinocchio_model: Any
    pinocchio_data: Any
    wrist_frame_id: int
    chain_text: str
    meshes: Meshes
    remarks: tuple[str, ...]

    @classmethod
    def load(
        cls,
        robot: str | Path | Description = 'lwr4',
        *,
        base: BasePlacement | None = None,
        wrist_frame: str | None = None,
        base_frame: str | None = None,
        tool: tuple[float, float, float] | None = None,
    ) -> RobotModel:
        """
        Read an arm from its URDF.

        Args:
            robot: a name of `config/robots.yaml` (`lwr4`, `iiwa14`, `panda`, `ur5`), the path of a
                URDF or xacro, see `read_description`, or a description.
            base: base placement; at the origin if left out.
            wrist_frame: the wrist link; by default that of `config/robots.yaml`, otherwise see
                `choose_wrist`.
            base_frame: first link of the chain; the joints above it are locked. The root if left
                out or empty.
            tool: the controlled point in the frame of the wrist link, m; its origin by default.

        Returns:
            The arm.

        Raises:
            RobotDescriptionError: the URDF cannot be read, its wrist link is ambiguous, or joints
                of the chain cannot be moved independently.

        """
        description = robot if isinstance(robot, Description) else read_description(robot)
        path, origin = description.path, str(description.path)
        tree = parse_description(description.text, origin)
        check_tree(tree, origin)
        known = known_arm(tree, origin, description.name)
        remarks = [known.remark] if known.remark else []
        if not wrist_frame and not base_frame and known.entry is not None:
            wrist_frame = known.entry.wrist_frame
        for option, link in (('wrist', wrist_frame), ('base', base_frame)):
            check_link(tree, link, option, origin)
        if not wrist_frame:
            wrist_frame, remark = choose_wrist(tree, base_frame or None, origin)
            remarks += [remark] if remark else []
        chain = chain_between(tree, wrist_frame, base_frame or None, origin)
        joint_names = tuple(joint.get('name', '') for joint in chain)
        found = effective_limits(chain, known.limits, default_limits(), origin)
        meshes, changes = make_plain(tree, path.parent, chain)
        remarks += [*found.remarks, *changes]
        chain_text = _chain_urdf(tree, chain, found.limits)
        placement = base or BasePlacement()
        model = _pinocchio_model(chain_text, placement, path)
        if immovable := immovable_joints(model, found.limits):
            carried = [chain[i - 1].find('child') for i in immovable]
            links = [link.get('link', '') for link in carried if link is not None]
            remarks.append(assume_inertia(tree, links))
            chain_text = ElementTree.tostring(tree, encoding='unicode')
            model = _pinocchio_model(chain_text, placement, path)
        tool = tool or (0.0, 0.0, 0.0)
        wrist_id = model.getFrameId(wrist_frame, pin.FrameType.BODY)
        if any(tool):
            wrist_id = _add_tool(model, wrist_id, tool)
        limits, weakness = _with_strong_motors(found, model, joint_names)
        remarks += [weakness] if weakness else []
        return cls(
            name=tree.get('name', path.stem),
            description=description,
            joint_names=joint_names,
            limits=limits,
            limit_sources=found.sources,
            home=_home([known.home.get(joint) for joint in joint_names], limits, model, wrist_id),
            wrist_frame=wrist_frame,
            base_frame=base_frame or '',
            tool=tool,
            base=placement,
            pinocchio_model=model,
            pinocchio_data=model.createData(),
            wrist_frame_id=wrist_id,
            chain_text=chain_text,
            meshes=meshes,
            remarks=tuple(remarks),
        )

    def __repr__(self) -> str:
        """Return a short description."""
        x, y, z = self.base.position
        return (
            f'RobotModel({self.name}, {self.dof} joints to {self.wrist_frame}, '
            f'base at ({x:g}, {y:g}, {z:g}) m)'
        )

    @property
    def urdf_path(self) -> Path:
        """Return the file of the description, or its topic."""
        return self.description.path

    @property
    def urdf_text(self) -> str:
        """Return the URDF, unchanged."""
        return self.description.text

    @property
    def limit_origins(self) -> dict[str, str]:
        """Describe the sources of the limits: quantity to words."""
        return source_summary(self.limit_sources, self.joint_names)

    @property
    def dof(self) -> int:
        """Return the number of joints."""
        return len(self.joint_names)

    def slides(self, joint: int) -> bool:
        """
        Return whether a joint is prismatic, with metres instead of radians.

        Args:
            joint: its index along the chain.

        Returns:
            Whether it is prismatic.

        """
        kind: str = self.pinocchio_model.joints[joint + 1].shortname()
        return kind.startswith('JointModelP')

    def placed(self, base: BasePlacement) -> RobotModel:
        """
        Return the arm with another base placement.

        Args:
            base: the placement.

        Returns:
            The same arm at that placement.

        """
        moved = RobotModel.load(
            self.description,
            base=base,
            wrist_frame=self.wrist_frame,
            base_frame=self.base_frame,
            tool=self.tool,
        )
        # keep the remark on the choice of the wrist link
        return replace(moved, remarks=self.remarks)

    def wrist_pose(self, joint_positions: Array) -> tuple[Array, Array]:
        """
        Compute the pose of the wrist.

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
        Compute the Jacobian of the wrist.

        Args:
            joint_positions: (n,), rad.

        Returns:
            (6, n), linear velocity above angular velocity, in the axes of `world`.

        """
        model, data = self.pinocchio_model, self.pinocchio_data
        q = np.asarray(joint_positions, dtype=float)
        jacobian: Array = pin.computeFrameJacobian(
            model, data, q, self.wrist_frame_id, pin.LOCAL_WORLD_ALIGNED
        )
        return jacobian

    def inverse(
        self,
        position: Array,
        rotation: Array | None = None,
        q0: Array | None = None,
    ) -> Array:
        """
        Solve the inverse kinematics for a pose, within the limits and close to a configuration.

        Args:
            position: (3,), m, in `world`.
            rotation: (3, 3), rotation of the wrist in `world`; any if left out.
            q0: (n,), rad, the configuration to stay close to; `home` if left out.

        Returns:
            Joint positions, (n,), rad; exact to 1e-6 m and 1e-6 rad.

        Raises:
            UnreachableError: there is no solution.

        """
        return inverse.inverse_kinematics(self, position, rotation, q0)

    @cached_property
    def shoulder(self) -> Array:
        """Return the point on the first joint's axis nearest to the second axis, (3,), m."""
        return inverse.shoulder(self)

    @cached_property
    def reach_m(self) -> float:
        """Maximum distance of the wrist from `shoulder`, m."""
        return inverse.greatest_reach(self)


def _chain_urdf(
    tree: ElementTree.Element, chain: tuple[ElementTree.Element, ...], limits: JointLimits
) -> str:
    """Rewrite the URDF with only the joints of the chain movable, each within limits."""
    hold_still(tree, chain)
    for joint in tree.findall('joint'):
        for part in ('limit', 'mimic', 'safety_controller', 'calibration', 'dynamics'):
            for element in joint.findall(part):
                joint.remove(element)
        if joint not in chain:
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
    return ElementTree.tostring(tree, encoding='unicode')


def _pinocchio_model(chain_text: str, base: BasePlacement, path: Path) -> Any:
    try:
        with silenced():
            model = pin.buildModelFromXML(chain_text)
    except (ValueError, RuntimeError) as error:
        raise RobotDescriptionError(f'{path}: {error} (run check_urdf for details)') from error
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


def _with_strong_motors(
    found: EffectiveLimits, model: Any, joint_names: Sequence[str]
) -> tuple[JointLimits, str]:
    """
    Set unknown effort limits to values that can hold and accelerate the arm.

    Returns:
        The limits, and a remark on known efforts that cannot hold the arm; empty if all can.

    """
    limits = found.limits
    unknown = np.array([source == DEFAULT for source in found.sources['effort']])
    low, high = limits.one_turn
    data, needed, held = model.createData(), limits.effort.copy(), np.zeros(model.nv)
    for q in np.random.default_rng(0).uniform(low, high, (SAMPLED, model.nq)):
        upper = np.triu(pin.crba(model, data, q))
        inertia = np.abs(upper + np.triu(upper, 1).T)
        hold = np.abs(pin.computeGeneralizedGravity(model, data, q))
        needed = np.maximum(needed, hold + inertia @ limits.acceleration)
        held = np.maximum(held, hold)
    effort = np.where(unknown, needed, limits.effort)
    effort.flags.writeable = False
    weak = np.flatnonzero(held > effort).tolist()
    told = ', '.join(f'{joint_names[i]} {effort[i]:.3g} of {held[i]:.3g} Nm' for i in weak)
    said = f'effort limits too low to hold the arm, which may sag in the simulation: {told}'
    return replace(limits, effort=effort), said if weak else ''


def _home(known: Sequence[float | None], limits: JointLimits, model: Any, wrist_id: int) -> Array:
    """Return the known configuration, or the sampled one in which the wrist moves best."""
    home = np.array([np.nan if q is None else q for q in known])
    low, high = limits.one_turn
    inset = HOME_INSET * (high - low)
    # NaN marks an unknown home, and is never within the limits
    if not (np.all(home >= low + inset) and np.all(home <= high - inset)):
        middle, half = (low + high) / 2.0, (high - low) / 2.0
        samples = np.random.default_rng(0).uniform(-0.6, 0.6, (300, len(low)))
        samples[0] = 0.0
        data = model.createData()

        def manipulability(q: Array) -> float:
            jacobian = pin.computeFrameJacobian(model, data, q, wrist_id, pin.LOCAL_WORLD_ALIGNED)
            return float(np.linalg.svd(jacobian[:3], compute_uv=False)[-1])

        configurations = middle + samples * half
        home = configurations[int(np.argmax([manipulability(q) for q in configurations]))]
    home.flags.writeable = False
    return home
