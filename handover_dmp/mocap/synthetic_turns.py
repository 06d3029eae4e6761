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

"""
Orientations of the wrists of the synthetic data set. No person was recorded for it.

The x axis of a wrist points along the fingers, z out of the back of the hand. An arm hangs with
the fingers forward and down. On the way to the partner the hand rises and turns its thumb
outwards, with the time course of the reach. The spread from trial to trial is some degrees, plus
a small random turn back and forth on the way.

Like the data set itself, it uses only sums, products and square roots.
"""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.common.arrays import Array
from handover_dmp.mocap.garage import CONFIGURATIONS
from handover_dmp.mocap.orientation import unit_orientations
from handover_dmp.mocap.trial import DIRECTIONS
import numpy as np
from numpy.random import RandomState

Pair = tuple[tuple[float, float, float, float], tuple[float, float, float, float]]

NOISE_PER_M = 5.0
"""Noise of a quaternion component per metre of marker noise; the markers are 0.1 m apart."""
_SPREAD = 0.04
_WOBBLE = 0.03

# Orientation of each wrist, x, y, z, w: at rest or work, and at the exchange.
_ASSISTANT: dict[str, Pair] = {
    'engine_bay': ((-0.060, 0.458, 0.116, 0.879), (0.494, 0.081, 0.054, 0.864)),
    'under_car': ((-0.026, 0.300, 0.083, 0.950), (0.359, 0.255, -0.060, 0.896)),
    'hydraulic_lift': ((-0.044, 0.498, 0.075, 0.863), (0.425, -0.167, 0.153, 0.876)),
}
_MECHANIC: dict[str, Pair] = {
    'engine_bay': ((-0.406, -0.057, 0.896, 0.171), (0.005, 0.643, 0.763, -0.061)),
    'under_car': ((0.101, 0.070, 0.979, 0.165), (0.139, 0.748, 0.628, -0.166)),
    'hydraulic_lift': ((0.606, -0.053, 0.790, 0.069), (-0.142, 0.565, 0.807, 0.100)),
}


@dataclass(frozen=True, eq=False)
class WristTurn:
    """
    The turn of a wrist in one reach.

    Attributes:
        first: (4,), x, y, z, w, orientation at the start.
        last: (4,), orientation at the end, with the sign nearer to `first`.
        wobble: (4,), addition half way.

    """

    first: Array
    last: Array
    wobble: Array

    @classmethod
    def between(cls, first: Array, last: Array, wobble: Array | None = None) -> WristTurn:
        """Go the shorter way."""
        nearer = -last if float(first @ last) < 0.0 else last
        return cls(first, nearer, np.zeros(4) if wobble is None else wobble)

    def at(self, share: Array) -> Array:
        """Return the orientations at shares (n,) of the reach; (n, 4), not yet normalised."""
        arch = (4.0 * share * (1.0 - share))[:, None]
        return self.first + share[:, None] * (self.last - self.first) + arch * self.wobble


def draw_turns(
    seed: int, configuration: str, direction: str, number: int
) -> tuple[WristTurn, WristTurn]:
    """
    Draw the turns of the wrists in a handover, from a separate random stream.

    Args:
        seed: seed of the data set.
        configuration: where it takes place.
        direction: `give` or `take`.
        number: number of the trial.

    Returns:
        The turns of P1 and of P2.

    """
    place = CONFIGURATIONS.index(configuration), DIRECTIONS.index(direction)
    random = RandomState(np.array([seed, *place, number, 1], dtype=np.uint32))
    return _draw(random, _MECHANIC[configuration]), _draw(random, _ASSISTANT[configuration])


def measured_turns(random: RandomState, path: Array, noise_m: float) -> Array:
    """
    Simulate the measurement of a wrist's orientations.

    Args:
        random: a separate random stream.
        path: (n, 4), x, y, z, w, of any norm.
        noise_m: noise of a marker, m.

    Returns:
        Unit quaternions, (n, 4).

    """
    path = path + NOISE_PER_M * noise_m * random.standard_normal(path.shape)
    return unit_orientations(np.round(path / np.sqrt((path * path).sum(axis=1))[:, None], 6))


def _draw(random: RandomState, pair: Pair) -> WristTurn:
    first, last = (_near(random, np.array(turn)) for turn in pair)
    return WristTurn.between(first, last, _WOBBLE * np.clip(random.standard_normal(4), -2.0, 2.0))


def _near(random: RandomState, turn: Array) -> Array:
    other = turn + _SPREAD * np.clip(random.standard_normal(4), -2.0, 2.0)
    return np.asarray(other / np.sqrt((other * other).sum()))
