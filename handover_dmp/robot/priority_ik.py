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
Joint velocities for a wrist command, by strict priorities that no lower task can disturb.

Over the joint velocities q̇ and the speed scale s, in this order:

1. limits: the box of `limits.VelocityBox`, 0 ≤ s ≤ 1, and the half-spaces of separation and
   collision;
2. the wrist's direction: J_p q̇ = s·v;
3. its speed: s = 1;
4. orientation: full, one axis, or none;
5. posture: towards home, away from the position limits and with the elbow away from the partner.

Each level is solved in the least-squares sense without giving up anything of those above it, by
the hierarchical solver of daqp (Arnström and Axehill).
"""

from __future__ import annotations

from dataclasses import dataclass, field
import math
from typing import NamedTuple

import daqp
from handover_dmp.common.errors import UsageError
from handover_dmp.common.settings import setting
from handover_dmp.robot.collision import ClosingSpeed, CollisionModel, NearPair
from handover_dmp.robot.limits import VelocityBox
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.separation import Partner, SpeedSeparation
from handover_dmp.robot.singularity import limit_outward_speed, singular_slope, smallest_singular
from handover_dmp.robot.tasks import axis_alignment, full_orientation, PostureTask, UP
import numpy as np
from numpy.typing import NDArray
import pinocchio as pin

Array = NDArray[np.float64]

ORIENTATIONS = ('none', 'full', 'level', 'point')
UNBOUNDED = 1e30
"""What daqp takes for infinity."""
SOFTNESS = 1e-7
"""Inverse weight of a missed task in daqp; smaller is nearer to strict priorities."""
IDLE_ROW = 1e-5
"""Rows whose entries are all smaller than this are taken for zero."""
TOUCHING = 1e-7
"""A bound this near counts as active, rad/s."""


@dataclass(frozen=True)
class IkOptions:
    """
    How the inverse kinematics weighs its tasks; the defaults stand in `config/handover.yaml`.

    Attributes:
        position_gain: wrist speed for its position error, 1/s.
        feedback_deceleration: m/s²; the error is worked off no faster than can be slowed by this.
        orientation: `none`, `full` (the target's rotation), `level` (what is up in the home
            posture stays up) or `point` (the wrist's z axis points at the partner's hand).
        orientation_gain: angular speed for the orientation error, 1/s.
        orientation_speed: what that gain may ask for, rad/s.
        posture_gain: joint speed for the distance to the home posture, 1/s.
        limit_margin: rad before a position limit from where the posture task pushes away.
        elbow_distance: m to the partner within which the posture task moves the elbow away.
        elbow_gain: elbow speed for what is missing of that distance, 1/s.
        braking_share: β of `VelocityBox`.
        singularity_activation: smallest singular value below which outward speed is limited, m.
        singularity_min: smallest singular value at which the arm rests at the end of its reach, m.
        singularity_rate: how fast it gets there, 1/s.
        separation: whether speed and separation bound the wrist.
        separation_distance: m to the hand within which `separation_speed` holds.
        separation_speed: m/s relative to the hand.
        separation_deceleration: m/s², with which the wrist slows on its way there.
        self_collision: whether the links keep apart from each other.
        forearm_collision: whether they keep apart from the partner's forearm, where its elbow is
            known.
        collision_distance: m that is always kept.
        collision_activation: m to the forearm below which a link is bounded; links among each
            other are bounded wherever they could be too fast.
        collision_deceleration: m/s², with which two links slow on their way to each other.

    """

    position_gain: float = setting('priority_ik', 'position_gain')
    feedback_deceleration: float = setting('priority_ik', 'feedback_deceleration')
    orientation: str = setting('priority_ik', 'orientation')
    orientation_gain: float = setting('priority_ik', 'orientation_gain')
    orientation_speed: float = setting('priority_ik', 'orientation_speed')
    posture_gain: float = setting('priority_ik', 'posture_gain')
    limit_margin: float = setting('priority_ik', 'limit_margin')
    elbow_distance: float = setting('priority_ik', 'elbow_distance')
    elbow_gain: float = setting('priority_ik', 'elbow_gain')
    braking_share: float = setting('priority_ik', 'braking_share')
    singularity_activation: float = setting('priority_ik', 'singularity_activation')
    singularity_min: float = setting('priority_ik', 'singularity_min')
    singularity_rate: float = setting('priority_ik', 'singularity_rate')
    separation: bool = setting('priority_ik', 'separation')
    separation_distance: float = setting('priority_ik', 'separation_distance')
    separation_speed: float = setting('priority_ik', 'separation_speed')
    separation_deceleration: float = setting('priority_ik', 'separation_deceleration')
    self_collision: bool = setting('priority_ik', 'self_collision')
    forearm_collision: bool = setting('priority_ik', 'forearm_collision')
    collision_distance: float = setting('priority_ik', 'collision_distance')
    collision_activation: float = setting('priority_ik', 'collision_activation')
    collision_deceleration: float = setting('priority_ik', 'collision_deceleration')

    def __post_init__(self) -> None:
        if self.orientation not in ORIENTATIONS:
            raise UsageError(
                f'orientation {self.orientation!r} is none of {", ".join(ORIENTATIONS)}'
            )


@dataclass(frozen=True, eq=False)
class WristTarget:
    """
    Where the wrist shall be now, and how fast it shall move.

    Attributes:
        position: (3,), m, in `world`.
        velocity: (3,), m/s.
        rotation: (3, 3), of the wrist in `world`; None if any will do.
        angular_velocity: (3,), rad/s, in `world`; None for zero.

    """

    position: Array
    velocity: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array | None = None
    angular_velocity: Array | None = None


class IkSolution(NamedTuple):
    """
    The answer for one period.

    Attributes:
        joint_velocity: (n,), rad/s.
        speed_scale: s, from 0 to 1: how much of the speed asked for is possible.
        active_limits: what holds the arm back, e.g. `joint_3 velocity`, `joint_4 position`,
            `stretch`, `approach`, `lwr4_link_1 to lwr4_wrist`.
        residuals: what is missing in each level: `limits` (always 0 unless the arm started
            outside of its limits), `position` m/s, `speed` (1 − s), `orientation` rad/s,
            `posture` rad/s.
        smallest_singular_value: of the Jacobian of the wrist's position, m.
        solved: whether the solver found it; otherwise the arm brakes.

    """

    joint_velocity: Array
    speed_scale: float
    active_limits: tuple[str, ...]
    residuals: dict[str, float]
    smallest_singular_value: float
    solved: bool = True


class _Problem:
    """The arrays of the hierarchical problem of one size; what never changes is filled in."""

    def __init__(self, dof: int, extra: int, orientation: int) -> None:
        rows = extra + 4 + orientation + dof
        first = dof + 1
        self.matrix = np.zeros((rows, dof + 1))
        self.upper = np.zeros(first + rows)
        self.lower = np.zeros(first + rows)
        self.sense = np.zeros(first + rows, dtype=np.intc)
        self.upper[dof] = 1.0
        self.upper[first: first + extra] = UNBOUNDED  # fmt: skip
        self.extra = slice(0, extra)
        self.position = slice(extra, extra + 3)
        self.speed = extra + 3
        self.orientation = slice(extra + 4, extra + 4 + orientation)
        self.posture = slice(extra + 4 + orientation, rows)
        self.matrix[self.speed, dof] = 1.0
        self.matrix[self.posture, :dof] = np.eye(dof)
        self.upper[first + self.speed] = self.lower[first + self.speed] = 1.0
        ends = [first + extra, first + extra + 3, first + extra + 4]
        ends += [ends[-1] + orientation] if orientation else []
        levels = np.array([*ends, first + rows], dtype=np.intc)
        # a cost of |x|² only decides what all levels leave open
        self._solver = daqp.Model()
        self._solver.setup(
            np.eye(first), np.zeros(first), self.matrix, self.upper, self.lower, self.sense, levels
        )
        # without weights of its own each row would count in proportion to 1/|row|
        softness = np.full(first + rows, SOFTNESS)
        self._solver.soft_weights(softness, softness)

    def solve(self) -> tuple[Array, bool]:
        """Give (q̇, s) and whether they solve it, always from a cold start: without state."""
        solution, solved = self._solution()
        if solved:
            return solution, True
        # a task that no joint can serve, as with an arm stretched straight, is called infeasible
        first = self.matrix.shape[1]
        idle = first + np.flatnonzero(np.abs(self.matrix).max(axis=1) < IDLE_ROW)
        self.lower[idle] = np.minimum(self.lower[idle], 0.0)
        self.upper[idle] = np.maximum(self.upper[idle], 0.0)
        return self._solution()

    def _solution(self) -> tuple[Array, bool]:
        changed = self._solver.update(
            A=self.matrix, bupper=self.upper, blower=self.lower, sense=self.sense
        )
        if changed < 0:
            return np.zeros(self.matrix.shape[1]), False
        solution, _, flag, _ = self._solver.solve()
        return solution, flag > 0 and math.isfinite(solution.dot(solution))


class PriorityIk:
    """
    Priority inverse kinematics of one arm.

    It holds no state but scratch arrays: the answer depends on the arguments alone.
    """

    def __init__(
        self,
        model: RobotModel,
        options: IkOptions | None = None,
        *,
        collision_model: CollisionModel | None = None,
    ) -> None:
        """
        Take the arm.

        Args:
            model: the arm.
            options: see there; the defaults if left out.
            collision_model: of this arm, if there is one; else it is made when it is needed,
                which takes longer than some periods.

        """
        self.model = model
        self.options = options or IkOptions()
        self._box = VelocityBox(model.limits, self.options.braking_share)
        self._no_rows, self._no_bounds = np.empty((0, model.dof)), np.empty(0)
        self._problems: dict[tuple[int, int], _Problem] = {}
        _, home_rotation = model.wrist_pose(model.home)
        self._level_axis = home_rotation.T @ UP
        self._posture_speed = 0.5 * model.limits.velocity
        self._posture = PostureTask(
            model.home,
            model.limits,
            self._posture_speed,
            self.options.posture_gain,
            self.options.limit_margin,
        )
        self._limit_names = [
            tuple(f'{joint} {limit}' for limit in ('acceleration', 'velocity', 'position'))
            for joint in model.joint_names
        ]
        self._fastest = model.limits.velocity.tolist()
        self._hardest = model.limits.acceleration.tolist()
        self._elbow = _elbow(model)
        self._separation = SpeedSeparation(
            self.options.separation_distance,
            self.options.separation_speed,
            self.options.separation_deceleration,
        )
        self._closing = _closing_speed(
            self.options.collision_distance, self.options.collision_deceleration
        )
        self.collision_model = collision_model
        if self.options.self_collision:
            self._collisions()

    def solve(
        self,
        joint_positions: Array,
        previous_velocity: Array,
        target: WristTarget,
        dt: float,
        *,
        hand: object = None,
    ) -> IkSolution:
        """
        Find the joint velocities for the next period.

        Args:
            joint_positions: (n,), rad.
            previous_velocity: (n,), rad/s, of the period that ends now (the last command).
            target: where the wrist shall be, and how fast it shall move.
            dt: length of the next period, s.
            hand: what is known of the partner, see `Partner.of`.

        Returns:
            The velocities, and what held them back.

        """
        options, model, dof = self.options, self.model, self.model.dof
        pinocchio_model, data = model.pinocchio_model, model.pinocchio_data
        world_jacobian = pin.computeJointJacobians(pinocchio_model, data, joint_positions)
        pose = pin.updateFramePlacement(pinocchio_model, data, model.wrist_frame_id)
        jacobian = pin.getFrameJacobian(
            pinocchio_model, data, model.wrist_frame_id, pin.LOCAL_WORLD_ALIGNED
        )
        linear, angular = jacobian[:3], jacobian[3:]
        position, rotation = pose.translation, pose.rotation
        partner = None if hand is None else Partner.of(hand)
        lower, upper = self._box.bounds(joint_positions, previous_velocity, dt)

        velocity = target.velocity + self._feedback(target.position - position)
        singular_value, direction = smallest_singular(linear)
        stretched = False
        if singular_value < options.singularity_activation:
            slope = singular_slope(model, joint_positions, linear, direction)
            velocity, stretched = limit_outward_speed(
                velocity,
                direction,
                singular_value,
                slope,
                options.singularity_min,
                options.singularity_rate,
            )
        names, rows, bounds = self._half_spaces(
            world_jacobian,
            linear,
            position,
            velocity,
            partner,
            (lower, upper),
            dt,
        )
        turning, turning_speed = self._orientation(position, rotation, angular, target, partner)
        posture = self._posture.velocity(joint_positions)
        if partner is not None:
            posture += self._elbow_away(world_jacobian, partner)

        key = (len(names), len(turning_speed))
        problem = self._problems.get(key)
        if problem is None:
            problem = self._problems[key] = _Problem(dof, *key)
        matrix, low, high = problem.matrix, problem.lower, problem.upper
        low[:dof], high[:dof] = lower, upper
        matrix[problem.position, :dof] = linear
        matrix[problem.position, dof] = -velocity
        low[-dof:] = high[-dof:] = posture
        if key[1]:
            matrix[problem.orientation, :dof] = turning
            tasks = slice(-dof - key[1], -dof)
            low[tasks] = high[tasks] = turning_speed
        if key[0]:
            # braking as hard as possible is always allowed, so that level 1 always has a solution
            braking = np.minimum(np.maximum(lower, 0.0), upper)
            bounds = np.minimum(bounds, rows @ braking - TOUCHING)
            matrix[problem.extra, :dof] = rows
            low[dof + 1: dof + 1 + key[0]] = bounds  # fmt: skip
        solution, solved = problem.solve()
        joint_velocity = np.minimum(np.maximum(solution[:dof], lower), upper)
        scale = max(float(solution[dof]), 0.0)
        if scale > 1.0 - 10.0 * SOFTNESS:
            scale = 1.0  # what is missing is the solver's
        if not solved:
            joint_velocity = np.minimum(np.maximum(lower, 0.0), upper)
            scale = 0.0

        active = self._active(joint_velocity, previous_velocity, lower, upper, dt)
        if stretched:
            active.append('stretch')
        broken = 0.0
        if key[0]:
            slack = rows @ joint_velocity - bounds
            active += [name for name, room in zip(names, slack, strict=True) if room < TOUCHING]
            broken = max(0.0, -float(slack.min()))
        miss = linear.dot(joint_velocity) - scale * velocity
        residuals = {'limits': broken, 'position': _norm(miss), 'speed': 1.0 - scale}
        residuals['orientation'] = (
            _norm(turning @ joint_velocity - turning_speed) if key[1] else 0.0
        )
        residuals['posture'] = _norm(joint_velocity - posture)
        return IkSolution(joint_velocity, scale, tuple(active), residuals, singular_value, solved)

    def brake(self, joint_positions: Array, velocity: Array, dt: float) -> Array:
        """
        Slow down as fast as the limits allow.

        Args:
            joint_positions: (n,), rad.
            velocity: (n,), rad/s, of the period that ends now.
            dt: length of the next period, s.

        Returns:
            Joint velocities for it, (n,), rad/s; zero in the end.

        """
        return self._box.brake(joint_positions, velocity, dt)

    def _feedback(self, error: Array) -> Array:
        """Give the speed towards the target: proportional, or less if it is far away."""
        distance = _norm(error)
        if distance < 1e-12:
            return np.zeros(3)
        gentle = math.sqrt(2.0 * self.options.feedback_deceleration / distance)
        return error * min(self.options.position_gain, gentle)

    def _orientation(
        self,
        position: Array,
        rotation: Array,
        angular: Array,
        target: WristTarget,
        partner: Partner | None,
    ) -> tuple[Array, Array]:
        """Give the rows (m, n) of level 4 and what they shall be equal to, (m,), rad/s."""
        options = self.options
        gain, fastest = options.orientation_gain, options.orientation_speed
        if options.orientation == 'full' and target.rotation is not None:
            turn = target.angular_velocity
            speed = full_orientation(
                rotation, target.rotation, np.zeros(3) if turn is None else turn, gain, fastest
            )
            return angular, speed
        if options.orientation == 'level':
            axis, wanted = rotation @ self._level_axis, UP
        elif options.orientation == 'point' and partner is not None:
            apart = partner.position - position
            distance = _norm(apart)
            if distance < 1e-3:
                return self._no_rows, self._no_bounds
            # close to the hand its direction swings wildly: turn no faster than it deserves
            axis, wanted = rotation[:, 2], apart / distance
            gain *= min(1.0, distance / 0.1)
        else:
            return self._no_rows, self._no_bounds
        directions, speed = axis_alignment(axis, wanted, gain, fastest)
        return directions @ angular, speed

    def _half_spaces(
        self,
        world_jacobian: Array,
        linear: Array,
        position: Array,
        velocity: Array,
        partner: Partner | None,
        box: tuple[Array, Array],
        dt: float,
    ) -> tuple[list[str], Array, Array]:
        """Give names, rows (k, n) and bounds (k,) of level 1: rows q̇ ≥ bounds."""
        options = self.options
        names: list[str] = []
        rows: list[Array] = []
        bounds: list[float] = []
        if options.separation:
            # a hand that is not known may be at the wrist itself
            worst_case_partner = partner or Partner(position, np.zeros(3))
            directions, maximum = self._separation.rows(position, velocity, worst_case_partner, dt)
            names += ['approach', 'speed near hand'][: len(maximum)]
            rows += list(-directions @ linear)
            bounds += list(-maximum)
        near: list[NearPair] = []
        if options.self_collision:
            fastest = np.maximum(box[1], -box[0])
            near += self._collisions().near_pairs(world_jacobian, self._closing, fastest)
        if options.forearm_collision and partner is not None and partner.elbow is not None:
            near += self._collisions().near_forearm(
                world_jacobian,
                partner.position,
                partner.elbow,
                partner.velocity,
                options.collision_activation,
            )
        for pair in near:
            names.append(pair.name)
            rows.append(pair.row)
            bounds.append(min(-self._closing(pair.distance) - pair.drift, 0.0))
        if not names:
            return names, self._no_rows, self._no_bounds
        return names, np.array(rows), np.array(bounds)

    def _collisions(self) -> CollisionModel:
        if self.collision_model is None:
            self.collision_model = CollisionModel(self.model)
        return self.collision_model

    def _elbow_away(self, world_jacobian: Array, partner: Partner) -> Array:
        """Give joint velocities that move the elbow away from the partner, if it is near."""
        elbow = self.model.pinocchio_data.oMi[self._elbow].translation
        apart = elbow - _nearest_on_forearm(elbow, partner)
        distance = _norm(apart)
        missing = self.options.elbow_distance - distance
        if missing <= 0.0 or distance < 1e-6:
            return np.zeros(self.model.dof)
        x, y, z = elbow
        a, b, c = apart / distance
        turning = np.array([a, b, c, y * c - z * b, z * a - x * c, x * b - y * a])
        row = turning @ world_jacobian
        row[self._elbow:] = 0.0  # fmt: skip
        square = float(row @ row)
        if square < 1e-4:
            return np.zeros(self.model.dof)
        away: Array = row * (self.options.elbow_gain * missing / square)
        return np.minimum(np.maximum(away, -self._posture_speed), self._posture_speed)

    def _active(
        self, velocity: Array, previous: Array, lower: Array, upper: Array, dt: float
    ) -> list[str]:
        names: list[str] = []
        limits = zip(
            self._limit_names,
            velocity.tolist(),
            previous.tolist(),
            lower.tolist(),
            upper.tolist(),
            self._fastest,
            self._hardest,
            strict=True,
        )
        for joint, speed, before, low, high, fastest, hardest in limits:
            if low + TOUCHING < speed < high - TOUCHING:
                continue
            if abs(speed - before) >= hardest * dt - TOUCHING:
                names.append(joint[0])
            elif abs(speed) >= fastest - TOUCHING:
                names.append(joint[1])
            else:
                names.append(joint[2])
        return names


def _closing_speed(kept: float, deceleration: float) -> ClosingSpeed:
    """Say how fast bodies may close in at a distance, so that braking keeps them apart."""
    twice = 2.0 * deceleration

    def allowed(distance: float) -> float:
        room = distance - kept
        return math.sqrt(twice * room) if room > 0.0 else 0.0

    return allowed


def _elbow(model: RobotModel) -> int:
    """Find the joint that stands out most from the line from shoulder to wrist, at home."""
    wrist, _ = model.wrist_pose(model.home)
    line = wrist - model.shoulder
    line /= max(_norm(line), 1e-9)
    joints = range(1, model.dof + 1)
    apart = [model.pinocchio_data.oMi[joint].translation - model.shoulder for joint in joints]
    return 1 + int(np.argmax([_norm(a - (a @ line) * line) for a in apart]))


def _nearest_on_forearm(point: Array, partner: Partner) -> Array:
    if partner.elbow is None:
        return partner.position
    axis = partner.elbow - partner.position
    share = float((point - partner.position) @ axis) / max(float(axis @ axis), 1e-12)
    nearest: Array = partner.position + min(max(share, 0.0), 1.0) * axis
    return nearest


def _norm(vector: Array) -> float:
    return math.sqrt(vector.dot(vector))  # `@` takes twice as long on a few numbers
