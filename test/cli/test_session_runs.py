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

"""`--session` of `demo` and `simulate`: what is asked for wrongly, and a whole session."""

from __future__ import annotations

import json
from pathlib import Path

from handover_dmp.cli.main import main
from handover_dmp.report import load_run
from PIL import Image
import pytest


@pytest.mark.parametrize(
    ('words', 'told'),
    [
        (['--mass', '1'], '--mass needs --session'),
        (['--take-model', 'x.json'], '--take-model needs --session'),
        (['--no-pick-up'], '--no-pick-up needs --session'),
        (['--session', '--mass', '70'], '--mass is 70 kg; it must be from 0 to'),
        (['--session', '--mass', 'nan'], '--mass is nan kg; it must be from 0 to'),
        (['--session', '--scale', '0.5'], '--scale cannot be combined'),
        (['--session', '--object', 'anvil'], "object 'anvil' is unknown"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(
    words: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['simulate', *words, '-o', str(tmp_path / 'run')]) == 2
    shown = capsys.readouterr().err
    assert told in shown
    assert 'Traceback' not in shown
    assert not (tmp_path / 'run').exists()


def test_a_trial_is_no_session(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['synthesize', '-o', str(tmp_path / 'trials'), '--trials', '1']) == 0
    trial = tmp_path / 'trials' / 'engine_bay_give_1.csv'
    assert main(['simulate', '--session', '--trial', str(trial), '-o', str(tmp_path / 'run')]) != 0
    assert 'Traceback' not in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.timeout(1800)  # on a machine that does much else
def test_a_whole_session_without_ros(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['synthesize', '--sessions', '-o', str(tmp_path / 'made'), '--trials', '1']) == 0
    recorded, run = tmp_path / 'made' / 'under_car_1.csv', tmp_path / 'run'
    words = ['--trial', str(recorded), '-o', str(run), '--json', str(tmp_path / 'report.json')]
    assert main(['simulate', '--session', *words]) == 0
    assert 'never dropped' in capsys.readouterr().out
    report = json.loads((tmp_path / 'report.json').read_text())
    assert report == json.loads((run / 'report.json').read_text())
    session = report['session']
    assert report['handed_over'] and report['limits']['met']
    assert (session['dropped'], session['released_early']) == (False, False)
    give, take = session['legs']
    assert give['release']['rule'] in ('share', 'pull')
    assert give['release']['both_s'] > 0.0
    assert give['exchange_gap_m'] < 0.04 and take['exchange_gap_m'] < 0.04
    states = [one['state'] for one in session['timeline']]
    wanted = ['reaching', 'exchange', 'released', 'withdrawing', 'waiting', 'reaching', 'exchange']
    assert [state for state in states if state in wanted or state == 'done'] == [
        *wanted, 'withdrawing', 'done',
    ]  # fmt: skip
    record = load_run(run)
    assert (record.holders[0][1], record.holders[-1][1]) == ('table', 'robot')
    assert 'picking_up' in states
    assert {'partner', 'both'} <= {who for _, who in record.holders}
    film = Image.open(run / 'session.webp')
    # ten pictures a second, from just before the arm first moves to the end
    assert film.n_frames == pytest.approx(10 * (record.end_time_s - 1.2), rel=0.25)
    assert 'meshcat' in (run / 'session.html').read_text().lower()
    for name in ('start', 'give', 'use', 'take', 'end'):
        assert (run / 'figures' / f'scene_{name}.png').is_file()
    assert main(['plot', str(run)]) == 0
    assert main(['simulate', '--session', *words]) != 0, 'a run is never overwritten'
