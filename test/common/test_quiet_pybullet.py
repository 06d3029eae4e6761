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

"""PyBullet's chatter is kept off the terminal, and nothing else is."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys

from handover_dmp.common.quiet_pybullet import silenced
import pytest


def test_own_output_comes_through_around_a_silenced_block(capfd):
    print('before', flush=True)
    with silenced():
        subprocess.run(['sh', '-c', 'echo from C; echo from C >&2'], check=True)
    print('after', flush=True)
    assert capfd.readouterr() == ('before\nafter\n', '')


def test_descriptors_come_back_after_an_error(capfd):
    with pytest.raises(RuntimeError), silenced():
        raise RuntimeError
    print('after', flush=True)
    assert capfd.readouterr().out == 'after\n'


def test_opens_no_descriptors_for_good():
    before = len(list(Path('/proc/self/fd').iterdir()))
    for _ in range(50):
        with silenced():
            pass
    assert len(list(Path('/proc/self/fd').iterdir())) == before


def test_works_in_a_process_without_a_terminal():
    """A daemon has closed its outputs."""
    script = (
        'import os, sys\n'
        'os.close(1)\n'
        'os.close(2)\n'
        'from handover_dmp.common.quiet_pybullet import pybullet\n'
        'sys.exit(7 if pybullet.connect(pybullet.DIRECT) == 0 else 1)\n'
    )
    assert subprocess.run([sys.executable, '-c', script], timeout=60).returncode == 7
