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

"""The defaults of everything that a user may want to change; they stand once, in `config/`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, fields
from functools import cache
from typing import Any

from handover_dmp.common.resources import share_path
import yaml

ANYWHERE = '/**/'
"""Before the name of a node, in a parameter file: whatever namespace it is in."""


@cache
def defaults(node: str) -> dict[str, Any]:
    """
    Read the parameters of one node from `config/handover.yaml`, with those of every node.

    Args:
        node: name of the node, e.g. `dmp`.

    Returns:
        Parameter name to value; names of nested parameters are joined by dots, as ROS 2 does.

    """
    tree = yaml.safe_load(share_path('config/handover.yaml').read_text(encoding='utf-8'))
    of_all, own = (tree[section]['ros__parameters'] for section in ('/**', ANYWHERE + node))
    return dict(_flatten(of_all) + _flatten(own))


@cache
def node_names() -> tuple[str, ...]:
    """Return the names of all nodes that have parameters in `config/handover.yaml`."""
    tree = yaml.safe_load(share_path('config/handover.yaml').read_text(encoding='utf-8'))
    return tuple(name.removeprefix(ANYWHERE) for name in tree if name != '/**')


def setting(node: str, name: str) -> Any:
    """
    Make a dataclass field whose default is a parameter of `config/handover.yaml`.

    Args:
        node: name of the node.
        name: name of its parameter, nested ones joined by dots.

    Returns:
        The dataclass field.

    """
    return field(default_factory=lambda: defaults(node)[name], metadata={'parameter': name})


def parameters_of(kind: type[Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """
    Choose the values that belong to a dataclass with fields made by `setting`.

    Args:
        kind: the dataclass.
        values: parameter name to value, of this dataclass and of others.

    Returns:
        Field name to value, for those that are given.

    """
    names = {one.name: str(one.metadata.get('parameter')) for one in fields(kind)}
    return {field: values[name] for field, name in names.items() if name in values}


def _flatten(tree: dict[str, Any], prefix: str = '') -> list[tuple[str, Any]]:
    pairs: list[tuple[str, Any]] = []
    for key, value in tree.items():
        if isinstance(value, dict):
            pairs += _flatten(value, f'{prefix}{key}.')
        else:
            pairs.append((prefix + key, value))
    return pairs
