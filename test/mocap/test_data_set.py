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

"""The folder of trials: round trip, and every fault of its index."""

from __future__ import annotations

from dataclasses import replace

from handover_dmp.common.errors import DataError
from handover_dmp.mocap import read_data_set, synthesize, write_data_set
from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
import numpy as np
import pytest

HEADER = 'file,configuration,exchange,trial\n'
ROW = 'engine_bay_give_1.csv,engine_bay,give,1\n'


@pytest.fixture
def trials():
    return synthesize(trials=2, configurations=['engine_bay'])


@pytest.fixture
def folder(tmp_path, trials):
    write_data_set(trials, tmp_path / 'set')
    return tmp_path / 'set'


def test_round_trip(folder, trials):
    again = read_data_set(folder)
    assert [trial.label for trial in again] == [trial.label for trial in trials]
    for one, other in zip(trials, again, strict=True):
        np.testing.assert_array_equal(one.partner, other.partner)
        np.testing.assert_array_equal(one.demonstrator, other.demonstrator)
        np.testing.assert_array_equal(one.times, other.times)


def test_the_index_tells_rate_and_source(folder):
    first = (folder / 'trials.csv').read_text().splitlines()[1]
    assert first == 'engine_bay_give_1.csv,engine_bay,give,1,200,synthetic (seed 0)'


def test_names_that_are_no_file_names_survive(tmp_path, trials):
    odd = replace(trials[0], configuration='pit "4", rear/left', source='two\nlines')
    write_data_set([odd], tmp_path)
    assert (tmp_path / 'pit-4-rear-left_give_1.csv').is_file()
    assert read_data_set(tmp_path)[0].configuration == 'pit "4", rear/left'


INDEX_FAULTS = {
    'columns': ('file,configuration,trial\n', "line 1: no column 'exchange'"),
    'no trial': (HEADER, 'names no trial'),
    'missing file': (HEADER + 'b_give_1.csv,b,give,1\n', "line 2: names 'b_give_1.csv', which is"),
    'short row': (HEADER + ROW + 'x.csv,b\n', 'line 3: 2 values instead of 4'),
    'exchange': (HEADER + ROW.replace('give,', 'lend,'), "line 2: exchange 'lend'"),
    'number': (HEADER + ROW.replace(',1\n', ',one\n'), "line 2: trial 'one' is not a number"),
    'nameless': (HEADER + ',engine_bay,give,1\n', "line 2: file '' is not the name"),
    'elsewhere': (HEADER + '../x.csv,engine_bay,give,1\n', "line 2: file '../x.csv'"),
    'absolute': (HEADER + '/etc/passwd,engine_bay,give,1\n', "line 2: file '/etc/passwd'"),
    'twice': (HEADER + ROW + ROW, 'line 3: engine_bay give 1 is there twice'),
    'nowhere': (HEADER + ROW.replace(',engine_bay,', ',,'), 'line 2: configuration is empty'),
    'quotes': (HEADER + '"engine', 'line 2: '),
}


@pytest.mark.parametrize('name', INDEX_FAULTS)
def test_a_faulty_index_is_named_with_line_and_fault(name, folder):
    text, message = INDEX_FAULTS[name]
    (folder / 'trials.csv').write_text(text)
    with pytest.raises(DataError) as caught:
        read_data_set(folder)
    assert str(folder / 'trials.csv') in str(caught.value)
    assert message in str(caught.value)


def test_no_index_and_no_folder(folder):
    (folder / 'trials.csv').unlink()
    with pytest.raises(DataError, match=r'trials\.csv: no such file'):
        read_data_set(folder)
    with pytest.raises(DataError, match='no such folder'):
        read_data_set(folder / 'nowhere')


def test_a_faulty_trial_is_named(folder):
    path = folder / 'engine_bay_take_2.csv'
    path.write_text(path.read_text().replace('0.005,', '0.005,nan,', 1))
    with pytest.raises(DataError, match=r'engine_bay_take_2\.csv: line 3: 8 values'):
        read_data_set(folder)


