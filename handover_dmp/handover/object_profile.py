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

"""
The carried object and its effect on the handover: a cup stays level, a knife goes handle first.

A profile changes the learnt movement if necessary (pace, goal offset, rotation of the wrist) and
provides the orientation task, the acceleration limit, the mass and the drawing. Defaults are in
`config/objects.yaml`; the rod changes nothing.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError, UsageError
from handover_dmp.common.plain_yaml import load_plain, read_plain
from handover_dmp.common.resources import share_path
from handover_dmp.common.settings import defaults
from handover_dmp.dmp import DecoupledDmp
from handover_dmp.handover.approach import ApproachOptions
from handover_dmp.handover.controller import HandoverOptions
from handover_dmp.robot.orientation_task import ORIENTATIONS
import numpy as np

DEFAULT_OBJECT = 'rod'
LEARNT = 'learnt'
SHAPES = ('rod', 'cup', 'knife', 'box')
LARGEST_FILE_BYTES = 100_000
RANGES = {
    'slows_to': (0.05, 1.0),
    'duration_scale': (1.0, 5.0),
    'acceleration_limit': (0.0, 1000.0),
    'standoff_m': (-0.5, 1.0),
    'hands_apart_m': (0.0, 2.0),
    'mass_kg': (0.01, 20.0),
}
MIN_ACCELERATION = 0.1
"""The smallest limit that the `dmp` node accepts, m/s²."""


@dataclass(frozen=True)
class ObjectProfile:
    """
    Profile of a carried object.

    Attributes:
        name: name of the profile.
        orientation: orientation task of the wrist, one of `ORIENTATIONS`, or `learnt`: `full` if
            the movement has learnt the rotation of the wrist, otherwise as in
            `config/handover.yaml`.
        slows_to: share of its speed to which the wrist may be slowed to keep the orientation;
            1: not slowed.
        duration_scale: factor on the duration of the reach.
        acceleration_limit: limit of the wrist command, m/s²; 0: that of `config/handover.yaml`.
        standoff_m: extra distance of the wrist from the partner's hand, m.
        hands_apart_m: distance between the two hands of the partner that take it, m; 0: one hand.
        mass_kg: mass in the simulation, kg.
        shape: shape of its drawing, one of `SHAPES`.
        size_m: width, depth and length, m.
        colour: red, green, blue, 0 to 1.

    Raises:
        DataError: a word is unknown, or a number is out of range.

    """

    name: str
    orientation: str
    slows_to: float
    duration_scale: float
    acceleration_limit: float
    standoff_m: float
    hands_apart_m: float
    mass_kg: float
    shape: str
    size_m: tuple[float, ...]
    colour: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check words and numbers."""
        words = (('orientation', (LEARNT, *ORIENTATIONS)), ('shape', SHAPES))
        for name, known in words:
            if getattr(self, name) not in known:
                given = getattr(self, name)
                raise DataError(f'{name} is {given!r}, not one of {", ".join(known)}')
        for name, (low, high) in RANGES.items():
            value = getattr(self, name)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not (number and low <= value <= high):
                raise DataError(f'{name} is {value!r}; it must be from {low:g} to {high:g}')
            object.__setattr__(self, name, float(value))
        if 0.0 < self.acceleration_limit < MIN_ACCELERATION:
            raise DataError(f'acceleration_limit is below {MIN_ACCELERATION:g} m/s2')
        for name, high in (('size_m', 2.0), ('colour', 1.0)):
            object.__setattr__(self, name, _three(name, getattr(self, name), high))

    def task_for(self, movement: DecoupledDmp) -> str:
        """
        Return the orientation task of the wrist.

        Args:
            movement: the movement.

        Returns:
            One of `ORIENTATIONS`.

        """
        if self.orientation != LEARNT:
            return self.orientation
        task: str = defaults('priority_ik')['orientation']
        return task if movement.turn is None else 'full'

    def node_parameters(self, movement: DecoupledDmp) -> dict[str, dict[str, Any]]:
        """
        Return the parameters that the nodes need besides the movement.

        Args:
            movement: the movement.

        Returns:
            For `dmp` and `priority_ik`, name to value, as far as it is not the default.

        """
        limits = {
            'acceleration_limit': self.acceleration,
            'approach.stopping_limit': self.stopping_limit,
        }
        tasks = {'orientation': self.task_for(movement), 'orientation_slows_to': self.slows_to}
        return {
            node: {name: value for name, value in asked.items() if value != defaults(node)[name]}
            for node, asked in (('dmp', limits), ('priority_ik', tasks))
        }

    @property
    def acceleration(self) -> float:
        """Limit on the acceleration of the wrist command, m/s²."""
        limit: float = self.acceleration_limit or defaults('dmp')['acceleration_limit']
        return limit

    @property
    def stopping_limit(self) -> float:
        """Return it for a hand that stops abruptly, m/s²: better a spilt cup than a hit hand."""
        usual = defaults('dmp')
        own: float = usual['approach.stopping_limit']
        return max(own, usual['acceleration_limit']) if self.acceleration_limit else own

    def handover_options(self, partner_model: str) -> HandoverOptions:
        """
        Return the rules of a handover that carries the object.

        Args:
            partner_model: `auto` or `off`.

        Returns:
            The rules of `config/handover.yaml` with the limits of the object.

        """
        return HandoverOptions(
            partner_model=partner_model,
            acceleration_limit=self.acceleration,
            approach=ApproachOptions(stopping_limit=self.stopping_limit),
        )

    def movement_with(self, movement: DecoupledDmp) -> DecoupledDmp:
        """
        Return the movement that carries the object.

        Args:
            movement: the learnt movement.

        Returns:
            The movement with the pace and goal offset of the object, and without the learnt turn
            if the object has an orientation of its own. `movement` itself if nothing changes.

        """
        if self.duration_scale != 1.0:
            movement = _slower(movement, self.duration_scale)
        if self.standoff_m or self.hands_apart_m:
            movement = movement.with_goal_offset(movement.goal_offset + self._farther(movement))
        if self.orientation != LEARNT and movement.turn is not None:
            movement = movement.with_turn(None)
        return movement

    def _farther(self, movement: DecoupledDmp) -> Array:
        """Return the shift of the goal: back, and to the middle between two hands."""
        forward = (movement.goal - movement.start) * [1.0, 1.0, 0.0]
        length = float(np.linalg.norm(forward))
        if length < 1e-6:
            raise DataError('the learnt reach is vertical, so the forward direction is undefined')
        forward /= length
        # the right hand is tracked; the other is to the left of the partner, who faces the robot
        across = np.cross(forward, [0.0, 0.0, 1.0])
        farther: Array = 0.5 * self.hands_apart_m * across - self.standoff_m * forward
        return farther

    def as_dict(self) -> dict[str, Any]:
        """Return the fields as plain types, for `/handover/info`."""
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in asdict(self).items()
        }


