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

"""Measures of the motions of the primitive, of an arm and of people, as in studies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache, partial
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.evaluation.beside import Beside, beside_table, NOTE, PERSON
from handover_dmp.evaluation.case_table import CaseTable
from handover_dmp.evaluation.cases import Case
from handover_dmp.evaluation.rollouts import learn_from_case, Learning, roll_out, sources_of
from handover_dmp.mocap import HandoverTrial, velocities
from handover_dmp.mocap.filtering import RATE_HZ
from handover_dmp.mocap.measures import (
    Fluency,
    fluency,
    measure_motion,
    MotionMeasures,
    Synchrony,
    synchrony,
)
import numpy as np

MEASURES = (
    ('path_m', 'path length, m', 2),
    ('path_ratio', 'path length / straight line', 3),
    ('peak_speed', 'peak speed, m/s', 2),
    ('time_to_peak_s', 'onset to peak speed, s', 2),
    ('duration_s', 'onset to rest, s', 2),
    ('peaks', 'number of speed peaks', 1),
    ('spectral_arc_length', 'spectral arc length', 2),
    ('log_dimensionless_jerk', 'log dimensionless jerk', 2),
    ('lag_s', 'lag behind the partner’s speed, s', 2),
    ('correlation', 'correlation of the two speeds', 2),
    ('distance_min_m', 'least distance to the partner, m', 3),
    ('relative_speed_m_s', 'relative speed at the end, m/s', 2),
    ('robot_idle', 'idle, share of reach', 2),
    ('concurrent', 'both active, share of reach', 2),
    ('functional_delay', 'functional delay, share of reach', 2),
)
"""Name in `table.json`, label, digits."""

ALONE = 'DMP'
ARM = 'arm'

TITLE = 'Smoothness and fluency: motions compared with those of P2'
WHAT = (
    'DMP: the primitive (learn {learn}) against every hand. Spectral '
    'arc length and log dimensionless jerk: the greater, the smoother. Active: faster than 0.05 '
    'm/s. Functional delay: from the end of each one’s motion to the beginning of the other’s; '
    'negative where the other begins before.'
)
WITH_ARM = ' arm: the simulated arm with the same movement.'


@dataclass(frozen=True)
class MotionBeside:
    """
    A motion of P2 or of what replaces P2.

    Attributes:
        motion: measures of the motion itself; None if nothing moves.
        synchrony: synchrony with the motion of P1; None if one of the two speeds never changes.
        fluency: fluency with P1 as the person and this motion as the robot.
        distance_min_m: least distance to P1, m.
        relative_speed_m_s: speed relative to P1 at the end, m/s.

    """

    motion: MotionMeasures | None
    synchrony: Synchrony | None
    fluency: Fluency
    distance_min_m: float
    relative_speed_m_s: float

    def as_json(self) -> dict[str, Any]:
        """Return every measure by its name; None if there is none."""
        found: dict[str, Any] = dict.fromkeys(name for name, *_ in MEASURES)
        found['distance_min_m'] = self.distance_min_m
        found['relative_speed_m_s'] = self.relative_speed_m_s
        for part in (self.motion, self.synchrony, self.fluency):
            if part is not None:
                found |= asdict(part)
        return _finite(found)


@dataclass(frozen=True)
class TrialMeasures:
    """
    One trial.

    Attributes:
        case: its case.
        number: its number.
        primitive: motion of the primitive.
        person: motion of P2.
        partner: motion of P1; None if nothing moves.

    """

    case: Case
    number: int
    primitive: MotionBeside
    person: MotionBeside
    partner: MotionMeasures | None

    @property
    def label(self) -> tuple[str, str, int]:
        """Return configuration, direction and number."""
        return *self.case.key, self.number

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain types."""
        return {
            'configuration': self.case.configuration,
            'exchange': self.case.direction,
            'trial': self.number,
            'primitive': self.primitive.as_json(),
            'person': self.person.as_json(),
            'partner': None if self.partner is None else _finite(asdict(self.partner)),
        }


def measure_beside(trial: HandoverTrial, motion: Array) -> MotionBeside:
    """
    Measure a motion of P2 or of what replaces P2.

    Args:
        trial: the trial, smooth and evenly spaced.
        motion: (n, 3) m, at the times of the trial, smooth.

    Returns:
        The measures.

    """
    moved = [velocities(trial.times, one) for one in (trial.partner, motion)]
    partner, own = (np.asarray(np.linalg.norm(one, axis=1)) for one in moved)
    return MotionBeside(
        motion=measure_motion(trial.times, motion),
        synchrony=synchrony(partner, own, RATE_HZ),
        fluency=fluency(partner, own),
        distance_min_m=float(np.linalg.norm(motion - trial.partner, axis=1).min()),
        relative_speed_m_s=float(np.linalg.norm(moved[1][-1] - moved[0][-1])),
    )


def measure_trials(
    cases: Sequence[Case], learning: Learning, learn: str = 'mean', *, leave_one_out: bool = False
) -> list[TrialMeasures]:
    """
    Measure the motions of all trials.

    Args:
        cases: the trials.
        learning: how the primitive is learnt.
        learn: source of the movement, as for `sources_of`; an arm uses the same.
        leave_one_out: whether a model must not have seen the trial that it moves against.

    Returns:
        The measures, one per trial.

    """
    found = []
    for case in cases:
        learnt = cache(partial(learn_from_case, case, method='decoupled', learning=learning))
        sources = sources_of(case, learn, leave_one_out=leave_one_out)
        for index, trial in enumerate(case.trials):
            rollout = roll_out(*learnt(sources[index]), case, [index])[0]
            primitive = measure_beside(trial, rollout[: len(trial.times)])
            person = measure_beside(trial, trial.demonstrator)
            partner = measure_motion(trial.times, trial.partner)
            found.append(TrialMeasures(case, trial.number, primitive, person, partner))
    return found


def motions_beside(
    trials: Sequence[TrialMeasures],
    arm: Mapping[tuple[str, str, int], MotionBeside] | None = None,
) -> list[Beside]:
    """
    Compare the motions of all trials.

    Args:
        trials: the measured trials.
        arm: motions of an arm, by the label of the trial; trials out of its reach are missing.

    Returns:
        One entry per measure.

    """
    movers: dict[str, list[dict[str, Any]]] = {ALONE: [one.primitive.as_json() for one in trials]}
    if arm is not None:
        went = [arm.get(one.label) for one in trials]
        movers[ARM] = [{} if one is None else one.as_json() for one in went]
    movers[PERSON] = [one.person.as_json() for one in trials]
    return [
        Beside(
            name,
            words,
            digits,
            {
                who: np.array([one.get(name) for one in all_of_them], dtype=np.float64)
                for who, all_of_them in movers.items()
            },
        )
        for name, words, digits in MEASURES
    ]


def measures_table(measures: Sequence[Beside], learn: str, seed: int) -> CaseTable:
    """
    Make the table of motions over all cases.

    Args:
        measures: result of `motions_beside`.
        learn: source of the movement.
        seed: seed of the bootstrap.

    Returns:
        One line per measure.

    """
    with_arm = WITH_ARM if ARM in measures[0].values else ''
    note = f'{WHAT.format(learn=learn)}{with_arm} {NOTE.format(what="trials")}'
    return beside_table(TITLE, note, measures, seed)


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    return {
        name: None if value is None or not np.isfinite(value) else value
        for name, value in values.items()
    }
