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

"""Options that verbs declare alike: settings with a default, output, JSON."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import json
from pathlib import Path
from typing import Any

from handover_dmp.common.files import write_text


def add_setting(
    parser: argparse._ActionsContainer,
    name: str,
    default: float | str,
    metavar: str | None,
    purpose: str,
    choices: Sequence[str] | None = None,
) -> None:
    """
    Declare an option with a default, which its help names; the type is that of the default.

    Args:
        parser: parser of a verb, or a group of it.
        name: the option, e.g. `--rate`.
        default: its default.
        metavar: its metavar, e.g. the unit; None: the name of the option.
        purpose: help text, without the default.
        choices: its values, if there are only some.

    """
    parser.add_argument(
        name,
        type=type(default),
        default=default,
        metavar=metavar,
        help=f'{purpose} (default: %(default)s)',
        choices=choices,
    )


def add_output(
    parser: argparse.ArgumentParser, metavar: str, purpose: str, default: Path | None = None
) -> None:
    """
    Declare `--output`, which is required if it has no default, else its help names it.

    Args:
        parser: parser of a verb.
        metavar: metavar of the output, e.g. `DIR`.
        purpose: help text, without the default.
        default: file or folder to write.

    """
    parser.add_argument(
        '-o',
        '--output',
        type=Path,
        required=default is None,
        default=default,
        metavar=metavar,
        help=purpose if default is None else f'{purpose} (default: %(default)s)',
    )


def add_json(parser: argparse.ArgumentParser, purpose: str) -> None:
    """
    Declare `--json`.

    Args:
        parser: parser of a verb.
        purpose: help text.

    """
    parser.add_argument('--json', type=Path, metavar='FILE', help=purpose)


def save_json(content: Any, path: Path | None, indent: int | None = 2) -> None:
    """
    Write a result as JSON, if requested.

    Args:
        content: plain types.
        path: the file of `--json`; None: none.
        indent: of each level; None: all in one line.

    """
    if path is not None:
        write_text(path, json.dumps(content, indent=indent) + '\n')
