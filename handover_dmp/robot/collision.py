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

"""The arm as capsules: how near they are to each other and to the partner's forearm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TYPE_CHECKING

import coal
from handover_dmp.robot.errors import RobotDescriptionError
import numpy as np
from numpy.typing import NDArray
import pinocchio as pin

if TYPE_CHECKING:
    from handover_dmp.robot.model import RobotModel

Array = NDArray[np.float64]

CLEAR_AT_HOME = 0.04
"""Pairs nearer than this at home, m, are as good as neighbours: their capsules are too wide."""
SAMPLED_POSTURES = 60
NEVER_NEAR = 0.06
"""Pairs that no search brings nearer than this, m, need no watching."""
SEARCHES = 4
"""How many of the sampled postures such a search starts from."""
SURVEY_RANGE = 0.1
"""How much distances may have changed before all of them are computed anew, m."""

ClosingSpeed = Callable[[Any], Any]
"""Gives the speeds, m/s, with which bodies may close in at distances, m; one or an array."""


@dataclass(frozen=True, eq=False)
class LinkCapsule:
    """
    A capsule that moves with a joint.

    Attributes:
        name: of the link.
        joint: index of the joint in Pinocchio's model, 0 for the base.
        start: (3,), m, one end of its axis, in the joint's frame.
        end: (3,), m, the other end.
        radius: m.

    """

    name: str
    joint: int
    start: Array
    end: Array
    radius: float


@dataclass(frozen=True, eq=False)
class NearPair:
    """
    Two bodies that are near each other.

    Attributes:
        name: what they are.
        distance: between their surfaces, m; negative when they overlap.
        row: (n,), its rate of change is `row`·q̇ + `drift`, m per rad.
        drift: the part of that rate that is not the arm's, m/s.

    """

    name: str
    distance: float
    row: Array
    drift: float


def link_capsules(model: RobotModel) -> tuple[LinkCapsule, ...]:
    """
    Wrap every link in capsules.

    A sphere or cylinder of the description becomes the capsule of its radius; boxes and meshes
    are wrapped in the smaller capsule of those about their principal axes. What lies inside
    another capsule of the same link is left out.

    Args:
        model: the arm.

    Returns:
        The capsules, from the base on.

    Raises:
        RobotDescriptionError: the geometry cannot be read, a mesh is missing for example.

    """
    folders = [str(folder) for folder in model.urdf_path.parents]
    try:
        geometry = pin.buildGeomFromUrdfString(
            model.pinocchio_model,
            model.chain_text,
            pin.GeometryType.COLLISION,
            package_dirs=folders,
        )
    except (ValueError, RuntimeError) as error:
        raise RobotDescriptionError(f'{model.urdf_path}: {error}') from error
    capsules: list[LinkCapsule] = []
    for item in geometry.geometryObjects:
        start, end, radius = _capsule(item.geometry, np.asarray(item.meshScale).ravel())
        link = model.pinocchio_model.frames[item.parentFrame].name
        capsules.append(
            LinkCapsule(
                link,
                int(item.parentJoint),
                item.placement.act(start),
                item.placement.act(end),
                radius,
            )
        )
    kept: list[LinkCapsule] = []
    for capsule in sorted(capsules, key=lambda item: -_volume(item)):
        if not any(_contains(other, capsule) for other in kept):
            kept.append(capsule)
    return tuple(sorted(kept, key=lambda item: item.joint))


class CollisionModel:
    """Distances between the capsules of the arm, and from them to the partner's forearm."""

    def __init__(self, model: RobotModel, *, forearm_radius: float = 0.06) -> None:
        """
        Choose which capsules to watch.

        Neighbours along the chain are not watched, nor are pairs that nearly touch at home or
        overlap in nearly every posture: no motion can keep those apart. Nor are pairs that
        never come near each other, as a search from many postures finds.

        Args:
            model: the arm.
            forearm_radius: of the partner's forearm, m.

        """
        self._model = model.pinocchio_model
        self._data = model.pinocchio_data
        self._dof = model.dof
        self.capsules = link_capsules(model)
        self._geometry = pin.GeometryModel()
        for i, capsule in enumerate(self.capsules):
            self._geometry.addGeometryObject(_geometry_object(f'{capsule.name} {i}', capsule))
        watched = [
            (i, j)
            for i, first in enumerate(self.capsules)
            for j, second in enumerate(self.capsules)
            if second.joint > first.joint + 1
        ]
        for i, j in self._avoidable(model, watched):
            self._geometry.addCollisionPair(pin.CollisionPair(i, j))
        self.pairs = tuple((pair.first, pair.second) for pair in self._geometry.collisionPairs)
        self._distances = self._geometry.createData()
        self._surveyed = np.full(model.dof, np.nan)
        self._survey_distances = np.zeros(len(self.pairs))
        self._levers = np.array([self._pair_levers(i, j) for i, j in self.pairs])
        self._forearm_radius = forearm_radius
        # the last links must come to the hand, so only those before the last three joints matter
        arm = range(1, max(model.dof - 2, 2))
        self._arm_capsules = [i for i, item in enumerate(self.capsules) if item.joint in arm]

    def near_pairs(
        self, joint_positions: Array, jacobian: Array, allowed: ClosingSpeed, fastest: Array
    ) -> list[NearPair]:
        """
        Find links that could come near each other too fast.

        All distances are computed at one posture. From there no distance can have changed by more
        than `lever`·|Δq|, so most pairs need not be looked at until the joints have moved a lot.

        Args:
            joint_positions: (n,), rad.
            jacobian: (6, n), Pinocchio's `computeJointJacobians` for the posture, which has left
                the placements of the joints in the model's data.
            allowed: the speed with which two links may close in, at their distance.
            fastest: (n,), what the joints can do in the next period, rad/s.

        Returns:
            Every pair that could close in faster than allowed; the others need no bound.

        """
        if not self.pairs:
            return []
        changed = self._levers @ np.abs(joint_positions - self._surveyed)
        if not changed.max() <= SURVEY_RANGE:
            self._survey(joint_positions)
            changed = np.zeros(len(self.pairs))
        closing = self._levers @ fastest
        candidates = np.flatnonzero(allowed(self._survey_distances - changed) < closing)
        if not len(candidates):
            return []
        pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._distances)
        near = []
        for k in candidates.tolist():
            result = pin.computeDistance(self._geometry, self._distances, k)
            distance = result.min_distance
            if allowed(distance) >= closing[k]:
                continue
            i, j = self.pairs[k]
            first, second = result.getNearestPoint1(), result.getNearestPoint2()
            normal = _direction(first, second, distance, result.normal)
            a, b = self.capsules[i], self.capsules[j]
            row = self._rate(jacobian, b.joint, second, normal)
            row -= self._rate(jacobian, a.joint, first, normal)
            if np.abs(row) @ fastest > allowed(distance):
                near.append(NearPair(f'{a.name} to {b.name}', distance, row, 0.0))
        return near

    def _survey(self, joint_positions: Array) -> None:
        """Compute all distances at a posture whose placements stand in the model's data."""
        pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._distances)
        pin.computeDistances(self._geometry, self._distances)
        results = self._distances.distanceResults
        self._survey_distances = np.array([result.min_distance for result in results])
        self._surveyed = np.array(joint_positions)

    def least_distance(self, joint_positions: Array) -> float:
        """
        Compute how near the arm is to itself.

        Args:
            joint_positions: (n,), rad.

        Returns:
            The least distance of all watched pairs, m; infinite if there are none.

        """
        pin.forwardKinematics(self._model, self._data, joint_positions)
        pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._distances)
        pin.computeDistances(self._geometry, self._distances)
        return min(
            (result.min_distance for result in self._distances.distanceResults), default=np.inf
        )

    def near_forearm(
        self,
        jacobian: Array,
        hand: Array,
        elbow: Array,
        velocity: Array,
        within: float = np.inf,
    ) -> list[NearPair]:
        """
        Find links near the partner's forearm, but for those that bring the object to the hand.

        Args:
            jacobian: (6, n), see `near_pairs`.
            hand: (3,), m, one end of the forearm, in `world`.
            elbow: (3,), m, its other end.
            velocity: (3,), m/s, of the forearm.
            within: m.

        Returns:
            The pairs nearer than that.

        """
        forearm, placement = _placed_capsule(hand, elbow, self._forearm_radius)
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        near = []
        for i in self._arm_capsules:
            capsule = self.capsules[i]
            pose = self._data.oMi[capsule.joint]
            shape, own = _placed_capsule(
                pose.act(capsule.start), pose.act(capsule.end), capsule.radius
            )
            result.clear()
            distance = coal.distance(shape, own, forearm, placement, request, result)
            if distance >= within:
                continue
            first, second = result.getNearestPoint1(), result.getNearestPoint2()
            normal = _direction(first, second, distance, result.normal)
            row = -self._rate(jacobian, capsule.joint, first, normal)
            near.append(
                NearPair(f'{capsule.name} to forearm', distance, row, float(normal @ velocity))
            )
        return near

    def _rate(self, jacobian: Array, joint: int, point: Array, normal: Array) -> Array:
        """Differentiate a point's position along a direction with respect to the joints."""
        row: Array = np.zeros(self._dof)
        x, y, z = point
        a, b, c = normal
        turning = np.array([a, b, c, y * c - z * b, z * a - x * c, x * b - y * a])
        row[:joint] = turning @ jacobian[:, :joint]
        return row

    def _pair_levers(self, i: int, j: int) -> Array:
        """Bound what each joint can change of a pair's distance, (n,), m per rad."""
        far, joint = self.capsules[j], self.capsules[j].joint
        levers = np.zeros(self._dof)
        lever = far.radius + max(float(np.linalg.norm(far.start)), float(np.linalg.norm(far.end)))
        while joint > self.capsules[i].joint:
            prismatic = self._model.joints[joint].shortname().startswith('JointModelP')
            levers[joint - 1] = 1.0 if prismatic else lever
            lever += float(np.linalg.norm(self._model.jointPlacements[joint].translation))
            joint -= 1
        return levers

    def _avoidable(
        self, model: RobotModel, watched: list[tuple[int, int]]
    ) -> list[tuple[int, int]]:
        low = np.maximum(model.limits.lower, -np.pi)
        high = np.minimum(model.limits.upper, np.pi)
        chance = np.random.default_rng(0)
        postures = [model.home, *chance.uniform(low, high, (SAMPLED_POSTURES, model.dof))]
        for i, j in watched:
            self._geometry.addCollisionPair(pin.CollisionPair(i, j))
        data = self._geometry.createData()
        distances = np.empty((len(postures), len(watched)))
        for posture, row in zip(postures, distances, strict=True):
            pin.updateGeometryPlacements(self._model, self._data, self._geometry, data, posture)
            pin.computeDistances(self._geometry, data)
            row[:] = [result.min_distance for result in data.distanceResults]
        rare = (distances[0] > CLEAR_AT_HOME) & (np.mean(distances <= 0.0, axis=0) < 0.9)
        for k in np.flatnonzero(rare & (distances.min(axis=0) > NEVER_NEAR)).tolist():
            starts = [postures[at] for at in np.argsort(distances[:, k])[:SEARCHES]]
            rare[k] = min(self._nearest(data, k, q, low, high) for q in starts) <= NEVER_NEAR
        self._geometry.removeAllCollisionPairs()
        return [pair for pair, keep in zip(watched, rare, strict=True) if keep]

    def _nearest(self, data: Any, k: int, posture: Array, low: Array, high: Array) -> float:
        """Search downhill for the least distance of a pair."""
        pair = self._geometry.collisionPairs[k]
        a, b = self.capsules[pair.first], self.capsules[pair.second]
        least, stride = np.inf, 0.3
        while stride > 0.01:
            jacobian = pin.computeJointJacobians(self._model, self._data, posture)
            pin.updateGeometryPlacements(self._model, self._data, self._geometry, data)
            result = pin.computeDistance(self._geometry, data, k)
            if result.min_distance > least - 1e-4:
                stride /= 2.0
            least = min(least, result.min_distance)
            if least <= NEVER_NEAR:
                break
            first, second = result.getNearestPoint1(), result.getNearestPoint2()
            normal = _direction(first, second, result.min_distance, result.normal)
            row = self._rate(jacobian, b.joint, second, normal)
            row -= self._rate(jacobian, a.joint, first, normal)
            steepest = float(np.abs(row).max())
            if steepest < 1e-6:
                break
            posture = np.clip(posture - stride / steepest * row, low, high)
        return least


