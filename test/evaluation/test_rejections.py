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

"""Rejected curves: counted again one by one, and told by the command."""

from __future__ import annotations

from collections import Counter
import json
from pathlib import Path

from handover_dmp.cli.main import main
from handover_dmp.evaluation.cases import make_cases
from handover_dmp.evaluation.envelope import Envelope
from handover_dmp.evaluation.protocol import evaluate, Protocol
from handover_dmp.evaluation.rejections import find_rejections
from handover_dmp.mocap import read_data_set
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest

SAMPLES = 11
PLACES = st.floats(-1.0, 1.0).map(lambda x: round(x, 3))


@given(
    arrays(np.float64, (3, SAMPLES, 3), elements=PLACES),
    arrays(np.float64, (SAMPLES, 3), elements=PLACES),
    arrays(np.float64, (SAMPLES, 3), elements=st.floats(0.001, 0.2)),
    st.floats(0.0, 1.0),
)
def test_each_is_what_counting_by_hand_gives(
    curves: np.ndarray, mean: np.ndarray, deviation: np.ndarray, width_m: float
) -> None:
    found = find_rejections(curves, (7,), [4, 5, 6], Envelope(mean, deviation, 5), width_m)
    by_place = {(r.tested, r.dimension): r for r in found}
    assert len(by_place) == len(found)
    for row in range(3):
        for dimension in range(3):
            beyond = [
                abs(curves[row, i, dimension] - mean[i, dimension]) - 3.0 * deviation[i, dimension]
                for i in range(SAMPLES)
            ]
            rejection = by_place.get((row + 4, dimension))
            if max(beyond) <= 0.0:
                assert rejection is None
            elif max(beyond) > 1e-8:
                assert rejection is not None
                worst = max(range(SAMPLES), key=lambda i: beyond[i])
                assert rejection.worst == pytest.approx(worst / (SAMPLES - 1))
                assert rejection.beyond_m == pytest.approx(beyond[worst], abs=2e-9)
                assert rejection.first <= rejection.worst
                assert rejection.in_bottleneck == (6.0 * deviation[worst, dimension] < width_m)
                assert rejection.sigmas > 3.0


def test_they_are_the_rest_of_table_i_and_a_wider_band_rejects_fewer(kth_folder: Path) -> None:
    trials = [t for t in read_data_set(kth_folder) if t.configuration == 'p03']
    narrow, wide = (
        evaluate(trials, Protocol(learn=('single',), min_width_m=width)) for width in (0.04, 0.2)
    )
    for before, after in zip(narrow.cases, wide.cases, strict=True):
        rejections, widened = before.rejections['single'], after.rejections['single']
        scores = before.scores['single', 'decoupled']
        assert len(rejections.rejected) == (scores.sigmas > 3.0).sum()
        assert rejections.curves == scores.curves
        assert rejections.outside.max() <= len(rejections.rejected)
        told = rejections.as_json()
        assert max(map(max, told['outside'].values())) == rejections.outside.max()
        assert all(r.widened for r in rejections.rejected if r.beyond_m > 0.1)
        assert sum(r.widened for r in widened.rejected) < len(rejections.rejected)
        deviation = Envelope.of(make_cases(trials)[narrow.cases.index(before)].curves).deviation
        for dimension, neck in enumerate(rejections.bottlenecks):
            assert neck.width_m == pytest.approx(6.0 * deviation[:, dimension].min())
            assert min(told['widths_m']['XYZ'[dimension]]) == pytest.approx(neck.width_m, abs=1e-6)
            assert deviation[round(100 * neck.at), dimension] == deviation[:, dimension].min()


def test_the_command_tells_what_the_table_holds(
    kth_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ['evaluate', str(kth_folder), '-o', str(tmp_path), '--no-figures', '--learn', 'single']
    assert main(words) == 0
    capsys.readouterr()
    assert main(['why', str(tmp_path), '--json', str(tmp_path / 'why.json')]) == 0
    printed = capsys.readouterr().out
    table = json.loads((tmp_path / 'table.json').read_text())
    assert json.loads((tmp_path / 'why.json').read_text()) == table['rejections']
    for case in table['rejections']:
        axes = Counter(curve['dimension'] for curve in case['rejected'])
        line = next(
            line.split()
            for line in printed.splitlines()
            if line.split()[:2] == [case['configuration'], case['exchange']]
        )
        assert line[2:5] == [str(len(case['rejected'])), 'of', str(case['curves'])]
        assert line[5:8] == [str(axes[axis]) for axis in 'XYZ']
        for counts, trials in (
            ('by_learnt', [curve['learnt'][0] for curve in case['rejected']]),
            ('by_tested', [curve['tested'] for curve in case['rejected']]),
        ):
            (summed,) = [
                one[counts]
                for one in table['why']
                if one['configuration'] == case['configuration']
                and one['exchange'] == case['exchange']
            ]
            assert summed == {str(number): count for number, count in Counter(trials).items()}
            assert list(summed.values()) == sorted(summed.values(), reverse=True)
            if summed:
                most, count = next(iter(summed.items()))
                assert f'#{most} {count}' in ' '.join(line)
    assert 'When and where curves were rejected' in (tmp_path / 'index.html').read_text()


@pytest.mark.parametrize(
    ('content', 'said'),
    [
        (None, 'no such file; run `evaluate` to write it'),
        ('{', 'not a table of `evaluate`'),
        ('{"rows": []}', 'has no rejections'),
    ],
)
def test_what_is_no_result_is_said_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str | None, said: str
) -> None:
    if content is not None:
        (tmp_path / 'table.json').write_text(content)
    assert main(['why', str(tmp_path)]) == 1
    error = capsys.readouterr().err
    assert said in error and error.count('\n') == 1
