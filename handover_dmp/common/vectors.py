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

"""Sums and products of short vectors as tuples, which are faster than arrays of NumPy."""

from __future__ import annotations

from collections.abc import Sequence
from operator import add, mul, sub

from handover_dmp.common.arrays import Vector


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the sum of the products of the components."""
    return float(sum(map(mul, a, b)))


def plus(a: Sequence[float], b: Sequence[float]) -> Vector:
    """Return a + b."""
    return tuple(map(add, a, b))


def minus(a: Sequence[float], b: Sequence[float]) -> Vector:
    """Return a − b."""
    return tuple(map(sub, a, b))


def scaled_by(a: Sequence[float], factor: float) -> Vector:
    """Return the product of every component with a factor."""
    return tuple([x * factor for x in a])
