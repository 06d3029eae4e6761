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

"""Measures of the motions of robot and people in one run."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.mocap.filtering import smooth
from handover_dmp.mocap.measures import ACTIVE_SPEED, fluency, measure_motion, synchrony
from handover_dmp.report.motion import RATE_HZ, resample
from handover_dmp.report.recorded_run import RunRecord
import numpy as np

MIN_SAMPLES = 10


def compare_motions(run: RunRecord) -> dict[str, Any]:
    """
    Measure the motions of the robot and of the people from the start of the reach to the exchange.

    All are low-passed at 6 Hz with zero phase, so that the noise of a tracker or of joint sensors
    does not count as roughness.

    Args:
        run: the run.

    Returns:
        `robot`, `person` (the demonstrator) and `partner`: the figures of
        `MotionMeasures`; `synchrony` of robot and of person with the partner; `distance_min_m`
        between robot and partner; `relative_speed_m_s` of the two when the exchange begins;
        `fluency` of partner and robot over the whole run. None if it cannot be measured, as the
        motion of somebody who rests.

    """
    begin_s = run.reaching_time_s
    end_s = run.exchange_time_s
    found: dict[str, Any] = dict.fromkeys(('robot', 'person', 'partner'))
    found |= dict.fromkeys(('distance_min_m', 'relative_speed_m_s', 'fluency'))
    found['synchrony'] = {'robot': None, 'person': None}
    if begin_s is None or end_s is None:
        return found
    even = np.arange(begin_s, end_s, 1.0 / RATE_HZ)
    tracks = {
        'robot': low_passed_track(run.wrist_times, run.wrist_positions),
        'person': low_passed_track(run.demonstrator_times, run.demonstrator_positions),
        'partner': low_passed_track(run.hand_times, run.hand_positions),
    }
    positions, speeds = {}, {}
    for name, track in tracks.items():
        if track is None or len(even) < MIN_SAMPLES:
            continue
        times, places, velocities = track
        positions[name] = resample(times, places, even)
        speeds[name] = np.linalg.norm(resample(times, velocities, even), axis=1)
        moves = speeds[name].max() >= ACTIVE_SPEED
        measures = measure_motion(even, positions[name]) if moves else None
        found[name] = None if measures is None else asdict(measures)
    for name in ('robot', 'person'):
        if name in speeds and 'partner' in speeds:
            together = synchrony(speeds['partner'], speeds[name], RATE_HZ)
            found['synchrony'][name] = None if together is None else asdict(together)
    robot, partner = tracks['robot'], tracks['partner']
    if robot is not None and partner is not None:
        if 'robot' in positions and 'partner' in positions:
            apart = np.linalg.norm(positions['robot'] - positions['partner'], axis=1)
            found['distance_min_m'] = float(apart.min())
        met = np.array([end_s])
        relative = resample(robot[0], robot[2], met) - resample(partner[0], partner[2], met)
        found['relative_speed_m_s'] = float(np.linalg.norm(relative))
        begin_s, end_s = max(robot[0][0], partner[0][0]), min(robot[0][-1], partner[0][-1])
        both = np.arange(begin_s, end_s, 1.0 / RATE_HZ)
        if len(both) >= MIN_SAMPLES:
            moving = [
                np.linalg.norm(resample(track[0], track[2], both), axis=1)
                for track in (partner, robot)
            ]
            found['fluency'] = asdict(fluency(*moving))
    return found


def low_passed_track(times: Array, positions: Array) -> tuple[Array, Array, Array] | None:
    """
    Low-pass a track at 6 Hz, if it is long enough.

    Args:
        times: (n,) s.
        positions: (n, 3) m.

    Returns:
        Times, low-passed positions and velocities, evenly spaced; None if it is too short.

    """
    kept = np.flatnonzero(np.diff(times, prepend=-np.inf) > 0.0)
    if len(kept) < MIN_SAMPLES:
        return None
    return smooth(times[kept], positions[kept], RATE_HZ)
