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

from array import array
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
import json
from pathlib import Path
from typing import Any

from handover_dmp.common.errors import DataError, HandoverError, UsageError
from handover_dmp.common.plain_yaml import load_plain
from handover_dmp.common.ros_parameters import sections, unknown_parameter
from handover_dmp.common.settings import ANYWHERE, defaults, node_names, Setting, settings_of
from handover_dmp.dmp.parameter_file import DURATION_SCALE
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    ParameterType,
    SetParametersResult,
)
from rcl_interfaces.msg import (
    Parameter as ParameterMessage,
)
from rclpy.node import Node
from rclpy.parameter import get_parameter_value
from rclpy.parameter import Parameter as RosParameter
import yaml

Values = dict[str, Any]
OFF = 'off'


@dataclass(frozen=True)
class Parameter(Setting):
    """One parameter of a node; its default stands in `config/handover.yaml`."""

    def descriptor(self, default: Any) -> ParameterDescriptor:
        """
        Make the descriptor of ROS.

        Args:
            default: default value, which sets the type.

        Returns:
            The descriptor.

        """
        descriptor = ParameterDescriptor(
            description=self.description,
            read_only=self.read_only,
            dynamic_typing=OFF in self.choices,
        )
        if self.choices:
            descriptor.additional_constraints = 'one of: ' + ', '.join(self.choices)
        if self.low is not None and self.high is not None:
            if isinstance(default, float):
                floats = FloatingPointRange(from_value=self.low, to_value=self.high)
                descriptor.floating_point_range = [floats]
            else:
                whole = IntegerRange(from_value=int(self.low), to_value=int(self.high), step=1)
                descriptor.integer_range = [whole]
        return descriptor

    def meant(self, value: Any) -> Any:
        """
        Read a bare `off` as the word; YAML reads it as false.

        Args:
            value: value from ROS.

        Returns:
            The intended value.

        """
        return OFF if value is False and OFF in self.choices else value


fixed = partial(Parameter, read_only=True)
"""Makes a parameter that does not change while the node runs."""


def parameters_from(*kinds: type[Any], names: Collection[str] = ()) -> tuple[Parameter, ...]:
    """
    Collect the parameters of dataclasses.

    Args:
        kinds: dataclasses with fields made by `setting`.
        names: names of the parameters to collect; default: all.

    Returns:
        The parameters, each once.

    """
    found = {
        what.name: Parameter(**vars(what)) for kind in kinds for what in settings_of(kind).values()
    }
    return tuple(one for name, one in found.items() if not names or name in names)


COMMON = (
    fixed('frame', 'Frame of all positions'),
    fixed('lockstep', 'Whether the nodes wait for each other on simulated time'),
    Parameter('patience_s', 'Maximum time to wait for another node in lockstep, s', 0.05, 600.0),
    fixed(
        'executor',
        'Executor of rclpy: events, or default (single-threaded)',
        choices=('events', 'default'),
    ),
    fixed(
        'thread_priority',
        'Real-time priority (FIFO), if the system permits it; ignored in lockstep; 0: ordinary '
        'scheduling',
        0,
        99,
    ),
)


ARM = (
    fixed(
        'robot',
        'Robot: lwr4, iiwa14, panda, ur5, the path of a URDF or xacro file, or the topic of a '
        'description',
    ),
    fixed('wrist_frame', 'Link that follows the wrist; empty: found from the description'),
    fixed('base_frame', 'First link of the arm; empty: the root of the description'),
    fixed('base_position', 'Position of the robot base in the room, m'),
    fixed('base_roll', 'Rotation of the robot base about x, applied first, rad', -6.3, 6.3),
    fixed('base_pitch', 'Rotation of the robot base about y, applied second, rad', -6.3, 6.3),
    fixed('base_yaw', 'Rotation of the robot base about z, applied last, rad', -6.3, 6.3),
)

DRIVER = (fixed('joint_prefix', 'Prefix of the joint names of the driver'),)


def declare(
    node: Node, parameters: Sequence[Parameter], *, defaults_from: Values | None = None
) -> Values:
    """
    Declare parameters with the defaults of `config/handover.yaml`.

    Args:
        node: node; its class's `NAME` is the section.
        parameters: parameters to declare.
        defaults_from: defaults in place of those of `config/handover.yaml`.

    Returns:
        Name to value.

    Raises:
        UsageError: a value has the wrong type, is out of range or not one of the choices.

    """
    section = defaults(node.NAME) if defaults_from is None else defaults_from
    values: Values = {}
    for parameter in parameters:
        default = section[parameter.name]
        try:
            values[parameter.name] = _declare(node, parameter, default)
        except Exception as error:
            raise UsageError(f'{node.NAME}: parameter {parameter.name}: {error}') from error
    fault = _wrong_choice(parameters, values)
    if fault:
        raise UsageError(f'{node.NAME}: {fault}')
    return values


def _declare(node: Node, parameter: Parameter, default: Any) -> Any:
    descriptor = parameter.descriptor(default)
    if not isinstance(default, str):
        return node.declare_parameter(parameter.name, default, descriptor).value
    # written before it becomes read-only, in the form that a dump needs
    free = ParameterDescriptor(
        description=parameter.description, dynamic_typing=descriptor.dynamic_typing
    )
    value = node.declare_parameter(parameter.name, default, free).value
    text = unquoted(str(parameter.meant(value)))
    if quoted(text) != value:
        node.set_parameters([RosParameter(parameter.name, value=quoted(text))])
    descriptor.type = ParameterType.PARAMETER_STRING
    node.set_descriptor(parameter.name, descriptor)
    return text


