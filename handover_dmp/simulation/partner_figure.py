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
The human partner as a kinematic figure, whose right hand follows that of P1.

The figure is the `human_description` of the package example-robot-data (36 joints, axes by the
convention of the International Society of Biomechanics: x forward, y up, z to the right). It is
not part of the physics: the recorded hand moves as recorded, whatever the robot does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.quiet_pybullet import pybullet, silenced
from handover_dmp.common.settings import setting
from handover_dmp.robot.descriptions import example_robot_data_folder
from handover_dmp.simulation.engine import Engine
from handover_dmp.simulation.stances import Stance, UPRIGHT
import numpy as np
import pinocchio as pin

ARM_JOINTS = (
    'right_clavicle_joint_X',
    'right_shoulder_Z',
    'right_shoulder_X',
    'right_shoulder_Y',
    'right_elbow_Z',
    'right_elbow_Y',
    'right_wrist_Z',
    'right_wrist_X',
)
# Weight of the deviation of the acting arm from its relaxed configuration.
ARM_STIFFNESS = np.array([3.0, 0.25, 0.35, 0.25, 0.25, 0.6, 0.8, 0.8])
# The same for the wrist's position, in 1/m, and for the direction of the fingers.
WRIST_WEIGHT = 1e3
FINGER_WEIGHT = 0.3
SHIFT_DIGITS = 5
"""Decimals of the displacement of parts that do not move by themselves, in m."""

Colour = tuple[float, float, float, float]
SKIN: Colour = (0.86, 0.66, 0.53, 1.0)
SHIRT: Colour = (0.23, 0.44, 0.58, 1.0)
TROUSERS: Colour = (0.25, 0.27, 0.33, 1.0)
SHOES: Colour = (0.14, 0.13, 0.13, 1.0)
CLOTHES: Mapping[str, Colour] = {
    'pelvis': TROUSERS,
    'upperleg': TROUSERS,
    'lowerleg': TROUSERS,
    'foot': SHOES,
    'abdomen': SHIRT,
    'thorax': SHIRT,
    'upperarm': SHIRT,
    'lowerarm': SKIN,
    'hand': SKIN,
    'head': SKIN,
}
# The trunk of the description is narrower than the distance of its shoulders. These factors on the
# scale of its meshes (forward, up, right) widen it.
FIT: Mapping[str, tuple[float, float, float]] = {
    'thorax': (1.0, 1.0, 1.55),
    'abdomen': (1.0, 1.0, 1.35),
    'pelvis': (1.0, 1.0, 1.15),
    'upperarm_0': (1.45, 1.45, 1.45),
}


@dataclass(frozen=True)
class PartnerFigureOptions:
    """Options for the placement of the figure."""

    hand_below_shoulder_m: float = setting(
        'robot_sim',
        'human.hand_below_shoulder_m',
        'Height of the shoulder over the hand at the exchange, if the height of the floor is not '
        'known, m',
    )
    reach_at_exchange_m: float = setting(
        'robot_sim',
        'human.reach_at_exchange_m',
        'Preferred horizontal distance from shoulder to wrist at the exchange, m',
    )
    update_rate_hz: float = setting(
        'robot_sim',
        'human.update_rate_hz',
        'Rate at which a running simulation moves the figure, Hz',
    )


@dataclass(frozen=True)
class Mesh:
    """
    One rigid piece of the figure's surface.

    Attributes:
        path: path of its file.
        scale: (3,), metres per file unit.
        position: (3,), m, in the frame of the body part.
        orientation: (4,), quaternion x, y, z, w, in the same frame.

    """

    path: str
    scale: tuple[float, ...]
    position: tuple[float, ...]
    orientation: tuple[float, ...]


@dataclass(frozen=True)
class BodyPart:
    """
    Pieces of one colour that move together.

    Attributes:
        joint: index of the arm's Pinocchio joint that carries them; 0: fixed.
        colour: red, green, blue, opacity, 0 to 1.
        meshes: the pieces.

    """

    joint: int
    colour: Colour
    meshes: tuple[Mesh, ...]


@dataclass(frozen=True)
class PartnerPosture:
    """
    Posture of the figure at one time.

    Attributes:
        joints: (8,), rad, of `ARM_JOINTS`.
        shift: (3,), m, displacement from its placement because the hand is out of reach.
        hand_position: (3,), m, position of the wrist in `world`.
        hand_rotation: (3, 3), rotation of the hand in `world`; -y points along the fingers.

    """

    joints: Array
    shift: Array
    hand_position: Array
    hand_rotation: Array


