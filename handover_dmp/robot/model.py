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
"""Position limit, rad, that stands for none while a description is parsed."""
SAMPLED = 30
"""Configurations in which is looked for the effort that an arm needs."""
HOME_INSET = 0.02
"""Share of its range that a joint at home keeps from either end."""


@dataclass(frozen=True)
class BasePlacement:
    """
    Where the arm stands.

    Attributes:
        position: (3,), m, of its root link in `world`.
        yaw: rad, about the vertical, after the two others.
        roll: rad, about the x of `world`, first; pi hangs the arm from a ceiling.
        pitch: rad, about the y of `world`, second; pi / 2 mounts it on a wall.

    """

    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no place."""
        angles = (self.roll, self.pitch, self.yaw)
        if len(self.position) != 3 or not np.all(np.isfinite((*self.position, *angles))):
            raise UsageError(
                f'a base stands at three finite numbers and three angles, not at {self.position} '
                f'and {angles}'
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
    An arm: one chain of joints of one degree of freedom each, and where it stands.

    Joints that do not move the wrist (fingers of a gripper) are locked. Made by `load`.

    Attributes:
        name: of the robot, as in its URDF.
        description: the URDF and where it comes from.
        joint_names: along the chain.
        limits: of those joints.
        limit_sources: `position`, `velocity`, … to where that limit of each joint comes from.
        home: (n,), rad, the posture to come back to.
        wrist_frame: the link that follows the wrist.
        base_frame: the link that the chain begins at; empty for the root.
        tool: (3,), m, the point that follows the wrist, in the frame of that link.
        base: where it stands.
        pinocchio_model: the chain, its root at `base`, so that all of its poses are in `world`.
        pinocchio_data: scratch space of Pinocchio; one model serves one thread.
        wrist_frame_id: index of the controlled frame in `pinocchio_model`.
        chain_text: what every engine reads: the URDF in plain form, the chain alone movable, the
            meshes by the paths of their files.
        meshes: those that the URDF names.
        remarks: what had to be changed or assumed that a user should know, limits first.

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
                URDF or xacro, see `read_description`, or what was read already.
            base: where its root link stands; at the origin if left out.
            wrist_frame: the link that follows the wrist; if left out or empty, the one that
                `config/robots.yaml` names, or else see `choose_wrist`.
            base_frame: the link that the chain begins at; the joints above it stand still. The
                root if left out or empty.
            tool: a point in that link's frame that follows the wrist in its stead, m.

        Returns:
            The arm.

        Raises:
            RobotDescriptionError: the URDF cannot be read, does not tell which link is the wrist,
                or has joints that cannot be moved one by one.

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
        """Say which arm it is, and where it stands."""
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
        """Say where the limits come from, for people: quantity to words."""
        return source_summary(self.limit_sources, self.joint_names)

    @property
    def dof(self) -> int:
        """Return the number of joints."""
        return len(self.joint_names)

    def slides(self, joint: int) -> bool:
        """
        Tell whether a joint slides, so that its numbers are of metres and not of radians.

        Args:
            joint: its index along the chain.

        Returns:
            Whether it is prismatic.

        """
        kind: str = self.pinocchio_model.joints[joint + 1].shortname()
        return kind.startswith('JointModelP')

    def placed(self, base: BasePlacement) -> RobotModel:
        """
        Put the arm elsewhere.

        Args:
            base: where.

        Returns:
            The same arm, standing there.

        """
        moved = RobotModel.load(
            self.description,
            base=base,
            wrist_frame=self.wrist_frame,
            base_frame=self.base_frame,
            tool=self.tool,
        )
        # that the wrist was chosen, and why, is still to be said
        return replace(moved, remarks=self.remarks)

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
        return inverse.inverse_kinematics(self, position, rotation, q0)

    @cached_property
    def shoulder(self) -> Array:
        """Return the point of the first joint's axis that is nearest to the second's, (3,), m."""
        return inverse.shoulder(self)

    @cached_property
    def reach_m(self) -> float:
        """How far from `shoulder` the wrist gets at most, m."""
        return inverse.greatest_reach(self)


def _chain_urdf(
    tree: ElementTree.Element, chain: tuple[ElementTree.Element, ...], limits: JointLimits
) -> str:
    """Write the URDF anew with the joints of the chain alone movable, each within limits."""
    hold_still(tree, chain)
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


def _with_strong_motors(
    found: EffectiveLimits, model: Any, joint_names: Sequence[str]
) -> tuple[JointLimits, str]:
    """
    Give joints of which nobody knows the effort one that can hold and accelerate the arm.

    Returns:
        The limits, and which of the efforts that are known cannot hold it; empty if all can.

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
    said = f'effort limits that cannot hold the arm, which may sag in the simulation: {told}'
    return replace(limits, effort=effort), said if weak else ''


def _home(known: Sequence[float | None], limits: JointLimits, model: Any, wrist_id: int) -> Array:
    """Take the configuration that is known, or the one of many that moves the wrist best."""
    home = np.array([np.nan if q is None else q for q in known])
    low, high = limits.one_turn
    inset = HOME_INSET * (high - low)
    # NaN, of a joint of which no home is known, is inside nothing
    if not (np.all(home >= low + inset) and np.all(home <= high - inset)):
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
