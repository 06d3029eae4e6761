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

"""The posterior of a Bayesian regression for the weights of one dimension."""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.common.arrays import Array, read_only, ReadOnly
from handover_dmp.common.errors import DataError
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class WeightPosterior(ReadOnly):
    """
    Covariance of the non-zero weights.

    Attributes:
        active: their indices, (k,).
        matrix: their covariance, m², (k, k).

    Raises:
        DataError: the shapes do not fit each other, or a number is not finite.

    """

    active: NDArray[np.int64]
    matrix: Array

    def __post_init__(self) -> None:
        """Check the shapes and make the arrays read-only."""
        active, matrix = read_only(self.active, np.int64), read_only(self.matrix)
        # A coordinate that never moves has no weights left, and so an empty covariance.
        matrix = matrix.reshape(-1, active.size) if active.size else matrix.reshape(0, 0)
        if active.ndim != 1 or matrix.shape != (active.size, active.size):
            raise DataError(f'covariance has the shape {matrix.shape} for {active.size} weights')
        if not np.isfinite(matrix).all():
            raise DataError('covariance holds a number that is not finite')
        object.__setattr__(self, 'active', active)
        object.__setattr__(self, 'matrix', matrix)

    def __repr__(self) -> str:
        """Return a short description."""
        return f'WeightPosterior({len(self.active)} weights)'
