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

"""YAML of plain values from untrusted files: no code, no aliases."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from handover_dmp.common.errors import DataError
import yaml

# Errors of the library's constructors for tags and numbers that do not fit their text.
MISFIT = (
    yaml.YAMLError, RecursionError, ValueError, OverflowError, LookupError, AttributeError,
    TypeError,
)  # fmt: skip
# libyaml takes a tenth of the time; it comes with the wheels of PyYAML, not with every build
_Loader = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
MAX_DEPTH = 100


def load_plain(text: str) -> Any:
    """
    Read YAML of plain values, without aliases, since these can expand a small text hugely.

    Args:
        text: the YAML text, nested at most 100 deep.

    Returns:
        The values.

    Raises:
        DataError: the text is not YAML, or has aliases.

    """
    try:
        _check_events(text)
        return yaml.load(text, Loader=_Loader)
    except MISFIT as error:
        reason = ' '.join(str(error).split())[:200] or type(error).__name__
        raise DataError(f'not proper YAML: {reason}') from error


def read_plain(path: Path, largest_bytes: int) -> Any:
    """
    Read a file with YAML of plain values.

    Args:
        path: the file.
        largest_bytes: size from which on it is not read.

    Returns:
        The values.

    Raises:
        DataError: the file cannot be read, is too large, or is not YAML without aliases.

    """
    try:
        if path.stat().st_size > largest_bytes:
            raise DataError(f'larger than {largest_bytes // 1000} kB')
        return load_plain(path.read_text(encoding='utf-8'))
    except OSError as error:
        raise DataError(f'{path}: cannot be read: {error.strerror}') from error
    except UnicodeDecodeError as error:
        raise DataError(f'{path}: cannot be read: not UTF-8: {error.reason}') from error
    except DataError as error:
        raise DataError(f'{path}: {error}') from error


def dump_plain(tree: Any) -> str:
    """
    Write YAML of plain values, without aliases, which the parser of ROS 2 does not know.

    Args:
        tree: values to write; the order of keys is kept.

    Returns:
        The text.

    """
    return str(yaml.dump(tree, Dumper=_PlainDumper, sort_keys=False))


class _PlainDumper(yaml.SafeDumper):
    """Writes repeated values in full."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _check_events(text: str) -> None:
    depth = 0
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.AliasEvent):
            raise yaml.YAMLError('aliases are not supported')
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > MAX_DEPTH:
            raise yaml.YAMLError(f'nested more than {MAX_DEPTH} deep')
