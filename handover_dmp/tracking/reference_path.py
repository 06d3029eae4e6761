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

"""A path that is smooth and defined at any time, except for its gaps."""

from __future__ import annotations

from handover_dmp.common.arrays import Array
from handover_dmp.common.quaternions import with_continuous_signs
from handover_dmp.mocap.body_path import BodyPath
from handover_dmp.mocap.filtering import interpolate, smooth
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.spatial.transform import Rotation

CUTOFF_HZ = 8.0
"""Cutoff, above the frequencies of people and arms; noise would favour times off the samples."""
SHARE_OF_RATE = 0.3
"""Maximum cutoff, in units of the sampling rate."""
MAX_GAP_S = 0.15
"""Time between two poses, if also above three periods, beyond which there is a gap."""
SPIKE_M = 0.03
"""Distance from its neighbours, if also five times the usual one, of an invalid pose, m."""
SPIKE_NEIGHBOURS = 5
RESAMPLED_HZ = 200.0


class ReferencePath:
    """Positions and rotations between the poses of a path."""

    def __init__(self, path: BodyPath) -> None:
        """
        Interpolate a path after removing spikes and low-pass filtering.

        Args:
            path: path of the body.

        """
        kept = ~spikes(path.positions)
        self.times = path.times[kept]
        periods = np.diff(self.times)
        usual_s = float(np.median(periods))
        self._max_gap_s = max(MAX_GAP_S, 3.0 * usual_s)
        cutoff_hz = min(CUTOFF_HZ, SHARE_OF_RATE / usual_s)
        edges = np.flatnonzero(periods > self._max_gap_s) + 1
        self._gaps = np.column_stack([self.times[edges - 1], self.times[edges]])
        columns = [path.positions[kept]]
        self.turns = path.quaternions is not None
        """Whether the path has rotations."""
        if path.quaternions is not None:
            columns.append(with_continuous_signs(path.quaternions[kept]))
        times, smoothed, _ = smooth(self.times, np.hstack(columns), RESAMPLED_HZ, cutoff_hz)
        self._position = interpolate(times, smoothed[:, :3])
        self._quaternion = interpolate(times, smoothed[:, 3:])
        self._end_s = float(times[-1])

    def known(self, times: Array) -> NDArray[np.bool_]:
        """
        Return whether the body was seen at given times.

        Args:
            times: (n,) s.

        Returns:
            (n,) whether each is within the path and outside its gaps.

        """
        inside = (times >= self.times[0]) & (times <= self._end_s)
        for begin, end in self._gaps:
            inside &= (times <= begin) | (times >= end)
        return np.asarray(inside)

    def positions(self, times: Array) -> Array:
        """
        Return positions.

        Args:
            times: (n,) s; unknown times get the nearest known position.

        Returns:
            (n, 3) m.

        """
        return np.asarray(self._position(np.clip(times, self.times[0], self._end_s)))

    def velocities(self, times: Array) -> Array:
        """
        Return velocities.

        Args:
            times: (n,) s, as for `positions`.

        Returns:
            (n, 3) m/s.

        """
        return np.asarray(self._position(np.clip(times, self.times[0], self._end_s), 1))

    def rotations(self, times: Array) -> Array:
        """
        Return rotations from the body's axes to those of the path's frame.

        Args:
            times: (n,) s, as for `positions`.

        Returns:
            (n, 3, 3); the identity if the path has no rotations.

        """
        if not self.turns:
            return np.broadcast_to(np.eye(3), (len(times), 3, 3))
        clipped = np.clip(times, self.times[0], self._end_s)
        return np.asarray(Rotation.from_quat(self._quaternion(clipped)).as_matrix())


def spikes(positions: Array) -> NDArray[np.bool_]:
    """
    Find single poses far from those before and after them.

    Args:
        positions: (n, 3) m, in the order of time.

    Returns:
        (n,) whether each pose is a spike.

    """
    medians = median_filter(positions, (SPIKE_NEIGHBOURS, 1), mode='nearest')
    beside = np.linalg.norm(positions - medians, axis=1)
    return np.asarray(beside > max(SPIKE_M, 5.0 * float(np.median(beside))))
