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

"""The command starts at once: what is heavy is imported by the verb that uses it, as it runs."""

from __future__ import annotations

import json
import subprocess
import sys

from handover_dmp.cli.main import VERBS
import pytest

HEAVY = (
    'joblib',
    'matplotlib',
    'mcap',
    'numpy',
    'pinocchio',
    'pybullet',
    'rclpy',
    'rich',
    'ruckig',
    'scipy',
    'sklearn',
)
PROGRAM = """
import json, sys
from handover_dmp.cli.main import main
try:
    main(json.loads(sys.argv[1]))
except SystemExit:
    pass
print(json.dumps(sorted(sys.modules)), file=sys.stderr)
"""


def modules_after(*words: str) -> set[str]:
    """Return the top-level modules that a run of the command has imported."""
    result = subprocess.run(
        [sys.executable, '-c', PROGRAM, json.dumps(words)],
        capture_output=True,
        text=True,
        check=True,
    )
    return {name.partition('.')[0] for name in json.loads(result.stderr.splitlines()[-1])}


@pytest.mark.parametrize(
    'words', [['--help'], ['--version'], *([verb, '--help'] for verb in VERBS)]
)
def test_help_imports_nothing_heavy(words: list[str]) -> None:
    assert not modules_after(*words) & set(HEAVY)


@pytest.mark.ros
@pytest.mark.parametrize(
    ('node', 'spared'),
    [
        ('dmp', {'coal', 'daqp', 'pinocchio', 'pybullet', 'ruckig', 'scipy'}),
        ('hand_tracker', {'coal', 'daqp', 'pinocchio', 'pybullet', 'ruckig', 'scipy'}),
        ('recorder', {'daqp', 'pybullet', 'scipy'}),
        ('priority_ik', {'pybullet', 'scipy'}),
        ('robot_sim', {'daqp', 'scipy'}),
    ],
)
def test_a_node_starts_without_what_others_need(node: str, spared: set[str]) -> None:
    """What a node imports and does not use makes five nodes start twice as late."""
    program = f'import handover_dmp.nodes.{node}, sys; print(*sys.modules)'
    loaded = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {name.partition('.')[0] for name in loaded} & spared


def test_the_check_can_see_a_heavy_import() -> None:
    assert 'rich' in modules_after('bench', 'compare', '/nowhere.json', '/nowhere.json')
