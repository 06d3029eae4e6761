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

"""Simple surroundings of the partner in each configuration: engine bay, car, lift."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

from handover_dmp.view.piece import Colour, Piece

BODYWORK: Colour = (0.60, 0.66, 0.72)
IRON: Colour = (0.36, 0.38, 0.41)
TYRE: Colour = (0.16, 0.16, 0.17)
POST: Colour = (0.42, 0.50, 0.58)


@dataclass(frozen=True)
class Surroundings:
    """
    Pieces around a person.

    Their origin is on the floor below the acting shoulder: x towards the partner, turned by
    `turn` to the left; z up.

    Attributes:
        pieces: the pieces; cylinders lie along y.
        turn: angle, rad.

    """

    pieces: tuple[Piece, ...]
    turn: float = 0.0


def _wheel(x: float, y: float, z: float) -> tuple[Piece, Piece]:
    tyre = Piece((x, y, z), (0.60, 0.60, 0.20), TYRE, is_round=True)
    return tyre, Piece((x, y, z), (0.34, 0.34, 0.21), IRON, is_round=True)


CAR = Surroundings(
    (
        # a car on stands, without floor: sills, axles and the wheels that hide nobody
        Piece((0.20, -0.28, 0.80), (2.4, 0.08, 0.12), BODYWORK),
        Piece((0.20, 1.05, 0.80), (2.4, 0.08, 0.12), BODYWORK),
        Piece((-0.75, 0.39, 0.76), (0.07, 1.30, 0.07), IRON),
        Piece((1.30, 0.39, 0.76), (0.07, 1.30, 0.07), IRON),
        Piece((1.05, -0.28, 0.37), (0.08, 0.08, 0.74), IRON),
        Piece((-0.50, 1.05, 0.37), (0.08, 0.08, 0.74), IRON),
        *_wheel(-0.75, 1.20, 0.76),
        *_wheel(1.30, 1.20, 0.76),
        *_wheel(1.30, -0.43, 0.76),
    ),
    turn=pi / 2,
)
ENGINE_BAY = Surroundings(
    (
        Piece((-0.07, 0.37, 0.60), (0.06, 1.46, 0.40), BODYWORK),
        Piece((0.50, -0.33, 0.60), (1.20, 0.06, 0.40), BODYWORK),
        Piece((0.50, 1.08, 0.60), (1.20, 0.06, 0.40), BODYWORK),
        Piece((0.45, 0.45, 0.55), (0.60, 0.60, 0.34), IRON),
        *_wheel(0.55, -0.33, 0.30),
    ),
    turn=0.9,
)
LIFT = Surroundings(
    (
        Piece((-0.10, 0.0, 2.20), (1.30, 1.30, 0.16), BODYWORK),
        Piece((-0.62, -0.85, 1.25), (0.20, 0.14, 2.50), POST),
        Piece((-0.62, 0.85, 1.25), (0.20, 0.14, 2.50), POST),
        Piece((-0.62, 0.0, 2.09), (0.12, 1.7, 0.06), POST),
        *_wheel(-0.40, -0.62, 2.20),
        *_wheel(-0.40, 0.62, 2.20),
    ),
)

SURROUNDINGS: Mapping[str, Surroundings] = {
    'under_car': CAR,
    'engine_bay': ENGINE_BAY,
    'hydraulic_lift': LIFT,
}
"""Surroundings by configuration."""