@dataclass(frozen=True)
class _Anatomy:
    """
    The figure before it is placed: arm model, surface, and lengths.

    By default, the axes point towards the partner, up, and to the right of that.
    """

    arm: Any
    parts: tuple[BodyPart, ...]
    pitched: Array  # (3, 3), to these axes from those of the pelvis
    low: Array  # (3,), lowest corner of a box around all but the acting arm, from the pelvis
    high: Array  # (3,), its highest corner
    shoulder: Array  # (3,), position of the right shoulder, from the pelvis
    reach_m: float  # shoulder to wrist, stretched
    trunk: Array  # (3,), unit vector from the pelvis to the neck
    fingers: Array  # (3,), unit vector in axes of the pelvis, their preferred direction
    ease: Array  # (8,), rad, relaxed configuration of the arm


@cache
def _description() -> tuple[Any, Any]:
    """Read the description of the figure: all of its joints, and its surface."""
    share = example_robot_data_folder()
    urdf = share / 'robots' / 'human_description' / 'robots' / 'human.urdf'
    with silenced():
        whole = pin.buildModelFromUrdf(str(urdf))
        surface = pin.buildGeomFromUrdf(
            whole, str(urdf), pin.VISUAL, package_dirs=[str(share.parent)]
        )
    return whole, surface


@cache
def _anatomy(stance: Stance) -> _Anatomy:
    whole, surface = _description()
    still = pin.neutral(whole)
    for name, angle in stance.joints.items():
        still[whole.joints[whole.getJointId(name)].idx_q] = angle
    locked = [i for i in range(1, whole.njoints) if whole.names[i] not in ARM_JOINTS]
    arm, (arm_surface,) = pin.buildReducedModel(whole, [surface], locked, still)
    data = arm.createData()
    pin.framesForwardKinematics(arm, data, np.zeros(arm.nq))
    joint = {name: data.oMi[arm.getJointId(name)].translation for name in ARM_JOINTS}
    neck = data.oMf[arm.getFrameId('middle_cervical_Z')].translation
    # a turn to the left is about the axis that points up, a forward one about the axis to the left
    pitched = pin.rpy.rpyToMatrix(0.0, stance.turn, 0.0) @ pin.rpy.rpyToMatrix(
        0.0, 0.0, -stance.pitch
    )
    corners = _still_corners(arm_surface) @ pitched.T
    return _Anatomy(
        arm=arm,
        parts=_body_parts(arm_surface),
        pitched=pitched,
        low=corners.min(axis=0),
        high=corners.max(axis=0),
        shoulder=pitched @ joint['right_shoulder_Z'],
        reach_m=float(np.linalg.norm(joint['right_wrist_Z'] - joint['right_shoulder_Z'])),
        trunk=pitched @ (neck / np.linalg.norm(neck)),
        fingers=pitched.T @ (np.array(stance.fingers) / np.linalg.norm(stance.fingers)),
        ease=np.array(stance.arm_at_ease),
    )


def _body_parts(surface: Any) -> tuple[BodyPart, ...]:
    pieces: dict[tuple[int, Colour], list[Mesh]] = {}
    for piece in surface.geometryObjects:
        colour = next(colour for word, colour in CLOTHES.items() if word in piece.name)
        fit = _fit(piece.name)
        mesh = Mesh(
            path=piece.meshPath,
            scale=tuple(np.asarray(piece.meshScale) * fit),
            position=tuple(piece.placement.translation),
            orientation=tuple(pin.Quaternion(piece.placement.rotation).coeffs()),
        )
        pieces.setdefault((piece.parentJoint, colour), []).append(mesh)
    return tuple(BodyPart(joint, colour, tuple(m)) for (joint, colour), m in pieces.items())


def _fit(piece_name: str) -> tuple[float, float, float]:
    return next((fit for word, fit in FIT.items() if word in piece_name), (1.0, 1.0, 1.0))


def _still_corners(surface: Any) -> Array:
    """Corners of the surface of all parts that the acting arm does not move, (n, 3), m."""
    return np.vstack(
        [
            piece.placement.translation
            + (piece.geometry.vertices() * _fit(piece.name)) @ piece.placement.rotation.T
            for piece in surface.geometryObjects
            if piece.parentJoint == 0
        ]
    )


