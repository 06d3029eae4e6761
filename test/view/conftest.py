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

import json
from pathlib import Path
from typing import Any

from handover_dmp import topics as graph
from handover_dmp.recording import BagWriter
from handover_dmp.recording.messages import joint_state, pose_stamped, string
from handover_dmp.robot.model import BasePlacement, RobotModel
from handover_dmp.topics import Topic
import numpy as np
import pytest

BASE = BasePlacement((0.1, -0.2, 0.6), 0.3)
REACHING_S, EXCHANGE_S, DONE_S, END_S = 0.4, 1.2, 1.4, 1.5
PERIOD_S = 0.02


def swing(time_s: float) -> float:
    """Share of the motion that is done, by minimum jerk."""
    u = min(1.0, max(0.0, (time_s - REACHING_S) / (EXCHANGE_S - REACHING_S)))
    return 10 * u**3 - 15 * u**4 + 6 * u**5


def joints_at(model: RobotModel, time_s: float) -> np.ndarray:
    """Swing the arm about its first joint."""
    return model.home + (1.0 - swing(time_s)) * 0.8 * np.eye(model.dof)[0]


def write_run(
    folder: Path,
    robot: str = 'lwr4',
    *,
    info: dict[str, Any] | None = None,
    direction: str = 'give',
    last_state: str = 'done',
) -> Path:
    """
    Write the bag of a hand that comes and an arm that swings towards it.

    Args:
        folder: of the run.
        robot: name or URDF of the arm.
        info: what the run says of itself, in place of the usual.
        direction: give or take.
        last_state: of the handover, after the exchange.

    Returns:
        The folder.

    """
    model = RobotModel.load(robot, base=BASE)
    meeting = model.wrist_pose(joints_at(model, END_S))[0] + [0.22, 0.05, 0.0]
    about = {
        'trial': 'swing give 1', 'robot': model.name, 'exchange': direction,
        'base_position_m': list(BASE.position), 'base_yaw_rad': BASE.yaw,
    } if info is None else info  # fmt: skip
    with BagWriter(folder / 'bag') as bag:

        def write(topic: Topic, message: dict[str, Any], time_s: float) -> None:
            bag.add_topic(topic.name, topic.type_name)
            bag.write_message(topic.name, message, round(time_s * 1e9))

        write(graph.ROBOT_DESCRIPTION, string(model.urdf_text), 0.0)
        write(graph.INFO, string(json.dumps(about)), 0.0)
        states = {0.0: 'idle', REACHING_S: 'reaching', EXCHANGE_S: 'exchange', DONE_S: last_state}
        for time_s, state in states.items():
            write(graph.STATE, string(state), time_s)
        for time_s in np.arange(0.0, END_S, PERIOD_S):
            stamp = round(time_s * 1e9) or 1
            q = joints_at(model, time_s)
            hand = meeting + (1.0 - swing(time_s)) * np.array([0.25, 0.2, -0.2])
            write(graph.HAND_POSE, pose_stamped(stamp, hand), time_s)
            write(graph.WRIST_POSE, pose_stamped(stamp, model.wrist_pose(q)[0]), time_s)
            state = joint_state(stamp, model.joint_names, q.tolist(), [0.0] * model.dof)
            write(graph.JOINT_STATES, state, time_s)
    return folder


@pytest.fixture(scope='session')
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the folder of a short run; nothing is to be written into it."""
    return write_run(tmp_path_factory.mktemp('run'))
