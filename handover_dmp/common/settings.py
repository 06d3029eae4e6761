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

"""Defaults of all parameters and settings, which are defined once, in `config/`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cache, partial
from typing import Any

from handover_dmp.common.errors import HandoverError
from handover_dmp.common.plain_yaml import load_plain
from handover_dmp.common.resources import share_path
from handover_dmp.common.ros_parameters import flat

ANYWHERE = '/**/'
"""Prefix of the name of a node in a parameter file: any namespace."""


@cache
def defaults(node: str) -> dict[str, Any]:
    """
    Read the parameters of one node from `config/handover.yaml`, with those of every node.

    Args:
        node: name of the node, e.g. `dmp`.

    Returns:
        Parameter name to value; names of nested parameters are joined by dots, as in ROS 2.

    """
    tree = _table()
    of_all, own = (tree[section]['ros__parameters'] for section in ('/**', ANYWHERE + node))
    return {**dict(flat(of_all)), **dict(flat(own))}


@cache
def node_names() -> tuple[str, ...]:
    """Return the names of all nodes that have parameters in `config/handover.yaml`."""
    return tuple(name.removeprefix(ANYWHERE) for name in _table() if name != '/**')


@cache
def _table() -> Any:
    return load_plain(share_path('config/handover.yaml').read_text(encoding='utf-8'))


@dataclass(frozen=True)
class Setting:
    """
    Description and range of a parameter or setting.

    Attributes:
        name: name of the node's parameter, nested ones joined by dots.
        description: meaning, with its unit.
        low: smallest number.
        high: greatest number.
        choices: permitted words.
        read_only: whether it is fixed once the node runs.

    """

    name: str
    description: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    read_only: bool = False

    def fault(self, value: Any) -> str:
        """
        Return the fault of a value.

        Args:
            value: the value.

        Returns:
            The fault, to follow the name; empty if there is none.

        """
        if self.choices and value not in self.choices:
            return f'is {_shown(value)}, not one of {", ".join(self.choices)}'
        if self.low is None or self.high is None:
            return ''
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            return f'is not a number: {_shown(value)}'
        if not self.low <= number <= self.high:
            return f'is {number:g}; it must be from {self.low:g} to {self.high:g}'
        return ''


def setting(
    node: str,
    name: str,
    description: str,
    low: float | None = None,
    high: float | None = None,
    *,
    choices: tuple[str, ...] = (),
    read_only: bool = False,
) -> Any:
    """
    Make a dataclass field whose default is a parameter of `config/handover.yaml`.

    The parameter is defined by this field and that file. The declarations of the nodes, the
    options of the commands and docs/parameters.md are made from them.

    Args:
        node: name of the node.
        name: name of its parameter, nested ones joined by dots.
        description: meaning, with its unit.
        low: smallest number.
        high: greatest number.
        choices: permitted words.
        read_only: whether it is fixed once the node runs.

    Returns:
        The dataclass field.

    """
    what = Setting(name, description, low, high, choices, read_only)
    return field(default_factory=lambda: defaults(node)[name], metadata={'setting': what})


dmp_setting = partial(setting, 'dmp')


def settings_of(kind: type[Any]) -> dict[str, Setting]:
    """
    List the fields of a dataclass that were made by `setting`.

    Args:
        kind: the dataclass.

    Returns:
        Field name to setting.

    """
    return {one.name: one.metadata['setting'] for one in fields(kind) if 'setting' in one.metadata}


def check_settings(owner: Any, error: type[HandoverError], prefix: str = '') -> None:
    """
    Refuse values that are out of range or not one of the choices.

    Args:
        owner: a dataclass with fields made by `setting`.
        error: error to raise.
        prefix: prefix of the name of the field.

    Raises:
        HandoverError: an `error` that names the field and its range.

    """
    for name, what in settings_of(type(owner)).items():
        if fault := what.fault(getattr(owner, name)):
            raise error(f'{prefix}{name} {fault}')


def parameters_of(kind: type[Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """
    Select the values of a dataclass with fields made by `setting`.

    Args:
        kind: the dataclass.
        values: parameter name to value, of this dataclass and of others.

    Returns:
        Field name to value, for those given.

    """
    names = {name: what.name for name, what in settings_of(kind).items()}
    return {field: values[name] for field, name in names.items() if name in values}


def _shown(value: object) -> str:
    """Quote a text; only name the type of other values, which may be too large to show."""
    return repr(value)[:40] if isinstance(value, str) else f'of type {type(value).__name__}'
