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

"""Everything that a run needs: the recorded handover, the learnt movement, the placed arm."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from handover_dmp.common.arrays import Array
from handover_dmp.common.settings import defaults
from handover_dmp.dmp import DecoupledDmp
from handover_dmp.handover.approach import rollout_towards
from handover_dmp.handover.object_profile import DEFAULT_OBJECT, object_profile, ObjectProfile
from handover_dmp.handover.recordings import (
    example_trials,
    read_model,
    recorded_trial,
    scaled,
)
from handover_dmp.handover.teaching import hand_goal, learn_from_trials
from handover_dmp.mocap import condition, HandoverTrial
from handover_dmp.robot.descriptions import ArmChoice
from handover_dmp.robot.errors import UnreachableError
from handover_dmp.robot.model import BasePlacement, RobotModel
from handover_dmp.robot.orientation_task import orthogonal_directions
from handover_dmp.robot.placement import choose_base_placement
import numpy as np

ROLLS = 8
"""Number of rolls tried for a configuration that points at the hand."""


@dataclass(frozen=True)
class Scenario:
    """
    One handover to run.

    Attributes:
        trial: the recorded handover, at 200 Hz; its P1 is the partner, its P2 for comparison.
        model: the learnt movement.
        robot: the arm, placed.
        q_start: (n,), rad, with the wrist at the start of P2's.
        seed: random seed.
        partner_model: how `dmp` expects the hand to move on; its parameter of that name.
        carried: the carried object; the movement is adapted to it.

    """

    trial: HandoverTrial
    model: DecoupledDmp
    robot: RobotModel
    q_start: Array
    seed: int
    partner_model: str = field(default_factory=lambda: defaults('dmp')['partner_model'])
    carried: ObjectProfile = field(default_factory=lambda: object_profile(DEFAULT_OBJECT))

    @property
    def orientation(self) -> str:
        """Orientation task of the wrist."""
        return self.carried.task_for(self.model)


def make_scenario(
    trial: Path | None = None,
    *,
    model: Path | None = None,
    arm: ArmChoice | None = None,
    base: BasePlacement | None = None,
    scale: float = 1.0,
    seed: int = 0,
    partner_model: str | None = None,
    span_s: tuple[float, float] | None = None,
    carried: ObjectProfile | None = None,
) -> Scenario:
    """
    Assemble a scenario.

    The movement is learnt from the replayed trial, unless a model is given; the movement of the
    example is learnt from another trial. The base is placed so that the path of the wrist is well
    inside the reach.

    Args:
        trial: CSV file or bag; by default the example.
        model: file of a learnt movement.
        arm: the arm; the LWR 4+ if left out.
        base: base placement; found if left out.
        scale: scale of the recorded motion.
        seed: seed of the synthetic data.
        partner_model: `auto` or `off`; that of `config/` if left out.
        span_s: beginning and end of the handover in a bag, s; detected if left out.
        carried: the carried object; a rod if left out.

    Returns:
        The scenario.

    Raises:
        DataError: a file cannot be used.
        UnreachableError: the arm cannot reach the path from any placement.

    """
    if trial is None:
        taught, replayed = (scaled(example, scale) for example in example_trials(seed))
    else:
        taught = replayed = scaled(recorded_trial(trial, cutoff_hz=0.0, span_s=span_s), scale)
    carried = carried or object_profile(DEFAULT_OBJECT)
    learnt = carried.movement_with(
        learn_from_trials([taught]) if model is None else read_model(model)
    )
    replayed = condition(replayed, cutoff_hz=defaults('hand_tracker')['cutoff_hz'])
    wrist_path, task = expected_path(learnt, replayed), carried.task_for(learnt)
    robot, q_start = placed_arm(arm, base, wrist_path, task, replayed.partner[-1])
    return Scenario(
        trial=replayed,
        model=learnt,
        robot=robot,
        q_start=q_start,
        seed=seed,
        partner_model=partner_model or defaults('dmp')['partner_model'],
        carried=carried,
    )


def placed_arm(
    choice: ArmChoice | None,
    base: BasePlacement | None,
    wrist_path: Array,
    task: str,
    hand: Array,
) -> tuple[RobotModel, Array]:
    """
    Load the arm, place it, and choose its start configuration.

    Args:
        choice: the arm; the LWR 4+ if left out.
        base: base placement; found if left out.
        wrist_path: (m, 3), m, expected path of the wrist.
        task: orientation task of the wrist.
        hand: (3,), m, future position of the partner's hand, at which a pointing wrist aims from
            the start.

    Returns:
        The arm and its configuration, (n,), rad.

    Raises:
        UnreachableError: the arm cannot reach the path from any placement.

    """
    choice = choice or ArmChoice('lwr4')
    robot = RobotModel.load(
        choice.robot, wrist_frame=choice.wrist_frame, base_frame=choice.base_frame
    )
    if base is None:
        base = choose_base_placement(wrist_path, robot, partner=hand, upright=task == 'upright')
    robot = robot.placed(base)
    return robot, _starting_joints(robot, wrist_path[0], task, hand)


def _starting_joints(robot: RobotModel, place: Array, task: str, hand: Array) -> Array:
    """Return, of the configurations that point at the hand, the one nearest to home, (n,) rad."""
    found: list[Array] = []
    if task == 'point':
        aim = (hand - place) / np.linalg.norm(hand - place)
        first, second = orthogonal_directions(aim)
        for roll in np.arange(ROLLS) * 2.0 * np.pi / ROLLS:
            side = np.cos(roll) * first + np.sin(roll) * second
            with suppress(UnreachableError):
                turned = np.column_stack([side, np.cross(aim, side), aim])
                found.append(robot.inverse(place, turned))
    if not found:
        return robot.inverse(place)
    return min(found, key=lambda q: float(np.linalg.norm(q - robot.home)))


def expected_path(model: DecoupledDmp, trial: HandoverTrial, start: Array | None = None) -> Array:
    """
    Predict the path of the wrist for a recorded hand.

    Args:
        model: the learnt movement.
        trial: the handover.
        start: (3,), m, position of the wrist at the beginning; that of P2's if left out.

    Returns:
        (n, 3), m, from there to the end of the movement.

    """
    goals, velocities = hand_goal(trial, model)
    start = trial.demonstrator[0] if start is None else start
    wrist_path, _ = rollout_towards(model, trial.times, goals, velocities, start)
    # a slow object is still moving when the recorded reach is over
    return np.vstack([wrist_path, trial.partner[-1] + model.goal_offset])
