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

"""Write the table of docs/trackers.md: two trackers with realistic faults, alone and together."""

from __future__ import annotations

import argparse
from pathlib import Path
import re
import sys

from handover_dmp.bench.trackers import compare_trackers, Errors, TRACKER_CASES

FILE = Path(__file__).resolve().parents[1] / 'docs' / 'trackers.md'
BEGIN, END = '<!-- generated: trackers -->\n', '<!-- end -->'
SEEDS = 20


def main() -> int:
    """Run every case and write the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seeds', type=int, default=SEEDS, help='runs of each case')
    seeds = range(parser.parse_args().seeds)
    lines = ['| case | mocap alone | camera alone | both |', '| --- | --- | --- | --- |']
    for case in TRACKER_CASES:
        row = compare_trackers(case, seeds)
        cells = (case.name, *map(shown, (row.mocap, row.camera, row.fused)))
        lines.append(f'| {" | ".join(cells)} |')
        print(lines[-1], flush=True)
    text = FILE.read_text(encoding='utf-8')
    table = BEGIN + '\n'.join(lines) + '\n' + END
    new, count = re.subn(re.escape(BEGIN) + '.*?' + re.escape(END), table, text, flags=re.DOTALL)
    if count != 1:
        raise SystemExit(f'{FILE}: {BEGIN.strip()} is not there once')
    FILE.write_text(new, encoding='utf-8')
    return 0


def shown(errors: Errors) -> str:
    """Format the errors of a cell."""
    if errors.position_m == float('inf'):
        return 'no hand'
    return f'{1e3 * errors.position_m:.1f} mm, {1e3 * errors.velocity:.0f} mm/s'


if __name__ == '__main__':
    sys.exit(main())
