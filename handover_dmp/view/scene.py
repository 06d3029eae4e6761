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
Pictures of a recorded handover: robot, human figure, object and trails, without a display.

PyBullet's software renderer draws the bodies with several samples per pixel. Floor, soft shadow
and background are flat and the camera is fixed, so they are computed separately and put behind.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import itertools
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.closing import Closing
from handover_dmp.common.errors import DataError
from handover_dmp.common.quiet_pybullet import pybullet, silenced
from handover_dmp.common.settings import setting
from handover_dmp.robot.model import RobotModel
from handover_dmp.simulation.carried_object import TABLE_SIDE_M
from handover_dmp.simulation.engine import Engine
from handover_dmp.simulation.partner_figure import FigureBodies, PartnerFigure
from handover_dmp.simulation.stances import LYING, Stance, UPRIGHT
from handover_dmp.simulation.world import joint_numbers, load_robot
from handover_dmp.view.camera_image import camera_image
from handover_dmp.view.carried_look import look_of
from handover_dmp.view.drawn_robot import drawn_description
from handover_dmp.view.piece import Colour, Piece
from handover_dmp.view.primitives import refine, write_unit_meshes
from handover_dmp.view.surroundings import Surroundings
import numpy as np
from numpy.typing import NDArray
import pinocchio as pin
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial.transform import Rotation

Image = NDArray[np.uint8]

HAND_COLOUR: Colour = (1.00, 0.16, 0.18)
WRIST_COLOUR: Colour = (0.12, 0.48, 1.00)
PEDESTAL_COLOUR: Colour = (0.30, 0.31, 0.33)
FLOOR_COLOUR = np.array([0.87, 0.88, 0.89])
SKY_TOP = np.array([0.80, 0.86, 0.92])
SKY_HORIZON = np.array([0.97, 0.98, 0.99])

FIELD_OF_VIEW_DEG = 32.0
ASIDE_DEG = 78.0
"""Angle from the line between the two to the camera, deg; the acting arms are on the near side."""
VIEWS = {LYING: (52.0, 28.0)}
"""The same angle and the elevation, deg, for stances with a better point of view."""
PAST_THE_ROBOT_M, FURTHEST_DEG = 0.30, 45
"""Distance of a visible table from the base, m; largest turn of the camera for it, deg."""
GRID_M = 0.5
PEDESTAL_RADIUS_M = 0.22
TABLE_COLOUR: Colour = (0.62, 0.50, 0.38)
TABLE_TOP_M, TABLE_LEG_M = 0.025, 0.06
"""Thickness of the table top and of its leg, m."""
GRIP_S = 0.3
"""Time in which the gripper pulls the object to its pose in the grip, s."""
PALM_M = 0.09  # from the wrist along the fingers
TRAIL_RADIUS_M = 0.008
ORIGIN, OUT_OF_SIGHT = (0.0, 0.0, 0.0), (0.0, 0.0, -1000.0)
UNTURNED = (0.0, 0.0, 0.0, 1.0)
UPWARDS = np.array([0.0, 0.0, 1.0])
SHADOW_PIXELS = 256
SHADOW_M, WIDE_SHADOW_M = 1.6, 2.6
"""Half the side of the square with shadows, m, without and with surroundings."""
SHADOW_BLUR_M = 0.035


@dataclass(frozen=True)
class SceneOptions:
    """Options of the pictures."""

    samples: int = setting(
        'robot_sim', 'scene.samples', 'Samples of a pixel, in width and in height'
    )
    elevation_deg: float = setting(
        'robot_sim', 'scene.elevation_deg', 'Elevation of the camera over the horizon, deg'
    )
    object_length_m: tuple[float, float] = setting(
        'robot_sim',
        'scene.object_length_m',
        'Shortest and longest length of the rod that changes hands, m; between them it spans the '
        'gap between the partners at the exchange',
    )
    object_radius_m: float = setting('robot_sim', 'scene.object_radius_m', 'Radius of the rod, m')


