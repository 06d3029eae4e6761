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

"""The arm as capsules: distances between them and to the partner's forearm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar
from weakref import WeakKeyDictionary

import coal
from handover_dmp.common.arrays import Array
from handover_dmp.robot.errors import RobotDescriptionError
from handover_dmp.robot.mesh_reading import LOADER
from handover_dmp.robot.model import RobotModel
import numpy as np
import pinocchio as pin

CLEAR_AT_HOME = 0.04
"""Pairs closer than this at home, m, count as neighbours: their capsules are too wide."""
SAMPLED_CONFIGURATIONS = 60
NEVER_NEAR = 0.06
"""Pairs that no search brings closer than this, m, are not monitored."""
TOUCHING = 1e-6
"""Distance, m, below which the nearest points define no direction."""
SEARCHES = 4
"""Number of sampled configurations from which such a search starts."""

ClosingSpeed = Callable[[float], float]
"""The maximum closing speed, m/s, as a function of the distance, m."""


@dataclass(frozen=True, eq=False)
class LinkCapsule:
    """
    A capsule that moves with a joint.

    Attributes:
        name: name of the link.
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
    Two bodies that are close to each other.

    Attributes:
        name: their names.
        distance: distance between their surfaces, m; negative if they overlap.
        row: (n,), m per rad; the rate of change of the distance is `row`·q̇ + `drift`.
        drift: the part of that rate that does not depend on the arm, m/s.

    """

    name: str
    distance: float
    row: Array
    drift: float


def link_capsules(model: RobotModel) -> tuple[LinkCapsule, ...]:
    """
    Enclose every link in capsules.

    A sphere or cylinder becomes a capsule of its radius; boxes and meshes get the smallest of the
    capsules about their principal axes. Capsules inside another one of the same link are dropped.

    Args:
        model: the arm.

    Returns:
        The capsules, from the base on.

    Raises:
        RobotDescriptionError: the geometry cannot be read, e.g. because a mesh is missing.

    """
    try:
        geometry = pin.buildGeomFromUrdfString(
            model.pinocchio_model,
            model.chain_text,
            pin.GeometryType.COLLISION,
            mesh_loader=LOADER,
        )
    except (ValueError, RuntimeError) as error:
        fault = ' '.join(str(error).split())
        raise RobotDescriptionError(f'{model.urdf_path}: {fault}') from error
    capsules: list[LinkCapsule] = []
    for item in geometry.geometryObjects:
        start, end, radius = _capsule(item.geometry, np.asarray(item.meshScale).ravel())
        link = model.pinocchio_model.frames[item.parentFrame].name
        joint, place = int(item.parentJoint), item.placement
        capsules.append(LinkCapsule(link, joint, place.act(start), place.act(end), radius))
    kept: list[LinkCapsule] = []
    for capsule in sorted(capsules, key=lambda item: -_volume(item)):
        if not any(_contains(other, capsule) for other in kept):
            kept.append(capsule)
    return tuple(sorted(kept, key=lambda item: item.joint))


class CollisionModel:
    """Distances between the capsules of the arm, and from them to the partner's forearm."""

    _made: ClassVar[WeakKeyDictionary[RobotModel, CollisionModel]] = WeakKeyDictionary()

    @classmethod
    def of(cls, model: RobotModel) -> CollisionModel:
        """
        Return the collision model of an arm, made once, since that takes longer than many periods.

        Args:
            model: the arm.

        Returns:
            Its collision model.

        """
        if model not in cls._made:
            cls._made[model] = cls(model)
        return cls._made[model]

    def __init__(self, model: RobotModel, *, forearm_radius: float = 0.06) -> None:
        """
        Choose the pairs of capsules to monitor.

        Three kinds of pairs are not monitored: neighbours along the chain; pairs that nearly
        touch at home or overlap in nearly every configuration, since no motion separates them;
        and pairs that never come close in a search from many configurations.

        Args:
            model: the arm.
            forearm_radius: radius of the partner's forearm, m.

        """
        self._model = model.pinocchio_model
        self._data = model.pinocchio_data
        self._dof = model.dof
        self._slides = [model.slides(i) for i in range(model.dof)]
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
        jacobian = pin.computeJointJacobians(self._model, self._data, model.home)
        turns = [placement.rotation for placement in self._data.oMi[1:]]
        self._axes = [turn.T @ jacobian[3:, k] for k, turn in enumerate(turns)]
        self._travel = np.maximum(np.abs(model.limits.lower), np.abs(model.limits.upper))
        names = [capsule.name for capsule in self.capsules]
        self._names = [f'{names[i]} to {names[j]}' for i, j in self.pairs]
        self._levers = np.array([self._pair_levers(i, j) for i, j in self.pairs])
        self._moving = [self._moved_apart(i, j) for i, j in self.pairs]
        self._forearm_radius = forearm_radius
        # the last links must approach the hand, so only links before the last three joints count
        arm = range(1, max(model.dof - 2, 2))
        self._arm_capsules = [i for i, item in enumerate(self.capsules) if item.joint in arm]

    def near_pairs(self, jacobian: Array, allowed: ClosingSpeed, fastest: Array) -> list[NearPair]:
        """
        Find the pairs of links that could close in too fast.

        Args:
            jacobian: (6, n), Pinocchio's `computeJointJacobians`, which has left the placements
                of the joints in the model's data.
            allowed: the maximum closing speed of two links at their distance.
            fastest: (n,), maximum joint speeds in the next period, rad/s.

        Returns:
            Every pair that could close in faster than allowed; the others need no bound.

        """
        if not self.pairs:
            return []
        geometry, distances, compute = self._geometry, self._distances, pin.computeDistance
        pin.updateGeometryPlacements(self._model, self._data, geometry, distances)
        near = []
        for k, closing in enumerate(self._levers.dot(fastest).tolist()):
            result = compute(geometry, distances, k)
            distance = result.min_distance
            speed = allowed(distance)
            if speed >= closing:
                continue
            row, _ = _rate(result, jacobian, self._moving[k])
            if np.abs(row).dot(fastest) > speed:
                near.append(NearPair(self._names[k], distance, row, 0.0))
        return near

    def _all_distances(self, data: Any) -> Array:
        """Compute the distance of every pair, m, at the placements in the data."""
        pairs = range(len(self._geometry.collisionPairs))
        return np.array([pin.computeDistance(self._geometry, data, k).min_distance for k in pairs])

    def min_distance(self, joint_positions: Array) -> float:
        """
        Compute the smallest distance between links.

        Args:
            joint_positions: (n,), rad.

        Returns:
            The smallest distance of all monitored pairs, m; infinite if there are none.

        """
        pin.forwardKinematics(self._model, self._data, joint_positions)
        pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._distances)
        return float(self._all_distances(self._distances).min(initial=np.inf))

    def near_forearm(
        self,
        jacobian: Array,
        hand: Array,
        elbow: Array,
        velocity: Array,
        within: float = np.inf,
    ) -> list[NearPair]:
        """
        Find links near the partner's forearm, except for those that carry the object to the hand.

        Args:
            jacobian: (6, n), see `near_pairs`.
            hand: (3,), m, one end of the forearm, in `world`.
            elbow: (3,), m, its other end.
            velocity: (3,), m/s, of the forearm.
            within: distance, m.

        Returns:
            The pairs closer than that.

        """
        forearm, placement = _placed_capsule(hand, elbow, self._forearm_radius)
        request = coal.DistanceRequest()
        near = []
        for i in self._arm_capsules:
            capsule = self.capsules[i]
            pose = self._data.oMi[capsule.joint]
            shape, own = _placed_capsule(
                pose.act(capsule.start), pose.act(capsule.end), capsule.radius
            )
            result = coal.DistanceResult()
            distance = coal.distance(forearm, placement, shape, own, request, result)
            if distance >= within:
                continue
            row, normal = _rate(result, jacobian, self._moved_by(capsule))
            drift = -sum(n * v for n, v in zip(normal, velocity, strict=True))
            near.append(NearPair(f'{capsule.name} to forearm', distance, row, float(drift)))
        return near

    def _moved_by(self, capsule: LinkCapsule) -> Array:
        """Return which joints move a capsule, (n,), 1 or 0."""
        return (np.arange(self._dof) < capsule.joint).astype(float)

    def _moved_apart(self, i: int, j: int) -> Array:
        """Return which joints move only the second capsule of a pair, (n,), 1 or 0."""
        return self._moved_by(self.capsules[j]) - self._moved_by(self.capsules[i])

    def _pair_levers(self, i: int, j: int) -> Array:
        """Bound the effect of each joint on a pair's distance, (n,), m per rad."""
        near, far = self.capsules[i], self.capsules[j]
        levers = np.zeros(self._dof)
        joint, beyond = far.joint, far.radius
        offsets: tuple[Array, ...] = (far.start, far.end)
        while joint > near.joint:
            axis = self._axes[joint - 1]
            prismatic = self._slides[joint - 1]
            lever = beyond + max(_across(offset, axis) for offset in offsets)
            levers[joint - 1] = 1.0 if prismatic else lever
            beyond += max(float(np.linalg.norm(offset)) for offset in offsets)
            beyond += self._travel[joint - 1] if prismatic else 0.0
            offsets = (self._model.jointPlacements[joint].translation,)
            joint -= 1
        first = self._model.jointPlacements[near.joint + 1]
        axis = first.rotation @ self._axes[near.joint]
        if all(_across(end - first.translation, axis) < 1e-9 for end in (near.start, near.end)):
            levers[near.joint] = 0.0  # rotates the capsule about its own axis
        return levers

    def _avoidable(
        self, model: RobotModel, watched: list[tuple[int, int]]
    ) -> list[tuple[int, int]]:
        low, high = model.limits.one_turn
        rng = np.random.default_rng(0)
        configurations = [model.home, *rng.uniform(low, high, (SAMPLED_CONFIGURATIONS, model.dof))]
        for i, j in watched:
            self._geometry.addCollisionPair(pin.CollisionPair(i, j))
        data = self._geometry.createData()
        distances = np.empty((len(configurations), len(watched)))
        for configuration, row in zip(configurations, distances, strict=True):
            pin.updateGeometryPlacements(
                self._model, self._data, self._geometry, data, configuration
            )
            row[:] = self._all_distances(data)
        rare = (distances[0] > CLEAR_AT_HOME) & (np.mean(distances <= 0.0, axis=0) < 0.9)
        for k in np.flatnonzero(rare & (distances.min(axis=0) > NEVER_NEAR)).tolist():
            starts = [configurations[at] for at in np.argsort(distances[:, k])[:SEARCHES]]
            rare[k] = min(self._nearest(data, k, q, low, high) for q in starts) <= NEVER_NEAR
        self._geometry.removeAllCollisionPairs()
        return [pair for pair, keep in zip(watched, rare, strict=True) if keep]

    def _nearest(self, data: Any, k: int, configuration: Array, low: Array, high: Array) -> float:
        """Search for a local minimum of a pair's distance."""
        pair = self._geometry.collisionPairs[k]
        moving = self._moved_apart(pair.first, pair.second)
        minimum, stride = np.inf, 0.3
        while stride > 0.01:
            jacobian = pin.computeJointJacobians(self._model, self._data, configuration)
            pin.updateGeometryPlacements(self._model, self._data, self._geometry, data)
            result = pin.computeDistance(self._geometry, data, k)
            if result.min_distance > minimum - 1e-4:
                stride /= 2.0
            minimum = min(minimum, result.min_distance)
            if minimum <= NEVER_NEAR:
                break
            row, _ = _rate(result, jacobian, moving)
            steepest = float(np.abs(row).max())
            if steepest < 1e-6:
                break
            configuration = np.clip(configuration - stride / steepest * row, low, high)
        return minimum


