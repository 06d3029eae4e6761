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
The effective limits of the joints of an arm, and their sources.

The description takes precedence: the table of `config/robots.yaml` may lower a limit, but not
raise it, unless the arm was requested by its name there. A value that cannot be a limit (0, 1000
or more, none) is a placeholder; the value of the table or a cautious default replaces it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from xml.etree import ElementTree

from handover_dmp.robot.errors import RobotDescriptionError
from handover_dmp.robot.limits import JointLimits
import numpy as np

Element = ElementTree.Element

PLACEHOLDER = 1e3
"""Values from here on are placeholders: rad, m, rad/s, m/s (an effort may be that large)."""
MIN_RANGE = 1e-3
"""Range, rad or m, below which a joint counts as fixed."""
FILE = 'description'
SOFT = 'safety_controller'
DEFAULT = 'default'
ENDLESS = 'continuous'
QUANTITIES = ('velocity', 'effort', 'acceleration', 'jerk')


@dataclass(frozen=True)
class DefaultLimits:
    """
    Defaults for values that neither the description nor the table provides.

    Attributes:
        position_rad: limit of a revolute joint to either side, rad.
        velocity: rad/s.
        prismatic_velocity: m/s.
        acceleration: rad/s² or m/s².
        effort: Nm or N.
        jerk_time_s: time from zero to full acceleration, s.

    """

    position_rad: float
    velocity: float
    prismatic_velocity: float
    acceleration: float
    effort: float
    jerk_time_s: float


@dataclass(frozen=True)
class KnownLimits:
    """
    The values of the table for the joints of an arm.

    Attributes:
        name: name of the arm there.
        rules: whether only the table counts, because the arm was requested by that name.
        joints: joint name to quantity to value.

    """

    name: str = ''
    rules: bool = False
    joints: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class EffectiveLimits:
    """
    The effective limits, and their sources.

    Attributes:
        limits: limits of the joints, in order.
        sources: `position`, `velocity`, `effort`, `acceleration` and `jerk` to the source of that
            limit for each joint.
        remarks: placeholders in the description, and what replaces them.

    """

    limits: JointLimits
    sources: Mapping[str, tuple[str, ...]]
    remarks: tuple[str, ...]


def effective_limits(
    joints: Sequence[Element], known: KnownLimits, defaults: DefaultLimits, origin: str
) -> EffectiveLimits:
    """
    Find the effective limits.

    Args:
        joints: `<joint>` elements of a description.
        known: their values in the table.
        defaults: values for everything else.
        origin: origin of the description, for error messages.

    Returns:
        The limits, their sources, and remarks.

    Raises:
        RobotDescriptionError: a joint cannot move, or a prismatic joint has no position limits.

    """
    placeholders: dict[str, list[str]] = {}
    ranges = [_range(joint, defaults, origin, placeholders) for joint in joints]
    columns = {'lower': [r[0] for r in ranges], 'upper': [r[1] for r in ranges]}
    sources = {'position': tuple(r[2] for r in ranges)}
    for quantity in QUANTITIES:
        default = [_default(quantity, joint, defaults) for joint in joints]
        if quantity == 'jerk':
            default = [a / defaults.jerk_time_s for a in columns['acceleration']]
        chosen = [
            _choose(joint, quantity, known, fallback, placeholders)
            for joint, fallback in zip(joints, default, strict=True)
        ]
        columns[quantity] = [value for value, _ in chosen]
        sources[quantity] = tuple(source for _, source in chosen)
    arrays = {name: np.array(values, dtype=float) for name, values in columns.items()}
    for array in arrays.values():
        array.flags.writeable = False
    remarks = tuple(
        f'{what}{"s" if len(names) > 1 else ""} {", ".join(names)}'
        for what, names in placeholders.items()
    )
    return EffectiveLimits(JointLimits(**arrays), sources, remarks)


