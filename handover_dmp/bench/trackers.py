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
Two trackers of one hand with realistic faults: errors of each alone, and of both fused.

A mocap (200 Hz, 0.5 mm of noise) and a depth camera (30 Hz, 8 mm, 80 ms late, 22 mm off) track
synthetic reaches, there and back. Errors are those of the estimated hand at 200 Hz, root mean
square over all runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
import math
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.mocap import condition, HandoverTrial, synthesize
from handover_dmp.mocap.filtering import interpolate
from handover_dmp.tracking import GoalEstimator
from handover_dmp.tracking.tracker_preset import read_trackers, TrackerPreset
import numpy as np

PERIOD_S = 0.005
REST_S = 0.8
PAUSE_S = 0.4
FROM_S = 0.3
REPORT_S = 1.0
MIDDLE_S = 0.75
"""Start of a fault after the start of the first reach, s."""
NO_FAULT: Mapping[str, Any] = {}
DIES = {'fault': 'dies', 'fault_at_s': REST_S + MIDDLE_S}
FREEZES = DIES | {'fault': 'freezes'}
JUMPS = DIES | {'fault': 'jumps', 'fault_m': (0.0, 0.5, 0.0)}
DRIFTS = DIES | {'fault': 'drifts', 'fault_m': (0.0, 0.05, 0.0)}
LATE = {'delay_s': 0.15}
DOUBLES = {'duplicates': 0.5, 'jitter_s': 0.02}


@dataclass(frozen=True)
class TrackerCase:
    """
    The faults of the two trackers.

    Attributes:
        name: description.
        mocap: changes to the sensor of its preset.
        camera: the same for the camera.

    """

    name: str
    mocap: Mapping[str, Any]
    camera: Mapping[str, Any]


TRACKER_CASES = (
    TrackerCase('nothing is wrong', NO_FAULT, NO_FAULT),
    TrackerCase('mocap loses 90 % of its poses', {'dropout': 0.9}, NO_FAULT),
    TrackerCase('mocap dies in motion', DIES, NO_FAULT),
    TrackerCase('camera dies in motion', NO_FAULT, DIES),
    TrackerCase('mocap freezes in motion', FREEZES, NO_FAULT),
    TrackerCase('camera freezes in motion', NO_FAULT, FREEZES),
    TrackerCase('mocap jumps by 0.5 m', JUMPS, NO_FAULT),
    TrackerCase('camera jumps by 0.5 m', NO_FAULT, JUMPS),
    TrackerCase('mocap drifts by 50 mm', DRIFTS, NO_FAULT),
    TrackerCase('camera drifts by 50 mm', NO_FAULT, DRIFTS),
    TrackerCase('mocap is 150 ms late', LATE, NO_FAULT),
    TrackerCase('camera is 150 ms late', NO_FAULT, LATE),
    TrackerCase("mocap's clock is 0.3 s ahead", {'clock_s': 0.3}, NO_FAULT),
    TrackerCase("camera's clock is 0.3 s ahead", NO_FAULT, {'clock_s': 0.3}),
    TrackerCase("mocap's clock is 0.3 s behind", {'clock_s': -0.3}, NO_FAULT),
    TrackerCase("camera's clock is 0.3 s behind", NO_FAULT, {'clock_s': -0.3}),
    TrackerCase('mocap doubles half of its poses', DOUBLES, NO_FAULT),
    TrackerCase('camera doubles half of its poses', NO_FAULT, DOUBLES),
)


@dataclass(frozen=True)
class Errors:
    """
    Errors of the estimated hand, root mean square.

    Attributes:
        position_m: position error, m; infinite without an estimate.
        velocity: velocity error, m/s; infinite without an estimate.
        said: status messages of the trackers.

    """

    position_m: float
    velocity: float
    said: frozenset[str] = frozenset()


@dataclass(frozen=True)
class TrackerErrors:
    """
    The results of a case.

    Attributes:
        mocap: errors of the mocap alone.
        camera: errors of the camera alone.
        fused: errors of both fused.

    """

    mocap: Errors
    camera: Errors
    fused: Errors

    @property
    def better(self) -> Errors:
        """Return the better single tracker, by position."""
        return min(self.mocap, self.camera, key=lambda errors: errors.position_m)


