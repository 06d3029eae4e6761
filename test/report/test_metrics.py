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

from collections.abc import Callable
import copy
from dataclasses import replace
import json
from pathlib import Path
from typing import Any

from handover_dmp.report import load_run, measure
import numpy as np
import pytest


@pytest.mark.parametrize('lag_s', [0.0, 0.002, 0.02])
def test_lag_behind_a_moving_hand(
    make_run: Callable[..., Path], make_motion: Callable[..., Any], tmp_path: Path, lag_s: float
) -> None:
    run = load_run(make_run(tmp_path / 'run', make_motion(lag_s=lag_s, hand_speed=0.2)))
    lag = measure(run)['lag']
    assert lag['time_ms'] == pytest.approx(lag_s * 1e3, abs=0.3)
    assert lag['distance_mm'] == pytest.approx(0.2 * lag_s * 1e3, abs=0.06)
    assert lag['hand_speed_m_s'] == pytest.approx(0.2, rel=0.01)
    assert lag['samples'] > 20


def test_lag_of_a_noisy_tracker(
    make_run: Callable[..., Path], make_motion: Callable[..., Any], tmp_path: Path
) -> None:
    run = load_run(make_run(tmp_path / 'run', make_motion(lag_s=0.01, hand_speed=0.2)))
    noise = np.random.default_rng(1).normal(0.0, 1e-4, run.hand_positions.shape)
    lag = measure(replace(run, hand_positions=run.hand_positions + noise))['lag']
    assert lag['time_ms'] == pytest.approx(10.0, abs=4 * lag['error_ms'])
    assert 0 < lag['error_ms'] < 0.5


def test_no_lag_behind_a_hand_that_is_still(run_bag: Path) -> None:
    assert measure(load_run(run_bag))['lag']['time_ms'] is None


def test_lag_in_a_settling_that_is_too_short_is_not_told(
    make_run: Callable[..., Path], make_motion: Callable[..., Any], tmp_path: Path
) -> None:
    # what is left of the way dies away while the hand slows down: no telling one from the other
    run = load_run(make_run(tmp_path / 'run', make_motion(lag_s=0.0, hand_speed=0.0)))
    times = run.hand_times
    slowing = 0.03 * np.exp(-5.0 * np.maximum(0.0, times - 1.6))[:, None]
    settling = 0.02 * np.exp(-7.0 * np.maximum(0.0, times - 1.6))[:, None]
    ripple = 1e-3 * np.sin(40.0 * times)[:, None]
    moved = replace(
        run,
        hand_positions=run.hand_positions - slowing,
        wrist_positions=run.wrist_positions - slowing - settling + ripple,
    )
    assert measure(moved)['lag']['time_ms'] is None


def test_lag_behind_the_command(
    make_run: Callable[..., Path], make_motion: Callable[..., Any], tmp_path: Path
) -> None:
    motion = make_motion()
    run = load_run(make_run(tmp_path / 'run', motion))
    late = replace(run, wrist_positions=motion.wrist(run.wrist_times - 0.008))
    lag = measure(late)['arm_lag']
    assert lag['time_ms'] == pytest.approx(8.0, abs=0.2)
    assert lag['largest_mm'] == pytest.approx(8.0 * run_peak(run), rel=0.02)
    assert measure(run)['arm_lag']['time_ms'] == pytest.approx(0.0, abs=1e-6)


def run_peak(run: Any) -> float:
    speed: float = measure(run)['wrist_peak_speed_m_s']
    return speed


def test_gap_and_distances(
    make_run: Callable[..., Path], make_motion: Callable[..., Any], tmp_path: Path
) -> None:
    motion = make_motion(lag_s=0.02, hand_speed=0.2)
    numbers = measure(load_run(make_run(tmp_path / 'run', motion)))
    assert numbers['exchange_time_s'] == pytest.approx(1.9)
    assert numbers['exchange_gap_m'] == pytest.approx(0.2 * 0.02, abs=1e-6)
    assert numbers['reach_duration_s'] == pytest.approx(1.4)
    assert numbers['handover_duration_s'] == pytest.approx(1.8)
    times = np.arange(0.5, 2.3, 0.005)
    apart = np.linalg.norm(motion.wrist(times) - motion.demonstrator(times), axis=1)
    assert numbers['to_human']['rms_m'] == pytest.approx(np.sqrt((apart**2).mean()), rel=5e-3)
    assert numbers['to_human']['largest_m'] == pytest.approx(apart.max(), rel=1e-3)


def test_peak_speeds(run_bag: Path, make_motion: Callable[..., Any]) -> None:
    motion = make_motion()
    numbers = measure(load_run(run_bag))
    times = np.arange(0.0, 2.5, 1e-4)
    for name, method in (('wrist', 'wrist'), ('hand', 'hand'), ('human', 'demonstrator')):
        speeds = np.linalg.norm(np.gradient(getattr(motion, method)(times), 1e-4, axis=0), axis=1)
        assert numbers[f'{name}_peak_speed_m_s'] == pytest.approx(speeds.max(), rel=0.01)
    # it is a minimum-jerk reach but for the hand that moves meanwhile
    assert numbers['wrist_from_minimum_jerk_share'] < 0.03


