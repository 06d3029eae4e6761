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

"""Fluency of whole sessions: the robot in the role of P2, and the two people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from handover_dmp.common.errors import DataError
from handover_dmp.evaluation.beside import Beside, beside_table, NOTE, PERSON
from handover_dmp.evaluation.case_table import CaseTable
from handover_dmp.evaluation.motions import ALONE, ARM
from handover_dmp.evaluation.protocol import Progress
from handover_dmp.evaluation.rollouts import Learning
from handover_dmp.evaluation.session_runs import run_alone, run_arm, SessionMotion
from handover_dmp.handover.session import SessionModels
from handover_dmp.handover.session_scenario import make_session_scenario, trials_of
from handover_dmp.handover.teaching import learn_from_trials
from handover_dmp.mocap import HandoverTrial
from handover_dmp.mocap.data_set import read_data_set
from handover_dmp.mocap.fluency import people_fluency, SessionFluency
from handover_dmp.mocap.session import read_session, RecordedSession, session_files, SESSIONS_NAME
from handover_dmp.mocap.trial import INDEX_NAME
from handover_dmp.robot.descriptions import ArmChoice
from handover_dmp.robot.errors import UnreachableError
from handover_dmp.robot.model import BasePlacement
from joblib import delayed, Memory, Parallel
import numpy as np

SHARES = (
    ('person_idle', 'partner idle, share of the session'),
    ('robot_idle', 'robot or P2 idle'),
    ('concurrent', 'both active'),
    ('functional_delay', 'functional delay'),
)
WAITS = (
    ('person_s', 'partner waited at the exchange, s'),
    ('robot_s', 'robot or P2 waited there, s'),
)

TITLE = 'Fluency: sessions compared with those of two people'
NONE = (
    'No sessions: this data set contains only single reaches; their fluency is shown above. '
    '--sessions reads recordings of a give and a take in a row.'
)
WHAT = (
    'Shares of the time from the first reach on, and waits with the hand at the exchange (Hoffman '
    '2019). DMP: an ideal wrist that is always at the commanded position, during reach, exchange '
    'and way home; learnt from the other sessions of the configuration, or from the only one.'
)
WITH_ARM = ' arm: the simulated arm, with the object.'


@dataclass(frozen=True)
class SessionOutcome:
    """
    One session.

    Attributes:
        configuration: where the session took place.
        number: number of the session.
        learnt: numbers of the sessions that the movements were learnt from.
        exchanges: number of exchanges.
        movers: measures by mover; None if it did not move. The last mover is P2.
        done: by mover, whether the object was given and taken back.
        reasons: by mover, why there are no measures, or how far the session came.

    """

    configuration: str
    number: int
    learnt: tuple[int, ...]
    exchanges: int
    movers: dict[str, SessionFluency | None]
    done: dict[str, bool]
    reasons: dict[str, str]

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain types."""
        return {
            'configuration': self.configuration,
            'session': self.number,
            'learnt': list(self.learnt),
            'exchanges': self.exchanges,
            'fluency': {
                who: None if found is None else asdict(found) for who, found in self.movers.items()
            },
            'done': self.done,
            'reasons': self.reasons,
        }


def read_recorded(folder: Path, more: Sequence[Path] = ()) -> list[RecordedSession]:
    """
    Read the sessions of a data set, and further ones.

    Args:
        folder: the data set; its `sessions.csv` names sessions, if it has one.
        more: further folders with such an index, or single recordings.

    Returns:
        The sessions.

    Raises:
        DataError: a session cannot be read.

    """
    found = session_files(folder) if (folder / SESSIONS_NAME).exists() else []
    for place in more:
        found += session_files(place) if (place / SESSIONS_NAME).exists() else [place]
    return [read_session(file) for file in found]


def read_trials(folder: Path) -> list[HandoverTrial]:
    """
    Read the trials of a data set, or cut them out of its sessions.

    Args:
        folder: folder with `trials.csv` or, if that is missing, with `sessions.csv`.

    Returns:
        The trials; if they were cut, numbered from 1 for each configuration and direction.

    Raises:
        DataError: there is no index, or a file of it cannot be read.

    """
    if (folder / INDEX_NAME).exists() or not (folder / SESSIONS_NAME).exists():
        return read_data_set(folder)
    trials: list[HandoverTrial] = []
    for session in read_recorded(folder):
        for trial in trials_of(session):
            before = [(one.configuration, one.direction) for one in trials]
            number = 1 + before.count((trial.configuration, trial.direction))
            trials.append(replace(trial, number=number))
    return trials


def evaluate_sessions(
    sessions: Sequence[RecordedSession],
    learning: Learning,
    choice: ArmChoice | None,
    cache: Path,
    *,
    jobs: int = 1,
    progress: Progress | None = None,
) -> list[SessionOutcome]:
    """
    Run whole sessions in which the robot replaces P2.

    Args:
        sessions: recorded sessions.
        learning: how the movements are learnt.
        choice: an arm to run the sessions, too; None: the movements alone.
        cache: folder for finished sessions of the arm.
        jobs: number of processes; −1 for one per processor.
        progress: called with the number of finished sessions and of all sessions.

    Returns:
        The outcomes, one per session.

    """
    run = _go_through if choice is None else Memory(cache, verbose=0).cache(_go_through)
    bases: dict[str, BasePlacement | str] = {}
    calls = []
    for session in sessions:
        group = [one for one in sessions if one.configuration == session.configuration]
        others = [one for one in group if one is not session] or [session]
        if choice is not None and session.configuration not in bases:
            bases[session.configuration] = _place(group[0], others, learning, choice)
        base = bases.get(session.configuration)
        calls.append(delayed(run)(session, others, learning, choice, base))
    found = []
    for outcome in Parallel(n_jobs=jobs, return_as='generator')(calls):
        found.append(outcome)
        if progress is not None:
            progress(len(found), len(calls))
    return found


