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
How the wrists of the synthetic data set are turned. No person was recorded for it.

In the axes of a wrist x points along the fingers and z out of the back of the hand. An arm hangs
with the fingers forward and down, and on its way to the partner the hand comes up and turns, the
thumb outwards, with the time course of the reach. Spread from trial to trial is some degrees, and
a small turn to and fro on the way makes no two alike.

As in the data set itself, sums, products and square roots alone.
"""

from __future__ import annotations

from handover_dmp.common.arrays import Array
from handover_dmp.mocap.orientation import unit_orientations
import numpy as np
from numpy.random import RandomState

Array = Array
Pair = tuple[tuple[float, float, float, float], tuple[float, float, float, float]]

NOISE_PER_M = 5.0
"""Of a component, for a metre of noise of a marker: the markers of a wrist are 0.1 m apart."""
_SPREAD = 0.04
_WOBBLE = 0.03

# Of each wrist, x, y, z, w: where it rests or works, and where it meets the other.
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


def synthetic_turns(
    random: RandomState, configuration: str, mechanic: Array, assistant: Array, noise_m: float
) -> tuple[Array, Array]:
    """
    Turn the wrists of a handover.

    Args:
        random: a stream of its own.
        configuration: where it takes place.
        mechanic: (n,), share of P1's reach that is done, 0 to 1.
        assistant: (n,), the same of P2's.
        noise_m: of a marker, m.

    Returns:
        Unit quaternions x, y, z, w of P1 and of P2, (n, 4) each.

    """
    return (
        _turned(random, _MECHANIC[configuration], mechanic, noise_m),
        _turned(random, _ASSISTANT[configuration], assistant, noise_m),
    )


def _turned(random: RandomState, pair: Pair, share: Array, noise_m: float) -> Array:
    first, last = (_near(random, np.array(turn)) for turn in pair)
    if float(first @ last) < 0.0:
        last = -last
    wobble = _WOBBLE * np.clip(random.standard_normal(4), -2.0, 2.0)
    arch = (4.0 * share * (1.0 - share))[:, None]
    path = first + share[:, None] * (last - first) + arch * wobble
    path += NOISE_PER_M * noise_m * random.standard_normal(path.shape)
    return unit_orientations(np.round(path / np.sqrt((path * path).sum(axis=1))[:, None], 6))


def _near(random: RandomState, turn: Array) -> Array:
    other = turn + _SPREAD * np.clip(random.standard_normal(4), -2.0, 2.0)
    near: Array = other / np.sqrt((other * other).sum())
    return near