@dataclass(frozen=True)
class Camera:
    """
    An upright camera that looks at a point.

    Attributes:
        eye: (3,), m, in `world`.
        target: (3,), m, the point in the middle of the picture.
        width: width of the picture, pixels.
        height: height of the picture, pixels.

    """

    eye: Array
    target: Array
    width: int
    height: int

    @property
    def view(self) -> list[float]:
        """View matrix for PyBullet: 16 numbers, column by column."""
        return list(pybullet.computeViewMatrix(list(self.eye), list(self.target), [0, 0, 1]))

    @property
    def projection(self) -> list[float]:
        """Projection matrix for PyBullet: 16 numbers, column by column."""
        return list(
            pybullet.computeProjectionMatrixFOV(
                FIELD_OF_VIEW_DEG, self.width / self.height, 0.1, 30.0
            )
        )

    def project(self, points: Array) -> Array:
        """
        Project points into the picture.

        Args:
            points: (n, 3), m, in `world`.

        Returns:
            (n, 2), -1 to 1 from left to right and from bottom to top; infinite behind the camera.

        """
        view = np.array(self.view).reshape(4, 4).T
        projection = np.array(self.projection).reshape(4, 4).T
        homogeneous = np.column_stack([points, np.ones(len(points))]) @ (projection @ view).T
        depth = homogeneous[:, 3:]
        return np.where(depth > 0.1, homogeneous[:, :2] / np.maximum(depth, 0.1), np.inf)

    def rays(self) -> Array:
        """
        Return the viewing direction of each pixel.

        Returns:
            (height, width, 3), directions in `world`, not normalised, first row on top.

        """
        ahead = self.target - self.eye
        ahead = ahead / np.linalg.norm(ahead)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        up = np.cross(right, ahead)
        half = np.tan(np.radians(FIELD_OF_VIEW_DEG) / 2)
        rows = half * (1.0 - 2.0 * (np.arange(self.height) + 0.5) / self.height)
        wide = half * (self.width / self.height)
        columns = wide * (2.0 * (np.arange(self.width) + 0.5) / self.width - 1.0)
        return np.asarray(ahead + columns[:, None] * right + rows[:, None, None] * up)


