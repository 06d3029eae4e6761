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

"""`handover_dmp bench`: what it measures, writes and compares."""

from __future__ import annotations

import argparse
from importlib.util import find_spec
import json
from pathlib import Path
from typing import Any

from handover_dmp.bench.measurement import Measurement
from handover_dmp.bench.report import cells, compare, markdown, read_json, write_json
from handover_dmp.cli.bench import SUBJECTS
from handover_dmp.cli.main import main
from handover_dmp.common.errors import DataError
import numpy as np
import pytest


def step(value: float, floor: float | None = 1.0, **more: Any) -> Measurement:
    """Make a figure of the kind where less is better."""
    return Measurement('step', value, 'µs', target=3.0, floor=floor, **more)


def speed(value: float, floor: float | None = None) -> Measurement:
    """Make a figure of the kind where more is better."""
    return Measurement('speed', value, 'times real time', floor=floor, higher_is_better=True)


def test_every_subject_has_its_module() -> None:
    for subject in SUBJECTS:
        assert find_spec(f'handover_dmp.bench.{subject}') is not None, subject


def test_a_run_writes_machine_and_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    json_file, markdown_file = tmp_path / 'new' / 'figures.json', tmp_path / 'table.md'
    words = ['bench', 'startup', '--json', str(json_file), '--markdown', str(markdown_file)]
    assert main(words) == 0
    document = json.loads(json_file.read_text())
    assert document['machine']['cores'] >= 1
    assert document['machine']['versions']['handover_dmp']
    (result,) = document['results']
    assert {'name', 'value', 'unit', 'target', 'floor', 'peers'} <= set(result)
    # Python itself is part of what was measured.
    assert result['value'] > 0.5 * result['floor'] > 0.0
    assert 'start of `handover_dmp --help`' in capsys.readouterr().out
    assert '| start of `handover_dmp --help` |' in markdown_file.read_text()