class PartnerFigure:
    """
    A person who faces the partner, or works, with the right wrist at a given position.

    The placement is chosen once from the path of the wrist, so that every point of it is within
    reach and in front of the body. If a wrist position is out of reach all the same, the whole
    figure moves towards it.

    Attributes:
        options: options for the placement.
        stance: stance of the body.
        floor_height_m: z of the floor, m.
        heading: direction in which the figure faces, rad, about the vertical.
        pelvis: (3,), m, position of the pelvis in `world`.
        shoulder: (3,), m, position of the right shoulder in `world`.

    """

    def __init__(
        self,
        hand_path: Array,
        partner: Array,
        *,
        floor_height_m: float | None = None,
        stance: Stance = UPRIGHT,
        options: PartnerFigureOptions | None = None,
    ) -> None:
        """
        Place the figure.

        Args:
            hand_path: (n, 3), m, positions of the right wrist in `world`; the last one is near the
                exchange. One point is enough.
            partner: (3,), m, where the other partner stands or reaches to, in `world`.
            floor_height_m: z of the floor; None: 0 if a person could hand over from there,
                otherwise below the exchange according to `options`.
            stance: stance of the body.
            options: options for the placement.

        Raises:
            RobotDescriptionError: example-robot-data is not installed.

        """
        self.options = options or PartnerFigureOptions()
        self.stance = stance
        self._anatomy = _anatomy(stance)
        self._model = self._anatomy.arm
        self._data = self._model.createData()
        self._hand_frame = self._model.getFrameId('right_hand')
        self._lower = self._model.lowerPositionLimit.copy()
        self._upper = self._model.upperPositionLimit.copy()
        self._rows = np.vstack([np.zeros((6, self._model.nv)), np.diag(ARM_STIFFNESS)])
        self._wanted = np.zeros(len(self._rows))
        path = np.atleast_2d(np.asarray(hand_path, dtype=float))
        self.floor_height_m = (
            self._likely_floor(path[-1]) if floor_height_m is None else floor_height_m
        )
        self.heading, self.pelvis = self._place(path, np.asarray(partner, dtype=float))
        self._upright: Array = pin.rpy.rpyToMatrix(np.pi / 2, 0.0, self.heading)
        self._root = pin.SE3(self._upright @ self._anatomy.pitched, self.pelvis)
        self.shoulder = pin.SE3(self._upright, self.pelvis).act(self._anatomy.shoulder)
        self._joints = self._anatomy.ease.copy()

    @property
    def parts(self) -> tuple[BodyPart, ...]:
        """Return the surface, in pieces that move together."""
        return self._anatomy.parts

    @property
    def trunk(self) -> Array:
        """Direction from the pelvis to the neck, (3,), a unit vector in `world`."""
        return np.asarray(self._upright @ self._anatomy.trunk)

    @property
    def height_m(self) -> float:
        """Height of the figure without the acting arm, m."""
        return float(self._anatomy.high[1] - self._anatomy.low[1])

    @property
    def outline(self) -> Array:
        """Corners of a box around the figure without the acting arm, (8, 3), m, in `world`."""
        ends = np.stack([self._anatomy.low, self._anatomy.high])
        corners = np.stack(np.meshgrid(*ends.T, indexing='ij'), axis=-1).reshape(-1, 3)
        return np.asarray(self.pelvis + corners @ self._upright.T)

    def _likely_floor(self, exchange_position: Array) -> float:
        """Distinguish a room frame, with its floor at z = 0, from a frame between two chests."""
        shoulder = self._anatomy.shoulder[1] - self._anatomy.low[1]
        low, high = self.stance.hand_over_shoulder_m
        if low < exchange_position[2] - shoulder < high:
            return 0.0
        return float(exchange_position[2] + self.options.hand_below_shoulder_m - shoulder)

    def _place(self, path: Array, partner: Array) -> tuple[float, Array]:
        """
        Try placements around the natural one, and choose the best for the whole path.

        The natural placement faces the partner, with the wrist at the exchange in front of the
        shoulder, by `reach_at_exchange_m` and slightly inwards.
        """
        ahead = partner[:2] - path[-1, :2]
        if np.linalg.norm(ahead) < 1e-3:
            ahead = path[-1, :2] - path[0, :2]
        facing = float(np.arctan2(ahead[1], ahead[0])) if np.linalg.norm(ahead) > 1e-3 else 0.0
        samples = path[np.linspace(0, len(path) - 1, min(len(path), 40)).astype(int)]
        turn, forward, inward = (
            grid.ravel()
            for grid in np.meshgrid(
                np.radians(np.linspace(-40, 40, 9)),
                np.linspace(0.12, 0.54, 15),
                np.linspace(-0.12, 0.30, 15),
                indexing='ij',
            )
        )
        heading = facing + turn
        front = np.stack([np.cos(heading), np.sin(heading)], axis=1)
        right = np.stack([front[:, 1], -front[:, 0]], axis=1)
        shoulder = path[-1, :2] - forward[:, None] * front + inward[:, None] * right
        off_m = forward - self.options.reach_at_exchange_m
        from_habit = off_m**2 + (inward - 0.08) ** 2 + 0.15 * turn**2
        cost = from_habit + self._discomfort(samples, shoulder, front, right)
        best = int(np.argmin(cost))
        shoulder_forward, _, shoulder_right = self._anatomy.shoulder
        pelvis = shoulder[best] - shoulder_forward * front[best] - shoulder_right * right[best]
        height = self.floor_height_m - self._anatomy.low[1]
        return float(heading[best]), np.array([pelvis[0], pelvis[1], height])

    def _discomfort(self, path: Array, shoulder: Array, front: Array, right: Array) -> Array:
        """
        Rate placements by how awkward it is for the arm to follow a path from there.

        Args:
            path: (n, 3), m.
            shoulder: (places, 2), m, positions of the shoulder.
            front: (places, 2), unit vectors, directions in which the figure faces.
            right: (places, 2), unit vectors, to its right.

        Returns:
            (places,), mean squared distances by which the wrist is too far, too close, too far
            behind or inside the body, m².

        """
        trunk = self._anatomy.trunk
        away = path[None, :, :2] - shoulder[:, None, :]
        shoulder_height = self._anatomy.shoulder[1] - self._anatomy.low[1]
        up = path[:, 2] - (self.floor_height_m + shoulder_height)
        distance = np.sqrt((away**2).sum(axis=2) + up**2)
        ahead = np.einsum('psk,pk->ps', away, front)
        aside = np.einsum('psk,pk->ps', away, right)
        above = np.broadcast_to(up, ahead.shape)
        from_pelvis = np.stack([ahead, above, aside], axis=-1) + self._anatomy.shoulder
        along = (from_pelvis @ trunk)[..., None] * trunk
        from_spine = np.linalg.norm(from_pelvis - along, axis=2)
        reach = self._anatomy.reach_m
        excesses = (
            (400.0, distance - 0.90 * reach),
            (400.0, 0.40 * reach - distance),
            (400.0, 0.27 - from_spine),  # the trunk fills the first 0.2 m
            (100.0, -0.05 - ahead),
        )
        return np.asarray(
            sum(weight * (np.maximum(0.0, e) ** 2).mean(axis=1) for weight, e in excesses)
        )

    def posture(self, hand: Array, start: Array | None = None) -> PartnerPosture:
        """
        Put the right wrist on a point.

        Damped Gauss-Newton steps on wrist position, direction of the fingers and relaxed
        configuration of the arm; the weight of the first makes it accurate to a micrometre.

        Args:
            hand: (3,), m, position of the wrist in `world`.
            start: (8,), rad, initial joints; None: those of the last posture.

        Returns:
            The posture.

        """
        hand = np.asarray(hand, dtype=float)
        shift = self._step_after(hand)
        to_figure = self._root.rotation.T
        target = to_figure @ (hand - shift - self._root.translation)
        joints = self._joints if start is None else start
        for _ in range(60):
            change = self._improvement(joints, target)
            joints = np.minimum(np.maximum(joints + change, self._lower), self._upper)
            # The next step would move the wrist by less than a micrometre.
            if np.abs(change).max() < 1e-3:
                break
        self._joints = joints
        pin.framesForwardKinematics(self._model, self._data, joints)
        placement = self._root * self._data.oMf[self._hand_frame]
        return PartnerPosture(joints, shift, placement.translation + shift, placement.rotation)

    def _improvement(self, joints: Array, target: Array) -> Array:
        """Return the next Gauss-Newton step; the rows of the least squares are reused."""
        model, data, frame = self._model, self._data, self._hand_frame
        pin.computeJointJacobians(model, data, joints)
        placement = pin.updateFramePlacement(model, data, frame)
        jacobian = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        pointing = -placement.rotation[:, 1]
        rows, wanted = self._rows, self._wanted
        rows[:3] = WRIST_WEIGHT * jacobian[:3]
        rows[3:6] = (-FINGER_WEIGHT * pin.skew(pointing)) @ jacobian[3:]
        wanted[:3] = WRIST_WEIGHT * (target - placement.translation)
        wanted[3:6] = FINGER_WEIGHT * (self._anatomy.fingers - pointing)
        wanted[6:] = ARM_STIFFNESS * (self._anatomy.ease - joints)
        # Otherwise a joint at its bound would be assigned motion that it cannot make.
        stuck = (joints <= self._lower) | (joints >= self._upper)
        if stuck.any():
            rows[:6, stuck] = 0.0
        change: Array = np.linalg.solve(rows.T @ rows, rows.T @ wanted)
        return change * min(1.0, 0.5 / max(1e-12, float(np.abs(change).max())))

    def _step_after(self, hand: Array) -> Array:
        """Move the whole figure by the missing reach, smoothly."""
        away = hand - self.shoulder
        distance = float(np.linalg.norm(away))
        width = 0.01
        beyond = (distance - 0.96 * self._anatomy.reach_m) / width
        step = width * float(np.logaddexp(0.0, beyond))
        return np.asarray(away * (step / max(distance, 1e-9)))

    def postures(self, hand_path: Array) -> list[PartnerPosture]:
        """
        Compute the postures along a path.

        Args:
            hand_path: (n, 3), m.

        Returns:
            One posture per point.

        """
        self._joints = self._anatomy.ease.copy()
        return [self.posture(point) for point in np.asarray(hand_path, dtype=float)]

    def part_pose(self, part: BodyPart, posture: PartnerPosture) -> tuple[Array, Array]:
        """
        Return the pose of a part; the posture must be the last one computed.

        Args:
            part: one of `parts`.
            posture: last result of `posture`.

        Returns:
            Position (3,), m, and quaternion x, y, z, w, in `world`.

        """
        placement = self._root * self._data.oMi[part.joint]
        rotation = pin.Quaternion(placement.rotation).coeffs()
        return placement.translation + posture.shift, rotation