class Scene(Closing):
    """
    The scene of a recorded handover, with a camera that sees all of it.

    Use it as a context manager or call `close`; otherwise PyBullet keeps the world.

    Attributes:
        hand_path: (n, 3), m, of the partner's wrist at `times`.
        wrist_path: (n, 3), m, of the robot's wrist at the same times.

    """

    def __init__(
        self,
        model: RobotModel,
        times: Array,
        joint_positions: Array,
        hand_path: Array,
        *,
        direction: str = 'give',
        exchange_time_s: float | None = None,
        back_time_s: float | None = None,
        pick_up_time_s: float | None = None,
        floor_height_m: float | None = None,
        stance: Stance = UPRIGHT,
        surroundings: Surroundings | None = None,
        carried: object = None,
        options: SceneOptions | None = None,
    ) -> None:
        """
        Set the scene up.

        Args:
            model: the robot, on its base.
            times: (n,), s, increasing.
            joint_positions: (n, dof), rad, of the robot.
            hand_path: (n, 3), m, of the partner's wrist, in `world`.
            direction: `give` (the robot has the object first) or `take` (the partner has it).
            exchange_time_s: time at which the object changes hands, s; None: never.
            back_time_s: time at which it changes hands again, in a session, s; None: never.
            pick_up_time_s: time at which the robot picks it up from a table, s; None: the robot
                has it from the start.
            floor_height_m: z of the floor, m; None: chosen to fit the human figure.
            stance: posture of the person.
            surroundings: objects around the person; None: none.
            carried: description of the object, see `look_of`; default: a rod.
            options: options of the pictures.

        Raises:
            DataError: the arrays do not fit together or are not finite, PyBullet cannot read the
                robot, or the human figure is not installed.

        """
        for name, array in (('times', times), ('joints', joint_positions), ('hand', hand_path)):
            if len(array) != len(times) or not np.all(np.isfinite(array)):
                raise DataError(f'no scene of it: {name}: not {len(times)} rows of finite numbers')
        self.options = options or SceneOptions()
        self._look = look_of(carried, self.options.object_radius_m)
        self.model = model
        self.times = np.asarray(times, dtype=float)
        self.exchange_time_s = np.inf if exchange_time_s is None else exchange_time_s
        self.back_time_s = np.inf if back_time_s is None else back_time_s
        self.pick_up_time_s = -np.inf if pick_up_time_s is None else pick_up_time_s
        self._robot_gives = direction == 'give'
        self._joints = np.asarray(joint_positions, dtype=float)
        self.hand_path = np.asarray(hand_path, dtype=float)
        self.wrist_path = np.array([model.wrist_pose(q)[0] for q in self._joints])
        last_s = self.exchange_time_s if back_time_s is None else back_time_s
        met = int(np.searchsorted(self.times, last_s).clip(0, len(self.times) - 1))
        place = self.hand_path[: met + 1], self.wrist_path[met]
        self.figure = PartnerFigure(*place, floor_height_m=floor_height_m, stance=stance)
        if floor_height_m is None and model.base.position[2] < self.figure.floor_height_m:
            # an arm beside a lying person stands on the floor, too
            floor_height_m = float(model.base.position[2])
            self.figure = PartnerFigure(*place, floor_height_m=floor_height_m, stance=stance)
        self.floor_height_m = self.figure.floor_height_m
        # Pictures must not depend on previous ones, so the figure's arm starts from these angles.
        self._arm = np.array([p.joints for p in self.figure.postures(self.hand_path)])
        self._surroundings = surroundings
        self._pieces: list[int] = []
        self._engine = Engine()
        self._bodies = FigureBodies(self.figure, self._engine)
        with TemporaryDirectory() as folder:
            sphere, self._cylinder = write_unit_meshes(Path(folder))
            fine = refine(drawn_description(model), sphere, self._cylinder)
            self._robot = load_robot(model, fine, self._engine)
            self._furnish()
        self._numbers = joint_numbers(model, self._robot, self._engine)
        self._trails = self._lay_trails()
        self._backdrops: dict[tuple[int, int], _Backdrop] = {}

    def _furnish(self) -> None:
        """Create pedestal and surroundings, the object at a preliminary pose, and its table."""
        for piece, place in self.pedestal:
            self._put(self._solid(piece), place)
        for piece, position, orientation in self.around:
            body = self._solid(piece)
            self._put(body, position, orientation)
            self._pieces.append(body)
        self._plan_grasp()
        self._lay_on_table()

    @property
    def pedestal(self) -> list[tuple[Piece, Array]]:
        """Return the pedestal: cylinders, and their positions, (3,), m."""
        x, y, z = self.model.base.position
        rise = z - self.floor_height_m
        if rise <= 0.02:
            return []
        foot, column = (PEDESTAL_RADIUS_M, 0.0, 0.02), (0.10, 0.02, rise - 0.02)
        pieces = []
        for radius, low, high in (foot, column, (0.16, rise - 0.02, rise)):
            piece = Piece(ORIGIN, (2 * radius, 2 * radius, high - low), PEDESTAL_COLOUR, True)
            pieces.append((piece, np.array([x, y, self.floor_height_m + (low + high) / 2])))
        return pieces

    @property
    def around(self) -> list[tuple[Piece, Array, Array]]:
        """Return the surroundings: pieces, positions (3,), m, and quaternions x, y, z, w."""
        if self._surroundings is None:
            return []
        turn = Rotation.from_euler('z', self.figure.heading + self._surroundings.turn)
        below = np.array([*self.figure.shoulder[:2], self.floor_height_m])
        flat = Rotation.from_euler('x', np.pi / 2)
        return [
            (
                piece,
                below + turn.apply(piece.middle),
                (turn * flat if piece.is_round else turn).as_quat(),
            )
            for piece in self._surroundings.pieces
        ]

    def _solid(self, piece: Piece) -> int:
        """Create the body of a piece in the origin."""
        x, y, z = piece.size
        if piece.is_round:
            file, scale = str(self._cylinder), [x / 2, y / 2, z]
            return self._body(pybullet.GEOM_MESH, piece.colour, fileName=file, meshScale=scale)
        return self._body(pybullet.GEOM_BOX, piece.colour, halfExtents=[x / 2, y / 2, z / 2])

    def _body(self, kind: int, colour: Colour, **shape: Any) -> int:
        """Create a body in the origin, of one shape of PyBullet."""
        with silenced():
            number = self._engine.createVisualShape(kind, rgbaColor=(*colour, 1.0), **shape)
        return int(self._engine.createMultiBody(baseVisualShapeIndex=number))

    def _put(
        self,
        body: int,
        position: Sequence[float] | Array,
        orientation: Sequence[float] | Array = UNTURNED,
    ) -> None:
        self._engine.resetBasePositionAndOrientation(body, position, orientation)

    def _plan_grasp(self) -> None:
        """
        Make the object, and compute its grasps.

        At the exchange it lies between the robot's flange and the palm of the hand, held by both.
        Before, it moves with the giver; after, with the receiver. Without an exchange the giver
        points it at the other one at the end. If it goes back later, its holder turns it in the
        meantime, so that it lies between the two again.
        """
        gap = self._between(self.exchange_time_s)[2]
        self.object_length_m = self._look.length_m or float(
            np.clip(gap, *self.options.object_length_m)
        )
        self._grasp = self._grasp_at(self.exchange_time_s, self._robot_gives)
        self._grasp_back = self._grasp
        if np.isfinite(self.back_time_s):
            self._grasp_back = self._grasp_at(self.back_time_s, not self._robot_gives)
        self.object_parts = self._look.parts_of(self.object_length_m)
        self._object = [self._solid(part) for part in self.object_parts]

    def _lay_on_table(self) -> None:
        """Lay the object on a table, at the flange's position at the pick-up."""
        self.table: tuple[tuple[Piece, Array], ...] = ()
        if not np.isfinite(self.pick_up_time_s):
            return
        held = self._flange_pose(self.pick_up_time_s) @ self._grasp.by_robot
        axis = np.append(held.rotation[:2, 2], 0.0)
        if self._look.stands or not axis.any():
            axis = UPWARDS
        self._lying = _Pose(held.position, _turn(held.rotation[:, 2], axis) @ held.rotation)
        depths = [
            self._lying.rotation[2] @ part.middle
            - 0.5 * np.abs(self._lying.rotation[2]) @ part.size
            for part in self.object_parts
        ]
        top = float(held.position[2] + min(depths)) - self.floor_height_m
        for size, height in (
            ((TABLE_SIDE_M, TABLE_SIDE_M, TABLE_TOP_M), top - 0.5 * TABLE_TOP_M),
            ((TABLE_LEG_M, TABLE_LEG_M, top - TABLE_TOP_M), 0.5 * (top - TABLE_TOP_M)),
        ):
            place = np.array([*held.position[:2], self.floor_height_m + height])
            piece = Piece(ORIGIN, size, TABLE_COLOUR)
            self.table += ((piece, place),)
            body = self._solid(piece)
            self._put(body, place)
            self._pieces.append(body)

    def _between(self, time_s: float) -> tuple[_Pose, _Pose, float, Array]:
        """Return flange and hand at a time, and gap and direction from flange to palm."""
        hand, flange = self._hand_pose(time_s), self._flange_pose(time_s)
        palm = hand @ _Pose(np.array([0.0, -PALM_M, 0.0]), np.eye(3))
        between = palm.position - flange.position
        gap = float(np.linalg.norm(between))
        return flange, hand, gap, between / gap if gap > 1e-6 else flange.rotation[:, 2]

    def _grasp_at(self, time_s: float, robot_gives: bool) -> _Grasp:
        """Place the object between the two, in the giver's grasp."""
        flange, hand, gap, along = self._between(time_s)
        half = 0.5 * self.object_length_m
        middle = flange.position + along * (half if robot_gives else gap - half)
        # its z axis, with the handle, towards the receiver
        taken = along if robot_gives or self._look.length_m is None else -along
        turn = _turn(UPWARDS, taken)
        if self._look.stands:
            away = flange.position - self.model.base.position
            turn = Rotation.from_euler('z', np.arctan2(away[1], away[0])).as_matrix()
            deep = turn @ [0.5 * self._look.depth_m, 0.0, 0.0]
            middle = flange.position + (deep if self._look.depth_m else 0.5 * gap * along)
        met_at = _Pose(middle, turn)
        return _Grasp(flange.inverse() @ met_at, hand.inverse() @ met_at)

    def joint_positions(self, time_s: float) -> Array:
        """
        Return the robot's joint positions.

        Args:
            time_s: time, s; before the start and after the end the robot is at rest.

        Returns:
            (dof,), rad.

        """
        return _at(time_s, self.times, self._joints)

    def _hand_pose(self, time_s: float) -> _Pose:
        hand = _at(time_s, self.times, self.hand_path)
        posture = self.figure.posture(hand, _at(time_s, self.times, self._arm))
        return _Pose(posture.hand_position, posture.hand_rotation)

    def _flange_pose(self, time_s: float) -> _Pose:
        return _Pose(*self.model.wrist_pose(self.joint_positions(time_s)))

    def show(self, time_s: float) -> None:
        """
        Move everything to its pose at a time.

        Args:
            time_s: time, s.

        """
        joints = self.joint_positions(time_s)
        for number, position in zip(self._numbers, joints, strict=True):
            self._engine.resetJointState(self._robot, number, float(position))
        posture = self._bodies.show(
            _at(time_s, self.times, self.hand_path), _at(time_s, self.times, self._arm)
        )
        hand = _Pose(posture.hand_position, posture.hand_rotation)
        pose = self._object_at(time_s, self._flange_pose(time_s), hand)
        turn = Rotation.from_matrix(pose.rotation).as_quat()
        for body, part in zip(self._object, self.object_parts, strict=True):
            self._put(body, pose.position + pose.rotation @ np.array(part.middle), turn)
        for body, until_s in self._trails:
            self._put(body, ORIGIN if until_s <= time_s else OUT_OF_SIGHT)

    def _object_at(self, time_s: float, flange: _Pose, hand: _Pose) -> _Pose:
        """Place the object in the grasp of its holder."""
        gripped_s = time_s - self.pick_up_time_s
        if gripped_s < GRIP_S:
            share = _smooth_step(max(gripped_s, 0.0) / GRIP_S)
            return self._lying.towards(flange @ self._grasp.by_robot, share)
        passed = int(time_s >= self.exchange_time_s) + int(time_s >= self.back_time_s)
        grasp = (self._grasp, self._grasp, self._grasp_back)[passed]
        if passed == 1 and np.isfinite(self.back_time_s):
            share = (time_s - self.exchange_time_s) / (self.back_time_s - self.exchange_time_s)
            grasp = self._grasp.towards(self._grasp_back, _smooth_step(share))
        by_robot = self._robot_gives if passed != 1 else not self._robot_gives
        return flange @ grasp.by_robot if by_robot else hand @ grasp.by_hand

    @property
    def object_pose(self) -> tuple[Array, Array]:
        """Shown pose of the object: position, (3,), m, and quaternion x, y, z, w."""
        position, orientation = self._engine.getBasePositionAndOrientation(self._object[0])
        return np.array(position), np.array(orientation)

    def _lay_trails(self) -> list[tuple[int, float]]:
        """
        Make both trails at full length, in short pieces, out of sight.

        Pieces are moved into sight when they are passed. New trails for each picture would be
        simpler, but PyBullet's renderer never frees a mesh.

        Returns:
            The body of each piece, and the time at which it is passed, s.

        """
        pieces = []
        for path, colour in ((self.hand_path, HAND_COLOUR), (self.wrist_path, WRIST_COLOUR)):
            corners = _spaced(path, TRAIL_RADIUS_M)
            for first in range(0, len(corners) - 1, 2):
                piece = corners[first: first + 3]  # fmt: skip
                surface = tube(path[piece], TRAIL_RADIUS_M)
                if surface is None:
                    continue
                vertices, normals, indices = (part.tolist() for part in surface)
                body = self._body(
                    pybullet.GEOM_MESH,
                    colour,
                    vertices=vertices,
                    normals=normals,
                    indices=indices,
                )
                self._put(body, OUT_OF_SIGHT)
                pieces.append((body, float(self.times[piece[-1]])))
        return pieces

    def camera(self, width: int, height: int) -> Camera:
        """
        Find a camera that always sees all of the robot and of the person.

        It is on the side of the acting arms, at right angles to the line between the two, and as
        near as possible.

        Args:
            width: width of the picture, pixels.
            height: height of the picture, pixels.

        Returns:
            The camera.

        """
        points = self._extent()
        aside_deg, elevation_deg = VIEWS.get(
            self.figure.stance, (ASIDE_DEG, self.options.elevation_deg)
        )
        # the pelvis of a lying or bent person is beside the line between the two
        facing = self.figure.heading
        if self.figure.stance is UPRIGHT:
            between = self.wrist_path[-1] - self.figure.pelvis
            facing = float(np.arctan2(between[1], between[0]))
        azimuth = facing - np.radians(aside_deg + self._past_the_robot(facing, aside_deg))
        elevation = np.radians(elevation_deg)
        level = np.cos(elevation)
        back = np.array([np.cos(azimuth) * level, np.sin(azimuth) * level, np.sin(elevation)])
        target = (points.min(axis=0) + points.max(axis=0)) / 2
        near, far = 0.5, 25.0
        for _ in range(30):
            distance = (near + far) / 2
            camera = Camera(target + distance * back, target, width, height)
            # Centre the scene before checking that all of it is visible.
            seen = camera.project(points)
            if np.all(np.isfinite(seen)) and np.all(np.ptp(seen, axis=0) < 2 * 0.90):
                far = distance
            else:
                near = distance
        for _ in range(5):
            camera = Camera(target + far * back, target, width, height)
            seen = camera.project(points)
            off = (seen.min(axis=0) + seen.max(axis=0)) / 2
            half = far * np.tan(np.radians(FIELD_OF_VIEW_DEG) / 2)
            right = np.cross(-back, [0.0, 0.0, 1.0])
            right /= np.linalg.norm(right)
            up = np.cross(right, -back)
            target = target + half * (off[0] * width / height * right + off[1] * up)
        return Camera(target + far * back, target, width, height)

    def _past_the_robot(self, facing: float, aside_deg: float) -> float:
        """Return the additional angle at which a camera sees the table past the robot, deg."""
        if not self.table:
            return 0.0
        away = self.table[0][1][:2] - np.array(self.model.base.position[:2])

        def aside_m(further_deg: float) -> float:
            azimuth = facing - np.radians(aside_deg + further_deg)
            return float(abs(away @ [-np.sin(azimuth), np.cos(azimuth)]))

        further = sorted(range(-FURTHEST_DEG, FURTHEST_DEG + 1, 5), key=abs)
        clear = [deg for deg in further if aside_m(deg) >= PAST_THE_ROBOT_M]
        return float(clear[0] if clear else max(further, key=aside_m))

    def _extent(self) -> Array:
        """Return points around everything that is ever visible, (n, 3)."""
        clouds = [self.hand_path, self.wrist_path]
        for index in np.linspace(0, len(self.times) - 1, 12).astype(int):
            self.show(float(self.times[index]))
            for number in range(-1, self._engine.getNumJoints(self._robot)):
                clouds.append(np.array(self._engine.getAABB(self._robot, number)))
        corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
        clouds += [place + corners * piece.size for piece, place in self.table]
        clouds += [
            place + Rotation.from_quat(turn).apply(corners * piece.size)
            for piece, place, turn in self.around
        ]
        person, base, floor = self.figure.pelvis, self.model.base.position, self.floor_height_m
        clouds.append(_ring(base, PEDESTAL_RADIUS_M, floor))
        if self.figure.stance is UPRIGHT:
            clouds.append(_ring(person, 0.28, floor))
            clouds.append(_ring(person, 0.15, floor + self.figure.height_m))
        else:
            clouds.append(self.figure.outline)
        return np.vstack(clouds)

    def image(self, time_s: float, width: int = 1280, height: int = 720) -> Image:
        """
        Draw the scene.

        Args:
            time_s: time, s.
            width: width of the picture, pixels.
            height: height of the picture, pixels.

        Returns:
            (height, width, 3), red, green and blue.

        """
        backdrop = self._backdrops.get((width, height))
        if backdrop is None:
            half_m = WIDE_SHADOW_M if self._pieces else SHADOW_M
            camera = self.camera(width, height)
            backdrop = _Backdrop(camera, self._centre(), self.floor_height_m, half_m)
            self._backdrops[width, height] = backdrop
        self.show(time_s)
        behind = backdrop.draw(self._shadow(backdrop))
        colours, cover = self._bodies_seen(backdrop.camera)
        picture = colours + (1.0 - cover[..., None]) * behind
        return np.asarray(np.clip(np.rint(255.0 * picture), 0, 255), dtype=np.uint8)

    def three_images(self, width: int = 960, height: int = 720) -> tuple[Image, Image, Image]:
        """
        Draw the start, the middle of the reach and the exchange, or the end if there was none.

        Args:
            width: width of each picture, pixels.
            height: height of each picture, pixels.

        Returns:
            The three pictures.

        """
        return (
            self.image(float(self.times[0]), width, height),
            self.image(self.middle_time_s, width, height),
            self.image(min(self.exchange_time_s, float(self.times[-1])), width, height),
        )

    @property
    def middle_time_s(self) -> float:
        """Time at which the robot's wrist was half way to the exchange, s."""
        lengths = lengths_along(self.wrist_path)
        half = 0.5 * float(np.interp(self.exchange_time_s, self.times, lengths))
        return float(self.times[np.searchsorted(lengths, half)])

    def _centre(self) -> Array:
        middle = (self.figure.pelvis[:2] + np.array(self.model.base.position[:2])) / 2
        return np.array([*middle, self.floor_height_m])

    def _bodies_seen(self, camera: Camera) -> tuple[Array, Array]:
        """Render all bodies: colour times coverage, (h, w, 3), and coverage, (h, w), 0 to 1."""
        k = self.options.samples
        width, height = k * camera.width, k * camera.height
        ahead = camera.target - camera.eye
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        light = -ahead / np.linalg.norm(ahead) - 0.55 * right / np.linalg.norm(right)
        rgba, seen = camera_image(
            width,
            height,
            camera.view,
            camera.projection,
            self._engine.client,
            lightDirection=[light[0], light[1], light[2] + 1.2],
            lightColor=[1.0, 1.0, 1.0],
            lightAmbientCoeff=0.50,
            lightDiffuseCoeff=0.48,
            lightSpecularCoeff=0.12,
        )
        rgba[..., 3] = seen >= 0
        total = np.zeros((camera.height, camera.width, 4), dtype=np.uint16)
        for row in range(k):
            for column in range(k):
                total += rgba[row::k, column::k]
        return total[..., :3] / (255.0 * k * k), total[..., 3] / (k * k)

    def _shadow(self, backdrop: _Backdrop) -> Array:
        """Compute the shadow of the bodies on the floor, from straight above, 0 to 1."""
        centre, half = backdrop.centre, backdrop.shadow_half_m
        eye = centre + np.array([0.0, 0.0, 20.0])
        tangent = half / 20.0
        _, seen = camera_image(
            SHADOW_PIXELS,
            SHADOW_PIXELS,
            pybullet.computeViewMatrix(list(eye), list(centre), [0, 1, 0]),
            pybullet.computeProjectionMatrixFOV(
                2 * float(np.degrees(np.arctan(tangent))), 1.0, 10.0, 21.0
            ),
            self._engine.client,
        )
        cover = (seen >= 0).astype(float)
        return np.asarray(gaussian_filter(cover, SHADOW_BLUR_M * SHADOW_PIXELS / (2 * half)))

    def close(self) -> None:
        """Free the scene in PyBullet; a second call does nothing."""
        self._engine.close()


