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

"""Learning the forcing term (6) from demonstrations, (9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError, UsageError
from handover_dmp.dmp.basis import equally_spaced
from handover_dmp.dmp.decoupled import DecoupledDmp
from handover_dmp.dmp.demonstration import demonstrate, Demonstration, mean_motion
from handover_dmp.dmp.orientation import LearntTurn, OrientationPrimitive
from handover_dmp.dmp.parameters import DmpParameters
from handover_dmp.dmp.posterior import WeightPosterior
from handover_dmp.dmp.primitive import Primitive
from handover_dmp.dmp.sparse_bayes import sparse_bayes
import numpy as np
from numpy.typing import ArrayLike

AnyPrimitive = TypeVar('AnyPrimitive', bound=Primitive)

REGRESSIONS = ('rvm', 'ridge')
DEFAULT_BASIS = 100
MAX_BASIS = 2000
WIDTHS: dict[str, tuple[float, ...]] = {'rvm': (0.045, 0.15), 'ridge': ()}
ROWS = 301  # minimum number of rows of the regression per demonstration
RIDGE = 1e-13  # relative to the mean square of a column


def learn(
    times: ArrayLike,
    positions: ArrayLike,
    parameters: DmpParameters | None = None,
    *,
    regression: str = 'rvm',
    basis: int = DEFAULT_BASIS,
    widths: Sequence[float] | None = None,
    source: str = '',
    primitive: type[AnyPrimitive] = DecoupledDmp,  # type: ignore[assignment]
) -> AnyPrimitive:
    """
    Learn from one demonstration.

    Minimises Σ‖(1 − w_g)·K_s·(Φw) − r‖² with r = τv̇ + Dv − w_g K(g − x) − (1 − w_g)K_s(x0 − x):
    (9) with its rows weighted by 1 − w_g, by which the paper divides. The goal is the end of
    the demonstration, at rest.

    Args:
        times: s, (n,), increasing; the spacing may vary.
        positions: m, (n, d).
        parameters: parameters of the primitive; by default those of `config/handover.yaml`.
        regression: `rvm`, sparse Bayesian, or `ridge`.
        basis: number of basis functions, 2 to 2000.
        widths: distance from the centre at which the Gaussians fall to 1/e, in units of τ, at
            least the distance of the centres. Default: that distance for ridge, and 0.045 and 0.15
            for rvm, which selects among them.
        source: description of the data.
        primitive: `DecoupledDmp` or `ClassicalDmp`.

    Returns:
        The learnt movement.

    Raises:
        DataError: a demonstration cannot be used.
        UsageError: the regression is unknown, or the number of basis functions is out of range.

    """
    return learn_jointly(
        [(times, positions)],
        parameters,
        regression=regression,
        basis=basis,
        widths=widths,
        source=source,
        primitive=primitive,
    )


def learn_mean(
    demonstrations: Sequence[tuple[ArrayLike, ArrayLike]],
    parameters: DmpParameters | None = None,
    *,
    regression: str = 'rvm',
    basis: int = DEFAULT_BASIS,
    widths: Sequence[float] | None = None,
    source: str = '',
    primitive: type[AnyPrimitive] = DecoupledDmp,  # type: ignore[assignment]
) -> AnyPrimitive:
    """
    Learn from the mean of several demonstrations, each scaled to the mean duration.

    Args:
        demonstrations: times, s, (n,), and positions, m, (n, d), of each; n may differ.
        parameters: see `learn`.
        regression: see `learn`.
        basis: see `learn`.
        widths: see `learn`.
        source: see `learn`.
        primitive: see `learn`.

    Returns:
        The learnt movement.

    Raises:
        DataError: a demonstration cannot be used.
        UsageError: the regression is unknown, or the number of basis functions is out of range.

    """
    count = max([ROWS, *(np.size(times) for times, _ in demonstrations)])
    times, positions = mean_motion(demonstrations, count)
    return learn(
        times,
        positions,
        parameters,
        regression=regression,
        basis=basis,
        widths=widths,
        source=source,
        primitive=primitive,
    )


def relearn(model: AnyPrimitive, **changes: Any) -> AnyPrimitive:
    """
    Relearn the movement of a model for other parameters.

    Weights are only valid for the K, D, μ and σ with which they were learnt: with others the
    movement would change, and near τ, where 1 − w_g was almost 0, it would be arbitrary. The
    rollout of the model to its own goal serves as the demonstration. Ridge regression takes a
    few milliseconds, so this can be done in motion.

    Args:
        model: the learnt movement.
        changes: fields of `DmpParameters`.

    Returns:
        The same movement with those parameters; `model` itself if nothing changes.

    Raises:
        DataError: a parameter is out of its range.

    """
    parameters = replace(model.parameters, **changes)
    if parameters == model.parameters:
        return model
    times = np.linspace(0.0, model.duration_s, ROWS)
    movement = model.rollout(times, model.goal, velocity=model.start_velocity)
    learnt = learn(
        times,
        movement.positions,
        parameters,
        regression='ridge',
        source=model.source,
        primitive=type(model),
    )
    known = (
        learnt.with_goal_offset(model.goal_offset)
        .with_partner_path(model.partner_path)
        .with_way_back(model.way_back)
    )
    if model.turn is None or not isinstance(model, DecoupledDmp):
        return known
    turning = relearn(OrientationPrimitive(model).turning, **changes)
    return known.with_turn(LearntTurn.of(turning, model.turn.start))


def learn_jointly(
    demonstrations: Sequence[tuple[ArrayLike, ArrayLike]],
    parameters: DmpParameters | None = None,
    *,
    regression: str = 'rvm',
    basis: int = DEFAULT_BASIS,
    widths: Sequence[float] | None = None,
    source: str = '',
    primitive: type[AnyPrimitive] = DecoupledDmp,  # type: ignore[assignment]
) -> AnyPrimitive:
    """
    Learn from several demonstrations in one regression, each with its own start, end and duration.

    Args:
        demonstrations: times, s, (n,), and positions, m, (n, d), of each; n may differ.
        parameters: see `learn`.
        regression: see `learn`.
        basis: see `learn`.
        widths: see `learn`.
        source: see `learn`.
        primitive: see `learn`.

    Returns:
        The learnt movement; duration, start and goal are the means over the demonstrations.

    Raises:
        DataError: a demonstration cannot be used.
        UsageError: the regression is unknown, or the number of basis functions is out of range.

    """
    if regression not in REGRESSIONS:
        raise UsageError(f'regression is {regression!r}; known: {", ".join(REGRESSIONS)}')
    kinds = WIDTHS[regression] if widths is None else tuple(widths)
    if not max(2, 2 * len(kinds)) <= basis <= MAX_BASIS:
        raise UsageError(
            f'{basis} basis functions: need at least 2 per width, and at most {MAX_BASIS}'
        )
    if not all(0.0 < width <= 10.0 for width in kinds):
        raise UsageError(f'widths are {kinds}; they must be above 0 and at most 10')
    if not demonstrations:
        raise DataError('no demonstration to learn from')
    parameters = parameters or DmpParameters()
    motions = [
        demonstrate(times, positions, max(ROWS, np.size(times)))
        for times, positions in demonstrations
    ]
    if len({motion.position.shape[1] for motion in motions}) != 1:
        raise DataError('the demonstrations have different numbers of dimensions')
    pool = equally_spaced(basis, parameters.alpha, kinds)
    blank = primitive(
        parameters,
        float(np.mean([motion.duration_s for motion in motions])),
        np.mean([motion.position[0] for motion in motions], axis=0),
        np.mean([motion.position[-1] for motion in motions], axis=0),
        np.zeros((pool.size, motions[0].position.shape[1])),
        pool,
        start_velocity=np.mean(
            [motion.velocity[0] / motion.duration_s for motion in motions], axis=0
        ),
        source=source,
    )
    rows = [_rows(motion, blank) for motion in motions]
    design = np.concatenate([each[0] for each in rows])
    target = np.concatenate([each[1] for each in rows])
    if regression == 'ridge':
        return blank.with_weights(_ridge(design, target))
    samples = sum(motion.samples for motion in motions)
    return _sparse(blank, design, target, min(1.0, samples / len(design)))


def _rows(motion: Demonstration, primitive: Primitive) -> tuple[Array, Array]:
    """Return the rows (1 − w)K_sΦ and r of (9), (n, m) and (n, d)."""
    parameters = primitive.parameters
    goal_weight = primitive.goal_weight_at_time(motion.u)[:, None]
    free = (1.0 - goal_weight) * primitive.shape_stiffness
    design = primitive.basis.activations(np.exp(-parameters.alpha * motion.u))
    design *= free
    target = motion.acceleration + parameters.effective_damping * motion.velocity
    target -= goal_weight * parameters.stiffness * (motion.position[-1] - motion.position)
    target -= free * (motion.position[0] - motion.position)
    return design, target


def _ridge(design: Array, target: Array) -> Array:
    """Minimise ‖design·w − target‖² + penalty·‖w‖² by QR; normal equations lose accuracy."""
    from scipy.linalg.lapack import dgels

    rows, size = design.shape
    padded = np.zeros((rows + size, size), order='F')
    padded[:rows] = design
    penalty = RIDGE * np.einsum('ij,ij->', design, design) / size
    padded[rows + np.arange(size), np.arange(size)] = np.sqrt(penalty)
    right = np.zeros((rows + size, target.shape[1]), order='F')
    right[:rows] = target
    _, solution, _ = dgels(padded, right, overwrite_a=True, overwrite_b=True)
    weights: Array = solution[:size]
    return weights


def _sparse(blank: AnyPrimitive, design: Array, target: Array, information: float) -> AnyPrimitive:
    """Regress each dimension separately; `information`: independent samples per row."""
    weights = np.zeros_like(blank.weights)
    posteriors = []
    for dimension in range(blank.dimensions):
        result = sparse_bayes(design, target[:, dimension], information=information)
        weights[result.active, dimension] = result.mean
        posteriors.append(WeightPosterior(result.active, result.covariance))
    return blank.with_weights(weights, tuple(posteriors))
