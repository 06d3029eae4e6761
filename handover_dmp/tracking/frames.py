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

"""A place in one frame, told in another one."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from handover_dmp.common.errors import UsageError
import numpy as np
from scipy.spatial.transform import Rotation

Place = tuple[float, float, float]


class FixedTransform:
    """Where a frame (the child) lies in another one (its parent), as `tf2` has it."""

    def __init__(self, position: Sequence[float], quaternion: Sequence[float]) -> None:
        """
        Take the place of the child.

        Args:
            position: (3,), m, of its origin in the parent.
            quaternion: x, y, z, w, from the child's axes to the parent's; of any length but 0.

        Raises:
            UsageError: it is no transform.

        """
        numbers = (*position, *quaternion)
        if len(position) != 3 or len(quaternion) != 4 or not all(map(isfinite, numbers)):
            raise UsageError(
                'a transform is a position x, y, z and a quaternion x, y, z, w of finite numbers, '
                f'not {list(position)} and {list(quaternion)}'
            )
        if not any(quaternion):
            raise UsageError('a transform has a quaternion of norm 1, not of norm 0')
        self._position = np.array(position, dtype=float)
        self._rotation = Rotation.from_quat(quaternion).as_matrix()

    def __call__(self, place: Sequence[float]) -> Place:
        """
        Tell a place of the child in the parent.

        Args:
            place: (3,), m, in the child.

        Returns:
            The same in the parent, m.

        """
        x, y, z = (self._position + self._rotation @ np.asarray(place)).tolist()
        return x, y, z
