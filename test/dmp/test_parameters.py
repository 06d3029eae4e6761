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

from __future__ import annotations

from dataclasses import fields
from math import sqrt

from handover_dmp.common.errors import DataError
from handover_dmp.common.settings import defaults
from handover_dmp.dmp import DmpParameters
import pytest


def test_defaults_are_those_of_the_configuration():
    parameters = DmpParameters()
    for field in fields(DmpParameters):
        assert getattr(parameters, field.name) == defaults('dmp')[field.name]


def test_zero_damping_is_critical_and_negative_gain_does_not_lag():
    parameters = DmpParameters(stiffness=100.0, damping=0.0, goal_velocity_gain=-1.0)
    assert parameters.effective_damping == pytest.approx(2.0 * sqrt(100.0))
    assert parameters.effective_goal_velocity_gain(1.5) == pytest.approx(30.0)
    assert DmpParameters(damping=7.0).effective_damping == 7.0
    assert DmpParameters(goal_velocity_gain=3.0).effective_goal_velocity_gain(9.0) == 3.0


def test_formulations():
    assert DmpParameters(stiffness=150.0, formulation='stiff').shape_stiffness == 150.0
    assert DmpParameters(stiffness=150.0, formulation='printed').shape_stiffness == 1.0


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('stiffness', 0.0),
        ('stiffness', float('nan')),
        ('stiffness', 1e30),
        ('damping', -1.0),
        ('goal_velocity_gain', float('inf')),
        ('phase_at_end', 0.0),
        ('phase_at_end', 1.0),
        ('mu', float('nan')),
        ('sigma', 0.0),
        ('sigma', 'wide'),
        ('formulation', 'soft'),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(name, value):
    with pytest.raises(DataError, match=name):
        DmpParameters(**{name: value})
