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

"""Which limits slowed an arm, when, and the acceleration that the movement demanded."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from handover_dmp.common.arrays import Array
from handover_dmp.handover.lockstep import Period
from handover_dmp.robot.model import RobotModel
import numpy as np

KINDS = ('acceleration', 'velocity', 'position')
"""Kinds of joint limits."""
START_S = 0.05
"""Length of the start of a movement, s."""


@dataclass(frozen=True)
class ReachLimits:
    """
    The limits that slowed an arm in one reach, or on average in the reaches of a case.

    Attributes:
        joints: by joint, share of the reach in which it was at a limit; joints that never were
            are left out.
        kinds: share in which any joint was at a limit of its acceleration, velocity, position.
        any_joint: share in which any joint was at any limit.
        half_by: fraction of the reach at which half of that time had passed; NaN if there was
            none.
        slowed_s: delay of the phase because the arm could not keep up, s.
        asked: greatest acceleration of the primitive in its first 50 ms, m/s².
        possible: greatest acceleration of the arm from rest in that direction, within the limits
            of its joints, m/s².

    """

    joints: dict[str, float]
    kinds: dict[str, float]
    any_joint: float
    half_by: float
    slowed_s: float
    asked: float
    possible: float


def reach_limits(
    periods: Sequence[Period], robot: RobotModel, period_s: float, primitive: Array
) -> ReachLimits:
    """
    Find the limits that slowed an arm in one reach.

    Args:
        periods: periods of the reach.
        robot: the arm.
        period_s: length of a period, s.
        primitive: (n, 3) m, rollout of the primitive alone at these times.

    Returns:
        The shares, and the acceleration that the start demanded.

    """
    joints: Counter[str] = Counter()
    kinds: Counter[str] = Counter()
    held = []
    slowed_s = 0.0
    names = set(robot.joint_names)
    for number, period in enumerate(periods):
        slowed_s += (1.0 - period.answer.speed_scale) * period_s
        solution = period.answer.solution
        active = [one.split(' ') for one in (() if solution is None else solution.active_limits)]
        of_joints = [one for one in active if one[0] in names]
        joints.update({one[0] for one in of_joints})
        kinds.update({one[-1] for one in of_joints})
        if of_joints:
            held.append(number)
    count = len(periods)
    accelerations = np.diff(primitive, 2, axis=0)[: round(START_S / period_s)] / period_s**2
    sizes = np.linalg.norm(accelerations, axis=1)
    strongest = int(sizes.argmax())
    return ReachLimits(
        joints={name: joints[name] / count for name in robot.joint_names if joints[name]},
        kinds={kind: kinds[kind] / count for kind in KINDS},
        any_joint=len(held) / count,
        half_by=float(np.median(held)) / count if held else float('nan'),
        slowed_s=slowed_s,
        asked=float(sizes[strongest]),
        possible=possible_acceleration(
            robot, periods[0].joint_positions, accelerations[strongest]
        ),
    )


def possible_acceleration(robot: RobotModel, joint_positions: Array, direction: Array) -> float:
    """
    Find the greatest acceleration of the wrist of an arm at rest.

    It is the greatest a with J q̈ = a·d and |q̈| within the joint limits, a linear programme.

    Args:
        robot: the arm.
        joint_positions: (n,) rad.
        direction: (3,), of any length but 0.

    Returns:
        The acceleration, m/s²; infinite if no joint has a limit.

    """
    from scipy.optimize import linprog

    limits = robot.limits.acceleration
    if not np.isfinite(limits).any():
        return inf
    jacobian = robot.wrist_jacobian(joint_positions)[:3]
    towards = direction / np.linalg.norm(direction)
    found = linprog(
        [*np.zeros(robot.dof), -1.0],
        A_eq=np.column_stack([jacobian, -towards]),
        b_eq=np.zeros(3),
        bounds=[*((-limit, limit) for limit in limits.tolist()), (0.0, None)],
    )
    return -float(found.fun)


def mean_limits(reaches: Sequence[ReachLimits]) -> ReachLimits:
    """
    Average over the reaches of a case.

    Args:
        reaches: one or more.

    Returns:
        The means; for `half_by` and the accelerations, the medians.

    """
    names = dict.fromkeys(name for one in reaches for name in one.joints)
    halves = [one.half_by for one in reaches if one.half_by == one.half_by]
    return ReachLimits(
        joints={
            name: float(np.mean([one.joints.get(name, 0.0) for one in reaches])) for name in names
        },
        kinds={kind: float(np.mean([one.kinds[kind] for one in reaches])) for kind in KINDS},
        any_joint=float(np.mean([one.any_joint for one in reaches])),
        half_by=float(np.median(halves)) if halves else float('nan'),
        slowed_s=float(np.mean([one.slowed_s for one in reaches])),
        asked=float(np.median([one.asked for one in reaches])),
        possible=float(np.median([one.possible for one in reaches])),
    )
