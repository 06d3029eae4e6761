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

"""Types of numbers: arrays of NumPy, also read-only, and tuples for fast steps of (8)."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Vector = tuple[float, ...]
Point = tuple[float, float, float]


class ReadOnly:
    """Base of frozen dataclasses with arrays that nobody can change."""

    def __reduce__(self: Any) -> tuple[Any, ...]:
        """Copy and pickle the fields without the tables; the copy is read-only, too."""
        return type(self), tuple(getattr(self, each.name) for each in fields(self) if each.init)


def read_only(values: ArrayLike, kind: type = float) -> NDArray[Any]:
    """
    Copy an array so that nobody can change the copy.

    Args:
        values: the array.
        kind: type of its numbers.

    Returns:
        The copy, stored row by row.

    """
    copy: NDArray[Any] = np.array(values, dtype=kind, order='C')
    copy.setflags(write=False)
    return copy
