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

"""The trials of one configuration and exchange, conditioned and time-normalised."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.mocap import condition, HandoverTrial, velocities
from handover_dmp.mocap.filtering import CUTOFF_HZ
from handover_dmp.mocap.typical import demonstrator_curves, SAMPLES, time_normalise
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Hands:
    """
    The hands of several P1 on one clock, so that one call rolls out against all of them.

    Attributes:
        times: (m,) s from the start, as long as the longest trial.
        positions: (n, m, 3) m; after the end of its trial a hand stands still.
        velocities: (n, m, 3) m/s.
        samples: (n,) number of recorded samples of each trial.

    """

    times: Array
    positions: Array
    velocities: Array
    samples: NDArray[np.int_]

    @classmethod
    def of(cls, trials: Sequence[HandoverTrial]) -> Hands:
        """
        Align trials of one rate.

        Args:
            trials: conditioned trials: their samples are evenly spaced at one rate.

        Returns:
            Their hands.

        """
        samples = np.array([len(trial.times) for trial in trials])
        longest = trials[int(samples.argmax())].times
        positions = np.empty((len(trials), len(longest), 3))
        speeds = np.zeros_like(positions)
        for index, trial in enumerate(trials):
            positions[index, : samples[index]] = trial.partner
            positions[index, samples[index]:] = trial.partner[-1]  # fmt: skip
            speeds[index, : samples[index]] = velocities(trial.times, trial.partner)
        return cls(longest - longest[0], positions, speeds, samples)

    def time_normalise(self, rollouts: Array, tested: Sequence[int]) -> Array:
        """
        Time-normalise rollouts against some of the hands, each over the duration of its trial.

        Args:
            rollouts: (k, at most m, 3) m, on `times`.
            tested: indices of the k trials whose hands they followed.

        Returns:
            (k, 101, 3) m.

        """
        last = self.samples[list(tested)] - 1
        at = np.linspace(0.0, last.astype(np.float64), SAMPLES, axis=1)
        before = np.minimum(at.astype(np.int_), last[:, None] - 1)
        share = (at - before)[..., None]
        trial = np.arange(len(rollouts))[:, None]
        curves = rollouts[trial, before] * (1.0 - share) + rollouts[trial, before + 1] * share
        return np.asarray(curves)


@dataclass(frozen=True)
class Case:
    """
    All trials of one configuration and exchange.

    Attributes:
        configuration: e.g. `engine_bay`.
        direction: `give` or `take`.
        trials: the trials, resampled to 200 Hz and low-passed, each starting at 0 s.

    """

    configuration: str
    direction: str
    trials: tuple[HandoverTrial, ...]

    def __len__(self) -> int:
        return len(self.trials)

    @property
    def key(self) -> tuple[str, str]:
        """Return configuration and direction."""
        return self.configuration, self.direction

    @cached_property
    def durations_s(self) -> Array:
        """(n,) duration of each trial, s."""
        return np.array([trial.times[-1] - trial.times[0] for trial in self.trials])

    @cached_property
    def curves(self) -> Array:
        """(n, 101, 3) m, the time-normalised P2 of each trial."""
        return demonstrator_curves(self.trials)

    @cached_property
    def partner_curves(self) -> Array:
        """(n, 101, 3) m, the time-normalised P1 of each trial."""
        return np.stack([time_normalise(trial.times, trial.partner) for trial in self.trials])

    @cached_property
    def starts(self) -> Array:
        """(n, 3) m, where each P2 starts."""
        return np.stack([trial.demonstrator[0] for trial in self.trials])

    @cached_property
    def goal_offsets(self) -> Array:
        """(n, 3) m, P2(end) − P1(end) of each trial."""
        return np.stack([trial.demonstrator[-1] - trial.partner[-1] for trial in self.trials])

    @cached_property
    def hands(self) -> Hands:
        """Return the hands of all P1 on one clock."""
        return Hands.of(self.trials)


def make_cases(
    trials: Sequence[HandoverTrial],
    *,
    min_trials: int = 2,
    cutoff_hz: float | None = CUTOFF_HZ,
) -> list[Case]:
    """
    Sort trials into cases and condition them.

    Args:
        trials: trials of any configurations and exchanges, in any order.
        min_trials: least number of trials in a case.
        cutoff_hz: low-pass of the recordings, Hz; None: they are smooth already.

    Returns:
        The cases in order of their first trial, trials in order of their number.

    Raises:
        DataError: there are no trials, or too few in a case.

    """
    if not trials:
        raise DataError('the data set holds no trials')
    groups: dict[tuple[str, str], list[HandoverTrial]] = {}
    for trial in trials:
        groups.setdefault((trial.configuration, trial.direction), []).append(trial)
    cases = []
    for (configuration, direction), group in groups.items():
        if len(group) < min_trials:
            raise DataError(
                f'{group[0].source or group[0].label}: {configuration} {direction} has '
                f'{len(group)} trial{"s" * (len(group) > 1)}, at least {min_trials} are needed'
            )
        group.sort(key=lambda trial: trial.number)
        conditioned = [condition(trial, cutoff_hz=cutoff_hz) for trial in group]
        cases.append(Case(configuration, direction, tuple(conditioned)))
    return cases


def index_of(case: Case, number: int) -> int:
    """
    Find a trial by its number.

    Args:
        case: the trials.
        number: number of the trial.

    Returns:
        Its index.

    Raises:
        DataError: the case has no such trial.

    """
    numbers = [trial.number for trial in case.trials]
    if number not in numbers:
        listed = ', '.join(map(str, numbers))
        raise DataError(
            f'{case.configuration} {case.direction} has no trial {number}; it has {listed}'
        )
    return numbers.index(number)
