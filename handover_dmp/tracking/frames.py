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

"""Transformation of positions between frames."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from handover_dmp.common.errors import UsageError
import numpy as np
from scipy.spatial.transform import Rotation

Place = tuple[float, float, float]


class FixedTransform:
    """Pose of a frame (the child) in another one (its parent), as in `tf2`."""

    def __init__(self, position: Sequence[float], quaternion: Sequence[float]) -> None:
        """
        Take the pose of the child.

        Args:
            position: (3,), m, position of its origin in the parent.
            quaternion: x, y, z, w, from the child's axes to the parent's; of any norm except 0.

        Raises:
            UsageError: a number is not finite, or the norm is 0.

        """
        numbers = (*position, *quaternion)
        if len(position) != 3 or len(quaternion) != 4 or not all(map(isfinite, numbers)):
            raise UsageError(
                'a transform needs a position x, y, z and a quaternion x, y, z, w of finite '
                f'numbers, not {list(position)} and {list(quaternion)}'
            )
        if not any(quaternion):
            raise UsageError('a transform needs a quaternion of norm 1, not 0')
        self._position = np.array(position, dtype=float)
        self._rotation = Rotation.from_quat(quaternion).as_matrix()

    def __call__(self, place: Sequence[float]) -> Place:
        """
        Transform a position from the child to the parent.

        Args:
            place: (3,), m, position in the child.

        Returns:
            The same in the parent, m.

        """
        x, y, z = (self._position + self._rotation @ np.asarray(place)).tolist()
        return x, y, z