def compare_trackers(
    case: TrackerCase, seeds: Iterable[int], tell: Callable[[], None] = lambda: None
) -> TrackerErrors:
    """
    Track the hand in some runs of a case, with each tracker alone and with both.

    Args:
        case: the faults.
        seeds: seeds of the runs; each also selects a reach.
        tell: called after each run.

    Returns:
        The errors.

    """
    runs: list[tuple[Errors, ...]] = []
    for seed in seeds:
        mocap, camera = trackers_of(case, seed)
        times, path = there_and_back(_reaches()[seed % len(_reaches())])
        chosen: tuple[list[TrackerPreset], ...] = ([mocap], [camera], [mocap, camera])
        runs.append(tuple(follow_hand(times, path, some) for some in chosen))
        tell()
    return TrackerErrors(*(_together(errors) for errors in zip(*runs, strict=True)))


def trackers_of(case: TrackerCase, seed: int) -> tuple[TrackerPreset, TrackerPreset]:
    """
    Make the two trackers of a case.

    Args:
        case: the faults.
        seed: seed of their noise.

    Returns:
        Mocap and camera.

    """
    mocap, camera = read_trackers(['mocap', 'depth_camera'], seed)
    # as in the table: without the few milliseconds of delay of the preset
    mocap = replace(mocap, sensor=replace(mocap.sensor, **{'delay_s': 0.0, **case.mocap}))
    return mocap, replace(camera, sensor=replace(camera.sensor, **case.camera))


def follow_hand(times: Array, path: Array, seen_by: Sequence[TrackerPreset]) -> Errors:
    """
    Track a hand with some trackers.

    Args:
        times: (n,) s, evenly spaced.
        path: (n, 3) m, true path of the hand.
        seen_by: the trackers.

    Returns:
        The errors, from shortly after the start on.

    """
    truth = interpolate(times, path)
    speed = truth.derivative()
    arriving = sorted(
        (
            (pose.arrival_s, number, pose)
            for number, one in enumerate(seen_by)
            for pose in one.sensor.observe_motion(times, path)
        ),
        key=lambda row: row[:2],
    )
    estimator = GoalEstimator(trackers=[one.tracker for one in seen_by])
    errors: list[tuple[Array, Array]] = []
    said: set[str] = set()
    heard, report_s = 0, times[0] + REPORT_S
    for now_s in np.arange(times[0], times[-1], PERIOD_S).tolist():
        while heard < len(arriving) and arriving[heard][0] <= now_s + 1e-9:
            _, number, pose = arriving[heard]
            name = seen_by[number].name
            estimator.update(pose.stamp_s, pose.position.tolist(), now_s, tracker=name)
            heard += 1
        if now_s >= report_s:
            report_s += REPORT_S
            said |= {report.fault for report in estimator.report(now_s) if report.fault}
        estimate = estimator.estimate(now_s)
        if estimate is not None and now_s > times[0] + FROM_S:
            errors.append((estimate.position - truth(now_s), estimate.velocity - speed(now_s)))
    if not errors:
        return Errors(math.inf, math.inf, frozenset(said))
    position, velocity = (
        float(np.sqrt(np.mean(np.sum(np.square(part), axis=1))))
        for part in zip(*errors, strict=True)
    )
    return Errors(position, velocity, frozenset(said))


def there_and_back(trial: HandoverTrial) -> tuple[Array, Array]:
    """
    Make a motion from a reach: rest, reach, rest, return, rest.

    Args:
        trial: trial with the partner's reach.

    Returns:
        (n,) s at 200 Hz, and (n, 3) m.

    """
    reach = trial.partner
    parts = (
        np.repeat(reach[:1], round(REST_S / PERIOD_S), axis=0),
        reach,
        np.repeat(reach[-1:], round(PAUSE_S / PERIOD_S), axis=0),
        reach[::-1],
        np.repeat(reach[:1], round(REST_S / PERIOD_S), axis=0),
    )
    path = np.concatenate(parts)
    return np.array(PERIOD_S * np.arange(len(path))), path


@cache
def _reaches() -> tuple[HandoverTrial, ...]:
    return tuple(condition(trial) for trial in synthesize() if trial.direction == 'take')


def _together(errors: Sequence[Errors]) -> Errors:
    position, velocity = (
        math.sqrt(sum(value**2 for value in values) / len(values))
        for values in zip(*((one.position_m, one.velocity) for one in errors), strict=True)
    )
    return Errors(position, velocity, frozenset().union(*(one.said for one in errors)))
