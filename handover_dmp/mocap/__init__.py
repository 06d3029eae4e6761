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
Recorded handovers: trials, data sets, readers of all formats, filters, synthetic data.

Public names are imported on first use, so that `handover_dmp --help` stays fast.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from handover_dmp.common.lazy import lazy_names

if TYPE_CHECKING:
    from handover_dmp.mocap.data_set import read_data_set, write_data_set
    from handover_dmp.mocap.filtering import condition, smooth, velocities
    from handover_dmp.mocap.synthetic import synthesize
    from handover_dmp.mocap.trial import HandoverTrial, read_trial, write_trial

_NAMES = {
    'data_set': ['read_data_set', 'write_data_set'],
    'filtering': ['condition', 'smooth', 'velocities'],
    'synthetic': ['synthesize'],
    'trial': ['HandoverTrial', 'read_trial', 'write_trial'],
}

__all__ = [
    'HandoverTrial',
    'condition',
    'read_data_set',
    'read_trial',
    'smooth',
    'synthesize',
    'velocities',
    'write_data_set',
    'write_trial',
]

__getattr__, __dir__ = lazy_names(__name__, _NAMES)
