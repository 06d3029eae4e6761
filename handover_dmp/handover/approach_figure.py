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

"""The figure of a wrist that approaches a hand much closer than in the demonstration."""

from __future__ import annotations

from pathlib import Path

from handover_dmp.common.files import replacing
from handover_dmp.dmp import DecoupledDmp
from handover_dmp.handover.approach import ApproachOptions, rollout_towards
from matplotlib.figure import Figure
import numpy as np

_BEFORE, _AFTER, _HAND = '#999999', '#1f77b4', '#d62728'
_PERIOD_S = 0.005


def draw_approach(model: DecoupledDmp, share: float, path: str | Path) -> None:
    """
    Draw distance, speed and acceleration, by (8) alone and with the rules of the approach.

    Args:
        model: the movement.
        share: distance of the hand, relative to the learnt one.
        path: figure to write; its suffix selects the format.

    """
    times = np.arange(0.0, 1.5 * model.duration_s, _PERIOD_S)
    learnt = model.goal - model.start
    line = learnt / np.linalg.norm(learnt)
    goals = np.broadcast_to(model.start + share * learnt, (len(times), 3))
    figure = Figure(figsize=(8.0, 6.4), layout='constrained')
    axes = figure.subplots(3, 1, sharex=True)
    for enabled, colour, label in (
        (False, _BEFORE, '(7) and (8) alone'),
        (True, _AFTER, 'with the approach rules'),
    ):
        options = ApproachOptions(enabled=enabled)
        positions, velocities = rollout_towards(
            model, times, goals, np.zeros_like(goals), model.start, options
        )
        speeds = velocities @ line
        curves = ((positions - model.start) @ line, speeds, np.gradient(speeds, times))
        for place, curve in zip(axes, curves, strict=True):
            place.plot(times, curve, color=colour, lw=2.0, label=label)
    distance = share * float(np.linalg.norm(learnt))
    axes[0].axhline(distance, color=_HAND, lw=1.2, label='meeting point')
    axes[0].legend(frameon=False, loc='upper right')
    for place, name in zip(
        axes, ('distance / m', 'speed / m/s', 'acceleration / m/s²'), strict=True
    ):
        place.set_ylabel(name)
        place.grid(alpha=0.25)
        place.spines[['top', 'right']].set_visible(False)
    axes[-1].set_xlabel('time / s')
    axes[-1].set_xlim(0.0, float(times[-1]))
    axes[0].set_title(
        f'Learnt with a hand {np.linalg.norm(learnt):.2f} m away, run with one at '
        f'{distance:.2f} m; components along the line to it',
        fontsize=11,
    )
    with replacing(Path(path)) as temporary:
        figure.savefig(temporary, dpi=110)
