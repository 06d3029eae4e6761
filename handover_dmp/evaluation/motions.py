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

"""The primitive's motions beside people's, by the measures that studies of handovers report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.evaluation.bootstrap import draw_samples, interval
from handover_dmp.evaluation.case_table import CaseTable
from handover_dmp.evaluation.cases import Case
from handover_dmp.evaluation.rollouts import learn_from_case, Learning, roll_out
from handover_dmp.mocap import velocities
from handover_dmp.mocap.filtering import RATE_HZ
from handover_dmp.mocap.measures import measure_motion, MotionMeasures, Synchrony, synchrony
from handover_dmp.mocap.typical import nearest_to_mean
import numpy as np

MEASURES = (
    ('path_ratio', 'path, in parts of the straight line', 3),
    ('peak_speed', 'peak speed, m/s', 2),
    ('time_to_peak_s', 'onset to peak speed, s', 2),
    ('duration_s', 'onset to rest, s', 2),
    ('peaks', 'peaks of the speed', 1),
    ('spectral_arc_length', 'spectral arc length', 2),
    ('log_dimensionless_jerk', 'log dimensionless jerk', 2),
    ('lag_s', 'speed later than the partner’s, s', 2),
)
"""Name in `table.json`, in words, digits."""

OF_TWO = ('lag_s', 'correlation')

NOTE = (
    'The primitive learnt from the trial nearest to the mean against every hand, beside what P2 '
    'did there; medians, and the mean difference in pairs with its 95 % interval from resampled '
    'trials. docs/method.md has the formulas.'
)


@dataclass(frozen=True)
class TrialMeasures:
    """
    One trial.

    Attributes:
        case: its case.
        number: its number.
        primitive: motion of the primitive; None where it does not move.
        person: of P2.
        partner: of P1.
        primitive_synchrony: of the primitive with P1.
        person_synchrony: of P2 with P1.

    """

    case: Case
    number: int
    primitive: MotionMeasures | None
    person: MotionMeasures | None
    partner: MotionMeasures | None
    primitive_synchrony: Synchrony | None
    person_synchrony: Synchrony | None

    def pair(self, name: str) -> tuple[float, float]:
        """Return a measure of the primitive and of P2; NaN where there is none."""
        of_two = self.primitive_synchrony, self.person_synchrony
        of_one = self.primitive, self.person
        first, second = (
            float(getattr(one, name, np.nan)) for one in (of_two if name in OF_TWO else of_one)
        )
        return first, second

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain types."""
        return {
            'configuration': self.case.configuration,
            'exchange': self.case.direction,
            'trial': self.number,
            **{
                name: None if one is None else _finite(asdict(one))
                for name, one in (
                    ('primitive', self.primitive),
                    ('person', self.person),
                    ('partner', self.partner),
                    ('primitive_synchrony', self.primitive_synchrony),
                    ('person_synchrony', self.person_synchrony),
                )
            },
        }


def measure_trials(cases: Sequence[Case], learning: Learning) -> list[TrialMeasures]:
    """
    Measure the motions of all trials.

    Args:
        cases: the trials.
        learning: how the primitive is learnt, from the trial of each case nearest to the mean.

    Returns:
        One a trial.

    """
    found = []
    for case in cases:
        learnt = learn_from_case(case, [nearest_to_mean(case.curves)], 'decoupled', learning)
        rollouts = roll_out(*learnt, case, range(len(case)))
        for index, trial in enumerate(case.trials):
            motions = rollouts[index, : len(trial.times)], trial.demonstrator, trial.partner
            speeds = [_speed(trial.times, motion) for motion in motions]
            primitive, person, partner = (measure_motion(trial.times, one) for one in motions)
            found.append(
                TrialMeasures(
                    case=case,
                    number=trial.number,
                    primitive=primitive,
                    person=person,
                    partner=partner,
                    primitive_synchrony=synchrony(speeds[2], speeds[0], RATE_HZ),
                    person_synchrony=synchrony(speeds[2], speeds[1], RATE_HZ),
                )
            )
    return found


def pairs_of(trials: Sequence[TrialMeasures], name: str) -> Array:
    """
    Collect a measure.

    Args:
        trials: measured.
        name: of the measure.

    Returns:
        (n, 2) of the primitive and of P2, where both have it.

    """
    values = np.array([trial.pair(name) for trial in trials])
    kept: Array = values[np.isfinite(values).all(axis=1)]
    return kept


def measures_table(trials: Sequence[TrialMeasures], seed: int) -> CaseTable:
    """
    Lay the measures out, over all cases.

    Args:
        trials: measured.
        seed: of the bootstrap.

    Returns:
        A line a measure.

    """
    lines = []
    for name, words, digits in MEASURES:
        values = pairs_of(trials, name)
        if not len(values):
            continue
        differences = values[:, 0] - values[:, 1]
        counts = draw_samples(len(values), np.random.SeedSequence(seed))
        low, high = interval(counts @ differences / counts.sum(axis=1))
        lines.append(
            [
                words,
                '',
                *(f'{np.median(column):.{digits}f}' for column in values.T),
                f'{differences.mean():+.{digits}f}',
                f'{low:+.{digits}f} to {high:+.{digits}f}',
            ]
        )
    head = ('measure', '', 'primitive', 'P2', 'difference', '95 %')
    return CaseTable('Motions beside each other', NOTE, head, lines)


def _speed(times: Array, positions: Array) -> Array:
    return np.asarray(np.linalg.norm(velocities(times, positions), axis=1))


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    return {name: value if np.isfinite(value) else None for name, value in values.items()}
