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

"""The shape of the carried object, from the description of the run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

from handover_dmp.common.arrays import Point
from handover_dmp.view.piece import Colour, Piece

ROD_COLOUR: Colour = (0.98, 0.80, 0.15)
STEEL: Colour = (0.78, 0.80, 0.82)
HANDLE_SHARE = 0.4
"""Of a knife."""


@dataclass(frozen=True)
class CarriedLook:
    """
    The shape of an object.

    Attributes:
        parts: its parts; the first is around the origin, which is the middle of the object.
        length_m: length along its z axis, m; None: the distance between the hands.
        stands: whether z points up; otherwise it points from the giver to the receiver.
        depth_m: size of a standing object from the robot to the partner, m.

    """

    parts: tuple[Piece, ...]
    length_m: float | None = None
    stands: bool = False
    depth_m: float = 0.0

    def parts_of(self, length_m: float) -> tuple[Piece, ...]:
        """
        Return the parts in their final size.

        Args:
            length_m: length of an object without its own length, m.

        Returns:
            The parts.

        """
        if self.length_m is not None or self.stands:
            return self.parts
        return tuple(
            replace(part, size=(part.size[0], part.size[1], length_m * part.size[2]))
            for part in self.parts
        )


def look_of(told: Any, radius_m: float) -> CarriedLook:
    """
    Make the shape of the carried object.

    Args:
        told: its description in `/handover/info`; without a drawable one, a rod.
        radius_m: radius of a rod, m.

    Returns:
        The shape; a rod has length 1 and is scaled.

    """
    known = told if isinstance(told, Mapping) else {}
    shape, size = known.get('shape'), _three(known.get('size_m'), 2.0)
    colour = _three(known.get('colour'), 1.0) or ROD_COLOUR
    if shape == 'cup' and size is not None:
        width, _, height = size
        grip = (0.015, 0.012, 0.6 * height)
        parts: tuple[Piece, ...] = (
            Piece((0.0, 0.0, 0.0), size, colour, is_round=True),
            Piece((0.0, 0.5 * width + 0.025, 0.0), grip, colour),
            Piece((0.0, 0.5 * width + 0.012, 0.25 * height), (0.015, 0.03, 0.012), colour),
            Piece((0.0, 0.5 * width + 0.012, -0.25 * height), (0.015, 0.03, 0.012), colour),
        )
        return CarriedLook(parts, stands=True)
    if shape == 'box' and size is not None:
        width, height, depth = size
        body = Piece((0.0, 0.0, 0.0), (depth, width, height), colour)
        return CarriedLook((body,), stands=True, depth_m=depth)
    if shape == 'knife' and size is not None:
        width, thickness, length = size
        handle = HANDLE_SHARE * length
        blade = (0.004, 1.3 * width, length - handle)
        parts = (
            # inside the blade, so that the first part is around the middle
            Piece((0.0, 0.0, 0.0), (0.006, 0.5 * width, 0.02), STEEL),
            Piece((0.0, 0.0, -0.5 * handle), blade, STEEL),
            Piece((0.0, 0.0, 0.5 * (length - handle)), (thickness, width, handle), colour),
        )
        return CarriedLook(parts, length)
    rod = (2.0 * radius_m, 2.0 * radius_m, 1.0)
    return CarriedLook((Piece((0.0, 0.0, 0.0), rod, colour, is_round=True),))


def _three(given: Any, high: float) -> Point | None:
    try:
        x, y, z = map(float, given)
    except (TypeError, ValueError):
        return None
    return (x, y, z) if all(isfinite(n) and 0.0 <= n <= high for n in (x, y, z)) else None
