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

"""Reports on recorded runs, made from the bag alone: figures, numbers, one page."""

from __future__ import annotations

from importlib import import_module
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from handover_dmp.report.metrics import measure
    from handover_dmp.report.recorded_run import load_run, RunRecord
    from handover_dmp.report.report import write_report

_HOMES = {
    'RunRecord': 'recorded_run',
    'load_run': 'recorded_run',
    'measure': 'metrics',
    'write_report': 'report',
}

__all__ = ['RunRecord', 'load_run', 'measure', 'write_report']


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_HOMES[name]}'), name)