def quoted(text: str) -> str:
    """
    Quote a text that `ros2 param load` would not read as a value.

    It parses each value of a file as YAML again: JSON would become a mapping.

    Args:
        text: value of a parameter.

    Returns:
        A text that is read as `text`.

    """
    try:
        read = yaml.safe_load(text)
    except yaml.parser.ParserError:
        return text
    except yaml.YAMLError:
        read = {}
    kept = read is None or isinstance(read, (str, bool, int, float, list))
    return text if kept else json.dumps(text, ensure_ascii=False)


def unquoted(text: str) -> str:
    """
    Undo `quoted`.

    Args:
        text: value of a parameter.

    Returns:
        The text within the quotes; unchanged if `quoted` has not added any.

    """
    if text.startswith('"'):
        with suppress(ValueError):
            inner = json.loads(text)
            if isinstance(inner, str) and quoted(inner) == text:
                return inner
    return text


def is_as_it_was(wanted: RosParameter, present: RosParameter) -> bool:
    """
    Tell whether a parameter already has a value, as it is or as `ros2 param load` reads it.

    Args:
        wanted: the requested value.
        present: the current value.

    Returns:
        Whether nothing would change.

    """
    value = present.value
    plain = list(value) if isinstance(value, (array, list, tuple)) else value
    read = ParameterMessage(name=present.name, value=get_parameter_value(str(plain)))
    alike = (present, RosParameter.from_parameter_msg(read))
    return any(wanted.type_ == one.type_ and wanted.value == one.value for one in alike)


TRACKER = 'tracker.'
"""Default prefix of the parameters of a tracker."""


def is_of_tracker(name: str) -> bool:
    """
    Tell whether a parameter is one that each tracker has.

    Args:
        name: name of the parameter, with any name of a tracker.

    Returns:
        Whether each tracker has it.

    """
    _, _, of_tracker = name.partition('.')
    known = {*defaults('dmp'), *defaults('hand_tracker')}
    return TRACKER + of_tracker in known or (of_tracker in known and of_tracker != name)


WITHOUT_DEFAULT = ('initial_positions',)
"""Parameters whose default comes from the arm, not from `config/handover.yaml`."""


def check_names(node: Node, arguments: Sequence[str], own: Collection[str] = ()) -> None:
    """
    Refuse parameters that the node does not have.

    Args:
        node: the node, by its class's `NAME`.
        arguments: arguments of the process; files follow `--params-file`, single parameters
            follow `-p`.
        own: its parameters besides those of `config/handover.yaml`.

    Raises:
        UsageError: an unknown name after `-p` or in a section of this node; in a section of many
            nodes only a name that is nearly a known one, since other nodes may have the rest.

    """
    own = {*defaults(node.NAME), DURATION_SCALE, *WITHOUT_DEFAULT, *own}
    for option, word in pairwise(arguments):
        fault = ''
        if option in ('-p', '--param'):
            fault = _single_fault(node, word, own)
        elif option == '--params-file':
            fault = _file_fault(node, word, own)
        if fault:
            raise UsageError(f'{node.NAME}: {word}: {fault}')


def _single_fault(node: Node, word: str, own: Collection[str]) -> str:
    """Return the fault of `name:=value`, or of `node:name:=value`."""
    meant, _, name = word.partition(':=')[0].rpartition(':')
    if meant.rpartition('/')[2] not in ('', node.get_name()):
        return ''
    return unknown_parameter([name], own)


def _file_fault(node: Node, file: str, own: Collection[str]) -> str:
    try:
        found = sections(load_plain(Path(file).read_text(encoding='utf-8')))
    except (DataError, OSError, UnicodeDecodeError):
        # rcl has already read what it understands and this parser does not.
        return ''
    name = node.get_fully_qualified_name()
    meant = [s.node for s in found if s.node.rpartition('/')[2] == node.get_name()]
    if meant and not any(section.is_for(name) for section in found if section.node in meant):
        node.get_logger().warning(
            f'{file}: {", ".join(meant)} does not apply to {name}, which is in another namespace: '
            f'use {ANYWHERE}{node.get_name()}'
        )
    everybody = set(own).union(*(defaults(other) for other in node_names()))
    for section in found:
        if section.is_for(name):
            many = section.is_for_many
            # parameters of trackers may be meant for other nodes
            names = [each for each in section.values if not (many and is_of_tracker(each))]
            fault = unknown_parameter(names, everybody if many else own, for_many=many)
            if fault:
                return f'{section.node}: {fault}'
    return ''


def on_change(
    node: Node, parameters: Sequence[Parameter], prepare: Callable[[Values], Callable[[], None]]
) -> None:
    """
    Accept changes of parameters while the node runs, all of a request or none.

    Args:
        node: the node.
        parameters: its declared parameters.
        prepare: gets all values, including the new ones. It returns a function that applies
            them once the request is accepted, or raises a `HandoverError` or `ValueError`.

    """
    prepared: list[Callable[[], None]] = []

    def changed(requested: list[RosParameter]) -> SetParametersResult:
        new = {wanted.name: wanted for wanted in requested}
        values = {
            one.name: one.meant((new.get(one.name) or node.get_parameter(one.name)).value)
            for one in parameters
        }
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
