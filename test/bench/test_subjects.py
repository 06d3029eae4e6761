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

"""The subjects of the benchmark, in short: what is no matter of time reaches its target."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
import math
from time import perf_counter
from typing import Any

import pytest

OF_THE_MACHINE = {'µs', 'ms', 's', 'messages/s', 'times real time'}
RATIO_OF_TIMES = 'world with the human figure to world without'
SHORTER = {
    'bag': {'COUNT': 2000, 'ROUNDS': 1},
    'dmp': {},
    'ik': {'LONG_RUN': 300, 'STEPS': 100},
    'rvm': {},
    'sim': {'PERIODS': 50},
}


def time_once(work: Callable[[], object], **_more: Any) -> float:
    start = perf_counter()
    work()
    return perf_counter() - start


@pytest.mark.parametrize('subject', SHORTER)
def test_every_figure_is_measured(subject: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module = import_module(f'handover_dmp.bench.{subject}')
    monkeypatch.setattr(module, 'time_call', time_once, raising=False)
    for name, value in SHORTER[subject].items():
        monkeypatch.setattr(module, name, value)
    said: list[str] = []
    rows = module.run(said.append)
    assert said
    assert len({row.name for row in rows}) == len(rows)
    for row in rows:
        assert math.isfinite(row.value), row
        if row.unit in OF_THE_MACHINE:
            assert row.value > 0.0, row
        elif row.name != RATIO_OF_TIMES:
            assert row.reached is not False, row
