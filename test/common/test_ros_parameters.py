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

"""Merging parameter files: held against what rcl itself makes of them."""

from __future__ import annotations

from handover_dmp.common.ros_parameters import merged, sections, unknown_parameter
import pytest
import yaml

NAMES = {'a', 'b', 'h.x', 'h.y', 'stiffness'}
FILES = {
    'section, then all': {'dmp': {'a': 1}, '/**': {'a': 2, 'b': 3}},
    'all, then section': {'/**': {'a': 2, 'b': 3}, 'dmp': {'a': 1}},
    'with a slash and without': {'/dmp': {'a': 1}, 'dmp': {'a': 2, 'b': 1}},
    'one name': {'/*': {'a': 1}},
    'any names': {'**': {'a': 1}, '/**/dmp': {'b': 2}},
    'in a namespace': {'/lab/dmp': {'a': 1}, 'other/dmp': {'a': 2}, '/*/dmp': {'b': 4}},
    'namespace around': {'/lab': {'dmp': {'ros__parameters': {'a': 1}}}},
    'nested': {'/dmp': {'h.x': 1, 'h': {'y': 2}}},
    'other nodes': {'recorder': {'a': 7}, 'dmp2': {'a': 8}},
}


def text(name):
    tree = {
        key: inner if name == 'namespace around' else {'ros__parameters': inner}
        for key, inner in FILES[name].items()
    }
    return yaml.safe_dump(tree, sort_keys=False)


@pytest.mark.ros
@pytest.mark.parametrize('name', FILES)
@pytest.mark.parametrize('space', ['/', '/lab'])
def test_as_rcl_merges_them(tmp_path, name, space):
    rclpy = pytest.importorskip('rclpy')
    from rclpy.context import Context
    from rclpy.node import Node

    file = tmp_path / 'parameters.yaml'
    file.write_text(text(name))
    context = Context()
    rclpy.init(context=context, args=['--ros-args', '--params-file', str(file)])
    try:
        node = Node('dmp', namespace=space, context=context, enable_rosout=False,
                    automatically_declare_parameters_from_overrides=True)  # fmt: skip
        full = node.get_fully_qualified_name()
        said = {key: node.get_parameter(key).value for key in NAMES if node.has_parameter(key)}
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)
    assert merged(sections(yaml.safe_load(file.read_text())), full) == said


def test_names_that_no_parameter_has():
    assert unknown_parameter(['a', 'use_sim_time', 'qos_overrides./clock.depth'], NAMES) == ''
    fault = unknown_parameter(['stifness'], NAMES)
    assert fault == "there is no parameter 'stifness'; the nearest is 'stiffness'"
    assert unknown_parameter(['publish_frequency'], NAMES).startswith('there is no parameter')
    # Among those of many nodes it may be that of another.
    assert unknown_parameter(['publish_frequency'], NAMES, for_many=True) == ''
    assert "'stiffness'" in unknown_parameter(['stifness'], NAMES, for_many=True)


@pytest.mark.parametrize('tree', [None, 7, [], 'text', {'dmp': None}, {'dmp': {1: 2}}])
def test_what_is_no_parameter_file_has_no_sections(tree):
    assert sections(tree) == []
