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
Tracking of the hand: playback of recordings, sensor model, goal estimator, calibration.

Public names are imported on first use, so a node that only needs the goal estimator does not
load scipy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from handover_dmp.common.lazy import lazy_names

if TYPE_CHECKING:
    from handover_dmp.tracking.goal_estimator import GoalEstimator, HandEstimate
    from handover_dmp.tracking.hand_filter import HandFilter
    from handover_dmp.tracking.playback import HandSample, Replay
    from handover_dmp.tracking.sensor_model import SensorModel
    from handover_dmp.tracking.tracker import Tracker
    from handover_dmp.tracking.tracker_watch import TrackerReport

_NAMES = {
    'goal_estimator': ['GoalEstimator', 'HandEstimate'],
    'hand_filter': ['HandFilter'],
    'playback': ['HandSample', 'Replay'],
    'sensor_model': ['SensorModel'],
    'tracker': ['Tracker'],
    'tracker_watch': ['TrackerReport'],
}

__all__ = [
    'GoalEstimator',
    'HandEstimate',
    'HandFilter',
    'HandSample',
    'Replay',
    'SensorModel',
    'Tracker',
    'TrackerReport',
]

__getattr__, __dir__ = lazy_names(__name__, _NAMES)
