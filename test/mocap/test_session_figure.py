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

"""The picture of a session: both wrists in three panels of one scale, the exchanges shaded."""

from __future__ import annotations

from dataclasses import replace

from handover_dmp.common.plot_style import EXCHANGE_TINTS
from handover_dmp.mocap.session_figure import draw_session, motion_curves
from handover_dmp.mocap.synthetic_session import synthesize_sessions
from matplotlib.colors import to_rgb
import numpy as np
import pytest


@pytest.fixture(scope='module')
def session():
    return synthesize_sessions(1, 1, configurations=['hydraulic_lift'])[0]


def span_of(patch):
    """Where a shaded part begins and ends; an older matplotlib draws it as a polygon."""
    return patch.get_patch_transform().transform_path(patch.get_path()).get_extents().intervalx


def test_every_panel_has_both_wrists_and_both_exchanges(session):
    figure = draw_session(session)
    figure.draw_without_rendering()
    panels = figure.axes
    assert [panel.get_ylabel() for panel in panels] == ['X / m', 'Y / m', 'Z / m']
    for axis, panel in enumerate(panels):
        partner, demonstrator, *marks = panel.get_lines()
        np.testing.assert_array_equal(partner.get_ydata(), session.motion.partner[:, axis])
        np.testing.assert_array_equal(
            demonstrator.get_ydata(), session.motion.demonstrator[:, axis]
        )
        low, high = panel.get_ylim()
        for wrist in (session.motion.partner, session.motion.demonstrator):
            assert low < wrist[:, axis].min() < wrist[:, axis].max() < high
        spans = [(*span_of(patch), patch.get_facecolor()[:3]) for patch in panel.patches]
        for part, (begin, end, colour), mark in zip(session.exchanges, spans, marks, strict=True):
            assert (begin, end) == pytest.approx((part.start_s, part.parting_s))
            assert colour == pytest.approx(to_rgb(EXCHANGE_TINTS[part.direction]))
            assert mark.get_xdata()[0] == part.exchange_s
    # a metre is as high in all of them
    scales = [
        panel.get_window_extent().height / float(np.ptp(panel.get_ylim())) for panel in panels
    ]
    assert max(scales) / min(scales) < 1.02


def test_a_gap_is_a_gap_in_the_curves(session):
    motion = session.motion
    keep = (motion.times < 2.0) | (motion.times > 3.0)
    gappy = replace(
        motion,
        times=motion.times[keep],
        partner=motion.partner[keep],
        demonstrator=motion.demonstrator[keep],
    )
    for curve in motion_curves(gappy):
        unseen = np.isnan(curve.positions).all(axis=1)
        assert unseen.sum() == 1
        assert curve.times[unseen] == pytest.approx([3.005])
