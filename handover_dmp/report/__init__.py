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

"""Reports on recorded runs: figures, numbers and one page, made from the bag alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

from handover_dmp.common.lazy import lazy_names

if TYPE_CHECKING:
    from handover_dmp.report.metrics import measure
    from handover_dmp.report.recorded_run import load_run, RunRecord
    from handover_dmp.report.report import write_report

_NAMES = {
    'metrics': ['measure'],
    'recorded_run': ['RunRecord', 'load_run'],
    'report': ['write_report'],
}

__all__ = ['RunRecord', 'load_run', 'measure', 'write_report']

__getattr__, __dir__ = lazy_names(__name__, _NAMES)
