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

"""The files that come with the package are found, and its defaults read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from handover_dmp.common.resources import share_path
from handover_dmp.common.settings import defaults, setting
import pytest


def test_a_file_that_comes_with_the_package() -> None:
    assert share_path('config/handover.yaml').is_absolute()
    assert share_path('package.xml').read_text(encoding='utf-8').startswith('<?xml')


def test_a_file_that_does_not() -> None:
    with pytest.raises(FileNotFoundError, match=r'config/other\.yaml'):
        share_path('config/other.yaml')


def test_every_node_has_a_section_of_defaults() -> None:
    for node in ('robot_sim', 'hand_tracker', 'dmp', 'priority_ik', 'recorder'):
        assert defaults(node)


def test_names_of_nested_parameters_are_joined_by_dots() -> None:
    assert not any(isinstance(value, dict) for value in defaults('robot_sim').values())


def test_a_setting_is_the_default_of_a_dataclass_field() -> None:
    @dataclass(frozen=True)
    class Options:
        stiffness: Any = setting('dmp', 'stiffness', 'a stiffness, N/m')

    assert Options().stiffness == defaults('dmp')['stiffness']
    assert Options(stiffness=1.0).stiffness == 1.0
