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

"""Table I: its computation time, alone and for the whole command."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from statistics import median
import subprocess
import sys
from tempfile import TemporaryDirectory
from time import perf_counter

from handover_dmp.bench.measurement import Measurement, time_call
from handover_dmp.evaluation.protocol import evaluate
from handover_dmp.mocap import synthesize, write_data_set

TABLE_TARGET_S = 3.0
LARGE_TARGET_S = 60.0
LARGE_TRIALS = 1000
CASES = 6
ROUNDS = 3


def run(progress: Callable[[str], None]) -> list[Measurement]:
    """
    Measure the table alone, and `handover_dmp evaluate` without figures.

    Args:
        progress: called with the name of each measurement.

    Returns:
        The times of Table I on 30 trials, and on a thousand.

    """
    trials = synthesize(seed=0)
    progress('Table I, 30 trials')
    table = time_call(lambda: evaluate(trials), rounds=5)
    with TemporaryDirectory() as folder:
        progress('Table I, 30 trials, the whole command')
        write_data_set(trials, Path(folder) / 'small')
        small = median(_evaluate(Path(folder) / 'small') for _ in range(ROUNDS))
        progress(f'Table I, {LARGE_TRIALS} trials')
        many = synthesize(seed=0, trials=-(-LARGE_TRIALS // CASES))[:LARGE_TRIALS]
        write_data_set(many, Path(folder) / 'large')
        large = _evaluate(Path(folder) / 'large')
    return [
        Measurement(
            'Table I, all methods',
            table,
            's',
            target=TABLE_TARGET_S,
            note='30 trials: 180 rollouts of 36 models, twice that with the base line; bootstrap',
        ),
        Measurement(
            'Table I, the whole command',
            small,
            's',
            target=TABLE_TARGET_S,
            note='the same with the start of Python, reading and writing',
        ),
        Measurement(
            f'Table I, {LARGE_TRIALS} trials',
            large,
            's',
            target=LARGE_TARGET_S,
            note='the whole command; every model against every hand of its case',
        ),
    ]


def _evaluate(data_set: Path) -> float:
    words = [sys.executable, '-m', 'handover_dmp', 'evaluate', str(data_set)]
    start = perf_counter()
    subprocess.run(
        [*words, '-o', str(data_set) + '_table', '--no-figures'],
        check=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    return perf_counter() - start