class FigureBodies:
    """A figure in a PyBullet world: massless bodies without collision shapes, set to poses."""

    def __init__(self, figure: PartnerFigure, engine: Engine) -> None:
        """
        Put the figure into a world.

        Args:
            figure: the figure.
            engine: the world.

        """
        self.figure = figure
        self._engine = engine
        with silenced():
            self._bodies = [self._body(part) for part in figure.parts]
        self._shift = np.full(3, np.nan)  # not shown yet

    def _body(self, part: BodyPart) -> int:
        shape = self._engine.createVisualShapeArray(
            shapeTypes=[pybullet.GEOM_MESH] * len(part.meshes),
            fileNames=[mesh.path for mesh in part.meshes],
            meshScales=[mesh.scale for mesh in part.meshes],
            visualFramePositions=[mesh.position for mesh in part.meshes],
            visualFrameOrientations=[mesh.orientation for mesh in part.meshes],
        )
        body = self._engine.createMultiBody(baseMass=0, baseVisualShapeIndex=shape)
        self._engine.changeVisualShape(body, -1, rgbaColor=part.colour)
        return int(body)

    def show(self, hand: Array, start: Array | None = None) -> PartnerPosture:
        """
        Move the figure so that its right wrist is on a point.

        Args:
            hand: (3,), m, in `world`.
            start: (8,), rad, initial joints of the search; None: the present ones.

        Returns:
            The new posture.

        """
        posture = self.figure.posture(hand, start)
        # Fixed parts are moved only if the figure has moved. Rounded, for what is shown may not
        # depend on what was shown before: several processes share the pictures of a film.
        fixed = replace(posture, shift=np.round(posture.shift, SHIFT_DIGITS))
        stepped = not np.array_equal(fixed.shift, self._shift)
        for part, body in zip(self.figure.parts, self._bodies, strict=True):
            if stepped or part.joint:
                pose = self.figure.part_pose(part, posture if part.joint else fixed)
                self._engine.resetBasePositionAndOrientation(body, *pose)
        self._shift = fixed.shift
        return posture
