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

"""A simple body: a piece of the carried object, of its table or of the surroundings."""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.common.arrays import Point

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Piece:
    """
    A box, or a cylinder along its z axis.

    Attributes:
        middle: (3,), m, in the axes of what it is part of.
        size: (3,), m, along x, y and z; for a cylinder, diameter, diameter and length.
        colour: red, green, blue, 0 to 1.
        is_round: whether it is a cylinder.

    """

    middle: Point
    size: Point
    colour: Colour
    is_round: bool = False
