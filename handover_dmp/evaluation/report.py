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

"""The result folder of an evaluation: its tables and the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
import json
from pathlib import Path
from typing import Any

from handover_dmp import __version__
from handover_dmp.common.files import write_text
from handover_dmp.evaluation.arm import ArmEvaluation
from handover_dmp.evaluation.arm_table import arm_remarks, arm_tables
from handover_dmp.evaluation.case_table import CaseTable
from handover_dmp.evaluation.cases import Case
from handover_dmp.evaluation.in_short import in_short
from handover_dmp.evaluation.motions import measures_table, motions_beside
from handover_dmp.evaluation.page import page, picture
from handover_dmp.evaluation.protocol import Evaluation
from handover_dmp.evaluation.rollouts import moved_from
from handover_dmp.evaluation.sessions import SessionOutcome, sessions_beside, sessions_table
from handover_dmp.evaluation.table import as_csv, as_text, PAPER
from handover_dmp.evaluation.why import explanation, why_tables
import numpy as np


def as_json(
    evaluation: Evaluation,
    data_set: str,
    arm: ArmEvaluation | None = None,
    sessions: Sequence[SessionOutcome] = (),
) -> dict[str, Any]:
    """
    Convert an evaluation to plain types.

    Args:
        evaluation: the table.
        data_set: its name.
        arm: results of an arm, if one was evaluated.
        sessions: results of whole sessions, if there are any.

    Returns:
        `rows` and `summary` of the table, `distances` of every trial, all `rejections` and their
        summary `why`, `measures` of every motion and `sessions` with summaries, the answers
        `in_short`, and the protocol.

    """
    protocol = evaluation.protocol
    beside = motions_beside(evaluation.measures, None if arm is None else arm.motions)
    rejections = [
        one.as_json() for judged in evaluation.cases for one in judged.rejections.values()
    ]
    table: dict[str, Any] = {
        'data_set': data_set,
        'trials': sum(len(judged.case) for judged in evaluation.cases),
        'cases': len(evaluation.cases),
        'protocol': {
            'learn': list(protocol.learn),
            'leave_one_out': protocol.leave_one_out,
            **asdict(protocol.learning),
            'effective_damping': protocol.learning.parameters.effective_damping,
            'seed': protocol.seed,
            'bootstrap_rounds': protocol.rounds,
            'min_width_m': protocol.min_width_m,
        },
        'rows': [row.as_json() for row in evaluation.rows],
        'summary': [row.as_json() for row in evaluation.summary],
        'distances': _distances(evaluation, arm),
        'rejections': rejections,
        'why': [line for learn in protocol.learn for line in explanation(rejections, learn)],
        'measures': [trial.as_json() for trial in evaluation.measures],
        'measures_summary': [one.as_json(protocol.seed) for one in beside],
        'arm': None if arm is None else {**arm.as_json(), 'remarks': arm_remarks(arm)},
        'sessions': [outcome.as_json() for outcome in sessions],
        'sessions_summary': (
            [one.as_json(protocol.seed) for one in sessions_beside(sessions)] if sessions else []
        ),
        'paper': {
            learn: {str(k): p for k, p in within.items()} for learn, within in PAPER.items()
        },
        'version': __version__,
    }
    return {**table, 'in_short': in_short(table, moved_from(protocol.learn))}


def _distances(evaluation: Evaluation, arm: ArmEvaluation | None) -> list[dict[str, Any]]:
    """Return the distances of the decoupled primitive, the arm and people, trial by trial."""
    first, *_ = evaluation.protocol.learn
    judged = [
        (one.case, learn, method, scores)
        for one in evaluation.cases
        for (learn, method), scores in one.scores.items()
        if method == 'decoupled' or (learn, method) == (first, 'human')
    ]
    if arm is not None:
        judged += [(one.case, arm.learn, 'arm', one.arm) for one in arm.cases]
    found = []
    for case, learn, method, scores in judged:
        totals = scores.by_trial()
        for index in np.flatnonzero(scores.counted.any(axis=0)).tolist():
            found.append(
                {
                    'configuration': case.configuration,
                    'exchange': case.direction,
                    'trial': case.trials[index].number,
                    'method': method,
                    'learn': None if method == 'human' else learn,
                    **totals.as_json(index),
                }
            )
    return found


def write_evaluation(
    evaluation: Evaluation,
    data_set: str,
    folder: Path,
    figures: Sequence[tuple[str, str]],
    arm: ArmEvaluation | None = None,
    sessions: Sequence[SessionOutcome] = (),
) -> str:
    """
    Write `table.txt`, `table.csv`, `table.json` and `index.html`.

    Args:
        evaluation: the evaluation.
        data_set: its name.
        folder: output folder.
        figures: name and caption of each figure in its `figures/`.
        arm: results of an arm, if one was evaluated.
        sessions: results of whole sessions, if there are any.

    Returns:
        The text of `table.json`.

    """
    rows, summary = evaluation.rows, evaluation.summary
    learn = moved_from(evaluation.protocol.learn)
    table = as_json(evaluation, data_set, arm, sessions)
    text = json.dumps(table, indent=1, allow_nan=False) + '\n'
    write_text(folder / 'table.json', text)
    write_text(folder / 'table.csv', as_csv([*rows, *summary]))
    seed = evaluation.protocol.seed
    beside = motions_beside(evaluation.measures, None if arm is None else arm.motions)
    captions = dict(figures)
    shown: list[tuple[Sequence[CaseTable], list[str]]] = [
        ([] if arm is None else arm_tables(arm), []),
        ([measures_table(beside, learn, seed)], ['measures']),
        ([sessions_table(sessions, seed)], ['sessions']),
        (
            why_tables(table['rejections'], evaluation.protocol.learn),
            [name for name in captions if name.startswith('why_')],
        ),
    ]
    tables = [one for some, _ in shown for one in some]
    write_text(folder / 'table.txt', as_text(rows, summary, tables))
    sections = []
    for some, names in shown:
        sections += [one.as_html() for one in some]
        sections += [picture(name, captions.pop(name)) for name in names if name in captions]
    html = page(
        f'Handovers by the primitive and by people: {data_set}',
        _facts(evaluation),
        table['in_short'],
        rows,
        summary,
        sections,
        list(captions.items()),
    )
    write_text(folder / 'index.html', html)
    return text


def _facts(evaluation: Evaluation) -> list[str]:
    protocol = evaluation.protocol
    cases: list[Case] = [judged.case for judged in evaluation.cases]
    parameters = protocol.learning.parameters
    band = (
        'Each trial is tested against the spread of the others of its case; no model has seen it.'
        if protocol.leave_one_out
        else 'Each rollout is tested against the spread of all P2 of its case.'
    )
    return [
        f'{sum(map(len, cases))} handovers, {len(cases)} cases.',
        'The primitive starts where P2 started and moves against the recorded hand of P1.',
        band,
        f'K = {parameters.stiffness:g}, D = {parameters.effective_damping:.3g}, '
        f'μ = {parameters.mu:g}, σ = {parameters.sigma:g}, {parameters.formulation} formulation, '
        f'{protocol.learning.regression} with {protocol.learning.basis} basis functions.',
    ]
