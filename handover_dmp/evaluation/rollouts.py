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

"""Learning and rolling out as the protocol has it: which model against which hands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from handover_dmp.common.arrays import Array
from handover_dmp.dmp import ClassicalDmp, DecoupledDmp, DmpParameters, learn
from handover_dmp.evaluation.cases import Case, Hands
from handover_dmp.mocap.filtering import CUTOFF_HZ
from handover_dmp.mocap.typical import nearest_to_mean, time_normalise
from handover_dmp.tracking.partner_model import PartnerOptions, rollout_expecting
import numpy as np

PRIMITIVES: dict[str, type[DecoupledDmp] | type[ClassicalDmp]] = {
    'decoupled': DecoupledDmp,
    'partner_model': DecoupledDmp,
    'classical': ClassicalDmp,
}
"""The methods that learn."""


@dataclass(frozen=True)
class Learning:
    """
    How movement primitives are learnt.

    The recordings are smoothed before, so nothing is left for a sparse regression to remove, and
    ridge gives the same table as the relevance vector machine in a tenth of the time.

    Attributes:
        parameters: of the primitive.
        regression: `rvm` or `ridge`.
        basis: number of basis functions.
        duration_scale: factor on the duration that was learnt; 1 in the protocol.
        cutoff_hz: low-pass of the recordings, Hz; None: they are smooth already.
        partner: constants of the partner model, its goal weight among them, for the method
            `partner_model`; None: that method is left out.

    """

    parameters: DmpParameters = field(default_factory=DmpParameters)
    regression: str = 'ridge'
    basis: int = 50
    duration_scale: float = 1.0
    cutoff_hz: float | None = CUTOFF_HZ
    partner: PartnerOptions | None = None

    @property
    def methods(self) -> tuple[str, ...]:
        """Return the methods that learn, as far as they are wanted."""
        return tuple(
            name for name in PRIMITIVES if name != 'partner_model' or self.partner is not None
        )

    def parameters_for(self, method: str) -> DmpParameters:
        """
        Give the parameters that a method learns with.

        Args:
            method: one of `methods`.

        Returns:
            The parameters; with the partner model, the goal weight is its own.

        """
        if method != 'partner_model' or self.partner is None:
            return self.parameters
        return replace(self.parameters, mu=self.partner.mu, sigma=self.partner.sigma)


@dataclass(frozen=True)
class RolloutTask:
    """
    One model and the trials that it is rolled out against.

    Attributes:
        row: line of the table of rollouts that it belongs to.
        sources: trials that it is learnt from, one, or several for their mean.
        tested: trials whose hand it moves against.

    """

    row: int
    sources: tuple[int, ...]
    tested: tuple[int, ...]


def plan(case: Case, learn_from: str, *, leave_one_out: bool = False) -> list[RolloutTask]:
    """
    Say which models the protocol wants, and what each is tested against.

    Args:
        case: the trials.
        learn_from: `single`, `mean` or `representative`.
        leave_one_out: never test a model against a trial that it was learnt from.

    Returns:
        The tasks; those of `single` have a row each, all others share row 0.

    """
    everyone = tuple(range(len(case)))
    if learn_from == 'single':
        if leave_one_out:
            return [RolloutTask(i, (i,), tuple(j for j in everyone if j != i)) for i in everyone]
        return [RolloutTask(i, (i,), everyone) for i in everyone]
    if not leave_one_out:
        sources = everyone if learn_from == 'mean' else (nearest_to_mean(case.curves),)
        return [RolloutTask(0, sources, everyone)]
    others = [tuple(i for i in everyone if i != j) for j in everyone]
    if learn_from == 'mean':
        return [RolloutTask(0, sources, (j,)) for j, sources in zip(everyone, others, strict=True)]
    tested: dict[int, list[int]] = {}
    for j, sources in zip(everyone, others, strict=True):
        representative = sources[nearest_to_mean(case.curves[list(sources)])]
        tested.setdefault(representative, []).append(j)
    return [RolloutTask(0, (i,), tuple(against)) for i, against in tested.items()]


def moved_from(learn: Sequence[str]) -> str:
    """
    Choose what the motions are learnt from that an arm makes, and that are measured.

    Args:
        learn: what was asked for.

    Returns:
        The mean where it is among them, else the first.

    """
    return 'mean' if 'mean' in learn else learn[0]


def sources_of(
    case: Case, learn_from: str, *, leave_one_out: bool = False
) -> dict[int, tuple[int, ...]]:
    """
    Say which model moves against each trial where there is to be one alone.

    Args:
        case: the trials.
        learn_from: as `plan` takes it; of the models of `single`, the representative one moves.
        leave_one_out: as `plan` takes it.

    Returns:
        Each trial to those that its model is learnt from.

    """
    one_model = 'representative' if learn_from == 'single' else learn_from
    tasks = plan(case, one_model, leave_one_out=leave_one_out)
    return {index: task.sources for task in tasks for index in task.tested}


def learn_from_case(
    case: Case, sources: Sequence[int], method: str, learning: Learning
) -> tuple[DecoupledDmp | ClassicalDmp, Array]:
    """
    Learn a movement primitive from a trial, or from the mean of several.

    The mean is that of the time-normalised motions, over the mean duration; its goal offset is
    the mean of theirs.

    Args:
        case: the trials.
        sources: which of them to learn from.
        method: `decoupled`, `partner_model` or `classical`.
        learning: how.

    Returns:
        The model, and its goal offset P2(end) − P1(end), (3,) m.

    """
    chosen = list(sources)
    if len(chosen) == 1:
        trial = case.trials[chosen[0]]
        times, positions = trial.times - trial.times[0], trial.demonstrator
    else:
        positions = case.curves[chosen].mean(axis=0)
        times = np.linspace(0.0, case.durations_s[chosen].mean(), len(positions))
    model: DecoupledDmp | ClassicalDmp = learn(
        times,
        positions,
        learning.parameters_for(method),
        regression=learning.regression,
        basis=learning.basis,
        primitive=PRIMITIVES[method],
    )
    if learning.duration_scale != 1.0:
        model = model.with_duration(learning.duration_scale * model.duration_s)
    return model, case.goal_offsets[chosen].mean(axis=0)


def roll_out(
    model: DecoupledDmp | ClassicalDmp,
    goal_offset: Array,
    case: Case,
    tested: Sequence[int],
    hands: Hands | None = None,
) -> Array:
    """
    Roll a model out from rest where P2 started, against the recorded hands.

    The goal is g(t) = P1(t) + goal offset, its velocity that of P1.

    Args:
        model: what to roll out, with its own duration.
        goal_offset: (3,) m, or (len(tested), 3) m, one a hand.
        case: the trials.
        tested: which of them give hand and start.
        hands: what the primitive is told of the hands, on the clock of `case.hands`; the truth if
            left out.

    Returns:
        (len(tested), m, 3) m on the clock of `case.hands`; after the end of its trial a rollout
        means nothing.

    """
    told = hands or case.hands
    # Everyone is the usual case, and a slice copies nothing.
    everyone = tuple(tested) == tuple(range(len(case)))
    chosen: slice | list[int] = slice(None) if everyone else list(tested)
    longest = int(told.samples[chosen].max())
    offsets = np.broadcast_to(goal_offset, (len(tested), 3))
    positions, _ = model.rollout_batch(
        told.times[:longest],
        told.positions[chosen, :longest] + offsets[:, None],
        told.velocities[chosen, :longest],
        case.starts[chosen],
    )
    return np.asarray(positions)


def curves_of(case: Case, task: RolloutTask, method: str, learning: Learning) -> Array:
    """
    Carry one task out.

    Args:
        case: the trials.
        task: the model to learn, and what to test it against.
        method: one of `Learning.methods`.
        learning: how to learn.

    Returns:
        The time-normalised rollouts, (len(task.tested), 101, 3) m.

    """
    model, goal_offset = learn_from_case(case, task.sources, method, learning)
    if method == 'partner_model' and isinstance(model, DecoupledDmp):
        path = case.partner_curves[list(task.sources)].mean(axis=0)
        knowing = model.with_goal_offset(goal_offset).with_partner_path(path)
        return roll_out_expecting(knowing, case, task.tested, learning.partner)
    rollouts = roll_out(model, goal_offset, case, task.tested)
    return case.hands.time_normalise(rollouts, task.tested)


def roll_out_expecting(
    model: DecoupledDmp,
    case: Case,
    tested: Sequence[int],
    options: PartnerOptions | None = None,
) -> Array:
    """
    Roll a model out as `roll_out` does, with what it may expect of each hand.

    Args:
        model: what to roll out, with goal offset and partner path.
        case: the trials.
        tested: which of them give hand and start.
        options: constants of the partner model; those of `config/` if left out.

    Returns:
        The time-normalised rollouts, (len(tested), 101, 3) m.

    """
    hands, curves = case.hands, []
    for trial in tested:
        count = int(hands.samples[trial])
        times = hands.times[:count]
        motion = rollout_expecting(
            model,
            times,
            hands.positions[trial, :count],
            hands.velocities[trial, :count],
            case.starts[trial].tolist(),
            options,
        )
        curves.append(time_normalise(times, motion.positions))
    return np.stack(curves)