def _capsule(shape: Any, scale: Array) -> tuple[Array, Array, float]:
    """Enclose a shape; return the ends of the axis in its own frame, and the radius."""
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
        raise RobotDescriptionError(f'shape {type(shape).__name__} is not supported for collision')
    return _wrapped(points)


def _wrapped(points: Array) -> tuple[Array, Array, float]:
    """Enclose points in the smallest of the three capsules about their principal axes."""
    centre = (points.min(axis=0) + points.max(axis=0)) / 2.0
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    found: list[tuple[float, Array, Array, float]] = []
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
        found.append((volume, centre + low * axis, centre + high * axis, radius))
    _, start, end, radius = min(found, key=lambda one: one[0])
    return start, end, radius


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


def _rate(result: Any, jacobian: Array, moving: Array) -> tuple[Array, tuple[float, float, float]]:
    """
    Differentiate a distance with respect to the joints.

    Joints that move both bodies alike do not change it, so only those count that move the
    second body alone.

    Args:
        result: distance result of coal.
        jacobian: (6, n), Pinocchio's `computeJointJacobians`.
        moving: (n,), 1 for the joints that move the second body but not the first, otherwise 0.

    Returns:
        The rate, (n,), m per rad, and the unit vector from the first to the second body.

    """
    x, y, z = result.getNearestPoint2().tolist()
    distance = result.min_distance
    if distance > TOUCHING:
        u, v, w = result.getNearestPoint1().tolist()
        a, b, c = (x - u) / distance, (y - v) / distance, (z - w) / distance
    else:  # if the bodies touch or overlap, only coal provides the direction
        a, b, c = result.normal.tolist()
    turning = np.array([a, b, c, y * c - z * b, z * a - x * c, x * b - y * a])
    return turning.dot(jacobian) * moving, (a, b, c)


def _across(vector: Array, axis: Array) -> float:
    """Return the length of a vector's component perpendicular to a unit vector."""
    return float(np.linalg.norm(vector - (vector @ axis) * axis))


def _volume(capsule: LinkCapsule) -> float:
    length = float(np.linalg.norm(capsule.end - capsule.start))
    return capsule.radius**2 * (length + 4.0 / 3.0 * capsule.radius)


def _contains(outer: LinkCapsule, inner: LinkCapsule) -> bool:
    if outer.joint != inner.joint:
        return False
    axis = outer.end - outer.start
    square = float(axis @ axis)
    for point in (inner.start, inner.end):
        along = (point - outer.start) @ axis
        share = 0.0 if square == 0.0 else float(np.clip(along / square, 0, 1))
        away = float(np.linalg.norm(point - outer.start - share * axis))
        if away + inner.radius > outer.radius + 1e-9:
            return False
    return True
