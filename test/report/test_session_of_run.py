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

"""The picture of a whole session in the report of a run, Fig. 3 of the paper."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from handover_dmp.report.figures import draw_session_of_run, exchanges_of
from handover_dmp.report.recorded_run import load_run
import numpy as np
import pytest

STATES = (
    (0.0, 'idle'),
    (0.4, 'reaching'),
    (0.9, 'exchange'),
    (1.1, 'released'),
    (1.2, 'withdrawing'),
    (1.4, 'waiting'),
    (1.5, 'reaching'),
    (2.0, 'exchange'),
    (2.2, 'withdrawing'),
    (2.4, 'done'),
)


def test_give_and_take_are_shaded_from_the_reach_to_the_parting(run_bag: Path) -> None:
    run = replace(load_run(run_bag), states=STATES)
    figure = draw_session_of_run(run)
    assert figure is not None
    for axis, panel in enumerate(figure.axes):
        lines = panel.get_lines()
        np.testing.assert_array_equal(lines[0].get_ydata(), run.hand_positions[:, axis])
        np.testing.assert_array_equal(lines[1].get_ydata(), run.wrist_positions[:, axis])
        # a rectangle, or a polygon of an older matplotlib
        shapes = [p.get_patch_transform().transform_path(p.get_path()) for p in panel.patches]
        spans = [tuple(shape.get_extents().intervalx) for shape in shapes]
        assert spans == [pytest.approx((0.4, 1.1)), pytest.approx((1.5, 2.2))]
    assert [text.get_text() for text in figure.axes[0].texts] == ['give', 'take']


def test_what_did_not_come_to_pass_is_not_shaded(run_bag: Path) -> None:
    run = load_run(run_bag)
    assert draw_session_of_run(run) is None
    broken = (*STATES[:2], (0.6, 'aborted'), (0.7, 'idle'), *STATES[6:])
    (only,) = exchanges_of(replace(run, states=broken))
    assert (only.start_s, only.exchange_s, only.parting_s) == (1.5, 2.0, 2.2)
    unfinished = exchanges_of(replace(run, states=STATES[:3]))
    assert unfinished == []