def _go_through(
    session: RecordedSession,
    taught: Sequence[RecordedSession],
    learning: Learning,
    choice: ArmChoice | None,
    base: BasePlacement | str | None,
) -> SessionOutcome:
    movers: dict[str, SessionFluency | None] = dict.fromkeys(
        (ALONE,) if choice is None else (ALONE, ARM)
    )
    done: dict[str, bool] = {}
    reasons: dict[str, str] = {}

    def record(who: str, motion: SessionMotion) -> None:
        movers[who], done[who] = motion.fluency(), motion.done
        if not motion.done:
            reasons[who] = motion.unfinished()

    partner_model = 'off' if learning.partner is None else 'auto'
    low_passed = session.low_passed(learning.cutoff_hz or 0.0)
    try:
        models = _learn(taught, learning)
    except DataError as error:
        reasons = dict.fromkeys(movers, str(error))
    else:
        record(ALONE, run_alone(low_passed, models, partner_model))
        if isinstance(base, str):
            reasons[ARM] = base
        elif choice is not None:
            try:
                scenario = make_session_scenario(
                    session, models=models, arm=choice, base=base, partner_model=partner_model
                )
            except UnreachableError as error:
                reasons[ARM] = str(error)
            else:
                record(ARM, run_arm(scenario))
    movers[PERSON] = people_fluency(session)
    learnt = tuple(one.number for one in taught)
    return SessionOutcome(
        session.configuration,
        session.number,
        learnt,
        len(session.exchanges),
        movers,
        done,
        reasons,
    )


def _place(
    session: RecordedSession,
    taught: Sequence[RecordedSession],
    learning: Learning,
    choice: ArmChoice,
) -> BasePlacement | str:
    """Place the arm for a session, or return why that is impossible."""
    try:
        models = _learn(taught, learning)
        return make_session_scenario(session, models=models, arm=choice).robot.base
    except (DataError, UnreachableError) as error:
        return str(error)


def _learn(taught: Sequence[RecordedSession], learning: Learning) -> SessionModels:
    """Learn the mean give and the mean take of sessions."""
    trials = [trial for session in taught for trial in trials_of(session)]
    learnt = {}
    for direction in ('give', 'take'):
        chosen = [trial for trial in trials if trial.direction == direction]
        if not chosen:
            raise DataError(f'the sessions of {taught[0].configuration} have no {direction}')
        learnt[direction] = learn_from_trials(
            chosen,
            learning.parameters,
            regression=learning.regression,
            basis=learning.basis,
            cutoff_hz=learning.cutoff_hz,
        )
    return SessionModels(learnt['give'], learnt['take'])


def sessions_beside(outcomes: Sequence[SessionOutcome]) -> list[Beside]:
    """
    Compare the sessions.

    Args:
        outcomes: one or more outcomes.

    Returns:
        One entry per measure, with a value per session; for waits, per exchange.

    """
    movers = list(outcomes[0].movers)
    found = []
    for name, words in SHARES:
        shares = {who: np.array([_share(one, who, name) for one in outcomes]) for who in movers}
        found.append(Beside(name, words, 2, shares))
    for name, words in WAITS:
        waits = {
            who: np.concatenate([_waits(one, who, name) for one in outcomes]) for who in movers
        }
        found.append(Beside(f'wait_{name}', words, 2, waits))
    return found


def sessions_table(outcomes: Sequence[SessionOutcome], seed: int) -> CaseTable:
    """
    Make the table of sessions.

    Args:
        outcomes: the outcomes, or none.
        seed: seed of the bootstrap.

    Returns:
        One line per measure, and remarks on sessions that were not completed. Without sessions,
        only a line that says so.

    """
    if not outcomes:
        return CaseTable(TITLE, NONE, (), [])
    note = f'{len(outcomes)} sessions. {WHAT}{WITH_ARM if ARM in outcomes[0].movers else ""} '
    failed = [
        f'{one.configuration} {one.number}, {who}: not given and taken back: {reason.rstrip(".")}.'
        for one in outcomes
        for who, reason in one.reasons.items()
    ]
    note += NOTE.format(what='sessions and exchanges')
    return replace(beside_table(TITLE, note, sessions_beside(outcomes), seed), remarks=failed)


def _share(outcome: SessionOutcome, who: str, name: str) -> float:
    found = outcome.movers[who]
    return float('nan') if found is None else float(getattr(found.whole, name))


def _waits(outcome: SessionOutcome, who: str, name: str) -> list[float]:
    """Return the wait at each exchange, NaN for exchanges that did not take place."""
    found = outcome.movers[who]
    waits = [] if found is None else [float(getattr(wait, name)) for wait in found.waits]
    missing = outcome.exchanges - len(waits)
    return [*waits[: outcome.exchanges], *[float('nan')] * missing]
