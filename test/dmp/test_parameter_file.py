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

"""The parameter file: what is written is read, and faults are named."""

from __future__ import annotations

from pathlib import Path

from handover_dmp.common.errors import DataError
from handover_dmp.dmp import DmpParameters
from handover_dmp.dmp.parameter_file import read_parameters, TunedParameters, write_parameters
import pytest
import yaml


def test_what_is_written_is_read(tmp_path):
    path = tmp_path / 'tuned.yaml'
    parameters = TunedParameters(DmpParameters(stiffness=123.456789, mu=0.6), 0.97)
    write_parameters(parameters, path, 'where it comes from\nand more')
    assert read_parameters(path) == parameters
    assert path.read_text().startswith('# where it comes from\n# and more\n/**/dmp:\n')


def test_it_is_a_parameter_file_of_ros(tmp_path):
    path = tmp_path / 'tuned.yaml'
    write_parameters(TunedParameters(), path)
    section = yaml.safe_load(path.read_text())['/**/dmp']['ros__parameters']
    assert all(isinstance(value, (float, str)) for value in section.values())


def test_the_defaults_of_the_package_can_be_read():
    share = Path(__file__).resolve().parents[2] / 'config' / 'handover.yaml'
    assert read_parameters(share) == TunedParameters()


@pytest.mark.parametrize(
    ('text', 'word'),
    [
        ('dmp: {ros__parameters: {stiffness: -3}}', 'stiffness'),
        ('dmp: {ros__parameters: {mu: wide}}', 'mu'),
        ('dmp: {ros__parameters: {duration_scale: 0}}', 'duration_scale'),
        ('dmp: {ros__parameters: {duration_scale: fast}}', 'duration_scale'),
        ('robot_sim: {ros__parameters: {}}', 'no section dmp'),
        ('dmp: 7', 'no section dmp'),
        ('', 'no section dmp'),
        ('a: [1', 'not proper YAML'),
        ('[' * 5000, 'not proper YAML'),
        ('dmp: {ros__parameters: {mu: 1' + '0' * 400 + '}}', 'mu'),
        ('dmp: {ros__parameters: {mu: 1' + '0' * 5000 + '}}', 'not proper YAML'),
        ('dmp: {ros__parameters: {duration_scale: 1' + '0' * 400 + '}}', 'int too large'),
        ('dmp: {ros__parameters: {duration_scale: -0x1' + '0' * 5000 + '}}', 'duration_scale'),
        ('dmp: {ros__parameters: {formulation: 0x1' + '0' * 5000 + '}}', 'formulation'),
        ('a: &a [1]\nb: *a', 'aliases'),
        ('a: !!bool maybe', 'not proper YAML'),
        ('a: !!timestamp now', 'not proper YAML'),
        ('a: 2001-99-99', 'not proper YAML'),
        ('a: !!python/object/apply:os.getcwd []', 'not proper YAML'),
        ('a: 1\n' * 50_000, 'larger than'),
    ],
)
def test_faults_are_named(tmp_path, text, word):
    path = tmp_path / 'faulty.yaml'
    path.write_text(text)
    with pytest.raises(DataError, match=word) as caught:
        read_parameters(path)
    assert 'faulty.yaml' in str(caught.value)
    assert '\n' not in str(caught.value)
    with pytest.raises(DataError, match='cannot be read'):
        read_parameters(tmp_path / 'missing.yaml')


def written(folder, text):
    path = folder / 'parameters.yaml'
    path.write_text(text)
    return path


def test_sections_are_merged_for_the_node(tmp_path):
    text = '/**:\n  ros__parameters: {stiffness: 150.0, robot: lwr4}\n'
    text += '/lab/dmp:\n  ros__parameters: {mu: 0.7, use_sim_time: true}\n'
    found = read_parameters(written(tmp_path, text)).primitive
    assert (found.stiffness, found.mu) == (150.0, 0.7)


@pytest.mark.parametrize(
    ('text', 'fault'),
    [
        ('dmp:\n  ros__parameters: {stifness: 1.0}\n', "'stifness'; the nearest is 'stiffness'"),
        ('/**:\n  ros__parameters: {stifness: 1.0}\n', "'stifness'; the nearest is 'stiffness'"),
        (
            '/a/dmp:\n  ros__parameters: {}\n/b/dmp:\n  ros__parameters: {}\n',
            'sections for several nodes, /a/dmp, /b/dmp',
        ),
        ('recorder:\n  ros__parameters: {mu: 0.7}\n', 'no section dmp'),
    ],
)
def test_files_that_mean_something_else(tmp_path, text, fault):
    with pytest.raises(DataError, match=fault):
        read_parameters(written(tmp_path, text))
