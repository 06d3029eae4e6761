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

"""The picture of a segmented recording: a real picture, with every handover in it."""

from __future__ import annotations

from dataclasses import replace

from handover_dmp.common.errors import UsageError
from handover_dmp.common.plot_style import EXCHANGE_TINTS
from handover_dmp.mocap import synthesize
from handover_dmp.mocap.segmentation import segment, Segmentation
from handover_dmp.mocap.segmentation_figure import draw_segmentation
from matplotlib.colors import to_rgb
from matplotlib.image import imread
import numpy as np
import pytest


def stripes(picture, colour):
    """Count the bands of a colour along one row of pixels."""
    near = (np.abs(picture[..., :3] - to_rgb(colour)) < 0.02).all(axis=2)
    upper = slice(int(0.1 * len(near)), int(0.4 * len(near)))
    columns = np.flatnonzero(near[upper].mean(axis=0) > 0.5)
    # A line of the grid does not make two of one.
    return 1 + int(np.sum(np.diff(columns) > 6)) if len(columns) > 20 else 0


def test_every_handover_is_shaded(play_session, tmp_path):
    trials = synthesize(seed=3, trials=1)[:4]
    motion, _ = play_session(trials)
    draw_segmentation(segment(motion, Segmentation(giver='p2_then_p1')), tmp_path / 'cut.png')
    picture = imread(tmp_path / 'cut.png')
    assert picture.shape[1] > 900
    assert stripes(picture, EXCHANGE_TINTS['give']) == 2
    assert stripes(picture, EXCHANGE_TINTS['take']) == 2


def test_what_is_left_out_and_gaps_do_not_stop_it(play_session, tmp_path):
    motion, _ = play_session(synthesize(trials=1)[:1])
    found = segment(motion, Segmentation(min_reach_m=2.0))
    draw_segmentation(found, tmp_path / 'out.svg')
    text = (tmp_path / 'out.svg').read_text()
    assert text.startswith('<?xml')
    keep = np.r_[0:100, 102:104, 200: len(motion.times)]  # fmt: skip
    gappy = replace(
        motion,
        times=motion.times[keep],
        partner=motion.partner[keep],
        demonstrator=motion.demonstrator[keep],
    )
    draw_segmentation(segment(gappy), tmp_path / 'gaps.png')
    assert sorted(path.name for path in tmp_path.iterdir()) == ['gaps.png', 'out.svg']


def test_pictures_of_unknown_kind(play_session, tmp_path):
    motion, _ = play_session(synthesize(trials=1)[:1])
    with pytest.raises(UsageError, match=r'cut\.doc'):
        draw_segmentation(segment(motion), tmp_path / 'cut.doc')
    assert not list(tmp_path.iterdir())
