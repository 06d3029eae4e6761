"""The folder that an evaluation leaves: tables, figures, and the page that shows them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
import json
from pathlib import Path
from typing import Any

from handover_dmp import __version__
from handover_dmp.evaluation.cases import Case
from handover_dmp.evaluation.figures import draw, figure_count, Panel, Shown
from handover_dmp.evaluation.page import page
from handover_dmp.evaluation.protocol import CaseScores, Evaluation, Protocol
from handover_dmp.evaluation.rollouts import learn_from_trials, nearest_to_mean, roll_out
from handover_dmp.evaluation.scores import BANDS
from handover_dmp.evaluation.table import as_csv, as_text, PAPER
from handover_dmp.files import write_text
import numpy as np


def as_json(evaluation: Evaluation, data_set: str) -> dict[str, Any]:
    """
    Say everything about an evaluation in plain types.

    Args:
        evaluation: the table.
        data_set: its name.

    Returns:
        `rows` and `summary` as the table has them, and how they came about.

    """
    protocol = evaluation.protocol
    return {
        'data_set': data_set,
        'trials': sum(len(judged.case) for judged in evaluation.cases),
        'cases': len(evaluation.cases),
        'protocol': {
            'learn': list(protocol.learn),
            'leave_one_out': protocol.leave_one_out,
            **asdict(protocol.learning),
            'seed': protocol.seed,
            'bootstrap_rounds': protocol.rounds,
        },
        'rows': [row.as_json() for row in evaluation.rows],
        'summary': [row.as_json() for row in evaluation.summary],
        'paper': {
            learn: {str(k): p for k, p in within.items()} for learn, within in PAPER.items()
        },
        'version': __version__,
    }


def write_report(
    evaluation: Evaluation, data_set: str, folder: Path, figures: Sequence[tuple[str, str]]
) -> str:
    """
    Write `table.txt`, `table.csv`, `table.json` and `index.html`.

    Args:
        evaluation: what to write.
        data_set: its name.
        folder: where to.
        figures: name and caption of each figure that lies in `figures/` there.

    Returns:
        The text of `table.json`.

    """
    rows, summary = evaluation.rows, evaluation.summary
    text = json.dumps(as_json(evaluation, data_set), indent=1, allow_nan=False) + '\n'
    write_text(folder / 'table.json', text)
    write_text(folder / 'table.csv', as_csv([*rows, *summary]))
    write_text(folder / 'table.txt', as_text(rows, summary))
    title = f'Handovers by the primitive and by people: {data_set}'
    facts = _facts(evaluation)
    write_text(folder / 'index.html', page(title, facts, rows, summary, figures))
    return text


def write_figures(
    evaluation: Evaluation, folder: Path, progress: Callable[[int, int], None] | None = None
) -> list[tuple[str, str]]:
    """
    Draw the figures of an evaluation into `figures/`.

    Args:
        evaluation: what to draw.
        folder: where `figures/` goes.
        progress: is told how many of how many are drawn.

    Returns:
        Name and caption of each.

    """
    panels = [_panel(judged, evaluation.protocol) for judged in evaluation.cases]
    figures = []
    for figure in draw(panels, folder / 'figures'):
        figures.append(figure)
        if progress is not None:
            progress(len(figures), figure_count(panels))
    return figures


def _panel(judged: CaseScores, protocol: Protocol) -> Panel:
    case = judged.case
    everyone = range(len(case))
    representative = nearest_to_mean(case.curves)
    learnt = learn_from_trials(case, [representative], 'decoupled', protocol.learning)
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
    return Panel(case, representative, roll_out(*learnt, case, everyone), shown)


def _facts(evaluation: Evaluation) -> list[str]:
    protocol = evaluation.protocol
    cases: list[Case] = [judged.case for judged in evaluation.cases]
    parameters = protocol.learning.parameters
    band = (
        'Each trial is held against the spread of the others of its case; no model has seen it.'
        if protocol.leave_one_out
        else 'Each rollout is held against the spread of all P2 of its case.'
    )
    return [
        f'{sum(map(len, cases))} handovers, {len(cases)} cases.',
        'The primitive starts where P2 started and moves against the recorded hand of P1.',
        band,
        f'K = {parameters.stiffness:g}, D = {parameters.effective_damping:.3g}, '
        f'μ = {parameters.mu:g}, σ = {parameters.sigma:g}, {parameters.formulation} formulation, '
        f'{protocol.learning.regression} with {protocol.learning.basis} basis functions.',
    ]
