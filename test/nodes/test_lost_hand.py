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

"""A bag whose hand is lost in mid-motion, played by `hand_tracker` to the whole graph."""

from __future__ import annotations

from pathlib import Path
import time
from typing import Any

from handover_dmp.handover.lockstep import Handover
from handover_dmp.handover.scenario import Scenario
from handover_dmp.nodes.graph import Graph
from handover_dmp.nodes.qos import message_class, qos_profile
from handover_dmp.recording import BagWriter, read_bag
from handover_dmp.recording.messages import header, pose_stamped
from handover_dmp.topics import DEMONSTRATOR_POSE, DIAGNOSTICS, HAND_POSE, SIGNAL, WRIST_POSE
import numpy as np
import pytest

pytestmark = [pytest.mark.ros, pytest.mark.timeout(400)]

REST_S = 0.5
RATE_HZ = 100.0
LOST_S = (1.1, 1.7)
"""In mid-motion; the first half as zeros, then NaN, then a quaternion of norm 0."""
COUNTS = {'zero': 30, 'not_finite': 15, 'no_rotation': 15}
HAND_TIMEOUT_S = 0.1
BRAKING_S = 0.3
MAX_S = 20.0
WAIT_S = 60.0


def pose_at(scenario: Scenario, number: int) -> dict[str, Any]:
    """Give the pose of a number, of a hand that rests, moves, is lost and rests."""
    time_s, trial = number / RATE_HZ, scenario.trial
    inside = np.clip(time_s - REST_S, 0.0, trial.duration_s) + trial.times[0]
    position = [float(np.interp(inside, trial.times, axis)) for axis in trial.partner.T]
    turn = (0.0, 0.0, 0.0, 1.0)
    lost = number - round(LOST_S[0] * RATE_HZ)
    if 0 <= lost < 30:
        position = [0.0, 0.0, 0.0]
    elif 30 <= lost < 45:
        position[1] = np.nan
    elif 45 <= lost < 60:
        turn = (0.0, 0.0, 0.0, 0.0)
    return pose_stamped(round(number * 1e9 / RATE_HZ), position, turn)


def write_bag(folder: Path, scenario: Scenario) -> None:
    with BagWriter(folder) as bag:
        bag.add_topic(HAND_POSE.name, HAND_POSE.type_name)
        bag.add_topic(DEMONSTRATOR_POSE.name, DEMONSTRATOR_POSE.type_name)
        bag.add_topic(SIGNAL.name, SIGNAL.type_name)
        for number in range(round((REST_S + scenario.trial.duration_s + 3.0) * RATE_HZ)):
            time_ns = round(number * 1e9 / RATE_HZ)
            bag.write_message(HAND_POSE.name, pose_at(scenario, number), time_ns)
            bag.write_message(
                DEMONSTRATOR_POSE.name, pose_stamped(time_ns, (1.0, 1.0, 1.0)), time_ns
            )
            if number == round(REST_S * RATE_HZ):
                bag.write_message(SIGNAL.name, header(time_ns), time_ns)


def counts_of(graph: Graph, node: str) -> dict[str, int]:
    """Tell what a node says from now on of the poses that it refused, once it has said it."""
    found: list[tuple[float, dict[str, int]]] = []

    def take(message: Any) -> None:
        for status in message.status:
            if status.name == node:
                refused = {
                    value.key.removeprefix('hand refused, '): int(value.value)
                    for value in status.values
                    if value.key.startswith('hand refused, ')
                }
                found.append((time.monotonic(), refused))

    subscription = graph.node.create_subscription(
        message_class(DIAGNOSTICS.type_name),
        DIAGNOSTICS.name,
        take,
        qos_profile(DIAGNOSTICS.quality),
    )
    end_s = time.monotonic() + WAIT_S
    # the first are those of before; one comes each second
    while not found or found[-1][0] < found[0][0] + 1.5:
        assert time.monotonic() < end_s, f'{node} says nothing'
        graph.spin(0.05)
    graph.node.destroy_subscription(subscription)
    return found[-1][1]


def test_the_arm_brakes_goes_on_and_never_turns_to_where_no_hand_was(
    prepare: Any, scenario: Scenario, tmp_path: Path
) -> None:
    bag = tmp_path / 'played'
    write_bag(bag, scenario)
    slow = {'tracker.rate_hz': RATE_HZ}
    frozen = {'hand_filter.frozen_s': 0.2, 'hand_filter.refuse_frozen': True}
    folder, parameters = prepare(
        hand_tracker={'source': 'bag', 'bag': str(bag), 'replay_at_s': 0.0},
        dmp=slow,
        priority_ik={**slow, **frozen},
    )
    with Graph(folder, parameters) as graph:
        graph.pause(False)
        assert graph.wait_for_state(('done',), MAX_S, lambda: None)
        graph.pause(True)
        counts = {node: counts_of(graph, node) for node in ('dmp', 'priority_ik')}
    assert counts['dmp'] == COUNTS, 'all of them, by reason'
    # its parameters are its own: here the resting hand is none
    assert counts['priority_ik'].pop('frozen') > 0
    assert counts['priority_ik'] == COUNTS
    path: dict[float, list[float]] = {}
    for _, message, _ in read_bag(folder / 'bag', [WRIST_POSE.name]):
        place, stamp = message.pose.position, message.header.stamp
        path[stamp.sec + 1e-9 * stamp.nanosec] = [place.x, place.y, place.z]
    at, wrist = np.array(list(path)), np.array(list(path.values()))
    speed = np.linalg.norm(np.diff(wrist, axis=0), axis=1) / np.diff(at)
    stands = (at[1:] > LOST_S[0] + HAND_TIMEOUT_S + BRAKING_S) & (at[1:] < LOST_S[1])
    assert speed[at[1:] < LOST_S[0]][-1] > 0.1, 'in mid-motion'
    assert speed[stands].max() < 0.01
    assert speed[at[1:] > LOST_S[1] + 0.1].max() > 0.1, 'it goes on'
    handover = Handover(scenario)
    control = np.array([period.wrist_position for period in handover.run()])
    handover.close()
    base = np.array(scenario.robot.base.position)
    nearest, of_control = (np.linalg.norm(way - base, axis=1).min() for way in (wrist, control))
    assert nearest > of_control - 0.02, 'never towards its base'
    assert np.linalg.norm(wrist[-1] - control[-1]) < 0.02
    apart = np.linalg.norm(wrist[:, None, :] - control[None, :, :], axis=2).min(axis=1)
    assert apart.max() < 0.05
