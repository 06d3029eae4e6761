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

"""The trial and its file: what is written is read back, and every fault has its line."""

from __future__ import annotations

import os
from pathlib import Path
import resource
import subprocess
import sys
import textwrap

from handover_dmp.common.errors import DataError
from handover_dmp.mocap import HandoverTrial, read_trial, write_trial
from handover_dmp.mocap.trial import describe, HEADER
from hypothesis import example, given, HealthCheck, settings
from hypothesis import strategies as st
import numpy as np
import pytest

SAMPLES = 20


def make_trial(**changes):
    times = np.arange(SAMPLES) / 100.0
    path = 0.5 * np.column_stack([times, times**2, 1.0 + times])
    values = {'times': times, 'partner': path, 'demonstrator': path + [0.4, 0.0, 0.1], 'number': 3}
    return HandoverTrial(**{**values, **changes})


def lines_of(trial: HandoverTrial, folder: Path) -> list[str]:
    write_trial(trial, folder / 'good.csv')
    return (folder / 'good.csv').read_text().splitlines()


def with_line(number: int, text: str):
    def change(lines):
        return [*lines[: number - 1], text, *lines[number:]]

    return change


def with_cell(line: int, column: int, text: str):
    def change(lines):
        cells = lines[line - 1].split(',')
        cells[column] = text
        return [*lines[: line - 1], ','.join(cells), *lines[line:]]

    return change


def swapped(lines):
    return [*lines[:6], lines[7], lines[6], *lines[8:]]


FAULTS = {
    'header': (with_line(1, 'time,x,y,z'), 'line 1: header'),
    'truncated row': (lambda lines: [*lines[:-1], lines[-1][:8]], 'line 21: '),
    'long row': (with_line(5, '1,2,3,4,5,6,7,8'), 'line 5: 8 values instead of 7'),
    'word': (with_cell(7, 2, 'left'), "line 7: p1_y is 'left', not a number"),
    'empty cell': (with_cell(7, 2, ''), "line 7: p1_y is '', not a number"),
    'underscore': (with_cell(7, 2, '1_0'), "line 7: p1_y is '1_0', not a number"),
    'not a number': (with_cell(8, 6, 'nan'), 'line 8: p2_z is'),
    'infinite': (with_cell(9, 0, '-inf'), 'line 9: t is'),
    'overflow': (with_cell(9, 4, '1e999'), "line 9: p2_x is '1e999', not a finite number"),
    'repeated': (lambda lines: [*lines[:8], lines[7], *lines[8:]], 'line 9: time 0.06 s is rep'),
    'backwards': (swapped, 'line 8: time runs backwards, from 0.06 to 0.05'),
    'short': (lambda lines: lines[:10], '9 samples, at least 10 are needed'),
    'header only': (lambda lines: lines[:1], '0 samples'),
    'jump': (with_cell(11, 1, '5.0'), 'line 11: a jump of 5 m'),
    'gap': (with_cell(21, 0, '9.0'), 'line 21: no sample for 8.82 s'),
    'millimetres': (
        lambda lines: [
            lines[0],
            *(
                ','.join([cells[0], *(str(1e3 * float(cell)) for cell in cells[1:])])
                for cells in (line.split(',') for line in lines[1:])
            ),
        ],
        'are these millimetres?',
    ),
}


@pytest.mark.parametrize('name', FAULTS)
def test_a_faulty_file_is_named_with_line_and_fault(name, tmp_path):
    change, message = FAULTS[name]
    path = tmp_path / 'bad.csv'
    path.write_text('\n'.join(change(lines_of(make_trial(), tmp_path))) + '\n')
    with pytest.raises(DataError) as caught:
        read_trial(path)
    assert str(path) in str(caught.value)
    assert message in str(caught.value)
    assert '\n' not in str(caught.value)


