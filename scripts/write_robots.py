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
Write the results of docs/robots.md for the arms of two public packages; takes minutes.

The arms are those of example-robot-data and of PyBullet's pybullet_data, found by their joints,
and small ones that each have one peculiarity in their description.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
import sys
from tempfile import TemporaryDirectory

from handover_dmp.bench.odd_arms import odd_arm, ODD_ARMS
from handover_dmp.bench.report import machine
from handover_dmp.bench.zoo import zoo, ZooArm
from handover_dmp.bench.zoo_outcome import examine, ZooOutcome
from handover_dmp.common.threads import use_one_thread
from write_docs import filled, ROOT, table

ARM_HEAD = (
    'arm', 'joints', 'reach, m', 'self-check', 'IK, µs', 'limits used, %', 'size', 'gap, mm',
    'options needed; remarks',
)  # fmt: skip
ODD_HEAD = ('peculiarity', 'limits used, %', 'gap, mm', 'remarks')
MOST_CHARACTERS = 260


def main() -> int:
    """Try all arms and write the results."""
    use_one_thread()
    arms = [_row(_examined(arm)) for arm in zoo()]
    with TemporaryDirectory() as folder:
        odd = [_odd_row(_examined(odd_arm(name, Path(folder))), folder) for name in ODD_ARMS]
    told = machine()
    versions = ', '.join(
        f'{name} {told["versions"][name]}' for name in ('pin', 'pybullet', 'daqp')
    )
    where = (
        f'\n{told["processor"]}, {told["cores"]} cores, load {told["load"]:.1f} at the end; '
        f'Python {told["python"]}; {versions}; {told["date"][:10]}.\n'
    )
    parts = {'arms': table(ARM_HEAD, arms) + where, 'odd arms': table(ODD_HEAD, odd)}
    document = ROOT / 'docs' / 'robots.md'
    document.write_text(filled(document.read_text(encoding='utf-8'), parts), encoding='utf-8')
    return 0


def _examined(arm: ZooArm) -> ZooOutcome:
    outcome = examine(arm)
    print(outcome.arm.name, outcome.fault or 'handed over', file=sys.stderr)
    return outcome


def _row(outcome: ZooOutcome) -> Sequence[str]:
    name = outcome.arm.name.removesuffix('.urdf').replace('_description', '')
    frames = f'`--wrist-frame {outcome.arm.wrist_frame}`'
    if outcome.arm.base_frame:
        frames += f' `--base-frame {outcome.arm.base_frame}`'
    said = [frames] if outcome.needs else []
    said += [_short(remark) for remark in [outcome.fault, *outcome.remarks] if remark]
    return (
        f'`{name}`', str(outcome.joints), f'{outcome.reach_m:.2f}',
        '✓' if outcome.shares else '✗', f'{outcome.ik_us:.0f}', _limits(outcome),
        f'{outcome.scale:.2f}' if outcome.scale else '–', _gap(outcome), '; '.join(said),
    )  # fmt: skip


def _odd_row(outcome: ZooOutcome, folder: str) -> Sequence[str]:
    said = outcome.fault or '; '.join([outcome.needs, *outcome.remarks]).strip('; ')
    return outcome.arm.name, _limits(outcome), _gap(outcome), said.replace(f'{folder}/', '')


def _limits(outcome: ZooOutcome) -> str:
    """Return the used shares of position, velocity and acceleration limits."""
    if outcome.shares is None:
        return '–'
    return ' / '.join(f'{100.0 * share:.0f}' for share in outcome.shares.values())


def _gap(outcome: ZooOutcome) -> str:
    return '–' if outcome.gap_m is None else f'{1e3 * outcome.gap_m:.0f}'


def _short(text: str) -> str:
    return text if len(text) <= MOST_CHARACTERS else f'{text[:MOST_CHARACTERS]} …'


if __name__ == '__main__':
    sys.exit(main())