def _capsule(shape: Any, scale: Array) -> tuple[Array, Array, float]:
    """Wrap a shape; gives the ends of the axis in the shape's own frame, and the radius."""
    along = np.array([0.0, 0.0, 1.0])
    if isinstance(shape, coal.Sphere):
        return np.zeros(3), np.zeros(3), float(shape.radius)
    if isinstance(shape, coal.Capsule | coal.Cylinder):
        return -shape.halfLength * along, shape.halfLength * along, float(shape.radius)
    if isinstance(shape, coal.Box):
        half = np.asarray(shape.halfSide)
        corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T * half
        return _wrapped(corners)
    points = np.array(shape.vertices()) if hasattr(shape, 'vertices') else None
    if points is None or not len(points):
        raise RobotDescriptionError(f'no capsule can be made of a {type(shape).__name__}')
    return _wrapped(points)


def _wrapped(points: Array) -> tuple[Array, Array, float]:
    """Wrap points in the smallest of the three capsules about their principal axes."""
    centre = (points.min(axis=0) + points.max(axis=0)) / 2.0
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    best: tuple[float, Array, Array, float] | None = None
    for axis in axes:
        relative = points - centre
        along = relative @ axis
        away = np.linalg.norm(relative - np.outer(along, axis), axis=1)
        radius = float(away.max())
        dome = np.sqrt(np.maximum(radius**2 - away**2, 0.0))
        low, high = float((along + dome).min()), float((along - dome).max())
        if low > high:
            low = high = (low + high) / 2.0
        volume = radius**2 * (high - low + 4.0 / 3.0 * radius)
        if best is None or volume < best[0]:
            best = (volume, centre + low * axis, centre + high * axis, radius)
    assert best is not None
    return best[1], best[2], best[3]


