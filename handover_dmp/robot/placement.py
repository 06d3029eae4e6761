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

"""Search for a base placement with the path of the wrist well inside the reach."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
import itertools
import math

from handover_dmp.common.arrays import Array
from handover_dmp.common.settings import defaults
from handover_dmp.robot.collision import CollisionModel
from handover_dmp.robot.errors import UnreachableError
from handover_dmp.robot.model import BasePlacement, RobotModel
from handover_dmp.robot.orientation_task import orthogonal_directions
import numpy as np

SAMPLES = 16
"""Minimum number of equally spaced points of the path that are checked."""
SPACING_M = 0.08
"""Maximum spacing of these, m; a larger one would miss the turning points of a path."""
TRIED = 24
"""Number of placements, best by distance, that are checked with the joints."""
REFINEMENTS = 2
"""Number of searches around the best one, each with half the spacing."""

BEHIND = np.array([-0.2, 0.0, 0.15, 0.3, 0.45, 0.6, 0.75])
"""Distance of the shoulder behind the middle of the path, in units of reach."""
ASIDE = np.array([-0.45, -0.3, -0.15, 0.0, 0.15, 0.3, 0.45])
"""Distance of the shoulder to the left of it, in units of reach."""
ABOVE = np.array([-0.3, -0.15, 0.0, 0.15, 0.3])
"""Height of the shoulder above it, in units of reach."""

EASY_SPEED = 1.5
"""A high wrist speed for a handover, m/s."""
MIN_SPEED_WEIGHT = 0.3
"""Minimum weight of the speed on slow parts of the path, relative to its fastest part."""
EASY_MARGIN = 0.4
"""A comfortable distance of a joint from its limits, rad."""
EASY_MANIPULABILITY = 0.25
"""A comfortable smallest singular value, m."""
TILT_LEVER_M = 0.3
"""Lever that converts a tilt, rad, to a distance, m."""
LEFT_BONUS = 0.01
"""Tie-breaker for mirror images: people reach with the right hand, the body is to its left."""
BEHIND_START = 0.15
"""Minimum distance of the base behind the start of the path, if possible, m."""
ANCHORS = 6
"""Number of configurations put at the middle of the path if distances alone do not suffice."""
ANCHOR_SAMPLES = 300
APART = 0.2
"""Minimum distance between the wrists of two of them, as a share of the reach."""
YAWS = 8
"""Number of yaw angles tried for each of them."""
HELD_CLEAR_M = 0.005
"""Extra clearance between links, beyond that of the inverse kinematics."""
NO_WAY = 'cannot follow this path from any base placement:'
FLAT_REASON = 'its wrist can hardly leave a surface'
PLANE = 1e-3
"""Deviation from a plane, as a share of the reach, below which a path is planar."""
FLAT = 0.15
"""Smallest singular value, as a share of the reach, below which an arm counts as flat."""


@dataclass(frozen=True)
class _WristPath:
    """The path of the wrist, and what the search needs to know of it."""

    points: Array
    speed_weight: Array
    forwards: Array
    leftwards: Array


class _Wrist:
    """
    The controlled part of the wrist: its position and, optionally, its upright axis.

    Attributes:
        model: the arm.

    """

    def __init__(self, model: RobotModel, start: Array | None) -> None:
        """Take the arm, and the configuration, (n,), rad, that is upright; None: free."""
        self.model = model
        self._vertical: Array = model.base.rotation[:, 2]
        self._across = np.array(orthogonal_directions(self._vertical)) * TILT_LEVER_M
        self._up: Array | None = None
        if start is not None:
            self._up = model.wrist_pose(start)[1].T @ self._vertical

    def jacobian(self, posture: Array) -> Array:
        """Return its Jacobian, (3, n) or (5, n), m per rad."""
        jacobian = self.model.wrist_jacobian(posture)
        if self._up is None:
            return jacobian[:3]
        return np.vstack([jacobian[:3], self._across @ jacobian[3:]])

    def error(self, posture: Array, point: Array) -> Array:
        """Return the error to a point, (3,) or (5,), m."""
        place, rotation = self.model.wrist_pose(posture)
        if self._up is None:
            return point - place
        tilt = np.cross(rotation @ self._up, self._vertical)
        return np.concatenate([point - place, self._across @ tilt])


def choose_base_placement(
    path: Array,
    model: RobotModel,
    *,
    partner: Array | None = None,
    upright: bool = False,
) -> BasePlacement:
    """
    Find the best base placement for a path of the wrist.

    Placements around the middle of the path, behind its start as seen by the partner, are ranked
    by the distances from the shoulder. The best of them are checked with the joints, which follow
    the path point by point. The chosen placement has the best worst point, in wrist speed,
    distance from the position limits and distance from singularities; placements in which links
    come too close to each other are discarded. If all fail, as with an arm at the side of a body,
    configurations in which the wrist moves well are put at the middle of the path. The height is
    free: the arm stands on a pedestal. The search is deterministic.

    Args:
        path: (n, 3), m, the path of the wrist in `world`, sampled at equal times if its speed is
            to be considered.
        model: the arm; its present placement does not matter.
        partner: (3,), m, the partner's hand or body, towards which the arm faces; by default the
            end of the path.
        upright: whether the axis of the wrist that is vertical at the start shall stay vertical,
            if a placement permits it.

    Returns:
        Position of the root link and yaw.

    Raises:
        UnreachableError: the path cannot be followed from any placement.

    """
    wrist_path = _wrist_path(np.asarray(path, dtype=float), partner)
    if upright:
        with suppress(UnreachableError):
            return _chosen(wrist_path, model, upright=True)
    return _chosen(wrist_path, model)


def _chosen(wrist_path: _WristPath, model: RobotModel, *, upright: bool = False) -> BasePlacement:
    reach = model.reach_m
    middle = wrist_path.points.mean(axis=0)
    offsets = np.array(list(itertools.product(BEHIND, ASIDE, ABOVE))) * reach
    ranked = sorted(
        (_distance_cost(wrist_path, _shoulder(wrist_path, middle, offset), reach), tuple(offset))
        for offset in offsets
    )
    sideways = _sideways(model)
    if sideways < PLANE * reach and _depth(wrist_path) > PLANE * reach:
        # a smaller motion would not help
        raise UnreachableError(f'{model.name} {NO_WAY} {FLAT_REASON}', np.inf)
    search = partial(_search, model, wrist_path, upright)
    nearest = [np.array(offset) for _, offset in ranked[:TRIED]]
    best = search(nearest, partial(_placement, model, wrist_path, middle))
    if best.missing_m > 0.0 and not upright:
        anchored = search(
            _anchored(model, wrist_path, middle),
            lambda place: BasePlacement((place[0], place[1], place[2]), place[3]),
        )
        best = max(best, anchored, key=_Trial.key)
    if best.missing_m > 0.0:
        length = float(np.linalg.norm(np.diff(wrist_path.points, axis=0), axis=1).sum())
        raise UnreachableError(
            f'{model.name} {NO_WAY.replace("path", f"path of {length:.2f} m")} '
            + _why_not(best, sideways < FLAT * reach),
            best.missing_m,
        )
    return best.base


@dataclass(frozen=True, eq=False)
class _Trial:
    """
    Result for a placement.

    Attributes:
        score: larger is better.
        base: the placement.
        missing_m: maximum distance to an unreachable point, m; 0 if the path can be followed.
        blocked: whether the path is within reach, but not without collision of the links.

    """

    score: float
    base: BasePlacement
    missing_m: float
    blocked: bool = False

    def key(self) -> tuple[float, float]:
        return -self.missing_m, self.score


def _search(
    model: RobotModel,
    wrist_path: _WristPath,
    upright: bool,
    starts: Iterable[Array],
    placed: Callable[[Array], BasePlacement],
) -> _Trial:
    """Try placements, then the neighbourhood of the best, in its first three coordinates."""
    best, at = _Trial(-np.inf, BasePlacement(), np.inf), np.zeros(4)
    for start in starts:
        trial = _tried(model, wrist_path, placed(start), upright)
        if trial.key() > best.key():
            best, at = trial, start
    spacing = 0.075 * model.reach_m
    for _ in range(REFINEMENTS if np.isfinite(best.missing_m) else 0):
        centre = at
        for axis, side in itertools.product(range(3), (-1.0, 1.0)):
            moved = centre.copy()
            moved[axis] += side * spacing
            trial = _tried(model, wrist_path, placed(moved), upright)
            if trial.key() > best.key():
                best, at = trial, moved
        spacing /= 2.0
    return best


def _anchored(model: RobotModel, wrist_path: _WristPath, middle: Array) -> Iterator[Array]:
    """
    Put configurations in which the wrist moves well at the middle of the path.

    Yields:
        Position of the root link and yaw, (4,), of those from which the path can be followed.

    """
    low, high = model.limits.one_turn
    shares = np.random.default_rng(0).uniform(-0.8, 0.8, (ANCHOR_SAMPLES, model.dof))
    samples = [model.home, *((low + high) / 2.0 + shares * (high - low) / 2.0)]
    samples[1:] = sorted(samples[1:], key=lambda q: -_smallest_singular_value(model, q))
    turn = np.arctan2(wrist_path.forwards[1], wrist_path.forwards[0])
    wrists: list[Array] = []
    for q in samples:
        wrist = model.base.rotation.T @ (model.wrist_pose(q)[0] - np.array(model.base.position))
        near = [np.linalg.norm(wrist - other) < APART * model.reach_m for other in wrists]
        if len(wrists) == ANCHORS or any(near):
            continue
        wrists.append(wrist)
        for yaw in turn + np.linspace(0.0, 2.0 * np.pi, YAWS, endpoint=False):
            base = BasePlacement(yaw=float(yaw))
            place = middle - base.rotation @ wrist
            base = replace(base, position=tuple(place.tolist()))
            if _followed_from(model, q, _seen_from(model, wrist_path, base)):
                yield np.array([*place, yaw])


def _followed_from(model: RobotModel, configuration: Array, points: Array) -> bool:
    """Return whether the path can be followed to both ends from a configuration at its middle."""
    half, wrist = len(points) // 2, _Wrist(model, None)
    for part in (points[half::-1], points[half:]):
        posture = configuration
        for point in part:
            posture, missing = _moved(wrist, posture, point)
            if missing > 1e-3:
                return False
    return True


def _smallest_singular_value(model: RobotModel, configuration: Array) -> float:
    jacobian = model.wrist_jacobian(configuration)[:3]
    return float(np.linalg.svd(jacobian, compute_uv=False)[-1])


def _sideways(model: RobotModel) -> float:
    """Return the largest smallest singular value over many configurations, m per rad."""
    low, high = model.limits.one_turn
    samples = np.random.default_rng(0).uniform(low, high, (ANCHOR_SAMPLES, model.dof))
    return max(_smallest_singular_value(model, q) for q in samples)


def _depth(wrist_path: _WristPath) -> float:
    """Return the deviation of a path from its best plane, m."""
    about_middle = wrist_path.points - wrist_path.points.mean(axis=0)
    normal = np.linalg.svd(about_middle)[2][-1]
    return float(np.abs(about_middle @ normal).max())


def _why_not(best: _Trial, flat: bool) -> str:
    if best.blocked:
        return 'its links come too close to each other'
    return FLAT_REASON if flat else f'one point is {best.missing_m:.3f} m out of reach'


def _wrist_path(path: Array, partner: Array | None) -> _WristPath:
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    if along[-1] > 0.0:
        count = max(SAMPLES, math.ceil(along[-1] / SPACING_M))
        share = np.linspace(0.0, along[-1], count)
        points = np.column_stack([np.interp(share, along, path[:, i]) for i in range(3)])
        at = np.arange(len(path))
        fraction = np.linspace(0.0, len(path) - 1.0, 8 * count)
        rates = np.diff(np.interp(fraction, at, along))
        rate = np.interp(share, np.interp(fraction[1:], at, along), rates)
        speed_weight = np.maximum(rate / rate.max(), MIN_SPEED_WEIGHT)
    else:
        points, speed_weight = path[:1], np.ones(1)
    towards = points[-1] if partner is None else np.asarray(partner, dtype=float)
    ahead = (towards - points[0]) * [1.0, 1.0, 0.0]
    length = float(np.linalg.norm(ahead))
    forwards = ahead / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])
    return _WristPath(points, speed_weight, forwards, np.array([-forwards[1], forwards[0], 0.0]))


def _shoulder(wrist_path: _WristPath, middle: Array, offset: Array) -> Array:
    behind, aside, above = offset
    up = np.array([0.0, 0.0, 1.0])
    return np.asarray(
        middle - behind * wrist_path.forwards + aside * wrist_path.leftwards + above * up
    )


def _distance_cost(wrist_path: _WristPath, shoulder: Array, reach: float) -> float:
    """Rate the distances of the path from a shoulder; a cheap, rough cost."""
    distances = np.linalg.norm(wrist_path.points - shoulder, axis=1) / reach
    far = float(np.maximum(distances - 0.85, 0.0).max())
    near = float(np.maximum(0.45 - distances, 0.0).max())
    level = float(np.linalg.norm((wrist_path.points - shoulder)[:, :2], axis=1).min()) / reach
    missing = max(0.0, BEHIND_START - _behind_start(wrist_path, shoulder))
    return (
        20.0 * far
        + 10.0 * near
        + float(np.mean(np.abs(distances - 0.65)))
        + max(0.0, 0.3 - level)
        + 5.0 * missing
        - _left_bonus(wrist_path, shoulder)
    )


def _left_bonus(wrist_path: _WristPath, shoulder: Array) -> float:
    aside = float((shoulder - wrist_path.points.mean(axis=0)) @ wrist_path.leftwards)
    return LEFT_BONUS * float(np.sign(np.round(aside, 9)))


def _behind_start(wrist_path: _WristPath, shoulder: Array) -> float:
    return float((wrist_path.points[0] - shoulder) @ wrist_path.forwards)


def _placement(
    model: RobotModel, wrist_path: _WristPath, middle: Array, offset: Array
) -> BasePlacement:
    """Put the shoulder there, with the home configuration facing the path."""
    shoulder = _shoulder(wrist_path, middle, offset)
    own = model.base.rotation.T @ (model.shoulder - np.array(model.base.position))
    wrist, _ = model.wrist_pose(model.home)
    home = model.base.rotation.T @ (wrist - np.array(model.base.position))
    looking = middle - shoulder
    if np.linalg.norm(looking[:2]) < 1e-3 * model.reach_m:
        looking = wrist_path.forwards
    home_bearing = np.arctan2(home[1] - own[1], home[0] - own[0])
    yaw = float(np.arctan2(looking[1], looking[0]) - home_bearing)
    yaw = float(np.arctan2(np.sin(yaw), np.cos(yaw)))
    position = shoulder - BasePlacement(yaw=yaw).rotation @ own
    return BasePlacement((float(position[0]), float(position[1]), float(position[2])), yaw)


def _seen_from(model: RobotModel, wrist_path: _WristPath, base: BasePlacement) -> Array:
    """Return the path relative to the present placement: the arm stays, and the path moves."""
    points = (wrist_path.points - np.array(base.position)) @ base.rotation
    return np.asarray(points @ model.base.rotation.T + np.array(model.base.position))


def _tried(
    model: RobotModel, wrist_path: _WristPath, base: BasePlacement, upright: bool
) -> _Trial:
    """Follow the path with the joints from one placement."""
    points = _seen_from(model, wrist_path, base)
    farthest = float(np.linalg.norm(points - model.shoulder, axis=1).max()) - model.reach_m
    if farthest > 0.0:
        return _Trial(-np.inf, base, farthest)
    try:
        posture = model.inverse(points[0])
    except UnreachableError as error:
        return _Trial(-np.inf, base, max(error.missing_m, 1e-9))
    ease, clear = [], np.inf
    wrist = _Wrist(model, posture if upright else None)
    for i, point in enumerate(points):
        posture, missing = _moved(wrist, posture, point)
        if missing > 1e-3:
            return _Trial(-np.inf, base, missing)
        clear = min(clear, CollisionModel.of(model).min_distance(posture))
        direction = points[min(i + 1, len(points) - 1)] - points[max(i - 1, 0)]
        ease.append(_ease(wrist, posture, direction, wrist_path.speed_weight[i]))
    if clear < defaults('priority_ik')['collision_distance'] + HELD_CLEAR_M:
        return _Trial(clear, base, 1e-9, blocked=True)
    own = model.base.rotation.T @ (model.shoulder - np.array(model.base.position))
    shoulder = np.array(base.position) + base.rotation @ own
    short = max(0.0, BEHIND_START - _behind_start(wrist_path, shoulder))
    score = min(ease) + 0.1 * float(np.mean(ease)) - 3.0 * short
    return _Trial(score + _left_bonus(wrist_path, shoulder), base, 0.0)


def _moved(wrist: _Wrist, posture: Array, point: Array) -> tuple[Array, float]:
    """Move the wrist to a nearby point, and the free joints slightly towards home."""
    limits = wrist.model.limits
    error = wrist.error(posture, point)
    for attempt in range(6):
        jacobian = wrist.jacobian(posture)
        back = np.linalg.pinv(jacobian, rcond=0.02)
        step = back @ error
        if attempt == 0:
            home = 0.2 * (wrist.model.home - posture)
            step += home - back @ (jacobian @ home)
        posture = np.clip(posture + step, limits.lower, limits.upper)
        error = wrist.error(posture, point)
        if attempt and error @ error < 1e-8:
            break
    return posture, float(np.linalg.norm(error))


def _ease(wrist: _Wrist, posture: Array, direction: Array, speed_weight: float) -> float:
    """Rate how well the arm moves on from a configuration; 1 is easy."""
    limits = wrist.model.limits
    margin = float(np.minimum(limits.upper - posture, posture - limits.lower).min())
    left, values, right = np.linalg.svd(wrist.jacobian(posture), full_matrices=False)
    length = float(np.linalg.norm(direction))
    speed = EASY_SPEED
    if length > 0.0:
        joints = right.T @ ((left[:3].T @ direction) / (length * np.maximum(values, 1e-3)))
        speed = 1.0 / float((np.abs(joints) / limits.velocity).max())
    return min(
        speed / (EASY_SPEED * speed_weight),
        margin / EASY_MARGIN,
        float(values[-1]) / EASY_MANIPULABILITY,
        1.2,
    )