@dataclass(frozen=True)
class _Pose:
    position: Array
    rotation: Array

    def __matmul__(self, inner: _Pose) -> _Pose:
        return _Pose(
            self.position + self.rotation @ inner.position, self.rotation @ inner.rotation
        )

    def towards(self, other: _Pose, share: float) -> _Pose:
        """Interpolate to another pose by a share, with the shortest rotation."""
        turn = Rotation.from_matrix(other.rotation @ self.rotation.T).as_rotvec()
        return _Pose(
            self.position + share * (other.position - self.position),
            Rotation.from_rotvec(share * turn).as_matrix() @ self.rotation,
        )

    def inverse(self) -> _Pose:
        return _Pose(-self.rotation.T @ self.position, self.rotation.T)


@dataclass(frozen=True)
class _Grasp:
    """Pose of the object in the frame of each holder."""

    by_robot: _Pose
    by_hand: _Pose

    def towards(self, other: _Grasp, share: float) -> _Grasp:
        return _Grasp(
            self.by_robot.towards(other.by_robot, share),
            self.by_hand.towards(other.by_hand, share),
        )


class _Backdrop:
    """Floor and sky in the view of one camera."""

    def __init__(
        self, camera: Camera, centre: Array, floor_height_m: float, shadow_half_m: float
    ) -> None:
        self.camera = camera
        self.centre = centre
        self.shadow_half_m = shadow_half_m
        rays = camera.rays()
        upward = rays[..., 2] / np.linalg.norm(rays, axis=2)
        share = np.clip(upward / np.sin(np.radians(25.0)), 0.0, 1.0)
        sky = SKY_HORIZON + (SKY_TOP - SKY_HORIZON) * share[..., None]
        falling = rays[..., 2] < -1e-6
        fall = np.where(falling, rays[..., 2], -1.0)
        reach = np.where(falling, (floor_height_m - camera.eye[2]) / fall, 0.0)
        x = camera.eye[0] + reach * rays[..., 0]
        y = camera.eye[1] + reach * rays[..., 1]
        away = np.hypot(x - centre[0], y - centre[1])
        fade = np.where(falling, np.exp(-((away / 2.6) ** 2)), 0.0)
        # Lines fade before they become thinner than a pixel.
        pixel = np.linalg.norm(
            np.stack([np.gradient(x, axis=1), np.gradient(y, axis=1)]), axis=0
        ) + np.linalg.norm(np.stack([np.gradient(x, axis=0), np.gradient(y, axis=0)]), axis=0)
        line = np.maximum(_line(x - centre[0], pixel), _line(y - centre[1], pixel))
        floor = FLOOR_COLOUR * (1.0 - 0.09 * line)[..., None]
        self._plain = sky + (floor - sky) * fade[..., None]
        scale = SHADOW_PIXELS / (2 * self.shadow_half_m)
        rows = (self.shadow_half_m - (y - centre[1])) * scale - 0.5
        columns = (x - centre[0] + self.shadow_half_m) * scale - 0.5
        first, last = np.minimum(rows, columns), np.maximum(rows, columns)
        self._inside = falling & (first > 0) & (last < SHADOW_PIXELS)
        self._coordinates = np.stack([rows[self._inside], columns[self._inside]])
        self._depth = 0.45 * fade[self._inside]

    def draw(self, shadow: Array) -> Array:
        """Return floor and sky, (h, w, 3), 0 to 1, with a shadow."""
        picture: Array = self._plain.copy()
        dark = map_coordinates(shadow, self._coordinates, order=1, mode='constant')
        picture[self._inside] *= (1.0 - self._depth * dark)[:, None]
        return picture


