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

"""What is worth a look in an imported trial before it is believed: facts, and what is unusual."""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.mocap.filtering import smooth
from handover_dmp.mocap.trial import HandoverTrial
from handover_dmp.mocap.wrists import extent, WristMotion
import numpy as np

MAX_USUAL_SPEED = 3.0
MAX_USUAL_DISTANCE_M = 0.6
MAX_REST_SPEED = 0.15
MIN_EDGE_SAMPLES = 3
# A P1 that goes this much farther than P2 may be the one who hands over.
_SWAPPED = 2.0
_MISSED_PERIODS = 1.8
# A low-pass needs a rate to speak of.
_CUTOFF_HZ = 6.0


@dataclass(frozen=True)
class Review:
    """
    What an imported trial looks like.

    Attributes:
        trial: the trial.
        unit: of length in its file, and where that is known from.
        up: the same of the axis that points up.
        peak_speeds: of the wrists of P1 and P2, m/s.
        nearest_m: least distance of the wrists, m.
        gaps: when samples are missing in the trial, s, from and to.
        warnings: what is unusual for a handover, a sentence each.

    """

    trial: HandoverTrial
    unit: str
    up: str
    peak_speeds: tuple[float, float]
    nearest_m: float
    gaps: tuple[tuple[float, float], ...]
    warnings: tuple[str, ...]


def review(trial: HandoverTrial, motion: WristMotion) -> Review:
    """
    Look at an imported trial.

    Args:
        trial: the trial.
        motion: the recording that it was cut out of.

    Returns:
        Its facts, and what is unusual about it.

    """
    wrists = (trial.partner, trial.demonstrator)
    speeds = [_speeds(trial, wrist) for wrist in wrists]
    peaks = (float(speeds[0].max()), float(speeds[1].max()))
    nearest_m = float(np.linalg.norm(trial.partner - trial.demonstrator, axis=1).min())
    steps = np.diff(trial.times)
    wide = np.flatnonzero(steps > _MISSED_PERIODS * np.median(steps))
    gaps = tuple((float(trial.times[k]), float(trial.times[k + 1])) for k in wide)
    warnings = list(motion.remarks)
    for who, peak, speed in zip(('P1', 'P2'), peaks, speeds, strict=True):
        if peak > MAX_USUAL_SPEED:
            warnings.append(f'{who} moves at {peak:.1f} m/s, faster than in a usual handover')
        if speed[0] > MAX_REST_SPEED:
            warnings.append(f'{who} does not start at rest, but at {speed[0]:.2f} m/s')
    if nearest_m > MAX_USUAL_DISTANCE_M:
        warnings.append(f'the wrists come no nearer than {nearest_m:.2f} m')
    edges = np.diff([0, *(wide + 1), len(trial.times)])
    if len(wide) and edges.min() < MIN_EDGE_SAMPLES:
        warnings.append(f'only {edges.min()} samples between two gaps, or a gap and an end')
    first, second = (extent(wrist) for wrist in wrists)
    if first > _SWAPPED * second:
        warnings.append(f'P1 moves {first:.2f} m, P2 {second:.2f} m: are they swapped?')
    return Review(
        trial,
        f'{motion.unit.value} ({motion.unit.why})',
        f'{motion.up.value} ({motion.up.why})',
        peaks,
        nearest_m,
        gaps,
        tuple(warnings),
    )


def _speeds(trial: HandoverTrial, wrist: np.ndarray) -> np.ndarray:
    cutoff_hz = _CUTOFF_HZ if trial.rate_hz > 2.5 * _CUTOFF_HZ else None
    _, _, velocities = smooth(trial.times, wrist, trial.rate_hz, cutoff_hz)
    return np.asarray(np.linalg.norm(velocities, axis=1))