def _geometry_object(name: str, capsule: LinkCapsule) -> Any:
    shape, pose = _placed_capsule(capsule.start, capsule.end, capsule.radius)
    placement = pin.SE3(pose.getRotation(), pose.getTranslation())
    return pin.GeometryObject(name, capsule.joint, placement, shape)


def _placed_capsule(start: Array, end: Array, radius: float) -> tuple[Any, Any]:
    axis = end - start
    length = float(np.sqrt(axis @ axis))
    rotation = np.eye(3)
    if length > 1e-9:
        rotation = pin.Quaternion.FromTwoVectors(
            np.array([0.0, 0.0, 1.0]), axis / length
        ).toRotationMatrix()
    return coal.Capsule(radius, length), coal.Transform3s(rotation, (start + end) / 2.0)


def _direction(first: Array, second: Array, distance: float, normal: Array) -> Array:
    """Give the unit vector from the first body to the second, also when they overlap."""
    if distance > 1e-6:
        return np.asarray((second - first) / distance)
    return np.asarray(normal)


def _volume(capsule: LinkCapsule) -> float:
    length = float(np.linalg.norm(capsule.end - capsule.start))
    return capsule.radius**2 * (length + 4.0 / 3.0 * capsule.radius)


def _contains(outer: LinkCapsule, inner: LinkCapsule) -> bool:
    if outer.joint != inner.joint:
        return False
    axis = outer.end - outer.start
    square = float(axis @ axis)
    for point in (inner.start, inner.end):
        share = (
            0.0 if square == 0.0 else float(np.clip((point - outer.start) @ axis / square, 0, 1))
        )
        away = float(np.linalg.norm(point - outer.start - share * axis))
        if away + inner.radius > outer.radius + 1e-9:
            return False
    return True