def _ring(centre: Sequence[float] | Array, radius: float, height: float) -> Array:
    """Return points around a vertical axis, (12, 3)."""
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    x, y = centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)
    return np.column_stack([x, y, np.full(12, height)])


def _line(coordinate: Array, pixel: Array) -> Array:
    """Return the coverage of a pixel by the lines of the floor's grid, 0 to 1."""
    distance = np.abs((coordinate + GRID_M / 2) % GRID_M - GRID_M / 2)
    width = 0.006
    cover = np.clip((width + pixel / 2 - distance) / np.maximum(pixel, 1e-9), 0.0, 1.0)
    return np.asarray(cover * np.minimum(1.0, 2 * width / np.maximum(pixel, 1e-9)))


def _turn(before: Array, after: Array) -> Array:
    """Return the smallest rotation, (3, 3), from one direction to another."""
    return np.asarray(pin.Quaternion.FromTwoVectors(before, after).toRotationMatrix())


def _smooth_step(share: float) -> float:
    """Rise from 0 to 1 by minimum jerk, at rest at both ends."""
    u = min(1.0, max(0.0, share))
    return u * u * u * (10.0 + u * (6.0 * u - 15.0))


def _at(time_s: float, times: Array, values: Array) -> Array:
    """Interpolate the rows of an array."""
    index = int(np.searchsorted(times, time_s).clip(1, max(1, len(times) - 1)))
    if len(times) == 1:
        return np.asarray(values[0])
    share = np.clip((time_s - times[index - 1]) / (times[index] - times[index - 1]), 0.0, 1.0)
    return np.asarray((1.0 - share) * values[index - 1] + share * values[index])


