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

"""The scores of a simulated arm, and where it is worse than the primitive alone."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import lru_cache, reduce
from math import isfinite, isinf, isnan, sqrt
from operator import add
from pathlib import Path
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.dmp import DecoupledDmp
from handover_dmp.evaluation.arm_limits import mean_limits, reach_limits, ReachLimits
from handover_dmp.evaluation.cases import Case
from handover_dmp.evaluation.motions import measure_beside, MotionBeside
from handover_dmp.evaluation.protocol import band_of, CaseScores, Evaluation, Progress, Protocol
from handover_dmp.evaluation.rollouts import (
    learn_from_case,
    moved_from,
    plan,
    roll_out,
    RolloutTask,
    sources_of,
)
from handover_dmp.evaluation.scores import judge, Scores
from handover_dmp.handover.lockstep import Handover, REPLAY_AT_S
from handover_dmp.handover.scenario import expected_path, Scenario
from handover_dmp.mocap.filtering import smooth, velocities
from handover_dmp.mocap.typical import nearest_to_mean, time_normalise
from handover_dmp.robot.descriptions import ArmChoice
from handover_dmp.robot.errors import UnreachableError
from handover_dmp.robot.model import BasePlacement, RobotModel
from handover_dmp.robot.placement import choose_base_placement
from joblib import delayed, Memory, Parallel
import numpy as np


@dataclass(frozen=True)
class ArmReach:
    """
    The arm's motion in one trial.

    Attributes:
        curve: (101, 3) m, the measured wrist, time-normalised.
        limits: the limits that slowed the arm.
        motion: measures of the motion.

    """

    curve: Array
    limits: ReachLimits
    motion: MotionBeside


@dataclass(frozen=True)
class ArmCase:
    """
    One case with the arm.

    Attributes:
        case: the trials.
        primitive: scores of the primitive alone, in the trials that the arm reaches.
        arm: scores of the arm in the same trials.
        apart_m: root-mean-square distance between the two, m.
        limits: the limits that slowed the arm; None if it reached the start of no trial.
        start_speed: median speed of P2 at the start of the recordings, m/s; the arm starts at
            rest.
        unreached: numbers of the trials whose start the arm does not reach.
        motions: measures of the motion, by number of each other trial.

    """

    case: Case
    primitive: Scores
    arm: Scores
    apart_m: float
    limits: ReachLimits | None
    start_speed: float
    unreached: tuple[int, ...]
    motions: dict[int, MotionBeside]

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain types."""
        held = self.limits
        return {
            'configuration': self.case.configuration,
            'exchange': self.case.direction,
            'primitive': figures(self.primitive),
            'arm': figures(self.arm),
            'apart_m': self.apart_m if isfinite(self.apart_m) else None,
            'limited': {} if held is None else held.joints,
            'any_limited': 0.0 if held is None else held.any_joint,
            'limits': {} if held is None else held.kinds,
            'limited_by': None if held is None or isnan(held.half_by) else held.half_by,
            'slowed_s': None if held is None else held.slowed_s,
            'acceleration_asked': None if held is None else held.asked,
            'acceleration_possible': (
                None if held is None or isinf(held.possible) else held.possible
            ),
            'start_speed': self.start_speed,
            'unreached': list(self.unreached),
            'measures': [
                {'trial': number, **motion.as_json()} for number, motion in self.motions.items()
            ],
        }


