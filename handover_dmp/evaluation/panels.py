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

"""Figures of an evaluation: selection of the shown rollouts, and captions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from handover_dmp.evaluation.arm import ArmEvaluation
from handover_dmp.evaluation.cases import index_of
from handover_dmp.evaluation.figures import draw, draw_beside, figure_count, Panel, Shown
from handover_dmp.evaluation.motions import motions_beside
from handover_dmp.evaluation.protocol import CaseScores, Evaluation, Protocol
from handover_dmp.evaluation.rollouts import learn_from_case, roll_out
from handover_dmp.evaluation.scores import BANDS
from handover_dmp.evaluation.sessions import SessionOutcome, sessions_beside
from handover_dmp.mocap.typical import nearest_to_mean
import numpy as np


def write_panels(
    evaluation: Evaluation,
    folder: Path,
    progress: Callable[[int, int], None] | None = None,
    *,
    learnt: int | None = None,
    tested: int | None = None,
    arm: ArmEvaluation | None = None,
    sessions: Sequence[SessionOutcome] = (),
) -> list[tuple[str, str]]:
    """
    Draw the figures of an evaluation into `figures/`.

    Args:
        evaluation: the evaluation.
        folder: parent folder of `figures/`.
        progress: called with the number of drawn figures and of all figures.
        learnt: number of the trial that Figs 4 to 6 learn from; default: the one nearest to the
            mean.
        tested: number of the other trial that they test against; default: the one with the
            median distance.
        arm: results of an arm, if one was evaluated.
        sessions: results of whole sessions, if there are any.

    Returns:
        Name and caption of each figure.

    Raises:
        DataError: a case has no trial with that number.

    """
    panels = [_panel(judged, evaluation.protocol, learnt, tested) for judged in evaluation.cases]
    place = folder / 'figures'
    total = figure_count(panels) + 1 + bool(sessions)
    figures: list[tuple[str, str]] = []

    def drawn(name: str, caption: str) -> None:
        figures.append((name, caption))
        if progress is not None:
            progress(len(figures), total)

    for name, caption in draw(panels, place):
        drawn(name, caption)
    beside = motions_beside(evaluation.measures, None if arm is None else arm.motions)
    draw_beside(beside, place, 'measures', 'Motions compared with those of P2')
    drawn('measures', 'Motions compared with those of P2, one line per trial; bars: medians')
    if sessions:
        draw_beside(
            sessions_beside(sessions), place, 'sessions', 'Sessions compared with those of P2', 3
        )
        drawn(
            'sessions',
            'Sessions compared with those of two people, one line per session or exchange',
        )
    return figures


def _panel(
    judged: CaseScores, protocol: Protocol, learnt: int | None, tested: int | None
) -> Panel:
    case = judged.case
    everyone = range(len(case))
    source = nearest_to_mean(case.curves) if learnt is None else index_of(case, learnt)
    other = None if tested is None else index_of(case, tested)
    model = learn_from_case(case, [source], 'decoupled', protocol.learning)
    shown = {}
    for learn in protocol.learn:
        scores = judged.scores[learn, 'decoupled']
        rows, columns = judged.kept[learn].T
        fits = scores.sigmas <= BANDS[-1]
        totals = scores.totals(np.ones((1, len(case))))
        shown[learn] = Shown(
            curves=judged.curves[learn],
            inside=fits[rows, columns],
            share=fits[scores.counted].mean(axis=0),
            within=dict(zip(BANDS, totals.within_percent[0].tolist(), strict=True)),
            rollouts=int(scores.counted.sum()),
        )
    rejections = judged.rejections[protocol.learn[0]]
    return Panel(case, source, other, roll_out(*model, case, everyone), shown, rejections)
