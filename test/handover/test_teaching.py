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

from __future__ import annotations

from handover_dmp.common.errors import DataError
from handover_dmp.common.quaternions import turns_from_start
from handover_dmp.dmp import ClassicalDmp, DmpParameters, OrientationPrimitive
from handover_dmp.handover.teaching import (
    hand_goal,
    learn_from_trials,
    reproduction_error,
    rollout_against,
)
from handover_dmp.mocap import condition, HandoverTrial, read_data_set, synthesize
import numpy as np
import pytest
from scipy.spatial.transform import Rotation


def trial(duration_s=1.5, hand=(0.9, 0.0, 0.1), drift=(0.1, 0.0, 0.0), number=1):
    """Give a smooth reach towards a hand that drifts."""
    times = np.arange(0.0, duration_s + 1e-9, 0.005)
    u = times / times[-1]
    way = 10 * u**3 - 15 * u**4 + 6 * u**5
    partner = np.array(hand) + np.outer(times - times[-1], drift)
    demonstrator = np.outer(1 - way, [0.1, 0.2, 0.0]) + np.outer(
        way, np.array(hand) - [0.1, 0.0, 0.05]
    )
    return HandoverTrial(times, partner, demonstrator, 'lab', 'give', number, f'trial {number}')


def test_the_goal_offset_is_that_of_the_end_points():
    model = learn_from_trials([trial()])
    assert model.goal_offset == pytest.approx([-0.1, 0.0, -0.05], abs=2e-4)
    assert model.source == 'trial 1'
    several = learn_from_trials([trial(), trial(2.0, number=2)])
    assert several.duration_s == pytest.approx(1.75, abs=0.01)
    assert several.source == 'mean of 2 trials: trial 1, trial 2'
    jointly = learn_from_trials([trial(), trial(2.0, number=2)], jointly=True)
    assert jointly.source.startswith('all of 2 trials')


def test_the_goal_is_the_hand_and_the_offset():
    recorded = trial()
    model = learn_from_trials([recorded], regression='ridge')
    goals, velocities = hand_goal(recorded, model)
    assert np.abs(goals - recorded.partner - model.goal_offset).max() < 5e-4
    assert np.abs(velocities[20:-20] - [0.1, 0.0, 0.0]).max() < 5e-3
    later, _ = hand_goal(recorded, model, [0.5, 0.7])
    assert later == pytest.approx(goals[[100, 140]], abs=1e-9)


@pytest.mark.parametrize('formulation', ['stiff', 'printed'])
@pytest.mark.parametrize('regression', ['rvm', 'ridge'])
def test_a_trial_rolled_out_against_itself_arrives(formulation, regression):
    recorded = trial()
    parameters = DmpParameters(formulation=formulation)
    model = learn_from_trials([recorded], parameters, regression=regression)
    rollout = rollout_against(model, recorded)
    assert rollout.times == pytest.approx(recorded.times)
    assert rollout.positions[0] == pytest.approx(recorded.demonstrator[0])
    assert rollout.velocities[0] == pytest.approx(np.zeros(3))
    assert np.abs(rollout.positions[-1] - recorded.demonstrator[-1]).max() < 5e-3
    assert reproduction_error(model, recorded) < 2e-3
    slower = rollout_against(model, recorded, 50.0)
    assert slower.positions == pytest.approx(rollout.positions[::4], abs=1e-4)


def test_a_hand_that_walks_away_is_followed_without_lag():
    """Long after τ, the wrist moves with the hand."""
    model = learn_from_trials([trial()])
    walking = trial(4.0, drift=(0.2, 0.0, 0.0))
    rollout = rollout_against(model, walking)
    lag = np.abs(rollout.positions - walking.partner - model.goal_offset)[600:-60]
    assert lag.max() < 5e-4


def test_the_classical_primitive_learns_from_trials_as_well():
    assert isinstance(learn_from_trials([trial()], primitive=ClassicalDmp), ClassicalDmp)


def test_nothing_to_learn_from_is_refused():
    with pytest.raises(DataError, match='no trial'):
        learn_from_trials([])


def test_recordings_of_people_are_learnt(kth_folder):
    """24 Hz and 120 Hz, starts and ends with speed."""
    errors = []
    for recorded in read_data_set(kth_folder)[::6]:
        model = learn_from_trials([recorded])
        assert np.isfinite(model.weights).all()
        errors.append(reproduction_error(model, recorded))
        rollout = rollout_against(model, recorded)
        end = np.linalg.norm(rollout.positions[-1] - recorded.demonstrator[-1])
        assert end < 0.03
    assert np.median(errors) < 1e-3
    assert np.max(errors) < 5e-3


def test_orientations_are_learnt_where_all_trials_have_them(kth_full) -> None:
    trials = synthesize(2, 3, configurations=['engine_bay'], orientation=True)[:3]
    bare = synthesize(2, 3, configurations=['engine_bay'])[:3]
    for jointly in (False, True):
        model = learn_from_trials(trials, jointly=jointly)
        plain = learn_from_trials(bare, jointly=jointly)
        assert plain.turn is None
        # the positions know nothing of it
        np.testing.assert_array_equal(model.weights, plain.weights)
        ends = [
            turns_from_start(condition(trial).demonstrator_orientation)[-1] for trial in trials
        ]
        np.testing.assert_allclose(model.turn.goal, np.mean(ends, axis=0), atol=1e-9)
    assert learn_from_trials([trials[0], bare[1]]).turn is None
    assert learn_from_trials(trials, primitive=ClassicalDmp).turn is None
    # a real one, whose hand turns already where it was cut
    taught = condition(kth_full)
    path, _ = OrientationPrimitive(learn_from_trials([kth_full])).rollout(taught.times)
    off = Rotation.from_quat(path) * Rotation.from_quat(taught.demonstrator_orientation).inv()
    assert np.degrees(off.magnitude().max()) < 1.5
    assert np.degrees(off[-1].magnitude()) < 0.2