@pytest.mark.slow
def test_the_graph_is_measured_in_motion(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip('rclpy', reason='ROS 2 is not installed')
    from handover_dmp.bench import ros

    monkeypatch.setattr(ros, 'DURATION_S', 6.0)
    file = tmp_path / 'figures.json'
    assert main(['bench', 'ros', '--json', str(file)]) == 0
    rows = {row.name: row for row in read_json(file)}

    for what in ('a handover is on', 'the arm moves'):
        assert rows[f'share of the measured periods in which {what}'].value > 50.0
    lost, drift = rows['periods lost by dmp'], rows['drift of dmp from 200 Hz']
    assert lost.target is not None and lost.value == round(lost.value)
    assert drift.target is not None and drift.floor is not None
    assert drift.target > drift.floor
    for share in (50, 99):
        row = rows[f'period error of dmp, {share} %']
        assert row.value >= 0.0
        assert len(row.peers) == 1
    middle, worst = (rows[f'hand pose to joint velocity, {share} %'] for share in (50, 99))
    # three hops and two computations cannot take less than two hops alone
    assert middle.floor is not None
    assert middle.floor < middle.value <= worst.value
    speed = rows['five nodes in lockstep']
    # no machine takes less time for all that a period does than for its messages alone
    assert speed.floor is not None
    assert 0.0 < speed.value < speed.floor
    for node in ('dmp', 'priority_ik'):
        assert rows[f'periods lost by {node} in lockstep'].value == 0.0


@pytest.mark.parametrize('on', [1.0, 0.0])
def test_an_answer_is_what_follows_from_the_pose_and_not_what_comes_next(on: float) -> None:
    from handover_dmp.bench.graph_run import WallClockRun
    from handover_dmp.bench.ros import _latencies_ms

    # the wrist command of 1.006 does not know the pose of 1.005, and 1.008 still follows that of
    # 1.006: what answers the pose is heard at 1.0145; a pose from before the start has no answer
    run = WallClockRun(
        hand=np.array([[1.0, 1.0], [1.0051, 1.005]]),
        dmp=np.array(
            [
                [0.996, 0.99, on],
                [1.001, 0.995, 1.0],
                [1.006, 1.0, 1.0],
                [1.011, 1.005, 1.0],
            ]
        ),
        ik=np.array([[1.008, 1.006], [1.013, 1.011]]),
        joints=np.array([[1.008, 1.0095, 1.0], [1.013, 1.0145, 1.0]]),
        ticks={},
        probes={},
        handovers=1,
        span=(0.5, 2.0),
    )
    np.testing.assert_allclose(_latencies_ms(run), [9.5, 9.4] if on else [9.4])


def test_an_answer_after_a_period_that_was_not_recorded_is_none() -> None:
    from handover_dmp.bench.graph_run import WallClockRun
    from handover_dmp.bench.ros import _latencies_ms

    run = WallClockRun(
        hand=np.array([[1.0, 1.0], [1.0051, 1.005]]),
        dmp=np.array([[0.996, 0.99, 1.0], [1.011, 1.005, 1.0]]),
        ik=np.array([[1.008, 1.006], [1.013, 1.011]]),
        joints=np.array([[1.008, 1.0095, 1.0], [1.013, 1.0145, 1.0]]),
        ticks={},
        probes={},
        handovers=1,
        span=(0.5, 2.0),
    )
    assert len(_latencies_ms(run)) == 0


def test_an_answer_of_an_arm_at_rest_is_none() -> None:
    from handover_dmp.bench.graph_run import WallClockRun
    from handover_dmp.bench.ros import _latencies_ms

    run = WallClockRun(
        hand=np.array([[1.0, 1.0]]),
        dmp=np.array([[1.001, 1.0, 0.0]]),
        ik=np.array([[1.002, 1.001]]),
        joints=np.array([[1.002, 1.003, 0.0]]),
        ticks={},
        probes={},
        handovers=0,
        span=(0.5, 2.0),
    )
    assert len(_latencies_ms(run)) == 0


@pytest.mark.parametrize(('missing', 'lost'), [((), 0), ((200,), 1), ((200, 201, 600), 3)])
def test_lost_periods_are_counted(missing: tuple[int, ...], lost: int) -> None:
    from handover_dmp.bench.ros import _pace

    times = np.arange(1000) * 0.005
    ran = np.delete(times, missing)
    numbered = np.column_stack((ran, np.arange(len(ran))))
    unseen = np.delete(numbered, (100, 101, 800), axis=0)
    count, drift = _pace(unseen, times)
    assert count.value == lost
    assert '3 of them unseen' in count.note
    assert count.reached == (lost == 0)
    assert drift.reached == (lost <= 1)


def test_a_subject_that_does_not_exist(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['bench', 'juggling']) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert 'juggling' in line
    assert 'startup' in line


def test_figures_survive_the_file(tmp_path: Path) -> None:
    results = [step(2.0, peers={'pydmps': 31.0}, note='so'), speed(12.0)]
    write_json(tmp_path / 'a.json', {}, results)
    assert read_json(tmp_path / 'a.json') == results


@pytest.mark.parametrize('text', ['', '[]', '{"results": [{"colour": "red"}]}', '{"results": 1}'])
def test_a_file_that_is_none_of_those(tmp_path: Path, text: str) -> None:
    file = tmp_path / 'a.json'
    file.write_text(text)
    with pytest.raises(DataError, match=r'a\.json'):
        read_json(file)


def test_ratios_to_floor_and_peers() -> None:
    _, here, target, floor, peers, _ = cells(step(2.0, peers={'pydmps': 31.0}))
    assert here == '2 µs ✓'
    assert target == 'at most 3 µs'
    assert floor == '1 µs (here × 2)'
    assert peers == 'pydmps: 31 µs (× 15.5)'


def test_a_missed_target_is_marked() -> None:
    assert cells(step(4.0))[1] == '4 µs ✗'


def test_a_figure_without_floor_and_target() -> None:
    assert cells(speed(12.0))[1:5] == ('12 times real time', '', '', '')


def test_markdown_has_one_line_a_figure() -> None:
    lines = markdown([step(2.0, peers={'a|b': 1.0, 'c': 2.0}), speed(12.0)]).splitlines()
    assert len(lines) == 4
    for line in lines:
        assert line.replace('\\|', '').count('|') == 7


@pytest.mark.parametrize(
    ('before', 'after', 'worsening'),
    [
        (step(2.0), step(3.0), 1.5),
        (step(3.0), step(2.0), 2.0 / 3.0),
        (speed(12.0), speed(6.0), 2.0),
        (speed(6.0), speed(12.0), 0.5),
        (step(0.0), step(0.0), 1.0),
        (step(0.0), step(1.0), float('inf')),
    ],
)
def test_worsening(before: Measurement, after: Measurement, worsening: float) -> None:
    ((change,), single) = compare([before], [after])
    assert change.worsening == pytest.approx(worsening)
    assert single == []


def test_a_slower_machine_is_no_slowdown() -> None:
    ((change,), _) = compare([step(2.0, floor=1.0)], [step(4.0, floor=2.0)])
    assert change.machine == 2.0
    assert not change.is_slowdown(1.25)
    ((change,), _) = compare([step(2.0, floor=1.0)], [step(6.0, floor=2.0)])
    assert change.is_slowdown(1.25)


def test_a_faster_machine_does_not_hide_one_nor_make_one() -> None:
    ((change,), _) = compare([step(2.0, floor=2.0)], [step(2.0, floor=1.0)])
    assert not change.is_slowdown(1.25)


def test_the_floor_of_an_error_says_nothing_of_the_machine() -> None:
    before = Measurement('error', 0.01, 'mm', floor=1e-15)
    after = Measurement('error', 0.02, 'mm', floor=3e-15)
    ((change,), _) = compare([before], [after])
    assert change.machine == 1.0
    assert change.is_slowdown(1.25)


def test_figures_of_one_run_alone_are_named() -> None:
    changes, single = compare([step(1.0)], [speed(1.0)])
    assert changes == []
    assert single == ['speed', 'step']


def test_compare_says_by_its_exit_code_whether_something_got_slower(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before, after = tmp_path / 'before.json', tmp_path / 'after.json'
    write_json(before, {}, [step(2.0)])
    write_json(after, {}, [step(2.8)])
    words = ['bench', 'compare', str(before), str(after)]
    assert main(words) == 1
    assert 'worse by more than × 1.25: step' in capsys.readouterr().out
    assert main([*words, '--tolerance', '1.5']) == 0
    assert main(['bench', 'compare', str(after), str(before)]) == 0


def test_compare_takes_two_files(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(['bench', 'compare', 'a.json']) == 2
    assert main(['bench', 'compare', str(tmp_path / 'a.json'), str(tmp_path / 'b.json')]) == 1
    assert 'a.json: No such file or directory' in capsys.readouterr().err


def test_bench_parses_as_the_command_promises() -> None:
    from handover_dmp.cli.bench import add_arguments

    parser = argparse.ArgumentParser()
    add_arguments(parser)
    options = parser.parse_args(['dmp', 'ik', '--json', 'a.json'])
    assert options.words == ['dmp', 'ik']
    assert options.json == Path('a.json')
