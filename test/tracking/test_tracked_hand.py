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

"""The tracked hand: what a tracker says before, during and after a replay."""

from __future__ import annotations

from handover_dmp.mocap import condition, synthesize
from handover_dmp.tracking import Replay, SensorModel
from handover_dmp.tracking.playback import TrackedHand
import numpy as np
import pytest


@pytest.fixture(scope='module')
def trial():
    return condition(synthesize(trials=1)[1])


def watch(hand, until_s, step_s=0.005, from_s=0.0):
    return [
        sample for now in np.arange(from_s, until_s, step_s) for sample in hand.due(float(now))
    ]


@pytest.mark.parametrize('rate_hz', [24.0, 60.0, 200.0])
def test_rest_then_the_recording_then_rest(trial, rate_hz):
    replay = Replay(trial.times, trial.partner)
    hand = TrackedHand(replay, SensorModel(rate_hz=rate_hz))
    assert hand.start_s == np.inf
    hand.start(0.5)
    seen = watch(hand, 4.0)
    stamps = np.array([sample.stamp_s for sample in seen])
    np.testing.assert_allclose(np.diff(stamps), 1.0 / rate_hz, atol=1e-9)
    for sample in seen:
        expected = replay(max(sample.stamp_s - 0.5, 0.0))
        np.testing.assert_allclose(sample.position, expected, atol=1e-12)
    np.testing.assert_allclose(seen[0].position, trial.partner[0])
    np.testing.assert_allclose(seen[-1].position, trial.partner[-1])


def test_faults_are_the_same_however_often_one_looks(trial):
    sensor = SensorModel(100.0, 1e-3, 0.03, dropout=0.2, outliers=0.1, seed=5)

    def run(step_s):
        hand = TrackedHand(Replay(trial.times, trial.partner), sensor)
        hand.start(0.0)
        return {sample.stamp_s: sample.position for sample in watch(hand, 20.0, step_s)}

    often, seldom = run(0.002), run(0.05)
    common = sorted(set(often) & set(seldom))
    assert len(common) > 1500
    for stamp in common:
        np.testing.assert_array_equal(often[stamp], seldom[stamp])
    assert len(often) / 2000 == pytest.approx(0.8, abs=0.03)
    rest = Replay(trial.times, trial.partner)
    far = [np.linalg.norm(place - rest(stamp)) for stamp, place in often.items()]
    assert np.mean(np.array(far) > 0.5) == pytest.approx(0.1, abs=0.03)


def test_a_pose_arrives_after_its_delay(trial):
    hand = TrackedHand(Replay(trial.times, trial.partner), SensorModel(200.0, delay_s=0.04))
    for now in np.arange(0.1, 1.0, 0.005):
        for sample in hand.due(float(now)):
            assert 0.0399 < now - sample.stamp_s < 0.0451


def test_a_clock_that_leaps_brings_no_flood(trial):
    hand = TrackedHand(Replay(trial.times, trial.partner))
    assert len(watch(hand, 1.0)) == 200
    assert len(hand.due(1000.0)) == 1
    assert len(hand.due(0.5)) == 1
    assert len(hand.due(0.51)) == 2


def test_between_two_replays_the_hand_is_not_seen_so_it_does_not_jump(trial):
    hand = TrackedHand(Replay(trial.times, trial.partner))
    hand.start(0.0)
    end = watch(hand, 5.0)
    hand.start(5.5)
    seen = watch(hand, 6.0, from_s=5.0)
    hidden = [bool(np.isnan(sample.position).all()) for sample in seen]
    assert hidden == [sample.stamp_s < 5.4 for sample in seen]
    np.testing.assert_allclose(end[-1].position, trial.partner[-1])
    np.testing.assert_allclose(seen[hidden.index(False)].position, trial.partner[0])
