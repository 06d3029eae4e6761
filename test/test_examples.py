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

"""The examples are short, run, and say what is true."""

from __future__ import annotations

from pathlib import Path
import re
import subprocess
import sys

from handover_dmp.mocap import synthesize, write_data_set
import pytest

pytestmark = pytest.mark.timeout(1800)  # on a machine that does much else
EXAMPLES = Path(__file__).resolve().parents[1] / 'examples'
MAX_LINES = 40
HEADER_LINES = 14  # of the licence, and the line below


def run(name: str, *words: str | Path) -> str:
    """Run an example as a user does; return what it printed."""
    result = subprocess.run(
        [sys.executable, str(EXAMPLES / f'{name}.py'), *map(str, words)],
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def numbers(text: str, pattern: str) -> list[float]:
    """Return every number that a pattern finds."""
    found = [float(match) for match in re.findall(pattern, text)]
    assert found, text
    return found


def test_every_example_is_short_and_tested_here() -> None:
    tests = Path(__file__).read_text(encoding='utf-8')
    files = sorted(EXAMPLES.glob('*.py'))
    assert len(files) >= 5
    for file in files:
        lines = file.read_text(encoding='utf-8').splitlines()
        own = len(lines) - (HEADER_LINES if lines[0].startswith('# Copyright') else 0)
        assert own <= MAX_LINES, f'{file.name} has {own} lines'
        assert re.search(rf"'{file.stem}(\.py)?'", tests), f'{file.name} is not run here'


def test_learn_and_roll_out() -> None:
    text = run('learn_and_roll_out')
    distances = numbers(text, r'([\d.]+) mm from the person')
    assert len(distances) == 11
    assert distances[0] < 1.0  # it begins where the person did
    assert max(distances) < 150.0
    weights = numbers(text, r'w_g = ([\d.]+)')
    assert weights == sorted(weights)
    assert (weights[0], weights[-1]) == (0.0, 1.0)


def test_moving_goal() -> None:
    decoupled, classical = numbers(run('moving_goal'), r'lags +([\d.]+) mm')
    assert decoupled < 0.5
    assert classical > 20.0


def test_arm_without_ros() -> None:
    text = run('arm_without_ros')
    assert numbers(text, r'at most ([\d.]+) mm')[0] < 1.0
    shares = numbers(text.partition('limits:')[2], r'([\d.]+)')
    assert len(shares) == 7
    assert 0.05 < max(shares) <= 1.0


def test_read_a_bag(tmp_path: Path) -> None:
    # Loaded here, not imported: conftest files are no modules.
    program = (
        'import runpy, sys, pathlib;'
        f'runs = runpy.run_path({str(Path(__file__).parent / "view" / "conftest.py")!r});'
        'runs["write_run"](pathlib.Path(sys.argv[1]))'
    )
    subprocess.run([sys.executable, '-c', program, str(tmp_path)], check=True)
    text = run('read_a_bag', tmp_path)
    states = re.findall(r'^ +[\d.]+ s  (\w+)$', text, re.MULTILINE)
    assert states == ['idle', 'reaching', 'exchange', 'done']
    assert '75 wrist poses' in text
    speeds = dict(re.findall(r'^(\w+) .* at most ([\d.]+) m/s$', text, re.MULTILINE))
    assert float(speeds['reaching']) > 0.1 > float(speeds['idle'])


def test_tune_parameters(tmp_path: Path) -> None:
    trials = synthesize(trials=4, configurations=['engine_bay'])
    write_data_set([trial for trial in trials if trial.direction == 'give'], tmp_path / 'trials')
    text = run('tune_parameters', tmp_path / 'trials', '3')
    assert 'on 4 trials' in text
    assert numbers(text, r'stiffness +([\d.]+)')[0] == 200.0
    assert len(re.findall(r'on unseen trials', text)) == 2
