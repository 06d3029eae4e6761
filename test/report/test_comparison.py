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

"""Motions of a run measured and runs compared, where every number is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import json
from pathlib import Path
from typing import Any

from handover_dmp.cli.main import main
from handover_dmp.report import measure
from handover_dmp.report.comparison import compare_runs
from handover_dmp.report.motions import compare_motions
from handover_dmp.report.recorded_run import load_run
from handover_dmp.topics import DEMONSTRATOR_POSE
import numpy as np
import pytest
from scipy.stats import ttest_rel

MakeRun = Callable[..., Path]


def test_measures_of_a_run_are_those_of_what_moved(
    make_run: MakeRun, make_motion: type[Any], tmp_path: Path
) -> None:
    motion = make_motion(lag_s=0.0)
    found = compare_motions(load_run(make_run(tmp_path / 'bag', motion)))
    times = np.arange(0.5, 1.9, 1e-3)
    for name, places in (
        ('robot', motion.wrist(times)),
        ('person', motion.demonstrator(times)),
        ('partner', motion.hand(times)),
    ):
        speeds = np.linalg.norm(np.gradient(places, 1e-3, axis=0), axis=1)
        path_m = np.linalg.norm(np.diff(places, axis=0), axis=1).sum()
        # the low-pass of 6 Hz takes a little of a bell as short as this
        assert found[name]['path_m'] == pytest.approx(path_m, rel=0.01)
        assert found[name]['peak_speed'] == pytest.approx(speeds.max(), rel=0.01)
        assert found[name]['peaks'] == 1
    apart = np.linalg.norm(motion.wrist(times) - motion.hand(times), axis=1)
    assert found['distance_min_m'] == pytest.approx(apart.min(), abs=1e-3)
    assert found['relative_speed_m_s'] == pytest.approx(0.0, abs=0.01)
    # the hand set out 0.3 s before the wrist
    assert 0.1 < found['synchrony']['robot']['lag_s'] < 0.45
    assert found['fluency']['person_idle'] > found['fluency']['concurrent'] > 0.2


def test_a_run_without_the_other_person_has_the_rest(make_run: MakeRun, tmp_path: Path) -> None:
    bag = make_run(tmp_path / 'bag', leave_out=(DEMONSTRATOR_POSE.name,))
    found = compare_motions(load_run(bag))
    assert found['person'] is found['synchrony']['person'] is None
    for name in ('robot', 'partner', 'fluency', 'distance_min_m'):
        assert found[name] is not None


def test_who_rests_during_the_reach_is_not_compared(
    make_run: MakeRun, make_motion: type[Any], tmp_path: Path
) -> None:
    """Whether a recorded hand sways or not: its correlation with the wrist would be of noise."""
    run = load_run(make_run(tmp_path / 'bag', make_motion()))
    sway = 1e-3 * np.sin(3.0 * run.hand_times)[:, None]
    waiting = replace(
        run,
        hand_positions=run.hand_positions[-1] + sway,
        demonstrator_positions=np.broadcast_to(
            run.demonstrator_positions[-1], run.demonstrator_positions.shape
        ),
    )
    found = compare_motions(waiting)
    assert found['partner'] is found['person'] is None
    assert found['synchrony'] == {'robot': None, 'person': None}
    assert found['robot'] == compare_motions(run)['robot']
    assert set(measure(waiting)['to_human'].values()) == {None}
    assert measure(run)['to_human']['rms_m'] is not None


def test_pairs_differ_as_they_were_made_to(
    make_run: MakeRun,
    make_motion: type[Any],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    lags = {'calm': (0.01, 0.02, 0.012), 'late': (0.04, 0.06, 0.05)}
    for folder, values in lags.items():
        for number, lag_s in enumerate(values):
            make_run(
                tmp_path / folder / f'trial_{number}' / 'bag',
                make_motion(lag_s=lag_s, hand_speed=0.25),
            )
    places = [str(tmp_path / folder) for folder in lags]
    assert main(['compare', *places, '--json', str(tmp_path / 'out.json')]) == 0
    assert 'Means of 3 pairs' in capsys.readouterr().out
    written = json.loads((tmp_path / 'out.json').read_text())
    assert written['pairs'] == 3
    lag = next(one for one in written['measures'] if one['name'] == 'lag behind the moving hand')
    calm, late = (1e3 * np.array(values) for values in lags.values())
    assert lag['means'] == pytest.approx([calm.mean(), late.mean()], abs=0.5)
    expected = ttest_rel(late, calm).confidence_interval(0.95)
    assert lag['intervals'][0] == pytest.approx([expected.low, expected.high], abs=2.0)


def test_a_run_does_not_differ_from_itself(make_run: MakeRun, tmp_path: Path) -> None:
    bag = make_run(tmp_path / 'one' / 'bag')
    differences, pairs = compare_runs([bag, tmp_path / 'one', bag])
    assert pairs == 1
    for one in differences:
        assert all(value is None or value == 0.0 for value in one.differences)
        assert one.intervals == (None, None)


def test_what_cannot_be_compared_is_said_in_one_line(
    make_run: MakeRun, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make_run(tmp_path / 'a' / 'first' / 'bag')
    make_run(tmp_path / 'b' / 'second' / 'bag')
    (tmp_path / 'empty').mkdir()
    for words, code, said in (
        (['a'], 2, 'compare needs two or more runs'),
        (['a', 'b'], 1, 'no run has the same name'),
        (['a', 'empty'], 1, 'neither a run nor a folder of runs'),
    ):
        assert main(['compare', *(str(tmp_path / word) for word in words)]) == code
        error = capsys.readouterr().err
        assert said in error and error.count('\n') == 1
