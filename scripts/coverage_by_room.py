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

"""Prints the test coverage of each room, from the JSON file of `coverage`."""

from __future__ import annotations

from collections import Counter
import json
from pathlib import Path
import sys

WANTED = 85.0


def shares(report: dict[str, dict[str, dict[str, dict[str, int]]]]) -> dict[str, float]:
    """
    Sum up the coverage by room.

    Args:
        report: report of `coverage json`.

    Returns:
        Room or single module to the covered share of its statements, %.

    """
    run, all_of_them = Counter[str](), Counter[str]()
    for file, entry in report['files'].items():
        room = Path(file).parts[1].removesuffix('.py')
        run[room] += entry['summary']['covered_lines']
        all_of_them[room] += entry['summary']['num_statements']
    return {
        room: 100.0 * run[room] / count for room, count in sorted(all_of_them.items()) if count
    }


if __name__ == '__main__':
    found = shares(json.loads(Path(sys.argv[1]).read_text(encoding='utf-8')))
    for room, share in found.items():
        print(f'{room:12} {share:5.1f} %' + ('' if share >= WANTED else f'  below {WANTED:.0f} %'))
    sys.exit(min(found.values()) < WANTED)