def test_limits_that_are_kept(run_bag: Path, make_motion: Callable[..., Any]) -> None:
    limits = measure(load_run(run_bag))['limits']
    assert limits['met']
    # 1.875 d/T of the first joint and 5.77 d/T² of a minimum-jerk motion of 0.9 rad in 1.2 s
    assert limits['velocity']['share'] == pytest.approx(1.875 * 0.9 / 1.2 / 1.74, rel=1e-3)
    assert limits['acceleration']['share'] == pytest.approx(5.7735 * 0.9 / 1.44 / 8.0, rel=0.01)


@pytest.mark.parametrize('endless', [1, 7])
def test_a_joint_without_limits_keeps_them(run_bag: Path, endless: int) -> None:
    run = load_run(run_bag)
    assert run.joint_limits is not None
    bounds = np.where(np.arange(7) < 7 - endless, run.joint_limits.upper, np.nan)
    free = replace(run, joint_limits=replace(run.joint_limits, lower=-bounds, upper=bounds))
    limits = measure(free)['limits']
    assert limits['met'] is True
    if endless == 7:
        assert limits['position'] is None
    else:
        assert 0.0 < limits['position']['share'] < 1.0


@pytest.mark.parametrize('quantity', ['lower', 'upper', 'velocity', 'acceleration'])
def test_limits_are_those_of_the_description_whatever_was_believed(
    make_run: Callable[..., Path], tmp_path: Path, quantity: str
) -> None:
    honest = load_run(make_run(tmp_path / 'honest'))
    believed = copy.deepcopy(honest.info)
    believed['joint_limits'][quantity][2] *= 5.0
    run = load_run(make_run(tmp_path / 'run', info=believed))
    assert run.joint_limits is not None and honest.joint_limits is not None
    if quantity == 'acceleration':
        # the description is silent of it: no more than is usual for an arm that nobody knows
        assert run.joint_limits.acceleration[2] == 10.0
    else:
        np.testing.assert_array_equal(
            getattr(run.joint_limits, quantity), getattr(honest.joint_limits, quantity)
        )
    limits = measure(run)['limits']
    assert [text.split(':')[0] for text in limits['believed_beyond']] == [f'{quantity} of joint_3']
    assert limits['judged_by'] == '/robot_description'
    assert measure(honest)['limits']['believed_beyond'] == []


@pytest.mark.parametrize('quantity', ['position', 'velocity', 'acceleration'])
def test_limits_that_are_broken(run_bag: Path, quantity: str) -> None:
    run = load_run(run_bag)
    positions, velocities = run.joint_positions.copy(), run.joint_velocities.copy()
    if quantity == 'position':
        positions[200, 3] = -2.2
    elif quantity == 'velocity':
        # slowly up and down again, so that no acceleration is wrong
        velocities[:, 3] = 2.1 * np.sin(np.pi * np.linspace(0.0, 1.0, len(velocities)))
    else:
        velocities[200, 3] += 0.05
    broken = replace(run, joint_positions=positions, joint_velocities=velocities)
    limits = measure(broken)['limits']
    assert not limits['met']
    assert limits[quantity]['joint'] == 'joint_4'
    others = {'position', 'velocity', 'acceleration'} - {quantity}
    assert all(limits[other]['met'] for other in others)


def test_rates_of_topics(run_bag: Path) -> None:
    run = load_run(run_bag)
    stamps = run.stamps['/hand/pose'].copy()
    stamps[250:] += 0.1
    late = replace(run, stamps={**run.stamps, '/hand/pose': stamps})
    hand = measure(late)['topics']['/hand/pose']
    assert hand['longest_ms'] == pytest.approx(105.0)
    assert hand['period_ms'] == pytest.approx(5.0)
    assert hand['rate_hz'] == pytest.approx(499 / 2.595, rel=1e-3)
    assert hand['jitter_median_ms'] == pytest.approx(0.0, abs=1e-5)
    assert '/handover/state' not in measure(run)['topics']


def test_nodes(run_bag: Path) -> None:
    node = measure(load_run(run_bag))['nodes']['dmp']
    assert node == {'reports': 3, 'faults': ['hand too old'], 'values': {'rate (Hz)': '200.0'}}


def test_inverse_kinematics_and_age(run_bag: Path) -> None:
    numbers = measure(load_run(run_bag))
    assert numbers['inverse_kinematics']['least_speed_share'] == pytest.approx(0.8)
    assert numbers['inverse_kinematics']['limited_time_share'] == pytest.approx(
        0.1 / 1.8, abs=0.01
    )
    assert 3.0 <= numbers['hand_age_median_ms'] <= 5.0


def test_a_bare_run_has_gaps_and_no_errors(make_run: Callable[..., Path], tmp_path: Path) -> None:
    absent = (
        '/clock', '/human/pose', '/wrist/pose_command', '/wrist/twist_command', '/handover/state',
        '/joint_velocity_controller/commands', '/handover/phase', '/wrist/ik_status',
        '/diagnostics', '/handover/info', '/robot_description',
    )  # fmt: skip
    numbers = measure(load_run(make_run(tmp_path / 'run', leave_out=absent)))
    assert numbers['handed_over'] is False
    assert numbers['exchange_gap_m'] is None
    assert numbers['to_human']['rms_m'] is None
    assert numbers['limits']['met'] is None
    json.dumps(numbers, allow_nan=False)
