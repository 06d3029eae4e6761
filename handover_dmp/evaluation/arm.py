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

"""The same table for what a simulated arm did, and where it lost what the primitive had."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.dmp import DecoupledDmp
from handover_dmp.evaluation.cases import Case
from handover_dmp.evaluation.protocol import band_of, CaseScores, Evaluation, Progress, Protocol
from handover_dmp.evaluation.rollouts import learn_from_case, plan, RolloutTask
from handover_dmp.evaluation.scores import BANDS, judge, Scores
from handover_dmp.handover.lockstep import Handover, REPLAY_AT_S
from handover_dmp.handover.scenario import expected_path, Scenario
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
    What the arm did in one trial.

    Attributes:
        curve: (101, 3) m, its measured wrist, time-normalised; None where the arm does not reach
            where the person started.
        limited: share of the reach in which each joint was at a limit.
        any_limited: share in which any of them was.

    """

    curve: Array | None
    limited: dict[str, float]
    any_limited: float


@dataclass(frozen=True)
class ArmCase:
    """
    One case with the arm.

    Attributes:
        case: the trials.
        primitive: the primitive alone, in the trials that the arm reaches.
        arm: what the arm did in them.
        apart_m: root-mean-square distance between the two, m.
        limited: share of the time in which each joint was at a limit, those that ever were.
        any_limited: share of the time in which any joint was.
        unreached: numbers of the trials whose start the arm does not reach.

    """

    case: Case
    primitive: Scores
    arm: Scores
    apart_m: float
    limited: dict[str, float]
    any_limited: float
    unreached: tuple[int, ...]

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain types."""
        return {
            'configuration': self.case.configuration,
            'exchange': self.case.direction,
            'primitive': figures(self.primitive),
            'arm': figures(self.arm),
            'apart_m': self.apart_m,
            'limited': self.limited,
            'any_limited': self.any_limited,
            'unreached': list(self.unreached),
        }


@dataclass(frozen=True)
class ArmEvaluation:
    """
    All cases with the arm.

    Attributes:
        arm: what was asked for.
        learn: what was learnt from.
        cases: that the arm can be placed for.
        refused: configuration, exchange and reason of the others.

    """

    arm: str
    learn: str
    cases: list[ArmCase]
    refused: list[tuple[str, str, str]]

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain types."""
        return {
            'arm': self.arm,
            'learn': self.learn,
            'cases': [case.as_json() for case in self.cases],
            'refused': [
                {'configuration': configuration, 'exchange': direction, 'reason': reason}
                for configuration, direction, reason in self.refused
            ],
        }


def figures(scores: Scores) -> dict[str, Any]:
    """
    Sum scores up.

    Args:
        scores: of one case.

    Returns:
        Percentages within 1σ, 2σ and 3σ, distance and final gap in m.

    """
    counted = scores.counted
    if not counted.any():
        return {'within': None, 'rms_m': None, 'final_gap_m': None}
    sigmas = scores.sigmas[counted]
    return {
        'within': {str(k): 100.0 * float((sigmas <= k).mean()) for k in BANDS},
        'rms_m': float(np.sqrt(scores.squared_m2[counted].mean())),
        'final_gap_m': float(scores.gap_m[counted].mean()),
    }


def evaluate_arm(
    evaluation: Evaluation,
    choice: ArmChoice,
    cache: Path,
    *,
    jobs: int = 1,
    progress: Progress | None = None,
) -> ArmEvaluation:
    """
    Let an arm go through the trials of an evaluation.

    In lockstep and with everything that the graph has: controller, approach rule, tracker, inverse
    kinematics with the arm's limits, simulated joints. The arm is placed once a case, for the
    trial nearest to the mean.

    Args:
        evaluation: of the primitive alone.
        choice: the arm.
        cache: folder in which finished trials are kept, so that what is broken off goes on there.
        jobs: processes; −1 for one a processor. Within `joblib.parallel_config` another backend
            takes their place.
        progress: is told how many of how many trials are done.

    Returns:
        What it did, by case. Learnt from the mean, or from the first of what was evaluated.

    Raises:
        DataError: there is no such arm, or it is none.

    """
    protocol = evaluation.protocol
    learn = 'mean' if 'mean' in protocol.learn else protocol.learn[0]
    run = Memory(cache, verbose=0).cache(reach)
    units: list[tuple[CaseScores, RolloutTask, int, tuple[Any, ...]]] = []
    refused = []
    for judged in evaluation.cases:
        case = judged.case
        try:
            base = place(case, choice, protocol)
        except UnreachableError as error:
            refused.append((case.configuration, case.direction, str(error)))
            continue
        for task in plan(case, learn, leave_one_out=protocol.leave_one_out):
            for index in task.tested:
                arguments = (case, task.sources, index, choice, base, protocol)
                units.append((judged, task, index, arguments))
    reached: list[ArmReach] = []
    calls = (delayed(run)(*arguments) for *_, arguments in units)
    for one in Parallel(n_jobs=jobs, return_as='generator')(calls):
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


