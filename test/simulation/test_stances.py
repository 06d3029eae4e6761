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

"""The partner lies, bends and stands as the configuration has it, and still meets the wrist."""

from __future__ import annotations

from functools import cache

import coal
from handover_dmp.mocap.synthetic import CONFIGURATIONS, synthesize
from handover_dmp.simulation.partner_figure import PartnerFigure
from handover_dmp.simulation.stances import stance_of, STANCES, UPRIGHT
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

TRIALS = synthesize(3, trials=2)
UP = np.array([0.0, 0.0, 1.0])
TOUCH_M = 0.02
"""What is no higher than this is on the floor."""


@cache
def corners(mesh):
    """Return the corners of a piece of the surface, in the frame of its body part."""
    loaded = coal.MeshLoader().load(mesh.path, np.array(mesh.scale, dtype=float))
    return Rotation.from_quat(mesh.orientation).apply(loaded.vertices()) + mesh.position


def pieces(figure, posture, word='', joints=range(20)):
    """Return the corners of each piece whose file bears a word, in the world; joint 0 is still."""
    found = []
    for part in figure.parts:
        position, turn = figure.part_pose(part, posture)
        for mesh in part.meshes:
            if word in mesh.path and part.joint in joints:
                found.append(Rotation.from_quat(turn).apply(corners(mesh)) + position)
    return found


def placed(trial):
    return PartnerFigure(
        trial.partner, trial.demonstrator[-1], stance=stance_of(trial.configuration)
    )


@pytest.mark.parametrize('trial', TRIALS, ids=lambda trial: trial.label)
def test_wrist_is_on_the_hand_and_nothing_is_below_the_floor(trial):
    figure = placed(trial)
    assert figure.floor_height_m == 0.0
    path = trial.partner[::20]
    for point, posture in zip(path, figure.postures(path), strict=True):
        assert posture.hand_position == pytest.approx(point, abs=1e-6)
        # out of reach it would step
        assert np.linalg.norm(posture.shift) < 0.02
    for point in (path[0], path[-1]):
        posture = figure.posture(point)
        assert np.vstack(pieces(figure, posture))[:, 2].min() > -1e-3


@pytest.mark.parametrize('trial', TRIALS, ids=lambda trial: trial.label)
def test_acting_arm_keeps_out_of_the_trunk(trial):
    """The elbow, the wrist and half of the way between are outside of what a trunk fills."""
    figure = placed(trial)
    for point in trial.partner[::40]:
        posture = figure.posture(point)
        elbow = next(
            figure.part_pose(part, posture)[0]
            for part in figure.parts
            if any('lowerarm' in mesh.path for mesh in part.meshes) and part.joint
        )
        for place in (elbow, (elbow + point) / 2, point):
            from_pelvis = place - figure.pelvis
            along = float(np.clip(from_pelvis @ figure.trunk, 0.0, 0.45))
            assert np.linalg.norm(from_pelvis - along * figure.trunk) > 0.14


@pytest.mark.parametrize(
    ('configuration', 'lowest_deg', 'highest_deg'),
    [('under_car', -2.0, 2.0), ('engine_bay', 20.0, 50.0), ('hydraulic_lift', 80.0, 90.0)],
)
def test_trunk_rises_as_the_posture_has_it(configuration, lowest_deg, highest_deg):
    for trial in TRIALS:
        if trial.configuration == configuration:
            rise_deg = np.degrees(np.arcsin(placed(trial).trunk @ UP))
            assert lowest_deg <= rise_deg <= highest_deg


def test_feet_are_on_the_floor_and_the_back_of_one_who_lies():
    for trial in TRIALS[::2]:
        figure = placed(trial)
        posture = figure.posture(trial.partner[-1])
        feet = pieces(figure, posture, 'foot')
        assert len(feet) == 2
        assert all(foot[:, 2].min() < TOUCH_M for foot in feet), trial.label
        (torso,) = pieces(figure, posture, 'torso')
        on_back = torso[:, 2].min() < TOUCH_M
        assert on_back == (trial.configuration == 'under_car')


def test_left_arm_is_raised_under_the_lift_alone():
    raised = {}
    for trial in TRIALS:
        figure = placed(trial)
        posture = figure.posture(trial.partner[-1])
        (left_hand,) = pieces(figure, posture, 'hand', joints=[0])
        raised[trial.configuration] = left_hand[:, 2].max() > 1.9
    assert raised == {'under_car': False, 'engine_bay': False, 'hydraulic_lift': True}


def test_who_is_in_no_known_configuration_stands_upright():
    assert set(STANCES) == set(CONFIGURATIONS)
    assert stance_of('') is stance_of('office') is UPRIGHT
    assert PartnerFigure(TRIALS[0].partner, TRIALS[0].demonstrator[-1]).trunk == pytest.approx(UP)
