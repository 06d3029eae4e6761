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

"""Learning a movement primitive from recorded handovers, and running it against one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.common.quaternions import turns_from_start, with_continuous_signs
from handover_dmp.dmp.decoupled import DecoupledDmp
from handover_dmp.dmp.demonstration import mean_motion
from handover_dmp.dmp.learning import DEFAULT_BASIS, learn_jointly, learn_mean
from handover_dmp.dmp.orientation import LearntTurn
from handover_dmp.dmp.parameters import DmpParameters
from handover_dmp.dmp.primitive import Primitive
from handover_dmp.dmp.state import Rollout
from handover_dmp.mocap.filtering import condition, CUTOFF_HZ, RATE_HZ, smooth
from handover_dmp.mocap.trial import HandoverTrial
from handover_dmp.tracking.partner_model import (
    PartnerOptions,
    rollout_expecting,
    with_goal_weight_of,
)
import numpy as np
from numpy.typing import ArrayLike

PATH_NODES = 101
"""Number of nodes of the partner path."""


def learn_from_trials(
    trials: Sequence[HandoverTrial],
    parameters: DmpParameters | None = None,
    *,
    regression: str = 'rvm',
    basis: int = DEFAULT_BASIS,
    jointly: bool = False,
    primitive: type[Any] = DecoupledDmp,
    cutoff_hz: float | None = CUTOFF_HZ,
) -> Any:
    """
    Learn the motion of P2 from one or several recorded handovers.

    The recordings are first resampled and low-pass filtered with zero phase.

    Args:
        trials: one or more; with several, their time-normalised mean is learnt (*learn mean*).
        parameters: parameters of the primitive; by default those of `config/handover.yaml`.
        regression: `rvm` or `ridge`.
        basis: number of basis functions.
        jointly: learn from all trials in one regression instead of from their mean.
        primitive: `DecoupledDmp` or `ClassicalDmp`.
        cutoff_hz: cutoff of the low-pass filter, Hz; None: not filtered.

    Returns:
        The learnt movement. Its goal offset is the mean of P2(end) − P1(end) over the trials, its
        partner path the mean of P1, each over its own duration. It has a way back if trials have
        one, and a turn if all trials have the orientation of P2's wrist.

    Raises:
        DataError: there is no trial, or one cannot be used.
        UsageError: the regression is unknown, or the number of basis functions is out of range.

    """
    if not trials:
        raise DataError('no trial to learn from')
    smoothed = [condition(trial, cutoff_hz=cutoff_hz) for trial in trials]

    def learn(taught: list[HandoverTrial]) -> Primitive:
        teach = learn_jointly if jointly or len(taught) == 1 else learn_mean
        learnt: Primitive = teach(
            [(trial.times, trial.demonstrator) for trial in taught],
            parameters,
            regression=regression,
            basis=basis,
            source=_source(taught, jointly),
            primitive=primitive,
        )
        paths = [trial.demonstrator_orientation for trial in taught]
        turned = [path for path in paths if path is not None]
        if len(turned) < len(taught) or not isinstance(learnt, DecoupledDmp):
            return learnt
        turns = [turns_from_start(path) for path in turned]
        turning: DecoupledDmp = teach(
            [(trial.times, turn) for trial, turn in zip(taught, turns, strict=True)],
            parameters,
            regression=regression,
            basis=basis,
        )
        starts = with_continuous_signs([path[0] for path in turned])
        return learnt.with_turn(LearntTurn.of(turning, starts.mean(axis=0)))

    model = learn(smoothed)
    offset = np.mean([trial.demonstrator[-1] - trial.partner[-1] for trial in smoothed], axis=0)
    _, path = mean_motion([(trial.times, trial.partner) for trial in smoothed], PATH_NODES)
    ways_back = [trial.way_back for trial in smoothed if trial.way_back is not None]
    return (
        model.with_goal_offset(offset)
        .with_partner_path(path)
        .with_way_back(learn(ways_back) if ways_back else None)
    )


def hand_goal(
    trial: HandoverTrial, model: Primitive, times: ArrayLike | None = None
) -> tuple[Array, Array]:
    """
    Convert the recorded hand of P1 to the goal of a primitive: g = P1 + goal offset.

    Args:
        trial: recorded handover.
        model: learnt movement.
        times: times of the goals, s, (n,); the stamps of the trial if left out.

    Returns:
        Goals, m, and their velocities, m/s, (n, 3) each, of the low-pass filtered hand.

    Raises:
        DataError: the trial cannot be low-pass filtered.

    """
    at = trial.times if times is None else np.asarray(times, dtype=float)
    stamps, positions, velocities = smooth(trial.times, trial.partner)
    goals = np.column_stack([np.interp(at, stamps, column) for column in positions.T])
    rates = np.column_stack([np.interp(at, stamps, column) for column in velocities.T])
    return goals + model.goal_offset, rates


def rollout_against(
    model: Primitive,
    trial: HandoverTrial,
    rate_hz: float = RATE_HZ,
    *,
    deviation: bool = False,
    partner: PartnerOptions | None = None,
) -> Rollout:
    """
    Run a primitive against the recorded hand of P1, from rest at the start of P2.

    Args:
        model: learnt movement of three dimensions.
        trial: recorded handover; it determines the duration of the rollout.
        rate_hz: samples per second.
        deviation: whether to compute the standard deviation from the posterior.
        partner: constants of the partner model; None: without it. It also needs a movement with a
            partner path.

    Returns:
        The motion, at the first stamp of the trial and every 1/rate_hz after it.

    Raises:
        DataError: the model does not have three dimensions, or the trial cannot be filtered.

    """
    if model.dimensions != 3:
        raise DataError(f'the model has {model.dimensions} dimensions; a handover needs 3')
    count = int(trial.duration_s * rate_hz + 1e-6) + 1
    times = trial.times[0] + np.arange(count) / rate_hz
    goals, velocities = hand_goal(trial, model, times)
    if partner and isinstance(model, DecoupledDmp) and model.partner_path is not None:
        movement = with_goal_weight_of(model, partner)
        start = trial.demonstrator[0].tolist()
        hands = goals - model.goal_offset
        return rollout_expecting(movement, times, hands, velocities, start, partner)
    return model.rollout(times, goals, start=trial.demonstrator[0], deviation=deviation)


def reproduction_error(
    model: Primitive, trial: HandoverTrial, cutoff_hz: float | None = CUTOFF_HZ
) -> float:
    """
    Measure the deviation from P2 of a primitive that runs to P2's own goal at its own pace.

    Args:
        model: learnt movement.
        trial: recorded handover, e.g. the one it was learnt from.
        cutoff_hz: cutoff of the low-pass filter, Hz; None: not filtered.

    Returns:
        Maximum distance between the motion and the filtered recording, m.

    """
    smoothed = condition(trial, cutoff_hz=cutoff_hz)
    motion = model.with_duration(smoothed.duration_s).rollout(
        smoothed.times,
        smoothed.demonstrator[-1],
        start=smoothed.demonstrator[0],
        velocity=model.start_velocity * (model.duration_s / smoothed.duration_s),
    )
    return float(np.linalg.norm(motion.positions - smoothed.demonstrator, axis=1).max())


def _source(trials: Sequence[HandoverTrial], jointly: bool) -> str:
    names = ', '.join(trial.source or trial.label for trial in trials)
    if len(trials) == 1:
        return names
    return f'{"all" if jointly else "mean"} of {len(trials)} trials: {names}'
