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
Parameters of the trackers of the hand.

`trackers` names them. Each has the parameters `NAME.topic`, `NAME.noise_m` and so on, with the
defaults of `tracker` in `config/handover.yaml`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
import re
from typing import Any

from handover_dmp.common.errors import UsageError
from handover_dmp.common.settings import defaults, parameters_of, settings_of
from handover_dmp.nodes.parameters import (
    declare,
    fixed,
    Parameter,
    parameters_from,
    TRACKER,
    Values,
)
from handover_dmp.tracking import GoalEstimator, HandFilter, Tracker
from rclpy.node import Node

TRACKERS = fixed('trackers', 'Names of the trackers that see the hand')
TOPIC = fixed(TRACKER + 'topic', 'Topic of the poses')


ONE_TRACKER = (
    TOPIC,
    fixed(TRACKER + 'type', 'Type of the messages; empty: as the topic has it'),
    fixed(TRACKER + 'body', 'Name or number of the hand, if the messages contain several bodies'),
    fixed(TRACKER + 'frame', 'Frame of the poses, if it differs from frame'),
    fixed(TRACKER + 'position', 'Position of the origin of that frame in our frame, m'),
    fixed(TRACKER + 'quaternion', 'Rotation from the axes of that frame to ours, as x, y, z, w'),
    fixed(
        TRACKER + 'latency_s',
        'Time from measurement to arrival, s; in lockstep the nodes wait for it',
        0.0,
        5.0,
    ),
    *parameters_from(Tracker),
)

HAND = (
    TRACKERS,
    *ONE_TRACKER,
    fixed(
        'hand_stamps',
        'Source of the time of a hand pose: its header or its arrival',
        choices=('header', 'arrival'),
    ),
    *parameters_from(HandFilter),
)


def declare_trackers(node: Node, values: Values, kinds: Sequence[Parameter]) -> Values:
    """
    Declare the parameters of each tracker of a node.

    Args:
        node: the node.
        values: values of its declared parameters, `trackers` among them.
        kinds: parameters of each tracker, by their names for the one called `tracker`, or by
            names without a tracker, whose values are then the defaults.

    Returns:
        Name to value, of those that were not declared yet.

    Raises:
        UsageError: a name is invalid or used twice, there is none, or a value is wrong.

    """
    names = values[TRACKERS.name]
    for name in names:
        if not re.fullmatch('[a-z][a-z0-9_]*', name):
            raise UsageError(
                f'{node.NAME}: trackers: {name!r:.80} is not a valid name; use only a-z, 0-9 and _'
            )
    if not names or len(set(names)) < len(names):
        raise UsageError(
            f'{node.NAME}: trackers: {list(names)} must be one or more different names'
        )
    section = defaults(node.NAME)
    found: Values = {}
    for name in names:
        own = [replace(kind, name=of(name, kind.name)) for kind in kinds]
        usual = {of(name, kind.name): _usual(kind.name, values, section) for kind in kinds}
        new = [parameter for parameter in own if parameter.name not in values]
        found |= declare(node, new, defaults_from=usual)
    return found


def _usual(name: str, values: Values, section: Values) -> Any:
    """Return the default of a parameter; a parameter without a tracker sets it by its value."""
    if name.startswith(TRACKER):
        return section[name]
    told = values[name]
    return list(plain(told)) if isinstance(section[name], list) else told


def of(tracker: str, parameter: str) -> str:
    """
    Return the name of a parameter of a tracker.

    Args:
        tracker: its name.
        parameter: its name for the one called `tracker`, e.g. `tracker.noise_m`.

    Returns:
        Its name for this one, e.g. `mocap.noise_m`.

    """
    return f'{tracker}.{parameter.removeprefix(TRACKER)}'


def goal_estimator(values: Values) -> GoalEstimator:
    """
    Make the estimator of the hand that a node's parameters describe.

    Args:
        values: values of the parameters `HAND` and of those of each tracker.

    Returns:
        The estimator, without a hand yet.

    """
    trackers = [
        Tracker(
            name, **{field: plain(values[f'{name}.{field}']) for field in settings_of(Tracker)}
        )
        for name in values[TRACKERS.name]
    ]
    return GoalEstimator(HandFilter(**parameters_of(HandFilter, values)), trackers)


def plain(value: Any) -> Any:
    """Convert arrays of ROS to tuples of numbers, and leave other values as they are."""
    numbers = isinstance(value, Iterable) and not isinstance(value, str)
    return tuple(map(float, value)) if numbers else value
