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

"""The folder that an evaluation leaves: its tables, and the page that shows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
import json
from pathlib import Path
from typing import Any

from handover_dmp import __version__
from handover_dmp.common.files import write_text
from handover_dmp.evaluation.arm import ArmEvaluation
from handover_dmp.evaluation.arm_table import arm_remarks, arm_table
from handover_dmp.evaluation.cases import Case
from handover_dmp.evaluation.motions import measures_table, motions_beside
from handover_dmp.evaluation.page import page
from handover_dmp.evaluation.protocol import Evaluation
from handover_dmp.evaluation.sessions import SessionOutcome, sessions_beside, sessions_table
from handover_dmp.evaluation.table import as_csv, as_text, PAPER
from handover_dmp.evaluation.why import explanation, why_table


def as_json(
    evaluation: Evaluation,
    data_set: str,
    arm: ArmEvaluation | None = None,
    sessions: Sequence[SessionOutcome] = (),
) -> dict[str, Any]:
    """
    Say everything about an evaluation in plain types.

    Args:
        evaluation: the table.
        data_set: its name.
        arm: what an arm did, if one was asked for.
        sessions: what was done in whole sessions, if there are any.

    Returns:
        `rows` and `summary` as the table has them, every single one of `rejections` and `why` they
        are, `measures` of every motion and `sessions` with their summaries, and how all of it came
        about.

    """
    protocol = evaluation.protocol
    beside = motions_beside(evaluation.measures, None if arm is None else arm.motions)
    rejections = [
        one.as_json() for judged in evaluation.cases for one in judged.rejections.values()
    ]
    return {
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
        evaluation: what to write.
        data_set: its name.
        folder: where to.
        figures: name and caption of each figure that lies in `figures/` there.
        arm: what an arm did, if one was asked for.
        sessions: what was done in whole sessions, if there are any.

    Returns:
        The text of `table.json`.

    """
    rows, summary = evaluation.rows, evaluation.summary
    table = as_json(evaluation, data_set, arm, sessions)
    text = json.dumps(table, indent=1, allow_nan=False) + '\n'
    write_text(folder / 'table.json', text)
    write_text(folder / 'table.csv', as_csv([*rows, *summary]))
    write_text(folder / 'table.txt', as_text(rows, summary))
    title = f'Handovers by the primitive and by people: {data_set}'
    facts = _facts(evaluation)
    seed = evaluation.protocol.seed
    beside = motions_beside(evaluation.measures, None if arm is None else arm.motions)
    tables = [] if arm is None else [arm_table(arm)]
    tables.append(measures_table(beside, seed))
    tables.append(sessions_table(sessions, seed))
    tables += [why_table(table['rejections'], learn) for learn in evaluation.protocol.learn]
    sections = [one.as_html() for one in tables]
    write_text(folder / 'index.html', page(title, facts, rows, summary, figures, sections))
    return text


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
