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
Human-robot handover with a decoupled Dynamic Movement Primitive (Prada et al., IROS 2013).

The public names are imported when they are first used, so that `handover_dmp --help` stays fast.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from handover_dmp.common.lazy import lazy_names

if TYPE_CHECKING:
    from handover_dmp.dmp.basis import Basis
    from handover_dmp.dmp.classical import ClassicalDmp
    from handover_dmp.dmp.decoupled import DecoupledDmp
    from handover_dmp.dmp.learning import learn
    from handover_dmp.dmp.model_file import load_model, save_model
    from handover_dmp.dmp.parameters import DmpParameters
    from handover_dmp.dmp.posterior import WeightPosterior
    from handover_dmp.evaluation.protocol import evaluate
    from handover_dmp.handover.lockstep import simulate
    from handover_dmp.handover.scenario import make_scenario
    from handover_dmp.handover.teaching import learn_from_trials, rollout_against
    from handover_dmp.mocap.data_set import read_data_set
    from handover_dmp.mocap.synthetic import synthesize
    from handover_dmp.mocap.trial import HandoverTrial, read_trial
    from handover_dmp.robot.model import RobotModel
    from handover_dmp.robot.priority_ik import PriorityIk
    from handover_dmp.robot.tasks import WristTarget
    from handover_dmp.tracking.goal_estimator import GoalEstimator

__version__ = '0.2.0'

_NAMES = {
    'dmp.basis': ['Basis'],
    'dmp.classical': ['ClassicalDmp'],
    'dmp.decoupled': ['DecoupledDmp'],
    'dmp.learning': ['learn'],
    'dmp.model_file': ['load_model', 'save_model'],
    'dmp.parameters': ['DmpParameters'],
    'dmp.posterior': ['WeightPosterior'],
    'evaluation.protocol': ['evaluate'],
    'handover.lockstep': ['simulate'],
    'handover.scenario': ['make_scenario'],
    'handover.teaching': ['learn_from_trials', 'rollout_against'],
    'mocap.data_set': ['read_data_set'],
    'mocap.synthetic': ['synthesize'],
    'mocap.trial': ['HandoverTrial', 'read_trial'],
    'robot.model': ['RobotModel'],
    'robot.priority_ik': ['PriorityIk'],
    'robot.tasks': ['WristTarget'],
    'tracking.goal_estimator': ['GoalEstimator'],
}

__all__ = [
    'Basis',
    'ClassicalDmp',
    'DecoupledDmp',
    'DmpParameters',
    'GoalEstimator',
    'HandoverTrial',
    'PriorityIk',
    'RobotModel',
    'WeightPosterior',
    'WristTarget',
    'evaluate',
    'learn',
    'learn_from_trials',
    'load_model',
    'make_scenario',
    'read_data_set',
    'read_trial',
    'rollout_against',
    'save_model',
    'simulate',
    'synthesize',
]

__getattr__, __dir__ = lazy_names(__name__, _NAMES)
