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

"""A whole handover with other trackers than a perfect one, in one process."""

from __future__ import annotations

from dataclasses import replace

from handover_dmp.handover.controller import HandoverState
from handover_dmp.handover.lockstep import Handover, REPLAY_AT_S
from handover_dmp.handover.scenario import make_scenario, Scenario
from handover_dmp.tracking import SensorModel, Tracker
from handover_dmp.tracking.tracker_preset import read_trackers, TrackerPreset
import numpy as np
import pytest

MAX_S = 8.0
DIES_S = 0.5


@pytest.fixture(scope='module')
def scenario() -> Scenario:
    return make_scenario()


def hand_over(scenario, trackers):
    """Run it; return the times, the commanded speeds and the last state."""
    handover = Handover(scenario, trackers=trackers)
    try:
        handover.begin()
        periods = []
        while handover.time_s < MAX_S and handover.controller.state is not HandoverState.DONE:
            periods.append(handover.step())
    finally:
        handover.close()
    times = np.array([period.time_ns * 1e-9 for period in periods])
    speeds = np.array([np.linalg.norm(period.command.velocity) for period in periods])
    return times, speeds, handover


def body_tracker(rate_hz, told_hz):
    return TrackerPreset(
        Tracker('body', rate_hz=told_hz, noise_m=0.005),
        SensorModel(rate_hz, noise_m=0.005, delay_s=0.05),
    )


def stops(times, speeds):
    """Count how often the wrist comes to rest before it has made its way."""
    moving = np.flatnonzero(speeds > 0.1 * speeds.max())
    first, end = moving[0], moving[-1] + 1
    way = speeds[first:end]
    return int(np.count_nonzero(np.diff((way < 0.02 * speeds.max()).astype(int)) > 0))


def test_a_body_tracker_at_5_5_hz_does_not_stop_and_go(scenario):
    times, speeds, handover = hand_over(scenario, [body_tracker(5.5, 5.5)])
    assert handover.controller.state is HandoverState.DONE
    assert stops(times, speeds) == 0
    # and it would, were its rate not told
    times, speeds, _ = hand_over(scenario, [body_tracker(5.5, 200.0)])
    assert stops(times, speeds) > 2


@pytest.mark.parametrize(
    'names', [['mocap'], ['depth_camera'], ['webcam'], ['mocap', 'depth_camera', 'webcam']]
)
def test_the_presets_hand_over(scenario, names):
    _, _, handover = hand_over(scenario, read_trackers(names))
    assert handover.controller.state is HandoverState.DONE
    assert [report.name for report in handover.controller.estimator.report(MAX_S)] == names
    reports = handover.controller.estimator.report(MAX_S)
    assert not any(report.fault for report in reports)


def dying(one, at_s):
    return replace(one, sensor=replace(one.sensor, fault='dies', fault_at_s=at_s))


def test_one_that_dies_in_motion_is_made_up_for_and_both_make_the_arm_brake(scenario):
    mocap, camera = read_trackers(['mocap', 'depth_camera'])
    dies_s = REPLAY_AT_S + DIES_S
    times, speeds, handover = hand_over(scenario, [dying(mocap, DIES_S), camera])
    assert handover.controller.state is HandoverState.DONE
    assert stops(times, speeds) == 0
    times, speeds, handover = hand_over(scenario, [dying(mocap, DIES_S), dying(camera, DIES_S)])
    assert speeds[times < dies_s].max() > 0.2, 'in mid motion'
    # the last pose of the camera comes 80 ms after the last one of the mocap
    last_s = dies_s + camera.sensor.delay_s + handover.controller.hand_timeout_s
    assert speeds[(times > dies_s) & (times < last_s - 0.05)].min() > 0.0
    assert speeds[times > last_s + 0.3].max() == 0.0
    assert handover.controller.state is HandoverState.REACHING, 'it waits for the hand'
