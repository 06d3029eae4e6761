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
Which limits hold for the joints of an arm, and where each of them comes from.

The description's word counts: the table of `config/robots.yaml` makes a limit of it smaller, never
greater, unless the arm was asked for by its name there. What cannot be a limit (0, a thousand and
more, nothing at all) is a placeholder; the table's value takes its place, or a cautious default.
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
"""From here on a number limits nothing: rad, m, rad/s, m/s (an effort may be that large)."""
MIN_RANGE = 1e-3
"""Range, rad or m, below which a joint cannot be said to move."""
FILE = 'description'
SOFT = 'safety_controller'
DEFAULT = 'default'
ENDLESS = 'turns for ever'
QUANTITIES = ('velocity', 'effort', 'acceleration', 'jerk')


@dataclass(frozen=True)
class DefaultLimits:
    """
    What holds where neither the description nor the table says anything.

    Attributes:
        position_rad: either way, of a revolute joint.
        velocity: rad/s.
        prismatic_velocity: m/s.
        acceleration: rad/s² or m/s².
        effort: Nm or N.
        jerk_time_s: from rest to full acceleration.

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
    What the table says about the joints of an arm.

    Attributes:
        name: of the arm, there.
        rules: whether it counts alone, since the arm was asked for by that name.
        joints: name of the joint to quantity to value.

    """

    name: str = ''
    rules: bool = False
    joints: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class EffectiveLimits:
    """
    The limits that hold, and why.

    Attributes:
        limits: of the joints, in order.
        sources: `position`, `velocity`, `effort`, `acceleration` and `jerk` to where that limit of
            each joint comes from.
        remarks: what the description says that cannot be a limit, and what holds in its place.

    """

    limits: JointLimits
    sources: Mapping[str, tuple[str, ...]]
    remarks: tuple[str, ...]


def effective_limits(
    joints: Sequence[Element], known: KnownLimits, defaults: DefaultLimits, origin: str
) -> EffectiveLimits:
    """
    Find the limits that hold.

    Args:
        joints: `<joint>` elements of a description.
        known: what the table says about them.
        defaults: what holds where nobody says anything.
        origin: of the description, for error messages.

    Returns:
        The limits, where they come from, and what a user should know.

    Raises:
        RobotDescriptionError: limits that leave a joint no room, or a prismatic joint without.

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
    Say in a few words where limits come from.

    Args:
        sources: of `EffectiveLimits`.
        joint_names: in the same order.

    Returns:
        Quantity to its source, or to its sources with the joints that each is of.

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
    # a URDF need say nothing of accelerations; of the other two it must
    if quantity in ('velocity', 'effort') or given is not None:
        was = 'missing' if given is None else f'{given:g}'
        what = f'{quantity} limit {was} is a placeholder, {value:.4g} ({source}) in its place'
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
    # some say 0 to both when they mean the controller's gains alone
    if any(float(end or 0.0) for end in (soft_lower, soft_upper)):
        within = lower, upper
        lower = lower if soft_lower is None else max(lower, float(soft_lower))
        upper = upper if soft_upper is None else min(upper, float(soft_upper))
        source = source if (lower, upper) == within else SOFT
    if not upper - lower >= MIN_RANGE:
        raise RobotDescriptionError(
            f'{origin}: joint {name!r} has no room to move: its lower position limit is '
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
            'say with <limit lower= upper=> how far it may move'
        )
    value = defaults.position_rad
    what = f'position limits {was} are placeholders, {value:.4g} rad (default) in their place'
    placeholders.setdefault(f'{what}: joint', []).append(str(joint.get('name')))
    if lower_says or upper_says:
        source = f'{FILE}, {DEFAULT}'
    else:
        source = DEFAULT
    return lower if lower_says else -value, upper if upper_says else value, source