def source_summary(
    sources: Mapping[str, Sequence[str]], joint_names: Sequence[str]
) -> dict[str, str]:
    """
    Describe the sources of limits.

    Args:
        sources: `sources` of `EffectiveLimits`.
        joint_names: in the same order.

    Returns:
        Quantity to its source, or to its sources with the joints of each.

    """
    found = {}
    for quantity, by_joint in sources.items():
        joints: dict[str, list[str]] = {}
        for source, name in zip(by_joint, joint_names, strict=True):
            joints.setdefault(source, []).append(name)
        found[quantity] = '; '.join(
            source if len(joints) == 1 else f'{source}: {", ".join(names)}'
            for source, names in joints.items()
        )
    return found


def _default(quantity: str, joint: Element, defaults: DefaultLimits) -> float:
    if quantity == 'velocity' and joint.get('type') == 'prismatic':
        return defaults.prismatic_velocity
    return float(getattr(defaults, quantity, 0.0))


def _choose(
    joint: Element,
    quantity: str,
    known: KnownLimits,
    default: float,
    placeholders: dict[str, list[str]],
) -> tuple[float, str]:
    """Return the limit and its source."""
    limit = joint.find('limit')
    text = None if limit is None else limit.get(quantity)
    given = None if text is None else float(text)
    name = str(joint.get('name'))
    told = known.joints.get(name, {}).get(quantity)
    table = f'config/robots.yaml ({known.name})'
    if told is not None and known.rules:
        return told, table
    if given is not None and 0.0 < given < (inf if quantity == 'effort' else PLACEHOLDER):
        return (given, FILE) if told is None or given <= told else (told, table)
    value, source = (default, DEFAULT) if told is None else (told, table)
    # a URDF has no accelerations; the other two are mandatory
    if quantity in ('velocity', 'effort') or given is not None:
        was = 'missing' if given is None else f'{given:g}'
        what = f'{quantity} limit {was} is a placeholder, replaced by {value:.4g} ({source})'
        placeholders.setdefault(f'{what}: joint', []).append(name)
    return value, source


def _range(
    joint: Element, defaults: DefaultLimits, origin: str, placeholders: dict[str, list[str]]
) -> tuple[float, float, str]:
    """Return lower and upper position limit and their source."""
    name = joint.get('name')
    if joint.get('type') == 'continuous':
        lower, upper, source = -inf, inf, ENDLESS
    else:
        lower, upper, source = _hard_range(joint, defaults, origin, placeholders)
    soft = joint.find('safety_controller')
    given = {} if soft is None else soft.attrib
    soft_lower, soft_upper = (given.get(f'soft_{side}_limit') for side in ('lower', 'upper'))
    # some files set both to 0 because they only need the controller's gains
    if any(float(end or 0.0) for end in (soft_lower, soft_upper)):
        within = lower, upper
        lower = lower if soft_lower is None else max(lower, float(soft_lower))
        upper = upper if soft_upper is None else min(upper, float(soft_upper))
        source = source if (lower, upper) == within else SOFT
    if not upper - lower >= MIN_RANGE:
        raise RobotDescriptionError(
            f'{origin}: joint {name!r} cannot move: its lower position limit is '
            f'{lower:g}, its upper one {upper:g}'
        )
    return lower, upper, source


def _hard_range(
    joint: Element, defaults: DefaultLimits, origin: str, placeholders: dict[str, list[str]]
) -> tuple[float, float, str]:
    limit = joint.find('limit')
    given = {} if limit is None else limit.attrib
    lower, upper = float(given.get('lower', 0.0)), float(given.get('upper', 0.0))
    nothing = lower == upper == 0.0
    lower_says, upper_says = (not nothing and abs(end) < PLACEHOLDER for end in (lower, upper))
    if lower_says and upper_says:
        return lower, upper, FILE
    was = 'missing' if not {'lower', 'upper'} & set(given) else f'{lower:g} to {upper:g}'
    if joint.get('type') == 'prismatic':
        raise RobotDescriptionError(
            f'{origin}: joint {joint.get("name")!r} has no position limits ({was}); '
            'set them with <limit lower= upper=>'
        )
    value = defaults.position_rad
    what = f'position limits {was} are placeholders, replaced by ±{value:.4g} rad (default)'
    placeholders.setdefault(f'{what}: joint', []).append(str(joint.get('name')))
    source = f'{FILE}, {DEFAULT}' if lower_says or upper_says else DEFAULT
    return lower if lower_says else -value, upper if upper_says else value, source
