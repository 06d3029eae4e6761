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
Movement primitives: canonical system, basis, goal weight, learning, rollout, model files.

Public names are imported on first use, which keeps `handover_dmp --help` fast.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from handover_dmp.common.lazy import lazy_names

if TYPE_CHECKING:
    from handover_dmp.dmp.basis import Basis
    from handover_dmp.dmp.classical import ClassicalDmp
    from handover_dmp.dmp.decoupled import DecoupledDmp
    from handover_dmp.dmp.learning import learn, learn_jointly, learn_mean, relearn
    from handover_dmp.dmp.model_file import load_model, save_model
    from handover_dmp.dmp.orientation import LearntTurn, OrientationPrimitive
    from handover_dmp.dmp.parameters import DmpParameters
    from handover_dmp.dmp.posterior import WeightPosterior
    from handover_dmp.dmp.state import DmpState, Rollout

_NAMES = {
    'basis': ['Basis'],
    'classical': ['ClassicalDmp'],
    'decoupled': ['DecoupledDmp'],
    'learning': ['learn', 'learn_jointly', 'learn_mean', 'relearn'],
    'model_file': ['load_model', 'save_model'],
    'orientation': ['LearntTurn', 'OrientationPrimitive'],
    'parameters': ['DmpParameters'],
    'posterior': ['WeightPosterior'],
    'state': ['DmpState', 'Rollout'],
}

__all__ = [
    'Basis',
    'ClassicalDmp',
    'DecoupledDmp',
    'DmpParameters',
    'DmpState',
    'LearntTurn',
    'OrientationPrimitive',
    'Rollout',
    'WeightPosterior',
    'learn',
    'learn_jointly',
    'learn_mean',
    'load_model',
    'relearn',
    'save_model',
]

__getattr__, __dir__ = lazy_names(__name__, _NAMES)
