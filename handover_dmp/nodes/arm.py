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

"""The arm of a node: chosen by its parameters, said to whoever looks."""

from __future__ import annotations

from handover_dmp.nodes.node import HandoverNode
from handover_dmp.robot.model import BasePlacement, RobotModel


def load_arm(node: HandoverNode) -> RobotModel:
    """
    Load the arm that the parameters of a node choose, and log what is to be known about it.

    Args:
        node: declares `ARM`.

    Returns:
        The arm, in its place.

    Raises:
        RobotDescriptionError: its description cannot be used.

    """
    values = node.values
    angles = {name: values[f'base_{name}'] for name in ('roll', 'pitch', 'yaw')}
    base = BasePlacement(tuple(values['base_position']), **angles)
    model = RobotModel.load(values['robot'], base=base)
    for remark in model.remarks:
        node.get_logger().warning(f'{model.urdf_path}: {remark}')
    return model


def limits_told(model: RobotModel) -> dict[str, str]:
    """
    Say where the limits of an arm come from, for `/diagnostics`.

    Args:
        model: the arm.

    Returns:
        Text by text.

    """
    return {f'{quantity} limits from': origin for quantity, origin in model.limit_origins.items()}
