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

"""The partner's arm, as known to the robot."""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.common.arrays import Array
import numpy as np


@dataclass(frozen=True, eq=False)
class Partner:
    """
    Known state of the partner's arm.

    Attributes:
        position: (3,), m, position of the hand in `world`.
        velocity: (3,), m/s, velocity of the hand.
        elbow: (3,), m, the other end of the forearm; None if unknown.

    """

    position: Array
    velocity: Array
    elbow: Array | None = None

    @classmethod
    def of(cls, hand: object) -> Partner | None:
        """
        Convert any form of the hand.

        Args:
            hand: a `Partner`; anything with a `position` and perhaps a `velocity` and an `elbow`;
                a position, (3,), m; or None.

        Returns:
            The partner; None if there is none. An unknown velocity is zero.

        """
        if hand is None or isinstance(hand, Partner):
            return hand
        position = getattr(hand, 'position', hand)
        velocity = getattr(hand, 'velocity', None)
        elbow = getattr(hand, 'elbow', None)
        return cls(
            np.asarray(position, dtype=float),
            np.zeros(3) if velocity is None else np.asarray(velocity, dtype=float),
            None if elbow is None else np.asarray(elbow, dtype=float),
        )
