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

"""YAML of plain values from anywhere: nothing in it runs, and nothing in it unfolds."""

from __future__ import annotations

from typing import Any

from handover_dmp.common.errors import DataError
import yaml

# What the constructors of the library raise at tags and numbers that do not fit their text.
MISFIT = (
    yaml.YAMLError, RecursionError, ValueError, OverflowError, LookupError, AttributeError,
    TypeError,
)  # fmt: skip
# libyaml takes a tenth of the time; it comes with the wheels of PyYAML, not with every build
_Loader = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
MAX_DEPTH = 100


def load_plain(text: str) -> Any:
    """
    Read YAML of plain values, without aliases, of which a small text can unfold into a huge one.

    Args:
        text: the YAML text, nested at most 100 deep.

    Returns:
        What it says.

    Raises:
        DataError: not YAML, or with aliases.

    """
    try:
        _check_events(text)
        return yaml.load(text, Loader=_Loader)
    except MISFIT as error:
        reason = ' '.join(str(error).split())[:200] or type(error).__name__
        raise DataError(f'not proper YAML: {reason}') from error


def dump_plain(tree: Any) -> str:
    """
    Write YAML of plain values, without aliases: the parser of ROS 2 and others know none.

    Args:
        tree: what to write; the order of its keys is kept.

    Returns:
        The text.

    """
    return str(yaml.dump(tree, Dumper=_PlainDumper, sort_keys=False))


class _PlainDumper(yaml.SafeDumper):
    """Writes what stands twice twice."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _check_events(text: str) -> None:
    depth = 0
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.AliasEvent):
            raise yaml.YAMLError('aliases are not understood')
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > MAX_DEPTH:
            raise yaml.YAMLError(f'nested more than {MAX_DEPTH} deep')
