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

"""The bag of a lockstep run: the messages that the graph would have published."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
import json
from pathlib import Path
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.dmp import DecoupledDmp
from handover_dmp.handover.lockstep import NANOSECONDS, Period, REPLAY_AT_S
from handover_dmp.handover.scenario import Scenario
from handover_dmp.handover.scene_markers import learnt_path, SceneMarkers, WITHOUT_ROS
from handover_dmp.handover.session_lockstep import SessionPeriod
from handover_dmp.handover.session_scenario import SessionScenario
from handover_dmp.mocap.filtering import interpolate
from handover_dmp.recording import BagWriter, Qos
from handover_dmp.recording.messages import (
    boolean,
    clock,
    float_array,
    header,
    joint_state,
    Message,
    pose_stamped,
    pose_with_covariance_stamped,
    string,
    time_message,
    transforms,
    twist_stamped,
    wrench_stamped,
)
from handover_dmp.robot.link_frames import LinkFrames
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.published_description import published_description
from handover_dmp.topics import (
    CLOCK,
    DEMONSTRATOR_POSE,
    FRAME,
    GRIPPER_COMMAND,
    HAND_FUSED,
    HAND_POSE,
    HAND_TRUTH,
    IK_STATUS,
    INFO,
    JOINT_COMMAND,
    JOINT_STATES,
    MARKERS,
    OBJECT_HOLDER,
    OBJECT_POSE,
    PHASE,
    POSE_COMMAND,
    ROBOT_DESCRIPTION,
    SIGNAL,
    STATE,
    TF,
    TF_PERIOD_S,
    TF_STATIC,
    Topic,
    TWIST_COMMAND,
    WRIST_POSE,
    WRIST_WRENCH,
)
import numpy as np
import pinocchio


def write_run_bag(
    folder: Path,
    scenario: Scenario,
    periods: Sequence[Period],
    info: dict[str, Any],
    topics: Sequence[str] = (),
) -> None:
    """
    Write the bag of a run.

    Args:
        folder: folder of the bag; must not exist.
        scenario: the scenario.
        periods: inputs and outputs of every period.
        info: content of `/handover/info`.
        topics: topic of the poses of each tracker; none: one tracker, on the default topic.

    Raises:
        DataError: the folder exists or cannot be written.

    """
    trial = scenario.trial
    partner = _path(scenario, periods, trial.partner)
    demonstrator = _path(scenario, periods, trial.demonstrator)
    people = list(zip(partner, demonstrator, strict=True))
    scene = _scene(scenario.model)
    _write_bag(folder, scenario.robot, scene, periods, people, info, topics)


def write_session_bag(
    folder: Path,
    scenario: SessionScenario,
    periods: Sequence[SessionPeriod],
    info: dict[str, Any],
    topics: Sequence[str] = (),
) -> None:
    """
    Write the bag of a session.

    Args:
        folder: folder of the bag; must not exist.
        scenario: the scenario.
        periods: inputs and outputs of every period.
        info: content of `/handover/info`.
        topics: topic of the poses of each tracker; none: one tracker, on the default topic.

    Raises:
        DataError: the folder exists or cannot be written.

    """
    people = [(one.truth.tolist(), one.demonstrator.tolist()) for one in periods]
    further: list[list[tuple[Topic, Message]]] = []
    closed = None
    for one in periods:
        told: list[tuple[Topic, Message]] = [
            (SIGNAL, header(round(signal.stamp_s * NANOSECONDS), FRAME)) for signal in one.signals
        ]
        if one.period.object_state is None and one.gripper_closed is not closed:
            closed = one.gripper_closed
            told.append((GRIPPER_COMMAND, boolean(closed)))
        further.append(told)
    plain = [one.period for one in periods]
    scene = _scene(scenario.models.give)
    _write_bag(folder, scenario.robot, scene, plain, people, info, topics, further)


def _write_bag(
    folder: Path,
    robot: RobotModel,
    scene: SceneMarkers,
    periods: Sequence[Period],
    people: Sequence[tuple[list[float], list[float]]],
    info: dict[str, Any],
    topics: Sequence[str],
    further: Sequence[Sequence[tuple[Topic, Message]]] | None = None,
) -> None:
    """Write all periods, with the positions of P1 and P2 and further messages in each."""
    with BagWriter(folder) as bag:
        start_ns = periods[0].time_ns
        described = published_description(robot.urdf_text, robot.urdf_path.parent, FRAME)
        _write(bag, ROBOT_DESCRIPTION, string(described), start_ns)
        links = LinkFrames(robot, FRAME)
        _write(bag, TF_STATIC, transforms(start_ns, links.fixed), start_ns)
        next_tf_ns = start_ns
        _write(bag, INFO, string(json.dumps(info)), start_ns)
        state = holder = gripper_closed = None
        rotation = periods[0].wrist_rotation
        heard = [replace(HAND_POSE, name=name) for name in topics] or [HAND_POSE]
        for number, (period, (hand, person)) in enumerate(zip(periods, people, strict=True)):
            time_ns = period.time_ns
            _write(bag, DEMONSTRATOR_POSE, pose_stamped(time_ns, person), time_ns)
            _write(bag, HAND_TRUTH, pose_stamped(time_ns, hand), time_ns)
            for topic, samples in zip(heard, period.hands, strict=True):
                for sample in samples:
                    stamp_ns, place = round(sample.stamp_s * NANOSECONDS), sample.position.tolist()
                    _write(bag, topic, pose_stamped(stamp_ns, place), time_ns)
            for topic, message in _messages(period, robot.joint_names, rotation):
                _write(bag, topic, message, time_ns)
            if time_ns >= next_tf_ns:
                next_tf_ns += round(TF_PERIOD_S * NANOSECONDS)
                moved = transforms(time_ns, links.moving(period.joint_positions))
                _write(bag, TF, moved, time_ns)
            markers = _markers(scene, period)
            if markers:
                _write(bag, MARKERS, {'markers': markers}, time_ns)
            if period.command.state is not state:
                state = period.command.state
                _write(bag, STATE, string(state.value), time_ns)
            seen = period.object_state
            if seen is not None and seen.holder is not holder:
                holder = seen.holder
                _write(bag, OBJECT_HOLDER, string(holder.value), time_ns)
            if seen is not None and seen.gripper_closed is not gripper_closed:
                gripper_closed = seen.gripper_closed
                _write(bag, GRIPPER_COMMAND, boolean(gripper_closed), time_ns)
            for topic, message in further[number] if further else ():
                _write(bag, topic, message, time_ns)


def _scene(model: DecoupledDmp) -> SceneMarkers:
    return SceneMarkers(WITHOUT_ROS, FRAME, learnt_path(model))


def _markers(scene: SceneMarkers, period: Period) -> list[Any]:
    """Return the markers that the graph would publish in a period."""
    if not scene.is_due():
        return []
    expectation = period.command.expectation
    return scene.update(
        time_message(period.time_ns),
        period.hand,
        period.wrist_position.tolist(),
        period.exchange_position,
        None if expectation is None else expectation.goal,
    )


def _path(scenario: Scenario, periods: Sequence[Period], positions: Array) -> list[list[float]]:
    """Return a recorded path at each period, at rest before and after the recording."""
    trial = scenario.trial
    since = np.array([period.time_ns for period in periods]) / NANOSECONDS - REPLAY_AT_S
    times = trial.times[0] + np.clip(since, 0.0, trial.duration_s)
    path: list[list[float]] = interpolate(trial.times, positions)(times).tolist()
    return path


def _messages(
    period: Period, joint_names: Sequence[str], commanded_rotation: Any
) -> Iterable[tuple[Topic, Message]]:
    time_ns, command, answer = period.time_ns, period.command, period.answer
    yield CLOCK, clock(time_ns)
    positions, velocities = period.joint_positions.tolist(), period.joint_velocities.tolist()
    yield JOINT_STATES, joint_state(time_ns, joint_names, positions, velocities)
    yield WRIST_POSE, _pose(time_ns, period.wrist_position.tolist(), period.wrist_rotation)
    if period.estimate is not None:
        place, deviation_m = period.estimate.position, period.estimate.deviation_m
        yield HAND_FUSED, pose_with_covariance_stamped(time_ns, place, deviation_m)
    if command.orientation is None:
        yield POSE_COMMAND, _pose(time_ns, command.position, commanded_rotation)
    else:
        yield POSE_COMMAND, pose_stamped(time_ns, command.position, command.orientation)
    yield TWIST_COMMAND, twist_stamped(time_ns, command.velocity, command.angular_velocity)
    yield PHASE, _float_array(command.status_values(time_ns / NANOSECONDS))
    if answer.velocities is not None:
        yield JOINT_COMMAND, float_array(answer.velocities.tolist(), [str(time_ns)])
    yield IK_STATUS, _float_array(answer.status_values(time_ns / NANOSECONDS))
    if period.object_state is not None:
        seen = period.object_state
        force, torque = (part.tolist() for part in seen.wrench)
        yield WRIST_WRENCH, wrench_stamped(time_ns, force, torque)
        yield OBJECT_POSE, pose_stamped(time_ns, seen.position.tolist(), seen.quaternion.tolist())


def _write(bag: BagWriter, topic: Topic, message: Message, time_ns: int) -> None:
    reliability, durability, depth = topic.quality.value
    qos = Qos(reliability, durability, history='keep_last', depth=depth)
    bag.add_topic(topic.name, topic.type_name, qos)
    bag.write_message(topic.name, message, time_ns)


def _pose(time_ns: int, position: Sequence[float], rotation: Any) -> Message:
    return pose_stamped(time_ns, position, pinocchio.Quaternion(rotation).coeffs())


def _float_array(values: dict[str, float]) -> Message:
    return float_array(list(values.values()), list(values))