@pytest.mark.parametrize('count', [2, 3, 5])
@pytest.mark.parametrize('person', ['partner', 'demonstrator'])
def test_trials_of_different_frames_are_named(count, person, tmp_path):
    trials = synthesize(trials=count, configurations=['under_car'])
    moved = trials[count - 1]
    trials[count - 1] = replace(moved, **{person: getattr(moved, person) + [0.0, 2.5, 0.0]})
    write_data_set(trials, tmp_path)
    with pytest.raises(
        DataError, match=f'under_car_give_{count}.csv: .* do all use the same frame'
    ):
        read_data_set(tmp_path)


def test_two_trials_cannot_have_one_file(tmp_path, trials):
    with pytest.raises(DataError, match='more than one trial'):
        write_data_set([trials[0], trials[0]], tmp_path)
    assert not list(tmp_path.iterdir())


def files(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_what_is_there_is_not_overwritten(folder, trials):
    before = files(folder)
    with pytest.raises(DataError, match=r'trials\.csv: exists already; .* --append'):
        write_data_set(trials, folder)
    with pytest.raises(DataError, match=r'_give_1\.csv: exists already; a trial is never'):
        write_data_set(trials, folder, append=True)
    assert files(folder) == before
    (folder / 'trials.csv').unlink()
    with pytest.raises(DataError, match=r'_give_1\.csv: exists already'):
        write_data_set([replace(trials[0], number=7), *trials], folder)
    assert files(folder).keys() == before.keys() - {'trials.csv'}


def test_appending_leaves_what_others_wrote_as_it_is(tmp_path, trials):
    write_data_set([replace(trials[0], configuration='hall')], tmp_path)
    (tmp_path / 'hall_give_1.csv').rename(tmp_path / 'monday.csv')
    index = (
        b'\xef\xbb\xbftrial, source ,giver_id,configuration,file,exchange\r\n'
        b'1,"vicon, session 7",g12, hall ,monday.csv,give'
    )
    (tmp_path / 'trials.csv').write_bytes(index + b'\r\n\r\n')
    before = files(tmp_path)
    write_data_set([replace(trials[0], source='a, b'), trials[1]], tmp_path, append=True)
    after = files(tmp_path)
    assert after.pop('trials.csv') == index + (
        b'\r\n1,"a, b",,engine_bay,engine_bay_give_1.csv,give'
        b'\r\n2,synthetic (seed 0),,engine_bay,engine_bay_give_2.csv,give\r\n'
    )
    assert before.items() - after.items() == {('trials.csv', before['trials.csv'])}
    labels = [trial.label for trial in read_data_set(tmp_path)]
    assert labels == ['hall give 1', 'engine_bay give 1', 'engine_bay give 2']


@pytest.mark.parametrize('append', [False, True])
def test_what_breaks_off_leaves_nothing(tmp_path, trials, append):
    folder = tmp_path / 'set'
    if append:
        write_data_set([replace(trials[0], configuration='hall')], folder)
    before = files(folder) if append else None
    steps = iter([None])
    with pytest.raises(StopIteration):
        write_data_set(trials, folder, append=append, progress=lambda: next(steps))
    assert (files(folder) if folder.exists() else None) == before


def test_a_place_that_cannot_be_written_to(tmp_path, trials):
    (tmp_path / 'file').write_text('x')
    with pytest.raises(DataError, match='cannot be written'):
        write_data_set(trials, tmp_path / 'file')


@given(st.text(max_size=200))
@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_any_index_is_read_or_a_data_error(folder, text):
    (folder / 'trials.csv').write_text(HEADER + text, encoding='utf-8', errors='replace')
    with pytest.raises(DataError) as caught:
        read_data_set(folder)
    assert '\n' not in str(caught.value)


def test_real_people(kth_folder):
    trials = read_data_set(kth_folder)
    assert len(trials) == 72
    assert {trial.configuration for trial in trials} == {'raw', 'p01', 'p02', 'p03', 'p04'}
