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

"""What a Bayesian regression knows, and does not know, about the weights of one dimension."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class WeightPosterior:
    """
    Covariance of the weights that are not zero.

    Attributes:
        active: their indices, (k,).
        matrix: their covariance, m², (k, k).

    Raises:
        DataError: shapes that do not fit each other, or numbers that are not finite.

    """

    active: NDArray[np.int64]
    matrix: Array

    def __post_init__(self) -> None:
        """Check the shapes and make the arrays read-only."""
        active = np.array(self.active, dtype=np.int64)
        matrix = np.array(self.matrix, dtype=float, order='C')
        # Of a coordinate that never moves no weight is left, and of their covariance no row.
        matrix = matrix.reshape(-1, active.size) if active.size else matrix.reshape(0, 0)
        if active.ndim != 1 or matrix.shape != (active.size, active.size):
            raise DataError(f'covariance has the shape {matrix.shape} for {active.size} weights')
        if not np.isfinite(matrix).all():
            raise DataError('covariance holds a number that is not finite')
        for name, array in (('active', active), ('matrix', matrix)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __repr__(self) -> str:
        """Say of how many weights it is."""
        return f'WeightPosterior({len(self.active)} weights)'

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle what it is made of, and make it anew: read-only."""
        return type(self), (self.active, self.matrix)
