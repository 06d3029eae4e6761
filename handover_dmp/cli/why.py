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

"""`handover_dmp why`: which curves of an evaluation were rejected, when, and by how much."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from handover_dmp.cli.options import add_json, save_json
from handover_dmp.common.errors import DataError, UsageError

TABLE = 'table.json'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of `why`.

    Args:
        parser: parser of the verb.

    """
    parser.add_argument(
        'results', type=Path, metavar='RESULTS', help=f'folder of `evaluate`, or its {TABLE}'
    )
    parser.add_argument(
        '--learn',
        metavar='NAME',
        help='kind of demonstration that was learnt from (default: all that were evaluated)',
    )
    add_json(parser, 'write every rejected curve as JSON')


def run(options: argparse.Namespace) -> int:
    """
    Print why curves were rejected.

    Args:
        options: the parsed arguments.

    Returns:
        0.

    Raises:
        DataError: there is no table, or it has no rejections.
        UsageError: the evaluation has no such `--learn`.

    """
    rejections = _read(options.results)
    learns = list(dict.fromkeys(case['learn'] for case in rejections))
    if options.learn is not None and options.learn not in learns:
        raise UsageError(
            f'--learn {options.learn!r}: not in {options.results}, which has {", ".join(learns)}'
        )
    from handover_dmp.evaluation.why import why_tables
    from rich.console import Console

    chosen = learns if options.learn is None else [options.learn]
    told = [case for case in rejections if case['learn'] in chosen]
    save_json(told, options.json, indent=1)
    console = Console()
    for table in why_tables(rejections, chosen):
        table.show(console)
    return 0


def _read(results: Path) -> list[dict[str, Any]]:
    file = results / TABLE if results.is_dir() else results
    try:
        table = json.loads(file.read_text(encoding='utf-8'))
    except FileNotFoundError:
        raise DataError(f'{file}: no such file; run `evaluate` to write it') from None
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise DataError(f'{file}: not a table of `evaluate`: {error}') from None
    found = table.get('rejections') if isinstance(table, dict) else None
    if not found:
        raise DataError(f'{file}: has no rejections; run `evaluate` again')
    rejections: list[dict[str, Any]] = found
    return rejections
