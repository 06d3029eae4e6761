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

"""Review of an imported trial: facts, and warnings of what is unusual."""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.mocap.filtering import smooth
from handover_dmp.mocap.trial import HandoverTrial
from handover_dmp.mocap.wrists import extent, Gap, STAMP_ROUNDING_S, WristMotion
import numpy as np

MAX_USUAL_SPEED = 3.0
MAX_USUAL_DISTANCE_M = 0.6
MIN_USUAL_DISTANCE_M = 0.02
MAX_REST_SPEED = 0.15
MIN_EDGE_SAMPLES = 3
# If P1 moves this much farther than P2, the two may be swapped.
_SWAPPED = 2.0
# Least sampling rate for a low-pass, Hz.
_CUTOFF_HZ = 6.0


@dataclass(frozen=True)
class Review:
    """
    The facts of an imported trial.

    Attributes:
        trial: the trial.
        unit: unit of length in its file, and the source of that knowledge.
        up: the same for the up axis.
        peak_speeds: peak speeds of the wrists of P1 and P2, m/s.
        nearest_m: least distance of the wrists, m.
        gaps: times in which a wrist was not seen, s from the start of the trial.
        warnings: sentences on what is unusual for a handover.

    """

    trial: HandoverTrial
    unit: str
    up: str
    peak_speeds: tuple[float, float]
    nearest_m: float
    gaps: tuple[Gap, ...]
    warnings: tuple[str, ...]


def review(trial: HandoverTrial, motion: WristMotion, start_s: float) -> Review:
    """
    Review an imported trial.

    Args:
        trial: the trial.
        motion: the recording that it was cut out of.
        start_s: start of the trial within the recording, s.

    Returns:
        Its facts, and what is unusual about it.

    """
    wrists = (trial.partner, trial.demonstrator)
    speeds = [_speeds(trial, wrist) for wrist in wrists]
    peaks = (float(speeds[0].max()), float(speeds[1].max()))
    nearest_m = float(np.linalg.norm(trial.partner - trial.demonstrator, axis=1).min())
    gaps = tuple(
        gap.since(start_s)
        for gap in motion.gaps
        if gap.end_s > start_s and gap.start_s < start_s + trial.duration_s
    )
    warnings = list(motion.remarks)
    for who, peak, speed in zip(('P1', 'P2'), peaks, speeds, strict=True):
        if peak > MAX_USUAL_SPEED:
            warnings.append(f'{who} moves at {peak:.1f} m/s, faster than in a usual handover')
        if speed[0] > MAX_REST_SPEED:
            warnings.append(f'{who} does not start at rest, but at {speed[0]:.2f} m/s')
    if nearest_m > MAX_USUAL_DISTANCE_M:
        warnings.append(f'the wrists come no nearer than {nearest_m:.2f} m')
    if nearest_m < MIN_USUAL_DISTANCE_M:
        warnings.append(f'the wrists come within {1e3 * nearest_m:.0f} mm: are they two wrists?')
    fewest = _fewest_between(trial.times, gaps)
    if fewest < MIN_EDGE_SAMPLES:
        warnings.append(f'only {fewest} samples between two gaps, or a gap and an end')
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


def _fewest_between(times: np.ndarray, gaps: tuple[Gap, ...]) -> int:
    """Return the number of samples of the shortest stretch in which both wrists were seen."""
    seen = np.ones(len(times), dtype=bool)
    edges = set()
    for gap in gaps:
        seen &= ~gap.hides(times)
        edges.add(int(np.searchsorted(times, gap.end_s - STAMP_ROUNDING_S)))
    counts = [int(part.sum()) for part in np.split(seen, sorted(edges))]
    return min((count for count in counts if count), default=0)


def _speeds(trial: HandoverTrial, wrist: np.ndarray) -> np.ndarray:
    cutoff_hz = _CUTOFF_HZ if trial.rate_hz > 2.5 * _CUTOFF_HZ else None
    _, _, velocities = smooth(trial.times, wrist, trial.rate_hz, cutoff_hz)
    return np.asarray(np.linalg.norm(velocities, axis=1))
