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

"""The offset between the clocks of two trackers, from their paths of the same hand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

StampedPath = Sequence[tuple[float, tuple[float, float, float]]]

MAX_OFFSET_S = 0.6
STEP_S = 0.02
MIN_MOTION_M = 0.03
MIN_SAMPLES = 20
# Errors of neighbouring poses are correlated, so each carries less information.
_CORRELATION = 3.0


class ClockOffset(NamedTuple):
    """
    Offset of one tracker's stamps relative to those of another one.

    Attributes:
        offset_s: the offset, positive if late, s.
        deviation_s: its standard deviation, s.

    """

    offset_s: float
    deviation_s: float


def clock_offset(poses: StampedPath, other: StampedPath) -> ClockOffset | None:
    """
    Find the time shift for which two paths fit best, up to a constant offset in space.

    Args:
        poses: stamp (s) and position (m) of each pose of the tracker in question, in order of
            their stamps.
        other: the same of the other tracker.

    Returns:
        The delay of the first one's stamps; None if the motion does not determine it.

    """
    times, path, of_times, of_path = (
        np.array([pose[part] for pose in each]) for each in (poses, other) for part in (0, 1)
    )
    if len(times) < MIN_SAMPLES or len(of_times) < MIN_SAMPLES:
        return None
    inside = (times > of_times[0] + MAX_OFFSET_S) & (times < of_times[-1] - MAX_OFFSET_S)
    count = int(inside.sum())
    if count < MIN_SAMPLES:
        return None
    times, path = times[inside], path[inside]
    steps = round(MAX_OFFSET_S / STEP_S)
    offsets = STEP_S * np.arange(-steps, steps + 1)
    at = (times[None, :] - offsets[:, None]).ravel()
    seen = np.column_stack([np.interp(at, of_times, axis) for axis in of_path.T])
    apart = seen.reshape(len(offsets), count, 3) - path
    apart -= apart.mean(axis=1, keepdims=True)
    errors = np.square(apart).sum(axis=(1, 2))
    best = int(np.argmin(errors))
    if not 0 < best < len(offsets) - 1:
        return None
    spread = np.square(path - path.mean(axis=0)).sum()
    if spread < count * MIN_MOTION_M**2 or errors[best] > 0.1 * spread:
        return None
    before, least, after = (errors[best + step] for step in (-1, 0, 1))
    curvature = (before - 2.0 * least + after) / STEP_S**2
    if curvature <= 0.0:
        return None
    shift = 0.5 * (before - after) / (before - 2.0 * least + after) * STEP_S
    variance = least / (3.0 * count)
    deviation = float(np.sqrt(2.0 * variance / curvature)) * _CORRELATION
    return ClockOffset(float(offsets[best] + shift), deviation)