def _spaced(path: Array, distance: float) -> list[int]:
    """Return the indices of successive points of a path with a least distance."""
    numbers = [0]
    for number, point in enumerate(path):
        if np.linalg.norm(point - path[numbers[-1]]) > distance:
            numbers.append(number)
    return numbers


def lengths_along(path: Array) -> Array:
    """
    Measure a path.

    Args:
        path: (n, 3), m.

    Returns:
        (n,), m, its length up to each of its points.

    """
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def tube(
    points: Array, radius: float, sides: int = 8
) -> tuple[Array, Array, NDArray[np.int64]] | None:
    """
    Make the surface of a tube around a path.

    Args:
        points: (n, 3), m.
        radius: radius, m.
        sides: number of sides of its cross section.

    Returns:
        Corners, (m, 3), normals, (m, 3), and triangles as a flat row of corner indices; None for
        a path without length.

    """
    spaced = [points[0]]
    for point in points[1:]:
        if np.linalg.norm(point - spaced[-1]) > 0.6 * radius:
            spaced.append(point)
    if len(spaced) < 2:
        return None
    path = np.array(spaced)
    ahead = np.gradient(path, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    across = np.cross(ahead[0], [0.0, 0.0, 1.0] if abs(ahead[0, 2]) < 0.9 else [1.0, 0.0, 0.0])
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)[:, None]
    outward = []
    for direction in ahead:
        across = across - (across @ direction) * direction  # parallel transport: no twist
        across /= np.linalg.norm(across)
        outward.append(np.cos(angle) * across + np.sin(angle) * np.cross(direction, across))
    normals = np.vstack([*outward, -ahead[:1], ahead[-1:]])
    rings = np.repeat(path, sides, axis=0) + radius * np.vstack(outward)
    corners = np.vstack([rings, path[:1], path[-1:]])
    side = np.arange(sides)
    turned = (side + 1) % sides
    ring = sides * np.arange(len(path) - 1)[:, None]
    a, b = ring + side, ring + turned
    c, d = a + sides, b + sides
    first, last = np.full(sides, len(rings)), np.full(sides, len(rings) + 1)
    end = len(rings) - sides
    triangles = np.vstack(
        [
            np.stack([a, b, d], axis=-1).reshape(-1, 3),
            np.stack([a, d, c], axis=-1).reshape(-1, 3),
            np.stack([first, turned, side], axis=-1),
            np.stack([last, end + side, end + turned], axis=-1),
        ]
    )
    return corners, normals, triangles.ravel()
