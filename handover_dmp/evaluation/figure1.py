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

"""Fig. 1 of the paper: one learnt curve, a shifted goal, three μ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from handover_dmp.common.arrays import Array
from handover_dmp.common.files import replacing
from handover_dmp.common.plot_style import PLOT_STYLE
from handover_dmp.dmp.decoupled import DecoupledDmp
from handover_dmp.dmp.learning import learn
from handover_dmp.dmp.parameters import DmpParameters
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np
from numpy.typing import ArrayLike

MU = (0.25, 0.5, 0.75)
# light to dark, each with its own line style, so that hue alone does not matter
LINES = (('#5aa9d6', (0, (6, 2))), ('#2f6fb5', (0, (6, 2, 1.5, 2))), ('#14345f', '-'))
LEARNT = '#59626d'
GOAL = '#c8372d'


def draw_figure1(
    times: ArrayLike,
    positions: ArrayLike,
    path: Path | str,
    *,
    parameters: DmpParameters | None = None,
    mu: Sequence[float] = MU,
    shift: float = 0.3,
) -> dict[float, Array]:
    """
    Draw how μ sets the time at which a motion leaves the learnt shape for a shifted goal.

    Args:
        times: times of the demonstration, s, (n,).
        positions: positions of the demonstration, m, (n, d); the dimension with the largest
            motion is drawn.
        path: image file; its suffix sets the format.
        parameters: parameters of the primitive; μ is replaced.
        mu: three centres of the goal weight (7), in units of τ.
        shift: distance of the new goal beyond the learnt one, as a share of the motion.

    Returns:
        The motion of the drawn dimension for each μ, m, at 401 times from 0 to 1.3 τ.

    Raises:
        DataError: the demonstration cannot be used.

    """
    stamps, points = np.asarray(times, dtype=float), np.asarray(positions, dtype=float)
    curve = points[:, [int(np.argmax(np.abs(points[-1] - points[0])))]]
    models: list[DecoupledDmp] = [
        learn(stamps, curve, replace(parameters or DmpParameters(), mu=each), regression='ridge')
        for each in mu
    ]
    u = np.linspace(0.0, 1.3, 401)
    goal = curve[-1] + shift * (curve[-1] - curve[0])
    motions = {
        each: model.rollout(u * model.duration_s, goal, start=curve[0]).positions[:, 0]
        for each, model in zip(mu, models, strict=True)
    }
    with rc_context({**PLOT_STYLE, 'axes.ymargin': 0.12}):
        figure = Figure(figsize=(7.2, 5.4), layout='constrained', dpi=150)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3.0, 1.0))
        _draw_motions(upper, (stamps - stamps[0]) / models[0].duration_s, curve, u, goal, motions)
        _draw_weights(lower, u, models)
        with replacing(Path(path)) as temporary:
            figure.savefig(temporary)
    return motions


def _draw_motions(
    axes: Axes, elapsed: Array, curve: Array, u: Array, goal: Array, motions: dict[float, Array]
) -> None:
    axes.plot(elapsed, curve[:, 0], color=LEARNT, linewidth=5.0, alpha=0.35, label='learnt curve')
    for name, height, colour, width in (
        ('new goal', goal[0], GOAL, 1.2),
        ('learnt goal', curve[-1, 0], LEARNT, 0.8),
    ):
        axes.axhline(height, color=colour, linewidth=width, linestyle=(0, (1, 1.5)))
        axes.annotate(
            name, (0.0, height), (4, 4), textcoords='offset points', color=colour, va='bottom'
        )
    for (mu, motion), (colour, stroke) in zip(motions.items(), LINES, strict=False):
        axes.plot(u, motion, color=colour, linestyle=stroke, linewidth=2.0, label=f'μ = {mu:g}')
    axes.set_ylabel('position [m]')
    axes.set_title('The larger μ, the longer the motion keeps the learnt shape')
    axes.legend(loc='lower right')


def _draw_weights(axes: Axes, u: Array, models: Sequence[DecoupledDmp]) -> None:
    for model, (colour, stroke) in zip(models, LINES, strict=False):
        axes.plot(u, model.goal_weight_at_time(u), color=colour, linestyle=stroke, linewidth=2.0)
        axes.axvline(model.parameters.mu, color=colour, linewidth=0.8, alpha=0.6)
    axes.set_ylabel('goal weight $w_g$')
    axes.set_xlabel('time [τ]')
    axes.set_yticks([0.0, 0.5, 1.0])
