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

"""Start time of the command: heavy libraries must be loaded only when they are used."""

from __future__ import annotations

from collections.abc import Callable
from statistics import median
import subprocess
import sys
from time import perf_counter

from handover_dmp.bench.measurement import Measurement

ROUNDS = 15


def run(progress: Callable[[str], None]) -> list[Measurement]:
    """
    Measure `handover_dmp --help`, compared with an empty Python program.

    Args:
        progress: called with the name of each measurement.

    Returns:
        One figure, in seconds.

    """
    progress('start of the command')
    commands = {'help': ['-m', 'handover_dmp', '--help'], 'python': ['-c', 'pass']}
    times: dict[str, list[float]] = {name: [] for name in commands}
    # In turns, so that a busy second of the machine affects both.
    for _ in range(ROUNDS):
        for name, command in commands.items():
            start = perf_counter()
            subprocess.run([sys.executable, *command], check=True, stdout=subprocess.DEVNULL)
            times[name].append(perf_counter() - start)
    return [
        Measurement(
            name='start of `handover_dmp --help`',
            value=median(times['help']),
            unit='s',
            target=0.3,
            floor=median(times['python']),
            note='floor: start of Python',
        )
    ]
