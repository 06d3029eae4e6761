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
from dataclasses import dataclass, field, fields
from functools import cache
from typing import Any

from handover_dmp.common.errors import HandoverError
from handover_dmp.common.plain_yaml import load_plain
from handover_dmp.common.resources import share_path

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
    tree = _table()
    of_all, own = (tree[section]['ros__parameters'] for section in ('/**', ANYWHERE + node))
    return dict(_flatten(of_all) + _flatten(own))


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
    What stands beside the default of a number or word that a user may change.

    Attributes:
        name: of the node's parameter, nested ones joined by dots.
        description: what it sets, with its unit.
        low: least value, of numbers.
        high: greatest value, of numbers.
        choices: the words it may be, of strings.
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
        Tell what is wrong with a value.

        Args:
            value: as given.

        Returns:
            What is wrong, after the name; empty if nothing is.

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

    This and that file are where the parameter stands; what the node declares, the options of the
    command and docs/parameters.md are made of them.

    Args:
        node: name of the node.
        name: name of its parameter, nested ones joined by dots.
        description: what it sets, with its unit.
        low: least value, of numbers.
        high: greatest value, of numbers.
        choices: the words it may be, of strings.
        read_only: whether it is fixed once the node runs.

    Returns:
        The dataclass field.

    """
    what = Setting(name, description, low, high, choices, read_only)
    return field(default_factory=lambda: defaults(node)[name], metadata={'setting': what})


def settings_of(kind: type[Any]) -> dict[str, Setting]:
    """
    List what a dataclass has of fields made by `setting`.

    Args:
        kind: the dataclass.

    Returns:
        Field name to setting.

    """
    return {one.name: one.metadata['setting'] for one in fields(kind) if 'setting' in one.metadata}


def check_settings(owner: Any, error: type[HandoverError], prefix: str = '') -> None:
    """
    Refuse values that are out of range, or no choice.

    Args:
        owner: a dataclass with fields made by `setting`.
        error: what to raise.
        prefix: before the name of the field.

    Raises:
        HandoverError: as asked for, naming the field and its range.

    """
    for name, what in settings_of(type(owner)).items():
        if fault := what.fault(getattr(owner, name)):
            raise error(f'{prefix}{name} {fault}')


def parameters_of(kind: type[Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """
    Choose the values that belong to a dataclass with fields made by `setting`.

    Args:
        kind: the dataclass.
        values: parameter name to value, of this dataclass and of others.

    Returns:
        Field name to value, for those that are given.

    """
    names = {name: what.name for name, what in settings_of(kind).items()}
    return {field: values[name] for field, name in names.items() if name in values}


def _shown(value: object) -> str:
    """Quote a text; whatever else a file holds may be too large to be shown."""
    return repr(value)[:40] if isinstance(value, str) else f'of type {type(value).__name__}'


def _flatten(tree: dict[str, Any], prefix: str = '') -> list[tuple[str, Any]]:
    pairs: list[tuple[str, Any]] = []
    for key, value in tree.items():
        if isinstance(value, dict):
            pairs += _flatten(value, f'{prefix}{key}.')
        else:
            pairs.append((prefix + key, value))
    return pairs