def test_files_that_are_no_files(tmp_path):
    (tmp_path / 'empty.csv').write_bytes(b'')
    (tmp_path / 'blank.csv').write_bytes(b'\n \n')
    (tmp_path / 'image.csv').write_bytes(b'\x89PNG\r\n\x1a\n\xff\xfe')
    os.mkfifo(tmp_path / 'pipe.csv')
    expected = {
        'none.csv': 'no such file',
        'empty.csv': 'is empty',
        'blank.csv': 'is empty',
        'image.csv': 'not a text',
        'pipe.csv': 'not a regular file',
        '.': 'not a regular file',
        'a\0b': 'no such file',
        'x' * 5000: 'cannot be read',
    }
    for name, message in expected.items():
        with pytest.raises(DataError, match=message):
            read_trial(tmp_path / name)


def test_what_is_written_is_read_back_to_the_last_bit(tmp_path):
    random = np.random.default_rng(1)
    path = np.cumsum(1e-3 * random.standard_normal((SAMPLES, 6)), axis=0)
    trial = make_trial(
        partner=path[:, :3], demonstrator=path[:, 3:], configuration='under car', direction='take'
    )
    write_trial(trial, tmp_path / 'a_take_3.csv')
    again = read_trial(tmp_path / 'a_take_3.csv', configuration='under car')
    for name in ('times', 'partner', 'demonstrator'):
        np.testing.assert_array_equal(getattr(trial, name), getattr(again, name))
    assert again.label == trial.label == 'under car take 3'


@given(
    st.lists(
        st.tuples(*[st.floats(-90.0, 90.0, allow_subnormal=True) for _ in range(6)]),
        min_size=10,
        max_size=10,
    ),
    st.floats(-1e9, 1e9),
)
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
def test_any_finite_trial_survives_its_file(tmp_path_factory, steps, start):
    # Steps this small cannot be jumps.
    path = np.cumsum(np.array(steps) / 1000.0, axis=0)
    trial = HandoverTrial(start + np.arange(10) / 8.0, path[:, :3], path[:, 3:])
    file = tmp_path_factory.mktemp('trial') / 'x.csv'
    write_trial(trial, file)
    again = read_trial(file)
    np.testing.assert_array_equal(again.demonstrator, trial.demonstrator)
    np.testing.assert_array_equal(again.times, trial.times)


def test_forgiving_where_nothing_is_lost(tmp_path):
    lines = lines_of(make_trial(), tmp_path)
    text = '\ufeff' + '\r\n'.join(line.replace(',', ' , ') for line in lines) + '\r\n\r\n  \n'
    (tmp_path / 'windows.csv').write_bytes(text.encode())
    np.testing.assert_array_equal(
        read_trial(tmp_path / 'windows.csv').partner, make_trial().partner
    )


def test_what_it_is_a_trial_of(tmp_path):
    def known(name, **told):
        write_trial(make_trial(), tmp_path / name)
        trial = read_trial(tmp_path / name, **told)
        return trial.configuration, trial.direction, trial.number

    assert known('engine_bay_take_12.csv') == ('engine_bay', 'take', 12)
    # What Motive calls every recording.
    name = 'Take 2023-05-01 10.12.13 AM'
    assert known(f'{name}.csv') == (name, 'give', 1)
    assert describe(tmp_path / f'{name}.c3d') == (name, None, 1)
    assert describe(tmp_path / 'take_1.c3d') == ('take_1', None, 1)
    assert known('mistaken.csv') == ('mistaken', 'give', 1)
    assert known('engine_bay_take_12.csv', direction='give') == ('engine_bay', 'give', 12)
    index = 'source,trial,exchange,configuration,file\n"a, b",7,take,pit,engine_bay_give_1.csv\n'
    (tmp_path / 'trials.csv').write_text(index)
    assert known('engine_bay_give_1.csv') == ('pit', 'take', 7)
    assert known('lift_give_2.csv') == ('lift', 'give', 2)
    (tmp_path / 'trials.csv').write_bytes(b'\xff\xff')
    assert known('engine_bay_give_1.csv') == ('engine_bay', 'give', 1)


