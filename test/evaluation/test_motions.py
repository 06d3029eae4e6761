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

"""The motions of an evaluation, measured where they are known."""

from __future__ import annotations

from math import log

from handover_dmp.evaluation.cases import make_cases
from handover_dmp.evaluation.motions import (
    measure_beside,
    measure_trials,
    measures_table,
    motions_beside,
)
from handover_dmp.evaluation.rollouts import Learning
from handover_dmp.mocap import HandoverTrial
import numpy as np
import pytest


def reach(number: int, length_m: float, late_s: float) -> HandoverTrial:
    """Two minimum-jerk reaches, that of P2 later than that of P1."""
    times = np.arange(0.0, 2.0 + 1e-9, 0.005)

    def along(begin_s: float) -> np.ndarray:
        u = np.clip((times - begin_s) / 1.2, 0.0, 1.0)
        return (10 * u**3 - 15 * u**4 + 6 * u**5)[:, None]

    partner = np.array([1.0, 0.0, 1.0]) - along(0.2) * np.array([length_m, 0.0, 0.0])
    demonstrator = np.array([-0.5, 0.1, 0.9]) + along(0.2 + late_s) * np.array([0.9, -0.1, 0.1])
    return HandoverTrial(times, partner, demonstrator, 'bench', 'give', number)


def test_people_who_move_in_minimum_jerk_are_measured_so() -> None:
    trials = [reach(1, 0.5, 0.2), reach(2, 0.4, 0.2), reach(3, 0.6, 0.3)]
    cases = make_cases(trials, cutoff_hz=None)
    found = measure_trials(cases, Learning(cutoff_hz=None), 'representative')
    for one, late_s, length_m in zip(found, (0.2, 0.2, 0.3), (0.5, 0.4, 0.6), strict=True):
        person = one.person
        assert person.motion is not None and person.synchrony is not None
        assert person.motion.path_ratio == pytest.approx(1.0, abs=1e-4)
        assert person.motion.peaks == 1
        # the rest before and after counts as duration: D³ is (2.0/1.2)³ as large
        expected = -log(204.8 * (2.0 / 1.2) ** 3)
        assert person.motion.log_dimensionless_jerk == pytest.approx(expected, abs=0.1)
        assert person.synchrony.lag_s == pytest.approx(late_s, abs=0.006)
        # both are at rest at the end, where they are nearest to each other
        assert person.relative_speed_m_s == pytest.approx(0.0, abs=2e-3)
        ends = np.array([1.0 - length_m, 0.0, 1.0]), np.array([0.4, 0.0, 1.0])
        assert person.distance_min_m == pytest.approx(float(np.linalg.norm(ends[0] - ends[1])))
        # faster than 0.05 m/s: all of 1.2 s but for a margin at both ends, of 2 s
        length = float(np.linalg.norm([0.9, -0.1, 0.1]))
        margin = 1.2 * (0.5 - np.sqrt(0.25 - np.sqrt(0.05 * 1.2 / (30.0 * length))))
        idle = 1.0 - (1.2 - 2 * margin) / 2.0
        assert person.fluency.robot_idle == pytest.approx(idle, abs=0.006)
    # the first is nearest to the mean, and what was learnt from it reproduces it
    own = found[0]
    assert own.primitive.motion is not None and own.person.motion is not None
    assert own.primitive.motion.path_ratio == pytest.approx(1.0, abs=2e-3)
    assert own.primitive.motion.peak_speed == pytest.approx(own.person.motion.peak_speed, rel=0.02)
    beside = motions_beside(found)
    (lag,) = [one for one in beside if one.name == 'lag_s']
    assert lag.pairs[:, 1] == pytest.approx([0.2, 0.2, 0.3], abs=0.006)
    table = measures_table(beside, 'representative', 0)
    (line,) = [one for one in table.lines if 'behind the partner' in one[0]]
    assert line[2] == '0.20'
    assert line[1] == f'{np.median(lag.pairs[:, 0]):.2f}'
    summed = lag.as_json(0)
    assert summed['median']['P2'] == pytest.approx(0.2, abs=0.006)
    mean = float((lag.pairs[:, 0] - lag.pairs[:, 1]).mean())
    assert summed['difference']['DMP'] == pytest.approx(mean)
    assert summed['interval']['DMP'][0] <= mean <= summed['interval']['DMP'][1]


def test_two_on_straight_lines_pass_and_part_as_geometry_says() -> None:
    times = np.arange(0.0, 2.0 + 1e-9, 0.005)[:, None]
    partner = np.array([0.5, 0.3, 1.0]) + times * np.array([-0.2, 0.0, 0.0])
    motion = np.array([-0.5, 0.0, 1.0]) + times * np.array([0.6, 0.1, 0.0])
    found = measure_beside(HandoverTrial(times[:, 0], partner, motion, 'bench', 'give', 1), motion)
    # they close in by (−0.8, −0.1) m/s from (1.0, 0.3) m; nearest after 0.83 / 0.65 s
    assert found.relative_speed_m_s == pytest.approx(np.hypot(0.8, 0.1))
    nearest = abs(1.0 * 0.1 - 0.3 * 0.8) / np.hypot(0.8, 0.1)
    assert found.distance_min_m == pytest.approx(nearest, abs=1e-4)
    assert found.fluency.concurrent == 1.0 and found.fluency.robot_idle == 0.0


def test_an_arm_stands_between_the_primitive_and_people() -> None:
    cases = make_cases([reach(1, 0.5, 0.2), reach(2, 0.4, 0.2)], cutoff_hz=None)
    found = measure_trials(cases, Learning(cutoff_hz=None))
    arm = {found[0].label: found[0].person}
    path, *_ = motions_beside(found, arm)
    assert list(path.values) == ['DMP', 'arm', 'P2']
    # the other one was not reached
    assert len(path.pairs) == 1
    assert path.pairs[0, 1] == path.pairs[0, 2]
    assert path.differences(0)[1] == (0.0, 0.0, 0.0)
