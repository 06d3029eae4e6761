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

"""
Invalid poses, which trackers send when they do not see the hand.

Few trackers stop sending. A lost body comes as zeros, as NaN, as a quaternion of norm 0, with a
covariance of -1 (as in `sensor_msgs`) or a huge one. Check a pose before transforming it: zeros
are no longer zeros in another frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import fsum, isfinite

# Indices of the variances of x, y, z in the 36 numbers of a `PoseWithCovariance`.
_VARIANCES = (0, 7, 14)


def no_pose(
    position: Sequence[float],
    orientation: Sequence[float] | None = None,
    covariance: Sequence[float] | None = None,
    max_deviation_m: float = float('inf'),
) -> str:
    """
    Tell whether a pose is invalid.

    Args:
        position: x, y, z in m.
        orientation: quaternion x, y, z, w, if the message has one.
        covariance: (36,), row by row, m² and rad², if the message has one; all zeros means
            unknown.
        max_deviation_m: a position with a larger standard deviation counts as unknown, m.

    Returns:
        The reason: `not_finite`, `zero`, `no_rotation` or `uncertain`; empty for a valid pose.

    """
    if not all(map(isfinite, position)):
        return 'not_finite'
    if not any(position):
        return 'zero'
    if orientation is not None and not 0.0 < fsum(q * q for q in orientation) < float('inf'):
        return 'no_rotation'
    if covariance is not None and any(covariance):
        variances = [covariance[place] for place in _VARIANCES]
        if not all(0.0 <= variance <= max_deviation_m**2 for variance in variances):
            return 'uncertain'
    return ''
