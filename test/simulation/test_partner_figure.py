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

"""The figure's wrist is where the recorded one was, and the figure stands as people do."""

from __future__ import annotations

import csv

from handover_dmp.simulation.engine import Engine
from handover_dmp.simulation.partner_figure import ARM_JOINTS, FigureBodies, PartnerFigure
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest


def reach(samples=200):
    """Return a reach from beside the hip to the exchange, as people make it: minimum jerk."""
    u = np.linspace(0, 1, samples)[:, None]
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    return np.array([0.55, 0.15, 0.85]) + s * np.array([-0.35, -0.2, 0.25])


PARTNER = np.array([-0.2, -0.2, 1.0])


def recorded(folder):
    with (folder / 'trials.csv').open() as index:
        for row in csv.DictReader(index):
            data = np.genfromtxt(folder / row['file'], delimiter=',', skip_header=1)
            yield row['file'], data[:, 1:4], data[:, 4:]


def test_wrist_is_on_every_point_of_the_path():
    figure = PartnerFigure(reach(), PARTNER)
    for point, posture in zip(reach(), figure.postures(reach()), strict=True):
        assert posture.hand_position == pytest.approx(point, abs=2e-6)


def test_wrist_follows_recorded_people(kth_folder):
    for name, partner, demonstrator in recorded(kth_folder):
        figure = PartnerFigure(partner, demonstrator[-1])
        postures = figure.postures(partner)
        errors = [
            np.linalg.norm(q.hand_position - p) for q, p in zip(postures, partner, strict=True)
        ]
        assert max(errors) < 2e-6, name
        # The arm as it is suffices for nearly all of it; a small step makes up for the rest.
        assert max(np.linalg.norm(q.shift) for q in postures) < 0.15, name


def test_shown_meshes_are_where_the_posture_says():
    """Ask PyBullet's body of the hand, not the figure's own word for it."""
    figure = PartnerFigure(reach(), PARTNER)
    with Engine() as engine:
        bodies = FigureBodies(figure, engine)
        for point in reach(5):
            bodies.show(point)
            places = [
                engine.getBasePositionAndOrientation(body)[0]
                for body in range(engine.getNumBodies())
            ]
            nearest = min(np.linalg.norm(np.array(place) - point) for place in places)
            assert nearest < 2e-6


def test_what_is_shown_does_not_depend_on_what_was_shown_before():
    """The processes that draw a film show different pictures before the same one."""
    figure = PartnerFigure(reach(), PARTNER)
    arm = figure.postures(reach())[100].joints
    # steps of the figure of some micrometres and of some millimetres, and none
    away = (reach()[100] - figure.shoulder) / np.linalg.norm(reach()[100] - figure.shoulder)
    hands = [figure.shoulder + away * far_m for far_m in (0.3, *np.linspace(0.44, 0.60, 40))]
    with Engine() as engine:
        bodies = FigureBodies(figure, engine)

        def shown(hand):
            bodies.show(hand, arm)
            return [
                engine.getBasePositionAndOrientation(body) for body in range(engine.getNumBodies())
            ]

        forwards = [shown(hand) for hand in hands]
        assert [shown(hand) for hand in reversed(hands)] == forwards[::-1]
    assert len({tuple(body[0] for body in bodies) for bodies in forwards}) == len(hands)


def test_joints_stay_within_their_limits_and_move_smoothly():
    model = PartnerFigure(reach(), PARTNER)._model
    coarse = np.array([p.joints for p in PartnerFigure(reach(), PARTNER).postures(reach(200))])
    fine = np.array([p.joints for p in PartnerFigure(reach(), PARTNER).postures(reach(399))])
    assert coarse.shape == (200, len(ARM_JOINTS))
    assert np.all(coarse >= model.lowerPositionLimit - 1e-9)
    assert np.all(coarse <= model.upperPositionLimit + 1e-9)
    # Twice as many samples, half the steps: no jump anywhere.
    largest, halved = np.abs(np.diff(coarse, axis=0)).max(), np.abs(np.diff(fine, axis=0)).max()
    assert largest < 0.05
    assert halved < 0.6 * largest
    # Nor a kink: second differences fall by four.
    bend = np.abs(np.diff(coarse, 2, axis=0)).max()
    assert np.abs(np.diff(fine, 2, axis=0)).max() < 0.5 * bend


def test_posture_hardly_depends_on_the_way_there():
    figure = PartnerFigure(reach(), PARTNER)
    along = figure.postures(reach())[120].joints
    back = figure.postures(reach()[::-1][: 200 - 120])[-1].joints
    assert along == pytest.approx(back, abs=2e-3)


@settings(deadline=None, max_examples=60)
@given(st.floats(-np.pi, np.pi), st.tuples(st.floats(-5, 5), st.floats(-5, 5)))
def test_place_turns_and_moves_with_the_room(yaw, offset):
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    moved = np.array([*offset, 0.0])
    here = PartnerFigure(reach(), PARTNER)
    there = PartnerFigure(reach() @ turn.T + moved, turn @ PARTNER + moved)
    assert there.pelvis == pytest.approx(turn @ here.pelvis + moved, abs=1e-9)
    assert there.shoulder == pytest.approx(turn @ here.shoulder + moved, abs=1e-9)


def test_stands_upright_behind_the_hand_and_faces_the_partner(kth_folder):
    for name, partner, demonstrator in recorded(kth_folder):
        figure = PartnerFigure(partner, demonstrator[-1])
        to_partner = demonstrator[-1, :2] - partner[-1, :2]
        ahead = np.array([np.cos(figure.heading), np.sin(figure.heading)])
        assert ahead @ to_partner / np.linalg.norm(to_partner) > np.cos(np.radians(41)), name
        assert (partner[-1, :2] - figure.pelvis[:2]) @ ahead > 0.1, name
        distance = np.linalg.norm(partner[-1] - figure.shoulder)
        assert 0.2 < distance < 0.56, name
        assert figure.pelvis[2] - figure.floor_height_m == pytest.approx(1.05, abs=0.05)
        assert figure.shoulder[2] - figure.floor_height_m == pytest.approx(1.38, abs=0.05)


def test_floor_is_that_of_the_room_where_it_can_be():
    assert PartnerFigure(reach(), PARTNER).floor_height_m == 0.0
    low = reach() - [0, 0, 1.1]  # a frame between two chests
    assert PartnerFigure(low, PARTNER).floor_height_m == pytest.approx(-1.07, abs=0.1)
    assert PartnerFigure(low, PARTNER, floor_height_m=-1.2).floor_height_m == -1.2


def test_steps_after_a_hand_that_is_out_of_reach_without_a_jump():
    figure = PartnerFigure(reach()[-1], PARTNER)
    away = np.linspace(reach()[-1], reach()[-1] + [-1.0, 0.0, 0.0], 500)
    postures = figure.postures(away)
    shifts = np.array([p.shift for p in postures])
    for point, posture in zip(away, postures, strict=True):
        assert posture.hand_position == pytest.approx(point, abs=2e-6)
    assert np.linalg.norm(shifts[0]) < 0.01
    assert np.linalg.norm(shifts[-1]) > 0.5
    assert np.abs(np.diff(shifts, axis=0)).max() < 1.5 * (1.0 / 499)


def test_one_point_is_enough():
    figure = PartnerFigure(np.array([0.3, 0.0, 1.0]), np.array([0.3, 0.0, 1.0]))
    posture = figure.posture(np.array([0.3, 0.0, 1.0]))
    assert posture.hand_position == pytest.approx([0.3, 0.0, 1.0], abs=2e-6)
