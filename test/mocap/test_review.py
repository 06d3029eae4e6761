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

"""What an import says of its trials: each warning where it belongs, and the page of them."""

from __future__ import annotations

from dataclasses import replace
import re

from handover_dmp.mocap.review import review
from handover_dmp.mocap.review_page import review_page
from handover_dmp.mocap.trial import HandoverTrial
from handover_dmp.mocap.wrists import Gap, Known, WristMotion
import numpy as np
import pytest

TIMES = np.arange(301) / 200.0


def reach(start, end):
    """Rest, go from one place to another with minimum jerk, rest."""
    u = np.clip((TIMES - 0.3) / 0.9, 0.0, 1.0)[:, None]
    return np.array(start) + (10 * u**3 - 15 * u**4 + 6 * u**5) * np.subtract(end, start)


P1 = reach([0.9, 0.3, 1.0], [0.6, 0.2, 1.15])
P2 = reach([0.0, 0.05, 0.9], [0.5, 0.2, 1.1])


def reviewed(partner=P1, demonstrator=P2, *, times=TIMES, gaps=(), start_s=0.0, remarks=()):
    motion = WristMotion(
        times + start_s, partner, demonstrator, 'a.c3d', unit=Known('cm', 'in the file'),
        up=Known('y', 'as told'), gaps=gaps, remarks=remarks,
    )  # fmt: skip
    trial = HandoverTrial(times, partner, demonstrator, 'bay', source='a.c3d')
    return review(trial, motion, start_s)


def test_a_usual_handover_gives_no_warning():
    one = reviewed()
    assert one.warnings == ()
    assert one.nearest_m == pytest.approx(np.linalg.norm(P1[-1] - P2[-1]))
    # Minimum jerk: 15/8 of the mean speed.
    for peak, path in zip(one.peak_speeds, (P1, P2), strict=True):
        length = np.linalg.norm(path[-1] - path[0])
        assert peak == pytest.approx(15.0 / 8.0 * length / 0.9, rel=0.03)


UNUSUAL = {
    'fast': ({'times': TIMES / 3.0, 'partner': P1[:1] + 0.0 * P1},
             r'P2 moves at 3\.[0-9] m/s, faster'),
    'far': ({'partner': P1 + [1.0, 0.0, 0.0]}, 'come no nearer than 1.1. m'),
    'one wrist twice': ({'partner': P2 + 0.005}, r'within 9 mm: are they two wrists\?'),
    'from motion': (
        {'partner': P1[120:], 'demonstrator': P2[120:], 'times': TIMES[:-120]},
        'P[12] does not start at rest, but at [01].* m/s',
    ),
    'swapped': ({'partner': P2, 'demonstrator': reach([0.9, 0.3, 1.0], [0.8, 0.3, 1.1])},
                r'P1 moves 0.56 m, P2 0.14 m: are they swapped\?'),
    'gaps': ({'gaps': (Gap('P1', 0.5, 0.6), Gap('P2', 0.605, 0.7))}, 'only [12] samples? between'),
    'gap at the start': ({'gaps': (Gap('P2', 0.005, 0.1),)}, 'only 2 samples between'),
    'said of the recording': ({'remarks': ('two clocks',)}, 'two clocks'),
}  # fmt: skip


@pytest.mark.parametrize('name', UNUSUAL)
def test_each_warning(name):
    changes, message = UNUSUAL[name]
    found = reviewed(**changes).warnings
    assert found
    assert all(re.search(message, warning) for warning in found), found


def test_gaps_are_those_within_the_trial_on_its_own_clock():
    gaps = (Gap('P2', 1.0, 1.1), Gap('P1', 7.5, 7.62), Gap('P1', 9.0, 9.1))
    one = reviewed(gaps=gaps, start_s=7.0)
    assert [gap.who for gap in one.gaps] == ['P1']
    np.testing.assert_allclose(one.gaps[0][1:], [0.5, 0.62])


def test_the_page_shows_what_is_known_and_where_from():
    gaps = (Gap('P2', 0.5, 0.62),)
    odd = reviewed(partner=P1 + [1.0, 0.0, 0.0])
    odd = replace(odd, trial=replace(odd.trial, configuration='<b>far</b>', number=2))
    page = review_page([reviewed(gaps=gaps), odd], 'Imported')
    assert page.count('<svg') == 2
    for words in ('200 Hz', 'cm (in the file)', 'y (as told)', 'P2 0.50 to 0.62 s', 'a.c3d',
                  'come no nearer than'):  # fmt: skip
        assert words in page
    assert '<a href="#trial1">&lt;b&gt;far&lt;/b&gt; give 2</a>.' in page
    assert '<b>' not in page
