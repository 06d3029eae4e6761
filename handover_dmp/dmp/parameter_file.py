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

"""The ROS parameter file that `tune` writes, and `learn`, `evaluate` and the `dmp` node read."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
import math
from pathlib import Path
from typing import Any

from handover_dmp.common.errors import DataError
from handover_dmp.common.files import write_text
from handover_dmp.common.plain_yaml import read_plain
from handover_dmp.common.ros_parameters import (
    merged,
    ParameterSection,
    sections,
    unknown_parameter,
)
from handover_dmp.common.settings import ANYWHERE, defaults, node_names, parameters_of
from handover_dmp.dmp import DmpParameters
import yaml

NODE = 'dmp'
DURATION_SCALE = 'duration_scale'
LARGEST_FILE_BYTES = 200_000


@dataclass(frozen=True)
class TunedParameters:
    """
    The content of a parameter file about the movement primitive.

    Attributes:
        primitive: parameters of the equations.
        duration_scale: factor on the learnt duration. It is applied to the model, so the node has
            no such parameter and ignores it.

    """

    primitive: DmpParameters = field(default_factory=DmpParameters)
    duration_scale: float = 1.0


def write_parameters(parameters: TunedParameters, path: Path, comment: str = '') -> None:
    """
    Write the parameters of the primitive for `--params-file` and `--parameters`.

    Args:
        parameters: what to write.
        path: the file.
        comment: lines of a comment at the top, without `#`.

    """
    section = {**asdict(parameters.primitive), DURATION_SCALE: parameters.duration_scale}
    head = ''.join(f'# {line}'.rstrip() + '\n' for line in comment.splitlines())
    tree = {ANYWHERE + NODE: {'ros__parameters': section}}
    write_text(path, head + yaml.safe_dump(tree, sort_keys=False))


def read_parameters(path: Path) -> TunedParameters:
    """
    Read the parameters of the primitive from a ROS parameter file.

    Args:
        path: the file; its sections are merged for the node `dmp` as rcl does. Other parameters of
            the node are ignored, and missing ones have their defaults.

    Returns:
        The parameters.

    Raises:
        DataError: the file is missing, is not a ROS parameter file with a section for `dmp`, or
            has a parameter that is unknown or out of range.

    """
    section = _section(path, sections(read_plain(path, LARGEST_FILE_BYTES)))
    given = parameters_of(DmpParameters, section)
    scale = section.get(DURATION_SCALE, 1.0)
    if not isinstance(scale, (int, float)) or not 0.0 < scale < math.inf:
        raise DataError(f'{path}: {DURATION_SCALE} is not a number above 0')
    try:
        return TunedParameters(replace(DmpParameters(), **given), float(scale))
    except (DataError, OverflowError) as error:
        raise DataError(f'{path}: {error}') from error


def _section(path: Path, found: list[ParameterSection]) -> dict[str, Any]:
    """Return the parameters of the node `dmp`, whatever its namespace."""
    nodes = {
        section.node
        for section in found
        if '*' not in section.node and section.node.rpartition('/')[2] == NODE
    }
    node = f'/{NODE}'
    if nodes and node not in nodes:
        if len(nodes) > 1:
            raise DataError(
                f'{path}: sections for several nodes, {", ".join(sorted(nodes))}: keep only one'
            )
        (node,) = nodes
    matching = [section for section in found if section.is_for(node)]
    if not matching:
        raise DataError(f'{path}: no section {NODE}: ros__parameters:')
    own = {*defaults(NODE), DURATION_SCALE}
    everybody = own.union(*(defaults(name) for name in node_names()))
    for section in matching:
        many = section.is_for_many
        fault = unknown_parameter(section.values, everybody if many else own, for_many=many)
        if fault:
            raise DataError(f'{path}: {section.node}: {fault}')
    return merged(matching, node)
