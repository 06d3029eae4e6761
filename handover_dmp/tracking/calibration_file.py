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

"""A calibration as parameters of the nodes, and as plain values for other programs."""

from __future__ import annotations

from math import sqrt
from typing import Any

from handover_dmp.common.plain_yaml import dump_plain
from handover_dmp.topics import FRAME, HAND_POSE
from handover_dmp.tracking.calibration import Calibration
import numpy as np

MAX_DELAY_S = 10.0
"""Maximum delay that the nodes accept, late or early, s."""
MIN_NOISE_M = 1e-5


def node_parameters(
    found: Calibration, name: str, topic: str, body: str, frame: str, reference_frame: str
) -> str:
    """
    Write the parameter file for `dmp` and `priority_ik`.

    Args:
        found: the calibration.
        name: name of the tracker in the nodes.
        topic: topic of its poses.
        body: name or number of the body on the topic; empty if there is only one.
        frame: frame of its poses.
        reference_frame: frame of the calibration.

    Returns:
        YAML, including noise and rate of the poses; without a delay that is undetermined or
        that the nodes do not accept.

    """
    values: dict[str, Any] = {}
    if reference_frame not in ('', FRAME):
        values['frame'] = reference_frame
    tracker: dict[str, Any] = {}
    if topic != HAND_POSE.name:
        tracker['topic'] = topic
    if body:
        tracker['body'] = body
    tracker['frame'] = frame
    tracker['position'] = [round(float(x), 6) for x in found.position]
    tracker['quaternion'] = [round(float(x), 9) for x in found.quaternion]
    if tells_delay(found):
        tracker['delay_s'] = round(found.delay_s, 5)
    tracker['noise_m'] = round(max(found.residual_m / sqrt(3.0), MIN_NOISE_M), 6)
    tracker['rate_hz'] = round(1.0 / float(np.median(np.diff(found.times))), 1)
    values[name] = tracker
    return dump_plain({'/**': {'ros__parameters': values}})


def tells_delay(found: Calibration) -> bool:
    """
    Return whether the parameter file includes the delay.

    Args:
        found: the calibration.

    Returns:
        Whether it is determined, and small enough for the nodes.

    """
    return 'delay' not in found.undetermined and abs(found.delay_s) <= MAX_DELAY_S


def outcome(found: Calibration) -> dict[str, Any]:
    """
    Return the result as plain values, for JSON.

    Args:
        found: the calibration.

    Returns:
        Name to value, with units in the names.

    """
    return {
        'position_m': found.position.tolist(),
        'position_interval_m': found.position_interval_m.tolist(),
        'quaternion': found.quaternion.tolist(),
        'rotation_interval_deg': found.rotation_interval_deg,
        'delay_s': found.delay_s,
        'delay_interval_s': found.delay_interval_s,
        'marker_m': found.marker.tolist(),
        'marker_interval_m': found.marker_interval_m.tolist(),
        'marker_estimated': found.marker_estimated,
        'residual_m': found.residual_m,
        'residual_95_m': found.residual_95_m,
        'poses': len(found.times),
        'left_out': int((~found.counted).sum()),
        'undetermined': list(found.undetermined),
        'warnings': list(found.warnings),
    }
