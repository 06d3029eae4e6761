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

"""Comparison of trials of one kind: time-normalised curves, and how typical each trial is."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.mocap.trial import HandoverTrial, read_trial
import numpy as np

SAMPLES = 101
"""Samples of a time-normalised curve: one per hundredth of the duration, with both ends."""

UNUSUAL = 2.0
"""A trial is unusual if its distance exceeds the median distance by this factor."""
MIN_OTHERS = 3
"""Least number of trials to tell what is usual."""


def time_normalise(times: Array, positions: Array, samples: int = SAMPLES) -> Array:
    """
    Resample a trajectory to equally spaced fractions of its own duration.

    Args:
        times: (n,) s, increasing, possibly uneven.
        positions: (n, d) m.
        samples: number of samples.

    Returns:
        (samples, d) m, by linear interpolation; first and last sample are kept.

    """
    at = np.linspace(times[0], times[-1], samples)
    return np.stack([np.interp(at, times, column) for column in positions.T], axis=1)


def demonstrator_curves(trials: Sequence[HandoverTrial]) -> Array:
    """
    Time-normalise the motions of P2.

    Args:
        trials: n trials.

    Returns:
        (n, 101, 3) m.

    """
    return np.stack([time_normalise(trial.times, trial.demonstrator) for trial in trials])


def nearest_to_mean(curves: Array) -> int:
    """
    Find the curve with the least root-mean-square distance to the mean of all.

    Args:
        curves: (n, samples, d) m.

    Returns:
        Its index.

    """
    return int(((curves - curves.mean(axis=0)) ** 2).sum(axis=(1, 2)).argmin())


def distances_to_others(curves: Array) -> Array:
    """
    Measure the distance of each curve to the mean of all others.

    Args:
        curves: (n, samples, d) m, n ≥ 2.

    Returns:
        (n,) root-mean-square distance, m.

    """
    others = (curves.sum(axis=0) - curves) / (len(curves) - 1)
    return np.asarray(np.sqrt(((curves - others) ** 2).sum(axis=2).mean(axis=1)))


def is_unusual(trial: HandoverTrial, others: Sequence[HandoverTrial]) -> str:
    """
    Tell whether a trial is far from others of its kind.

    Args:
        trial: the trial.
        others: trials of the same configuration and exchange.

    Returns:
        The distance in words; empty if it is usual, or if there are too few others to tell.

    """
    if len(others) < MIN_OTHERS:
        return ''
    own, *rest = distances_to_others(demonstrator_curves([trial, *others]))
    middle = float(np.median(rest))
    if own <= UNUSUAL * middle:
        return ''
    return (
        f'{1e3 * own:.0f} mm from the mean of the {len(others)} others beside it; the '
        f'median distance of the others is {1e3 * middle:.0f} mm'
    )


def trials_beside(file: Path, trial: HandoverTrial) -> list[HandoverTrial]:
    """
    Read the trials of the same configuration and exchange in the folder of one.

    Args:
        file: file of the trial.
        trial: the trial.

    Returns:
        The other trials; files without a trial are skipped.

    """
    others = []
    for path in sorted(file.parent.glob(f'{trial.configuration}_{trial.direction}_*.csv')):
        try:
            other = read_trial(path)
        except DataError:
            continue
        if path.name != file.name and other.direction == trial.direction:
            others.append(other)
    return others
