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

import copy
import json

from handover_dmp.common.errors import DataError
from handover_dmp.dmp import ClassicalDmp, DmpParameters, learn, load_model, save_model
from handover_dmp.dmp.model_file import VERSION
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest


@pytest.fixture(scope='module', params=['rvm', 'ridge', 'classical'])
def model(request, reach):
    if request.param == 'classical':
        return learn(*reach, regression='ridge', basis=20, primitive=ClassicalDmp)
    parameters = DmpParameters(stiffness=1 / 3, mu=0.1 + 0.2, formulation='printed')
    learnt = learn(*reach, parameters, regression=request.param, basis=20, source='träge ✓')
    path = np.linspace([1 / 3, 0.0, 2.0], [0.1, -1e-17, 1 / 7], 7)
    back = learnt.with_duration(1 / 3)
    return (
        learnt.with_goal_offset([0.1, 1 / 7, -1e-17]).with_partner_path(path).with_way_back(back)
    )


@pytest.fixture(scope='module')
def document(reach, tmp_path_factory):
    path = tmp_path_factory.mktemp('models') / 'model.json'
    save_model(learn(*reach, basis=10), path)
    return json.loads(path.read_text())


def bits(model):
    covariance = model.covariance or ()
    return [
        type(model),
        model.parameters,
        model.duration_s,
        model.source,
        *(
            array.tobytes()
            for array in (
                model.start,
                model.start_velocity,
                model.goal,
                model.goal_offset,
                model.weights,
                model.basis.centres,
                model.basis.sharpness,
            )
        ),
        None if model.partner_path is None else model.partner_path.tobytes(),
        *((each.active.tobytes(), each.matrix.tobytes()) for each in covariance),
        model.way_back and bits(model.way_back),
    ]


def test_a_model_is_read_back_to_the_last_bit(model, tmp_path):
    save_model(model, tmp_path / 'model.json')
    again = load_model(tmp_path / 'model.json')
    assert bits(again) == bits(model)
    times = np.linspace(0.0, 2.0, 100)
    goal = model.goal + 0.1
    assert np.array_equal(
        again.rollout(times, goal).positions, model.rollout(times, goal).positions
    )


def test_the_file_names_its_version_and_units(document):
    assert document['version'] == VERSION
    assert document['units']['duration'] == 's'
    assert document['kind'] == 'decoupled'


def test_version_1_is_migrated(document, tmp_path):
    old = copy.deepcopy(document)
    old['version'] = 1
    del old['start_velocity'], old['kind'], old['partner_path'], old['turn']
    (tmp_path / 'old.json').write_text(json.dumps(old))
    model = load_model(tmp_path / 'old.json')
    assert np.array_equal(model.start_velocity, np.zeros(3))
    assert model.weights.tolist() == document['weights']


def test_version_2_is_migrated(document, tmp_path):
    old = {**copy.deepcopy(document), 'version': 2}
    del old['partner_path'], old['turn']
    (tmp_path / 'old.json').write_text(json.dumps(old))
    model = load_model(tmp_path / 'old.json')
    assert model.partner_path is None
    assert model.turn is None
    assert model.weights.tolist() == document['weights']


def test_version_3_is_migrated(document, tmp_path):
    old = {**copy.deepcopy(document), 'version': 3}
    del old['way_back']
    (tmp_path / 'old.json').write_text(json.dumps(old))
    model = load_model(tmp_path / 'old.json')
    assert model.way_back is None
    assert model.weights.tolist() == document['weights']


def test_a_way_back_is_a_movement_and_has_none_itself(document, tmp_path, model):
    path = tmp_path / 'back.json'
    inner = {key: document[key] for key in document if key not in ('format', 'version', 'units')}
    path.write_text(json.dumps({**document, 'way_back': inner}))
    assert load_model(path).way_back.weights.tolist() == document['weights']
    path.write_text(json.dumps({**document, 'way_back': {**inner, 'way_back': inner}}))
    with pytest.raises(DataError, match='way back has a way back'):
        load_model(path)
    twice = model.with_way_back(None).with_way_back(model.with_way_back(None))
    with pytest.raises(DataError, match='way back has a way back'):
        model.with_way_back(twice)


@pytest.mark.parametrize('version', [0, VERSION + 1, '2', None, True, 2.5, [1]])
def test_unknown_versions_are_refused_by_name(document, tmp_path, version):
    (tmp_path / 'new.json').write_text(json.dumps({**document, 'version': version}))
    with pytest.raises(DataError, match='version') as error:
        load_model(tmp_path / 'new.json')
    assert str(version)[:10] in str(error.value)


