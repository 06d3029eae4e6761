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

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from types import ModuleType

from handover_dmp.cli.main import main
from handover_dmp.mocap.session import write_sessions
from handover_dmp.mocap.synthetic_session import synthesize_sessions
import pytest


@pytest.fixture(scope='module')
def runs() -> ModuleType:
    """Give the maker of runs of the tests of reports."""
    path = Path(__file__).parents[1] / 'report' / 'conftest.py'
    spec = importlib.util.spec_from_file_location('report_runs', path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_run_is_drawn(runs: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    runs.write_run(tmp_path / 'run' / 'bag', leave_out=('/handover/phase', '/wrist/ik_status'))
    numbers = tmp_path / 'numbers.json'
    assert main(['plot', str(tmp_path / 'run'), '--json', str(numbers)]) == 0
    assert json.loads(numbers.read_text()) == json.loads(
        (tmp_path / 'run' / 'report.json').read_text()
    )
    assert str(tmp_path / 'run' / 'index.html') in capsys.readouterr().out
    assert (tmp_path / 'run' / 'figures' / 'positions.png').is_file()


def test_what_cannot_be_drawn(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / 'text.mcap').write_text('no bag')
    for path, fault in ((tmp_path / 'absent', 'no such bag'), (tmp_path / 'text.mcap', 'MCAP')):
        assert main(['plot', str(path), '-o', str(tmp_path / 'report')]) == 1
        error = capsys.readouterr().err
        assert fault in error
        assert len(error.strip().splitlines()) == 1
    assert not (tmp_path / 'report').exists()


def test_a_recorded_session_is_drawn(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    write_sessions(synthesize_sessions(0, 1, configurations=['under_car']), tmp_path)
    numbers = tmp_path / 'numbers.json'
    words = ['plot', str(tmp_path / 'under_car_1.csv'), '--json', str(numbers)]
    assert main(words) == 0
    picture = tmp_path / 'under_car_1_report' / 'session.png'
    assert picture.read_bytes().startswith(b'\x89PNG')
    assert f'2 exchanges; {picture}' in capsys.readouterr().out
    told = json.loads(numbers.read_text())
    assert [part['direction'] for part in told['exchanges']] == ['give', 'take']
    assert len(told['fluency']['waits']) == 2
    (tmp_path / 'broken.csv').write_text('t\n')
    assert main(['plot', str(tmp_path / 'broken.csv')]) == 1
    assert capsys.readouterr().err.count('\n') == 1
    assert not (tmp_path / 'broken_report').exists()