def test_a_trial_cannot_be_changed():
    times = np.arange(SAMPLES) / 100.0
    trial = make_trial(times=times)
    with pytest.raises(ValueError, match='read-only'):
        trial.partner[0] = 0.0
    times[0] = 7.0
    assert trial.times[0] == 0.0
    assert trial.duration_s == pytest.approx(0.19)
    assert trial.rate_hz == pytest.approx(100.0)


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'direction': 'throw'}, "exchange 'throw'"),
        ({'partner': np.zeros((SAMPLES, 2))}, 'shapes'),
        ({'times': np.float64(3.0)}, 'shapes'),
        ({'times': -np.arange(SAMPLES) / 100.0}, 'sample 1: time runs backwards'),
        (
            {'demonstrator': np.full((SAMPLES, 3), np.nan)},
            'sample 0: a value is not a finite number',
        ),
        ({'demonstrator': np.full((SAMPLES, 3), 1e300)}, 'sample 0: a position of 1e'),
    ],
)
def test_a_trial_in_code_is_checked_as_a_file_is(changes, message):
    with pytest.raises(DataError, match=message):
        make_trial(**changes)


def test_real_people(kth_folder):
    trial = read_trial(kth_folder / 'raw_give_1.csv')
    assert trial.label == 'raw give 1'
    assert trial.rate_hz == pytest.approx(120.0, rel=1e-2)


@given(st.binary(max_size=400))
@example(b'\x00')
@example(','.join(HEADER).encode() + b'\n' + b'1,2,3,4,5,6,7\n' * 20)
@settings(max_examples=120, deadline=None, suppress_health_check=list(HealthCheck))
def test_any_bytes_are_a_trial_or_a_data_error(tmp_path_factory, content):
    check_hostile(tmp_path_factory.mktemp('bytes') / 'x.csv', content)


CELLS = st.sampled_from(
    ['0', '1', '-1', '0.5', '1e308', '-1e308', '1e-320', '5e-324', 'nan', '١', '', ' ', '9' * 400]
)


@given(st.lists(st.lists(CELLS, min_size=6, max_size=8), min_size=8, max_size=14))
@settings(max_examples=120, deadline=None, suppress_health_check=list(HealthCheck))
def test_any_table_is_a_trial_or_a_data_error(tmp_path_factory, rows):
    text = '\n'.join([','.join(HEADER), *(','.join(row) for row in rows)])
    check_hostile(tmp_path_factory.mktemp('table') / 'x.csv', text.encode())


def check_hostile(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    try:
        trial = read_trial(path)
    except DataError as error:
        assert '\n' not in str(error)
        assert len(str(error)) < 1000
    else:
        assert np.isfinite(trial.partner).all()
        assert (np.diff(trial.times) > 0.0).all()


@pytest.mark.parametrize(
    'line',
    ['\\n', ',\\n', '1,2,3,4,5,6,7\\n', '0,0,0,0,0,0,0,', '"', '\\U0001f600\\n', '1' * 1000],
    ids=['newlines', 'commas', 'rows', 'one line', 'quotes', 'emoji', 'digits'],
)
def test_a_huge_file_takes_little_memory(line, tmp_path):
    """Under a limit of 500 MB on the process, it is a DataError and not a MemoryError."""
    script = f"""
        import resource
        from handover_dmp.common.errors import DataError
        from handover_dmp.mocap.data_set import read_data_set
        from handover_dmp.mocap.trial import HEADER, read_trial
        used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        line = '{line}'
        for name, header in (('x.csv', ','.join(HEADER)), ('trials.csv', 'file,configuration')):
            with open(name, 'w', encoding='utf-8') as file:
                file.write(header + '\\n')
                file.write(line * (15_500_000 // len(line.encode())))
            try:
                read_trial('x.csv') if name == 'x.csv' else read_data_set('.')
            except DataError as error:
                assert len(str(error)) < 1000, len(str(error))
            else:
                raise SystemExit('read')
        print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - used)
        """
    result = subprocess.run(
        [sys.executable, '-c', textwrap.dedent(script)],
        cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': str(Path(__file__).parents[2])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    assert int(result.stdout) < 500_000, 'kB more than before'


def test_endless_files_are_not_read(tmp_path):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    path = tmp_path / 'sparse.csv'
    with path.open('wb') as file:
        file.truncate(50_000_000_000)
    with pytest.raises(DataError, match='more than 16 MB'):
        read_trial(path)
    with pytest.raises(DataError, match='not a regular file'):
        read_trial('/dev/zero')
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000
