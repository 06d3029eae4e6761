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

"""Views of a hand for a primitive: the truth, or a filtered version."""

from __future__ import annotations

from dataclasses import replace

from handover_dmp.common.arrays import Array
from handover_dmp.evaluation.cases import Hands
from handover_dmp.tracking import GoalEstimator
import numpy as np


def smooth_velocity(hands: Hands, time_constant_s: float) -> Hands:
    """
    Low-pass the velocity (first order, causal), and keep the position.

    Args:
        hands: the truth.
        time_constant_s: of the filter, s.

    Returns:
        The hands that the primitive sees.

    """
    return replace(hands, velocities=_low_pass(hands.velocities, hands.times, time_constant_s))


def smooth_goal(hands: Hands, time_constant_s: float) -> Hands:
    """
    Low-pass position and velocity (first order, causal): a smoother but later goal.

    Args:
        hands: the truth.
        time_constant_s: of the filter, s.

    Returns:
        The hands that the primitive sees.

    """
    return replace(
        smooth_velocity(hands, time_constant_s),
        positions=_low_pass(hands.positions, hands.times, time_constant_s),
    )


def looking_ahead(hands: Hands, horizon_s: float) -> Hands:
    """
    Predict the hand at constant velocity.

    Args:
        hands: the truth.
        horizon_s: horizon of the prediction, s.

    Returns:
        The hands that the primitive sees.

    """
    return replace(hands, positions=hands.positions + horizon_s * hands.velocities)


def estimated(hands: Hands) -> Hands:
    """Return the causal output of the goal estimator for the positions."""
    positions, velocities = hands.positions.copy(), np.zeros_like(hands.velocities)
    for trial in range(len(positions)):
        estimator = GoalEstimator()
        for sample, stamp in enumerate(hands.times):
            estimator.update(float(stamp), tuple(hands.positions[trial, sample]))
            estimate = estimator.estimate(float(stamp))
            if estimate is not None:
                positions[trial, sample] = estimate.position
                velocities[trial, sample] = estimate.velocity
    return replace(hands, positions=positions, velocities=velocities)


def _low_pass(signals: Array, times: Array, time_constant_s: float) -> Array:
    kept = float(np.exp(-(times[1] - times[0]) / time_constant_s))
    start = kept * signals[:, :1]
    # takes longer to load than the rest of the package
    from scipy.signal import lfilter

    filtered, _ = lfilter([1.0 - kept], [1.0, -kept], signals, axis=1, zi=start)
    return np.asarray(filtered)
