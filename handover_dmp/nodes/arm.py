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

"""The arm of a node, chosen by its parameters."""

from __future__ import annotations

from pathlib import Path
import re
from time import sleep

from handover_dmp.common.errors import HandoverError
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.nodes.qos import message_class, qos_profile
from handover_dmp.nodes.spin import told_to_end
from handover_dmp.robot.descriptions import Description, read_description
from handover_dmp.robot.model import BasePlacement, RobotModel
from handover_dmp.topics import ROBOT_DESCRIPTION

TOPIC = re.compile(r'(/[A-Za-z_]\w*)+')
LOOK_S = 0.05
SAY_EVERY = 100
"""Polls without success after which the log repeats what the node is waiting for."""


class EndedError(HandoverError):
    """The node was told to end before its inputs were complete."""

    exit_code = 0


def load_arm(node: HandoverNode) -> RobotModel:
    """
    Load the arm that the parameters of a node choose, and log remarks about it.

    Args:
        node: declares `ARM`.

    Returns:
        The arm, at its base placement.

    Raises:
        RobotDescriptionError: its description cannot be used.
        EndedError: the node was told to end before a description came.

    """
    values = node.values
    robot = values['robot']
    angles = {name: values[f'base_{name}'] for name in ('roll', 'pitch', 'yaw')}
    model = RobotModel.load(
        _awaited(node, robot) if names_topic(robot) else read_description(robot),
        base=BasePlacement(tuple(values['base_position']), **angles),
        wrist_frame=values['wrist_frame'],
        base_frame=values['base_frame'],
    )
    for remark in model.remarks:
        node.get_logger().warning(f'{model.urdf_path}: {remark}')
    return model


def names_topic(robot: str) -> bool:
    """
    Tell whether an arm is described on a topic.

    Args:
        robot: value of the parameter.

    Returns:
        Whether it is the absolute name of a topic and not the path of a file.

    """
    return TOPIC.fullmatch(robot) is not None and not Path(robot).exists()


def _awaited(node: HandoverNode, topic: str) -> Description:
    """Wait for the description that `robot_state_publisher` latches."""
    kind = message_class(ROBOT_DESCRIPTION.type_name)
    quality = qos_profile(ROBOT_DESCRIPTION.quality)
    subscription = node.create_subscription(kind, topic, lambda _message: None, quality)
    looks = 0
    try:
        # nothing spins this node yet
        while (taken := subscription.handle.take_message(kind, False)) is None:
            if told_to_end():
                raise EndedError(f'{node.NAME}: ended while waiting for {topic}')
            if looks % SAY_EVERY == 0:
                node.get_logger().info(f'waiting for the robot description on {topic}')
            looks += 1
            sleep(LOOK_S)
    finally:
        node.destroy_subscription(subscription)
    return Description(topic, '', Path(topic), str(taken[0].data))


def limits_told(model: RobotModel) -> dict[str, str]:
    """
    List the sources of the limits of an arm, for `/diagnostics`.

    Args:
        model: the arm.

    Returns:
        Quantity to source.

    """
    return {f'{quantity} limits from': origin for quantity, origin in model.limit_origins.items()}