def place(case: Case, choice: ArmChoice, protocol: Protocol) -> BasePlacement:
    """
    Place an arm for a case, by the trial nearest to the mean.

    Args:
        case: the trials.
        choice: the arm.
        protocol: how the movement is learnt.

    Returns:
        Where its base stands.

    Raises:
        UnreachableError: it reaches the way from nowhere.

    """
    index = nearest_to_mean(case.curves)
    model = _learn(case, (index,), protocol)
    trial = case.trials[index]
    path = expected_path(model, trial)
    return choose_base_placement(path, _arm(choice), partner=trial.partner[-1])


def reach(
    case: Case,
    sources: tuple[int, ...],
    index: int,
    choice: ArmChoice,
    base: BasePlacement,
    protocol: Protocol,
) -> ArmReach:
    """
    Let the arm go through one trial.

    Args:
        case: the trials.
        sources: which of them it is learnt from.
        index: the trial to go through.
        choice: the arm.
        base: where it stands.
        protocol: how the movement is learnt.

    Returns:
        What it did.

    """
    trial = case.trials[index]
    robot = _arm(choice).placed(base)
    try:
        q_start = robot.inverse(trial.demonstrator[0])
    except UnreachableError:
        return ArmReach(None, {}, 0.0)
    model = _learn(case, sources, protocol)
    handover = Handover(Scenario(trial, model, robot, q_start, protocol.seed))
    try:
        handover.begin()
        periods = []
        while handover.time_s <= REPLAY_AT_S + trial.duration_s:
            periods.append(handover.step())
    finally:
        handover.close()
    times = np.array([1e-9 * period.time_ns - REPLAY_AT_S for period in periods])
    kept = np.flatnonzero(times > -1e-9)
    wrist = np.array([periods[i].wrist_position for i in kept])
    held: Counter[str] = Counter()
    any_held = 0
    for i in kept:
        solution = periods[i].answer.solution
        active = () if solution is None else solution.active_limits
        joints = {name for name in robot.joint_names if any(a.split()[0] == name for a in active)}
        held.update(joints)
        any_held += bool(joints)
    return ArmReach(
        curve=time_normalise(times[kept], wrist),
        limited={name: held[name] / len(kept) for name in robot.joint_names if held[name]},
        any_limited=any_held / len(kept),
    )


def _judge(
    judged: CaseScores,
    reached: Sequence[tuple[RolloutTask, int, ArmReach]],
    learn: str,
    protocol: Protocol,
) -> ArmCase:
    case = judged.case
    alone = judged.scores[learn, 'decoupled']
    band = band_of(case, leave_one_out=protocol.leave_one_out)
    shape = alone.gap_m.shape
    arm = Scores(
        np.zeros((*shape, 3)), np.zeros(shape), np.zeros(shape), np.zeros(shape, dtype=np.bool_)
    )
    apart, unreached = [], []
    for task, index, one in reached:
        if one.curve is None:
            unreached.append(case.trials[index].number)
            continue
        scores = judge(one.curve[None, None], case.curves[[index]], band.at([index]))
        spot = task.row, index
        arm.sigmas[spot] = scores.sigmas[0, 0]
        arm.squared_m2[spot] = scores.squared_m2[0, 0]
        arm.gap_m[spot] = scores.gap_m[0, 0]
        arm.counted[spot] = True
        drawn = np.flatnonzero((judged.kept[learn] == spot).all(axis=1))
        if len(drawn):
            away = one.curve - judged.curves[learn][drawn[0]]
            apart.append(float((away**2).sum(axis=1).mean()))
    went = [one for _, _, one in reached if one.curve is not None]
    names = dict.fromkeys(name for one in went for name in one.limited)
    limited = {
        name: float(np.mean([one.limited.get(name, 0.0) for one in went])) for name in names
    }
    return ArmCase(
        case=case,
        primitive=Scores(alone.sigmas, alone.squared_m2, alone.gap_m, arm.counted),
        arm=arm,
        apart_m=float(np.sqrt(np.mean(apart))) if apart else float('nan'),
        limited=limited,
        any_limited=float(np.mean([one.any_limited for one in went])) if went else 0.0,
        unreached=tuple(unreached),
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