def object_names() -> tuple[str, ...]:
    """Return the names of the objects in `config/objects.yaml`."""
    return tuple(_profiles())


def object_profile(name: str) -> ObjectProfile:
    """
    Return the profile of an object.

    Args:
        name: name of an object in `config/objects.yaml`, or path of a `.yaml` file with one.

    Returns:
        Its profile.

    Raises:
        UsageError: there is no such object.
        DataError: the file cannot be used.

    """
    if name.endswith(('.yaml', '.yml')):
        return _read(Path(name))
    if name not in _profiles():
        known = ', '.join(object_names())
        raise UsageError(
            f'object {name!r} is unknown: give one of {known}, or a .yaml file in the format of '
            'config/objects.yaml'
        )
    return _profiles()[name]


@cache
def _profiles() -> dict[str, ObjectProfile]:
    tree = load_plain(share_path('config/objects.yaml').read_text(encoding='utf-8'))
    return {name: _profile(name, {**tree[DEFAULT_OBJECT], **own}) for name, own in tree.items()}


def _read(path: Path) -> ObjectProfile:
    tree = read_plain(path, LARGEST_FILE_BYTES)
    if not isinstance(tree, dict) or len(tree) != 1:
        raise DataError(f'{path}: must hold one object: its name, and its fields below that')
    [(name, own)] = tree.items()
    if not isinstance(own, dict):
        raise DataError(f'{path}: object {name!r} has no fields')
    known = _profiles()[DEFAULT_OBJECT].as_dict()
    try:
        return _profile(str(name), {**known, **own, 'name': str(name)})
    except DataError as error:
        raise DataError(f'{path}: {error}') from error


def _profile(name: str, values: dict[str, Any]) -> ObjectProfile:
    known = {each.name for each in fields(ObjectProfile)}
    if unknown := sorted(set(map(str, values)) - known):
        raise DataError(
            f'object {name}: unknown field {unknown[0]!r}; known: {", ".join(sorted(known))}'
        )
    return ObjectProfile(**{**values, 'name': name})


def _three(name: str, given: Any, high: float) -> tuple[float, ...]:
    try:
        numbers = tuple(map(float, given))
    except (TypeError, ValueError) as error:
        raise DataError(f'{name} is not three numbers') from error
    if len(numbers) != 3 or not all(isfinite(x) and 0.0 <= x <= high for x in numbers):
        raise DataError(f'{name} is not three numbers from 0 to {high:g}')
    return numbers


def _slower(movement: DecoupledDmp, scale: float) -> DecoupledDmp:
    """Stretch the movement, but not the partner path: the partner's pace does not change."""
    path = movement.partner_path
    if path is not None:
        nodes = np.linspace(0.0, 1.0, len(path))
        at = np.minimum(nodes * scale, 1.0)
        path = np.column_stack([np.interp(at, nodes, column) for column in path.T])
    return movement.with_duration(scale * movement.duration_s).with_partner_path(path)
