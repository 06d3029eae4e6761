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

"""
Files of ROS parameters, merged for one node in the same way as rcl.

The keys of such a file are names of nodes, with namespaces as a prefix or as outer keys, with `*`
for one name and `**` for any number of names. All sections that match a node apply, in the order
of the file: later ones override earlier ones, however exact their keys are.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from difflib import get_close_matches
import re
from typing import Any, NamedTuple

PARAMETERS = 'ros__parameters'
# Parameters of every ROS node.
_OF_EVERY_NODE = ('use_sim_time', 'start_type_description_service')
_OVERRIDES = 'qos_overrides.'
_ALIKE = 0.75


class ParameterSection(NamedTuple):
    """
    A section of a parameter file.

    Attributes:
        node: full name of its nodes, perhaps with wildcards.
        values: parameter name to value; names of nested parameters are joined by dots.

    """

    node: str
    values: dict[str, Any]

    @property
    def is_for_many(self) -> bool:
        """Tell whether it is for nodes of different names."""
        return '*' in self.node.rpartition('/')[2]

    def is_for(self, node: str) -> bool:
        """
        Tell whether this section applies to a node.

        Args:
            node: full name, e.g. `/dmp`.

        Returns:
            Whether its name fits.

        """
        pattern = re.escape(self.node).replace(r'/\*\*', r'(/\w+)*').replace(r'\*', r'\w+')
        return re.fullmatch(pattern, node) is not None


def sections(tree: Any, space: str = '') -> list[ParameterSection]:
    """
    List the sections of a parameter file.

    Args:
        tree: the content of the file.
        space: namespace of all names in it.

    Returns:
        The sections in the order of the file.

    """
    found: list[ParameterSection] = []
    for key, inner in tree.items() if isinstance(tree, dict) else ():
        if not isinstance(inner, dict):
            continue
        name = f'{space}/{str(key).strip("/")}'
        if PARAMETERS in inner:
            found.append(ParameterSection(name, dict(flat(inner[PARAMETERS]))))
        found += sections({k: v for k, v in inner.items() if k != PARAMETERS}, name)
    return found


def merged(found: Collection[ParameterSection], node: str) -> dict[str, Any]:
    """
    Merge the sections of a parameter file for one node.

    Args:
        found: the sections.
        node: full name, e.g. `/dmp`.

    Returns:
        Parameter name to value.

    """
    values: dict[str, Any] = {}
    for section in found:
        if section.is_for(node):
            values |= section.values
    return values


def unknown_parameter(
    names: Collection[str], known: Collection[str], *, for_many: bool = False
) -> str:
    """
    Find a name that no parameter has.

    Args:
        names: names in a file.
        known: names of the existing parameters.
        for_many: whether the names are meant for many nodes, of which others may have them; then
            only a name that is nearly one of ours is a fault.

    Returns:
        The fault, with the nearest parameter; empty if there is none.

    """
    for name in names:
        if name in known or name in _OF_EVERY_NODE or name.startswith(_OVERRIDES):
            continue
        near = get_close_matches(name, known, n=1, cutoff=_ALIKE if for_many else 0.0)
        if near:
            return f'there is no parameter {name!r:.80}; the nearest is {near[0]!r}'
        if not for_many:
            return f'there is no parameter {name!r:.80}'
    return ''


def flat(tree: Any, prefix: str = '') -> Iterator[tuple[str, Any]]:
    """
    List nested parameters.

    Args:
        tree: the parameters, of which some may be tables of others.
        prefix: prefix of their names.

    Yields:
        Name, joined by dots, and value.

    """
    if not isinstance(tree, dict):
        return
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from flat(value, f'{prefix}{key}.')
        else:
            yield f'{prefix}{key}', value