NAN, INF = float('nan'), float('inf')
SPOILT = {
    'kind': ['dog', None, 3],
    'duration': [0, -1.0, NAN, INF, 1e300, '1', None, True, [1.0], 10**400],
    'start': [[], [NAN, 0, 0], [INF, 0, 0], [0, 0], 'abc', None, {}, [[0, 0, 0]], [0.0] * 200],
    'start_velocity': [[0, 0], None],
    'goal': [[0, 0], [0, 0, None], [0, 0, '0']],
    'goal_offset': [[1e400, 0, 0]],
    'weights': [[], [[0, 0]], [[0, 0, 0]] * 11, [[0, 0, NAN]] * 10, [0] * 10, 'x', None],
    'basis': [None, [], {}, {'centres': [], 'sharpness': []}, {'centres': [0.5] * 10}],
    'parameters': [None, {}, [], {'stiffness': 3}],
    'covariance': [[], [1, 2, 3], {}, 'x', [{'active': [0], 'matrix': [[NAN]]}] * 3],
    'source': [None, 3, ['a']],
    'partner_path': [3, [], [[0, 0, 0]], [[0, 0], [0, 0]], [[0, 0, NAN]] * 5, [0] * 5],
    'way_back': [3, [], {}, 'home', {'kind': 'dog'}],
    'format': [None, 'another'],
}


@pytest.mark.parametrize(
    ('name', 'value'), [(name, value) for name, values in SPOILT.items() for value in values]
)
def test_what_cannot_be_a_model_is_one_clear_line(document, tmp_path, name, value):
    path = tmp_path / 'spoilt.json'
    path.write_text(json.dumps({**document, name: value}))
    with pytest.raises(DataError) as error:
        load_model(path)
    assert str(error.value).startswith(str(path))
    assert '\n' not in str(error.value)
    assert len(str(error.value)) < 400


@pytest.mark.parametrize(
    ('part', 'name', 'value'),
    [
        ('parameters', 'stiffness', -1.0),
        ('parameters', 'sigma', 0.0),
        ('parameters', 'formulation', 'soft'),
        ('parameters', 'colour', 1.0),
        ('basis', 'sharpness', [0.0] * 10),
        ('basis', 'sharpness', [1e308] * 10),
        ('basis', 'centres', [1e200] * 10),
        ('basis', 'centres', [0.5] * 20_000),
    ],
)
def test_spoilt_parts_are_one_clear_line(document, tmp_path, part, name, value):
    path = tmp_path / 'spoilt.json'
    path.write_text(json.dumps({**document, part: {**document[part], name: value}}))
    with pytest.raises(DataError):
        load_model(path)


@pytest.mark.parametrize('name', ['start', 'weights', 'parameters', 'basis', 'source', 'goal'])
def test_what_is_missing_is_named(document, tmp_path, name):
    left = {key: value for key, value in document.items() if key != name}
    (tmp_path / 'part.json').write_text(json.dumps(left))
    with pytest.raises(DataError, match=f'{name} is missing'):
        load_model(tmp_path / 'part.json')


@pytest.mark.parametrize(
    'content',
    [
        b'',
        b'{',
        b'[]',
        b'null',
        b'\xff\xfe\x00',
        b'[' * 100_000,
        b'{"a": 1' + b'1' * 100_000 + b'}',
    ],
)
def test_what_is_no_json_is_one_clear_line(tmp_path, content):
    (tmp_path / 'junk.json').write_bytes(content)
    with pytest.raises(DataError, match=r'junk\.json') as error:
        load_model(tmp_path / 'junk.json')
    assert '\n' not in str(error.value)


def test_a_missing_file_is_one_clear_line(tmp_path):
    with pytest.raises(DataError, match='No such file'):
        load_model(tmp_path / 'none.json')


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=8,
)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_whatever_stands_in_the_file_it_loads_or_is_a_data_error(document, tmp_path_factory, data):
    name = data.draw(st.sampled_from(sorted(document)))
    spoilt = {**document, name: data.draw(ANYTHING)}
    path = tmp_path_factory.getbasetemp() / 'fuzz.json'
    path.write_text(json.dumps(spoilt))
    try:
        loaded = load_model(path)
    except DataError:
        return
    rollout = loaded.rollout(np.linspace(0.0, 1.0, 20), loaded.goal)
    assert np.isfinite(rollout.positions).all()
