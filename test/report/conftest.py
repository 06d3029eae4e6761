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
import json
from pathlib import Path
from typing import Any

from handover_dmp import topics as graph
from handover_dmp.recording import BagWriter
from handover_dmp.recording.messages import (
    clock,
    float_array,
    header,
    joint_state,
    pose_stamped,
    string,
    twist_stamped,
)
from handover_dmp.topics import Topic, TOPICS
import numpy as np
import pytest

JOINTS = [f'joint_{number}' for number in range(1, 8)]
LIMITS = {
    'lower': [-2.96, -2.09, -2.96, -2.09, -2.96, -2.09, -2.96],
    'upper': [2.96, 2.09, 2.96, 2.09, 2.96, 2.09, 2.96],
    'velocity': [1.74, 1.91, 1.74, 1.97, 2.26, 3.14, 3.14],
    'acceleration': [8.0] * 7,
}
REACH_S, EXCHANGE_S, DONE_S, END_S = 0.5, 1.9, 2.3, 2.5
PERIOD_S = 0.005


def minimum_jerk(u: np.ndarray) -> np.ndarray:
    u = np.clip(u, 0.0, 1.0)
    return 10 * u**3 - 15 * u**4 + 6 * u**5


class Motion:
    """A plausible run made of minimum-jerk reaches; every number of it is known."""

    def __init__(self, lag_s: float = 0.012, hand_speed: float = 0.0) -> None:
        self.lag_s = lag_s
        self.hand_speed = hand_speed
        self.offset = np.array([-0.05, 0.02, 0.03])

    def hand(self, times: np.ndarray) -> np.ndarray:
        """Reach to the meeting place and go on from there at constant speed."""
        share = minimum_jerk((times - 0.2) / 1.2)[:, None]
        there = np.array([0.55, 0.1, 1.2]) + share * np.array([-0.2, 0.15, 0.1])
        drift = self.hand_speed * np.maximum(0.0, times - 0.9)[:, None] * np.array([0.6, 0.8, 0])
        return there + drift

    def wrist(self, times: np.ndarray) -> np.ndarray:
        """Reach to where the hand will be, then follow it, `lag_s` behind."""
        share = minimum_jerk((times - REACH_S) / 1.2)[:, None]
        start = np.array([-0.35, -0.3, 0.9])
        return start + share * (self.hand(times - self.lag_s) + self.offset - start)

    def demonstrator(self, times: np.ndarray) -> np.ndarray:
        share = minimum_jerk((times - REACH_S) / 1.3)[:, None]
        start = np.array([-0.35, -0.3, 0.9])
        end = self.hand(np.array([END_S])) + self.offset
        return start + share * (end - start) + 0.01 * np.sin(np.pi * share)

    def joints(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and exact velocities."""
        u = np.clip((times - REACH_S) / 1.2, 0.0, 1.0)
        way = np.linspace(-0.9, 0.9, 7)
        rate = np.where((u > 0) & (u < 1), 30 * u**2 * (1 - u) ** 2 / 1.2, 0.0)
        return minimum_jerk(u)[:, None] * way + 0.2, rate[:, None] * way


def write_run(
    folder: Path,
    motion: Motion | None = None,
    *,
    start_s: float = 0.0,
    recorder_ahead_s: float = 0.0,
    info: dict[str, Any] | None = None,
    leave_out: tuple[str, ...] = (),
    shuffle_joints: bool = False,
) -> Path:
    """
    Write the bag of a run.

    Args:
        folder: of the bag.
        motion: what moved.
        start_s: time of the graph at the beginning, s.
        recorder_ahead_s: how far the recorder's clock is ahead of the graph's, s.
        info: of the run, in place of the usual one.
        leave_out: topics that are not recorded.
        shuffle_joints: whether joint states come in another order than that of the run.

    """
    motion = motion or Motion()
    times = np.arange(0.0, END_S, PERIOD_S)
    about = {
        'trial': 'engine_bay give 1', 'configuration': 'engine_bay', 'exchange': 'give',
        'seed': 3, 'robot': 'lwr4', 'base_position_m': [0.0, -0.8, 0.4], 'base_yaw_rad': 0.5,
        'goal_offset_m': motion.offset.tolist(), 'joint_names': JOINTS, 'joint_limits': LIMITS,
        'command': 'handover_dmp simulate --seed 3', 'versions': {'handover_dmp': '0.1.0'},
    } if info is None else info  # fmt: skip
    names = JOINTS[::-1] if shuffle_joints else JOINTS
    with BagWriter(folder) as bag:
        for topic in TOPICS:
            if topic.name not in leave_out:
                bag.add_topic(topic.name, topic.type_name)

        def write(topic: Topic, message: dict[str, Any], time_s: float) -> None:
            if topic.name not in leave_out:
                log_ns = round((start_s + time_s + recorder_ahead_s) * 1e9)
                bag.write_message(topic.name, message, log_ns)

        write(graph.ROBOT_DESCRIPTION, string(urdf()), 0.0)
        if about:
            write(graph.INFO, string(json.dumps(about)), 0.0)
        changes = {0.0: 'idle', REACH_S: 'reaching', EXCHANGE_S: 'exchange', DONE_S: 'done'}
        hand, wrist, human = motion.hand(times), motion.wrist(times), motion.demonstrator(times)
        joints, speeds = motion.joints(times)
        for index, time_s in enumerate(times):
            stamp = round((start_s + time_s) * 1e9) or 1
            write(graph.CLOCK, clock(stamp), time_s)
            write(graph.HAND_POSE, pose_stamped(stamp, hand[index]), time_s)
            write(graph.DEMONSTRATOR_POSE, pose_stamped(stamp, human[index]), time_s)
            write(graph.WRIST_POSE, pose_stamped(stamp, wrist[index]), time_s)
            write(graph.POSE_COMMAND, pose_stamped(stamp, wrist[index]), time_s)
            ahead = np.gradient(wrist[max(0, index - 1): index + 2], PERIOD_S, axis=0)  # fmt: skip
            write(graph.TWIST_COMMAND, twist_stamped(stamp, ahead[min(1, len(ahead) - 1)]), time_s)
            order = [JOINTS.index(name) for name in names]
            state = joint_state(stamp, names, joints[index][order], speeds[index][order])
            write(graph.JOINT_STATES, state, time_s)
            write(graph.JOINT_COMMAND, float_array(speeds[index]), time_s)
            u = max(0.0, (time_s - REACH_S) / 1.2)
            weight = float(1 / (1 + np.exp(-(u - 0.9) * 50)))
            values = {
                'time_s': start_s + time_s,
                'phase': float(np.exp(-4.6 * u)),
                'goal_weight': weight,
                'hand_age_s': 0.004 + 0.001 * np.sin(index),
            }
            write(graph.PHASE, float_array(list(values.values()), list(values)), time_s)
            values = {
                'time_s': start_s + time_s,
                'speed_scale': 0.8 if 0.9 < time_s < 1.0 else 1.0,
                # the joints were not known for a moment
                'smallest_singular_value': np.nan if 0.95 < time_s < 0.97 else 0.2 - 0.05 * weight,
                'position_residual': 0.001 * weight,
                'orientation_residual': 0.002,
                'active_limits': 2.0 if 0.9 < time_s < 1.0 else 0.0,
            }
            write(graph.IK_STATUS, float_array(list(values.values()), list(values)), time_s)
            for change_s in [one for one in changes if one <= time_s]:
                write(graph.STATE, string(changes.pop(change_s)), time_s)
            if index % 200 == 0:
                values = [{'key': 'rate (Hz)', 'value': '200.0'}]
                faults = {'level': 1, 'message': 'hand too old'} if index == 200 else {}
                status = {'name': 'dmp', 'message': 'ok', 'values': values, **faults}
                message = {'header': header(stamp), 'status': [status]}
                write(graph.DIAGNOSTICS, message, time_s)
    return folder


def urdf() -> str:
    joints = ''.join(
        f'<joint name="{name}" type="revolute"><limit lower="{lower}" upper="{upper}" '
        f'velocity="{velocity}" effort="1"/></joint>'
        for name, lower, upper, velocity in zip(
            JOINTS, LIMITS['lower'], LIMITS['upper'], LIMITS['velocity'], strict=True
        )
    )
    return f'<?xml version="1.0"?><robot name="arm">{joints}</robot>'


@pytest.fixture(scope='session')
def make_run() -> Callable[..., Path]:
    """Give the function that writes the bag of a run."""
    return write_run


@pytest.fixture(scope='session')
def make_motion() -> type[Motion]:
    """Give the class of the motion of such a run."""
    return Motion


@pytest.fixture(scope='session')
def run_bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One run, as a folder with its bag in `bag/`."""
    folder = tmp_path_factory.mktemp('runs') / 'run'
    write_run(folder / 'bag')
    return folder