@dataclass(frozen=True)
class ArmEvaluation:
    """
    All cases with the arm.

    Attributes:
        arm: name or description of the arm.
        learn: source of the movement, one of `LEARN`.
        cases: cases for which the arm can be placed.
        refused: configuration, exchange and reason of the other cases.

    """

    arm: str
    learn: str
    cases: list[ArmCase]
    refused: list[tuple[str, str, str]]

    @property
    def motions(self) -> dict[tuple[str, str, int], MotionBeside]:
        """Return the measures of each motion by configuration, direction and number."""
        return {
            (*one.case.key, number): motion
            for one in self.cases
            for number, motion in one.motions.items()
        }

    def total(self) -> dict[str, Any]:
        """Summarise all cases, in plain types; all trials that the arm reaches weigh the same."""
        reached = [(int(one.arm.counted.sum()), one) for one in self.cases if one.limits]
        trials = sum(number for number, _ in reached)
        held = sum(number * one.limits.any_joint for number, one in reached if one.limits)
        apart = sum(number * one.apart_m**2 for number, one in reached)
        return {
            'trials': trials,
            'primitive': figures(*(one.primitive for one in self.cases)),
            'arm': figures(*(one.arm for one in self.cases)),
            'apart_m': sqrt(apart / trials) if trials and isfinite(apart) else None,
            'any_limited': held / trials if trials else 0.0,
        }

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain types."""
        return {
            'arm': self.arm,
            'learn': self.learn,
            'cases': [case.as_json() for case in self.cases],
            'all': self.total(),
            'refused': [
                {'configuration': configuration, 'exchange': direction, 'reason': reason}
                for configuration, direction, reason in self.refused
            ],
        }


def figures(*scores: Scores) -> dict[str, Any]:
    """
    Summarise scores.

    Args:
        scores: scores of one or several cases, with the best shift in time of each rollout.

    Returns:
        Percentages within 1σ, 2σ and 3σ; distance, final gap and distance after the best shift,
        m; that shift, s.

    """
    counted = [one for one in scores if one.counted.any()]
    if not counted:
        return dict.fromkeys(
            ('within', 'rms_m', 'final_gap_m', 'shifted_rms_m', 'lateness_s'),
        )
    totals = (one.totals(np.ones((1, one.counted.shape[1]))) for one in counted)
    return reduce(add, totals).as_json()


def evaluate_arm(
    evaluation: Evaluation,
    choice: ArmChoice,
    cache: Path,
    *,
    jobs: int = 1,
    progress: Progress | None = None,
) -> ArmEvaluation:
    """
    Run the trials of an evaluation on a simulated arm.

    The simulation runs in lockstep and contains everything that the graph has: controller,
    approach rule, tracker, inverse kinematics with the arm's limits, simulated joints. The arm is
    placed once per case, for the trial nearest to the mean.

    Args:
        evaluation: evaluation of the primitive alone.
        choice: the arm.
        cache: folder for finished trials; an interrupted evaluation resumes from it.
        jobs: number of processes; −1 for one per processor. `joblib.parallel_config` selects
            another backend.
        progress: called with the number of finished trials and of all trials.

    Returns:
        The results by case. The movement is learnt from the mean if that was evaluated, otherwise
        from the first source.

    Raises:
        DataError: the arm is missing or not an arm.

    """
    protocol = evaluation.protocol
    learn = moved_from(protocol.learn)
    memory = Memory(cache, verbose=0)
    together = Parallel(n_jobs=jobs, return_as='generator')
    placed = together(
        delayed(memory.cache(place))(judged.case, choice, protocol) for judged in evaluation.cases
    )
    units: list[tuple[CaseScores, RolloutTask, int, BasePlacement]] = []
    refused = []
    for judged, base in zip(evaluation.cases, placed, strict=True):
        case = judged.case
        if isinstance(base, str):
            refused.append((*case.key, base))
            continue
        for task in plan(case, learn, leave_one_out=protocol.leave_one_out):
            units += [(judged, task, index, base) for index in task.tested]
    reached: list[ArmReach | None] = []
    run = memory.cache(reach)
    calls = (
        delayed(run)(judged.case, task.sources, index, choice, base, protocol)
        for judged, task, index, base in units
    )
    for one in together(calls):
        reached.append(one)
        if progress is not None:
            progress(len(reached), len(units))
    cases = []
    for judged in evaluation.cases:
        own = [
            (task, index, one)
            for (other, task, index, _), one in zip(units, reached, strict=True)
            if other is judged
        ]
        if own:
            cases.append(_judge(judged, own, learn, protocol))
    return ArmEvaluation(choice.robot, learn, cases, refused)


def place(case: Case, choice: ArmChoice, protocol: Protocol) -> BasePlacement | str:
    """
    Place an arm for a case, by the trial nearest to the mean.

    Args:
        case: the trials.
        choice: the arm.
        protocol: how the movement is learnt.

    Returns:
        The base placement, or the reason why the arm reaches the path from nowhere.

    """
    index = nearest_to_mean(case.curves)
    model = _learn(case, (index,), protocol)
    trial = case.trials[index]
    path = expected_path(model, trial)
    try:
        return choose_base_placement(path, _arm(choice), partner=trial.partner[-1])
    except UnreachableError as error:
        return str(error)


def reach(
    case: Case,
    sources: tuple[int, ...],
    index: int,
    choice: ArmChoice,
    base: BasePlacement,
    protocol: Protocol,
) -> ArmReach | None:
    """
    Run one trial on the arm.

    Args:
        case: the trials.
        sources: indices of the trials to learn from.
        index: index of the trial to run.
        choice: the arm.
        base: its base placement.
        protocol: how the movement is learnt.

    Returns:
        The arm's motion; None if the start of the demonstrator is out of reach.

    """
    trial = case.trials[index]
    robot = _arm(choice).placed(base)
    try:
        q_start = robot.inverse(trial.demonstrator[0])
    except UnreachableError:
        return None
    model = _learn(case, sources, protocol)
    with closing(Handover(Scenario(trial, model, robot, q_start, protocol.seed))) as handover:
        handover.begin()
        periods = []
        while handover.time_s <= REPLAY_AT_S + trial.duration_s:
            periods.append(handover.step())
    times = np.array([1e-9 * period.time_ns - REPLAY_AT_S for period in periods])
    kept = np.flatnonzero(times > -1e-9)
    wrist = np.array([periods[i].wrist_position for i in kept])
    calm, places, _ = smooth(times[kept], wrist)
    motion = np.column_stack([np.interp(trial.times, calm, column) for column in places.T])
    alone = roll_out(model, np.asarray(model.goal_offset), case, [index])[0]
    return ArmReach(
        curve=time_normalise(times[kept], wrist),
        limits=reach_limits(
            [periods[i] for i in kept], robot, handover.period_s, alone[: len(trial.times)]
        ),
        motion=measure_beside(trial, motion),
    )


def _judge(
    judged: CaseScores,
    reached: Sequence[tuple[RolloutTask, int, ArmReach | None]],
    learn: str,
    protocol: Protocol,
) -> ArmCase:
    case = judged.case
    alone = judged.scores[learn, 'decoupled']
    band = band_of(case, leave_one_out=protocol.leave_one_out)
    arm = Scores.blank(*alone.gap_m.shape)
    apart, unreached, went = [], [], []
    motions: dict[int, MotionBeside] = {}
    measured = sources_of(case, learn, leave_one_out=protocol.leave_one_out)
    for task, index, one in reached:
        if one is None:
            unreached.append(case.trials[index].number)
            continue
        went.append(one.limits)
        if task.sources == measured[index]:
            motions[case.trials[index].number] = one.motion
        scores = judge(
            one.curve[None, None],
            case.curves[[index]],
            band.at([index]),
            durations_s=case.durations_s[[index]],
        )
        arm.enter(task.row, [index], scores)
        drawn = np.flatnonzero((judged.kept[learn] == (task.row, index)).all(axis=1))
        if len(drawn):
            away = one.curve - judged.curves[learn][drawn[0]]
            apart.append(float((away**2).sum(axis=1).mean()))
    starts = [
        float(np.linalg.norm(velocities(trial.times, trial.demonstrator)[0]))
        for trial in case.trials
    ]
    return ArmCase(
        case=case,
        primitive=replace(alone, counted=arm.counted),
        arm=arm,
        apart_m=float(np.sqrt(np.mean(apart))) if apart else float('nan'),
        limits=mean_limits(went) if went else None,
        start_speed=float(np.median(starts)),
        unreached=tuple(unreached),
        motions=motions,
    )


@lru_cache(maxsize=2)
def _arm(choice: ArmChoice) -> RobotModel:
    return RobotModel.load(
        choice.robot, wrist_frame=choice.wrist_frame, base_frame=choice.base_frame
    )


def _learn(case: Case, sources: tuple[int, ...], protocol: Protocol) -> DecoupledDmp:
    model, offset = learn_from_case(case, sources, 'decoupled', protocol.learning)
    assert isinstance(model, DecoupledDmp)
    return model.with_goal_offset(offset)
