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

"""Parameters with description and range, declared in one call and changed all or none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from handover_dmp.common.errors import DataError, HandoverError, UsageError
from handover_dmp.common.plain_yaml import load_plain
from handover_dmp.common.ros_parameters import sections, unknown_parameter
from handover_dmp.common.settings import ANYWHERE, defaults, node_names
from handover_dmp.dmp.parameter_file import DURATION_SCALE
from handover_dmp.tracking import GoalEstimator, HandFilter
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

Values = dict[str, Any]
HAND_FILTER = 'hand_filter.'


@dataclass(frozen=True)
class Parameter:
    """
    One parameter of a node; its default stands in `config/handover.yaml`.

    Attributes:
        name: nested ones joined by dots.
        description: what it sets, with its unit.
        low: least value, of numbers.
        high: greatest value, of numbers.
        choices: the words it may be, of strings.
        read_only: whether it is fixed once the node runs.

    """

    name: str
    description: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    read_only: bool = False

    def descriptor(self, default: Any) -> ParameterDescriptor:
        """
        Say it as ROS does.

        Args:
            default: its default, which sets its type.

        Returns:
            The descriptor.

        """
        descriptor = ParameterDescriptor(description=self.description, read_only=self.read_only)
        if self.choices:
            descriptor.additional_constraints = 'one of: ' + ', '.join(self.choices)
        if self.low is not None and self.high is not None:
            if isinstance(default, float):
                descriptor.floating_point_range = [
                    FloatingPointRange(from_value=self.low, to_value=self.high)
                ]
            else:
                descriptor.integer_range = [
                    IntegerRange(from_value=int(self.low), to_value=int(self.high), step=1)
                ]
        return descriptor


COMMON = (
    Parameter('frame', 'of all positions', read_only=True),
    Parameter('lockstep', 'wait for each other on simulated time', read_only=True),
    Parameter(
        'lockstep_hand_period_s', 'how often the hand comes then, s', 0.001, 1.0, read_only=True
    ),
    Parameter('patience_s', 'how long to wait for another node then, s', 0.05, 600.0),
    Parameter(
        'executor', 'which executor of rclpy', choices=('events', 'default'), read_only=True
    ),
    Parameter(
        'thread_priority',
        'real-time (FIFO), where the system permits it; not in lockstep; 0: ordinary',
        0,
        99,
        read_only=True,
    ),
)


def _filter(
    name: str, description: str, low: float | None = None, high: float | None = None
) -> Parameter:
    return Parameter(HAND_FILTER + name, description, low, high, read_only=True)


HAND = (
    Parameter(
        'tracker.type', 'of the messages about the hand; empty: what they have', read_only=True
    ),
    Parameter(
        'tracker.body', 'name or number of the hand, where there are several', read_only=True
    ),
    Parameter('tracker.frame', "of the tracker's poses, if that is another", read_only=True),
    Parameter('tracker.position', 'of that frame in ours, m', read_only=True),
    Parameter('tracker.quaternion', 'from its axes to ours, x, y, z, w', read_only=True),
    Parameter(
        'hand_stamps',
        'time of a pose of the hand: of its header, or of its arrival',
        choices=('header', 'arrival'),
        read_only=True,
    ),
    _filter('acceleration_noise', 'of the hand, m/s2/sqrt(Hz)', 1e-6, 1e3),
    _filter('measurement_noise_m', 'of a pose, standard deviation, m', 1e-9, 1.0),
    _filter('outlier_distance_m', 'from what is expected, m', 1e-6, 100.0),
    _filter('hand_acceleration', 'widens that with time, m/s2', 0.0, 1e3),
    _filter('hand_speed', 'within which a hand that is back is believed at once, m/s', 1e-3, 1e3),
    _filter('reacquire_poses', 'that agree, before one further off is believed', 1, 1_000_000),
    _filter('frozen_s', 'a pose unchanged to the last bit for longer is frozen, s', 1e-3, 1e6),
    _filter('refuse_frozen', 'whether that is no pose; a replay at rest may be frozen'),
    _filter('max_deviation_m', 'of a covariance, beyond which there is no pose, m', 1e-6, 1e3),
    _filter('lost_s', 'without a pose, all is forgotten, s', 1e-3, 60.0),
    _filter('late_limit_s', 'age up to which late poses are used, s', 0.0, 10.0),
    _filter('prediction_limit_s', 'how far ahead the hand moves on, s', 0.0, 10.0),
    _filter('delay_s', 'how much too late poses are stamped, s', 0.0, 10.0),
)

ARM = (
    Parameter(
        'robot',
        'lwr4, iiwa14, panda, ur5, the path of a URDF or xacro, or the topic of a description',
        read_only=True,
    ),
    Parameter(
        'wrist_frame', 'link that follows the wrist; empty: by the description', read_only=True
    ),
    Parameter('base_frame', 'link that the arm begins at; empty: the root', read_only=True),
    Parameter('base_position', 'of the robot in the room, m', read_only=True),
    Parameter('base_roll', 'about x, the first of three turns, rad', -6.3, 6.3, read_only=True),
    Parameter('base_pitch', 'about y, the second, rad', -6.3, 6.3, read_only=True),
    Parameter('base_yaw', 'about z, the last, rad', -6.3, 6.3, read_only=True),
)

DRIVER = (
    Parameter(
        'joint_prefix', 'what the driver puts before the names of the joints', read_only=True
    ),
)


def declare(
    node: Node, parameters: Sequence[Parameter], *, defaults_from: Values | None = None
) -> Values:
    """
    Declare parameters with the defaults of `config/handover.yaml`.

    Args:
        node: whose section it is, by its class's `NAME`.
        parameters: what to declare.
        defaults_from: other defaults than those of `config/handover.yaml`.

    Returns:
        Name to value.

    Raises:
        UsageError: a value given at the start is of the wrong type, out of range or no choice.

    """
    section = defaults(node.NAME) if defaults_from is None else defaults_from
    values: Values = {}
    for parameter in parameters:
        default = section[parameter.name]
        try:
            declared = node.declare_parameter(
                parameter.name, default, parameter.descriptor(default)
            )
        except Exception as error:
            raise UsageError(f'{node.NAME}: parameter {parameter.name}: {error}') from error
        values[parameter.name] = declared.value
    fault = _wrong_choice(parameters, values)
    if fault:
        raise UsageError(f'{node.NAME}: {fault}')
    return values


def goal_estimator(values: Values) -> GoalEstimator:
    """
    Make the estimator of the hand that a node's parameters describe.

    Args:
        values: of the parameters `HAND`.

    Returns:
        The estimator; it knows of no hand yet.

    """
    named = {
        name.removeprefix(HAND_FILTER): value
        for name, value in values.items()
        if name.startswith(HAND_FILTER)
    }
    return GoalEstimator(HandFilter(**named))


WITHOUT_DEFAULT = ('initial_positions',)
"""Parameters whose default the arm has, and not `config/handover.yaml`."""


def check_names(node: Node, arguments: Sequence[str]) -> None:
    """
    Refuse a parameter file that gives the node a parameter which it does not have.

    Args:
        node: the node, by its class's `NAME`.
        arguments: words of the process; files are those after `--params-file`.

    Raises:
        UsageError: such a name in a section of this node; in one of many nodes, a name that is
            nearly the one of a parameter, for others may have those that are not.

    """
    own = {*defaults(node.NAME), DURATION_SCALE, *WITHOUT_DEFAULT}
    everybody = own.union(*(defaults(name) for name in node_names()))
    for option, file in pairwise(arguments):
        if option != '--params-file':
            continue
        try:
            found = sections(load_plain(Path(file).read_text(encoding='utf-8')))
        except (DataError, OSError, UnicodeDecodeError):
            # What rcl understands and this does not, it has read already.
            continue
        name = node.get_fully_qualified_name()
        meant = [s.node for s in found if s.node.rpartition('/')[2] == node.get_name()]
        if meant and not any(section.is_for(name) for section in found if section.node in meant):
            node.get_logger().warning(
                f'{file}: {", ".join(meant)} is not for {name}, which is in another namespace: '
                f'{ANYWHERE}{node.get_name()} would be'
            )
        for section in found:
            if section.is_for(name):
                many = section.is_for_many
                fault = unknown_parameter(
                    section.values, everybody if many else own, for_many=many
                )
                if fault:
                    raise UsageError(f'{node.NAME}: {file}: {section.node}: {fault}')


def on_change(
    node: Node, parameters: Sequence[Parameter], prepare: Callable[[Values], Callable[[], None]]
) -> None:
    """
    Let parameters be changed while the node runs, all of one request or none.

    Args:
        node: the node.
        parameters: those it declared.
        prepare: gets every value, the new ones among them, and either returns what takes them
            all, once nobody else has refused the request, or raises a `HandoverError` or
            `ValueError`.

    """
    prepared: list[Callable[[], None]] = []

    def changed(requested: list[RosParameter]) -> SetParametersResult:
        values = {
            parameter.name: node.get_parameter(parameter.name).value for parameter in parameters
        }
        values.update({r.name: r.value for r in requested if r.name in values})
        fault = _wrong_choice(parameters, values)
        if fault:
            return SetParametersResult(successful=False, reason=fault)
        try:
            prepared[:] = [prepare(values)]
        except (HandoverError, ValueError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def apply(_set: list[RosParameter]) -> None:
        while prepared:
            prepared.pop()()

    node.add_on_set_parameters_callback(changed)
    node.add_post_set_parameters_callback(apply)


def _wrong_choice(parameters: Sequence[Parameter], values: Values) -> str:
    for parameter in parameters:
        value = values[parameter.name]
        if parameter.choices and value not in parameter.choices:
            return f'{parameter.name} is {value!r}, not one of {", ".join(parameter.choices)}'
    return ''
