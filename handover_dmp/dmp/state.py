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

"""The state of a movement primitive, and the result of a rollout."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from handover_dmp.common.arrays import Array, Vector

SMALLEST_PHASE = 1e-300


class DmpState(NamedTuple):
    """
    State of a movement primitive of d dimensions.

    The velocity is ẋ, not v = τẋ, so it does not jump when τ changes. To set a state to a
    measurement: `state._replace(position=…, velocity=…)`.

    Attributes:
        position: x, m, d floats.
        velocity: ẋ, m/s, d floats.
        phase: s of (4), 1 at the start.
        start: x0, m, d floats.

    """

    position: Vector
    velocity: Vector
    phase: float
    start: Vector


@dataclass(frozen=True, eq=False)
class Rollout:
    """
    A motion from its start to its end.

    Attributes:
        times: s, (n,).
        positions: x, m, (n, d).
        velocities: ẋ, m/s, (n, d).
        goal_weight: w_g of (7), (n,).
        phase: s of (4), (n,).
        deviation: standard deviation of the positions from the posterior of the weights, m,
            (n, d); None unless requested.

    """

    times: Array
    positions: Array
    velocities: Array
    goal_weight: Array
    phase: Array
    deviation: Array | None = None
