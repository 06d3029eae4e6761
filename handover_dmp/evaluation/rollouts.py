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

"""Learning and rollouts of the protocol: which model runs against which hands."""

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
"""Methods that learn."""


@dataclass(frozen=True)
class Learning:
    """
    How movement primitives are learnt.

    The recordings are already smooth, so a sparse regression has no noise to remove. Ridge gives
    the same table as the relevance vector machine in a tenth of the time.

    Attributes:
        parameters: parameters of the primitive.
        regression: `rvm` or `ridge`.
        basis: number of basis functions.
        duration_scale: factor on the learnt duration; 1 in the protocol.
        cutoff_hz: low-pass of the recordings, Hz; None: they are smooth already.
        partner: constants of the partner model, including its goal weight, for the method
            `partner_model`; None leaves that method out.

    """

    parameters: DmpParameters = field(default_factory=DmpParameters)
    regression: str = 'ridge'
    basis: int = 50
    duration_scale: float = 1.0
    cutoff_hz: float | None = CUTOFF_HZ
    partner: PartnerOptions | None = None

    @property
    def methods(self) -> tuple[str, ...]:
        """Return the selected methods that learn."""
        return tuple(
            name for name in PRIMITIVES if name != 'partner_model' or self.partner is not None
        )

    def parameters_for(self, method: str) -> DmpParameters:
        """
        Return the parameters with which a method learns.

        Args:
            method: one of `methods`.

        Returns:
            The parameters; the partner model has its own goal weight.

        """
        if method != 'partner_model' or self.partner is None:
            return self.parameters
        return replace(self.parameters, mu=self.partner.mu, sigma=self.partner.sigma)


@dataclass(frozen=True)
class RolloutTask:
    """
    One model and the trials that it is rolled out against.

    Attributes:
        row: its row in the table of rollouts.
        sources: trials to learn from: one, or several for their mean.
        tested: trials whose hands it moves against.

    """

    row: int
    sources: tuple[int, ...]
    tested: tuple[int, ...]


def plan(case: Case, learn_from: str, *, leave_one_out: bool = False) -> list[RolloutTask]:
    """
    Return the models of the protocol, and the trials against which each is tested.

    Args:
        case: the trials.
        learn_from: `single`, `mean` or `representative`.
        leave_one_out: never test a model against a trial that it was learnt from.

    Returns:
        The tasks; each task of `single` has its own row, all others share row 0.

    """
    everyone = tuple(range(len(case)))
    others = [tuple(i for i in everyone if i != j) for j in everyone]
    if learn_from == 'single':
        tested = others if leave_one_out else [everyone] * len(case)
        return [RolloutTask(i, (i,), tested[i]) for i in everyone]
    if not leave_one_out:
        sources = everyone if learn_from == 'mean' else (nearest_to_mean(case.curves),)
        return [RolloutTask(0, sources, everyone)]
    if learn_from == 'mean':
        return [RolloutTask(0, sources, (j,)) for j, sources in zip(everyone, others, strict=True)]
    tested_by: dict[int, list[int]] = {}
    for j, sources in zip(everyone, others, strict=True):
        representative = sources[nearest_to_mean(case.curves[list(sources)])]
        tested_by.setdefault(representative, []).append(j)
    return [RolloutTask(0, (i,), tuple(against)) for i, against in tested_by.items()]


def moved_from(learn: Sequence[str]) -> str:
    """
    Choose the source of learning for the motions of an arm and for the measures.

    Args:
        learn: selected sources.

    Returns:
        The mean if it is selected, otherwise the first.

    """
    return 'mean' if 'mean' in learn else learn[0]


def sources_of(
    case: Case, learn_from: str, *, leave_one_out: bool = False
) -> dict[int, tuple[int, ...]]:
    """
    Choose one model for each trial.

    Args:
        case: the trials.
        learn_from: as for `plan`; for `single`, the representative model is chosen.
        leave_one_out: as for `plan`.

    Returns:
        By trial, the sources of its model.

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
    the mean of their offsets.

    Args:
        case: the trials.
        sources: indices of the trials to learn from.
        method: `decoupled`, `partner_model` or `classical`.
        learning: how to learn.

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
    Roll a model out from rest at the start of P2, against the recorded hands.

    The goal is g(t) = P1(t) + goal offset; its velocity is that of P1.

    Args:
        model: the model, with its own duration.
        goal_offset: (3,) m, or (len(tested), 3) m, one per hand.
        case: the trials.
        tested: indices of the trials that give hand and start.
        hands: the hands as the primitive sees them, on the clock of `case.hands`; default: the
            truth.

    Returns:
        (len(tested), m, 3) m on the clock of `case.hands`; a rollout is meaningless after the
        end of its trial.

    """
    told = hands or case.hands
    # Usually all trials are tested; a slice copies nothing.
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
        task: the model to learn, and the trials to test it against.
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
    Roll a model out like `roll_out`, with the partner model.

    Args:
        model: the model, with goal offset and partner path.
        case: the trials.
        tested: indices of the trials that give hand and start.
        options: constants of the partner model; default: those of `config/`.

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
