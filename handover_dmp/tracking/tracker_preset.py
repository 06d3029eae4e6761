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
Trackers of a kind, by their presets: what is told of one, and how a simulated one sees the hand.

A preset is a file of ROS parameters, `config/trackers/NAME.yaml` or one's own. Nodes take it as
any other; whoever runs without ROS reads it here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from handover_dmp.common.errors import DataError, UsageError
from handover_dmp.common.plain_yaml import load_plain
from handover_dmp.common.resources import share_path
from handover_dmp.common.ros_parameters import sections
from handover_dmp.common.settings import defaults
from handover_dmp.tracking.sensor_model import SensorModel
from handover_dmp.tracking.tracker import Tracker

SENSOR = 'sensor.'


@dataclass(frozen=True)
class TrackerPreset:
    """
    A tracker of a kind.

    Attributes:
        tracker: what is told of it to whoever follows the hand.
        sensor: how it sees the hand.
        topic: of its poses.
        parameters: all of it, by the names of ROS parameters without that of the tracker.

    """

    tracker: Tracker = field(default_factory=Tracker)
    sensor: SensorModel = field(default_factory=SensorModel)
    topic: str = field(default_factory=lambda: str(defaults('dmp')['tracker.topic']))
    parameters: Mapping[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Of the tracker."""
        return self.tracker.name

    @property
    def absolute_topic(self) -> str:
        """Of its poses, in the root namespace."""
        return '/' + self.topic.lstrip('/')


def read_trackers(names: Sequence[str], seed: int = 0) -> list[TrackerPreset]:
    """
    Read presets.

    Args:
        names: of those in `config/trackers/`, or paths of files like them.
        seed: of what they draw at random; each draws its own.

    Returns:
        Its trackers, in their order.

    Raises:
        DataError: a file is not there, or cannot be read.
        UsageError: it has no tracker, or a wrong one, or one that is there already.

    """
    found = [
        replace(one, sensor=replace(one.sensor, seed=one.sensor.seed + 1000 * seed + number))
        for number, one in enumerate(tracker for name in names for tracker in _read(name))
    ]
    labels = [one.name for one in found]
    for what, values in (('name', labels), ('topic', [one.topic for one in found])):
        if len(set(values)) < len(values):
            raise UsageError(f'two trackers of one {what}: {", ".join(values)}')
    return found


def _read(name: str) -> list[TrackerPreset]:
    path = Path(name)
    if path.suffix not in ('.yaml', '.yml'):
        path = share_path('config/trackers') / f'{name}.yaml'
        if not path.is_file():
            known = sorted(file.stem for file in path.parent.glob('*.yaml'))
            raise UsageError(f'tracker {name!r}: none of {", ".join(known)}, and no .yaml file')
    try:
        tree = load_plain(path.read_text(encoding='utf-8'))
    except OSError as error:
        raise DataError(f'{path}: {error.strerror}') from error
    values = {key: value for section in sections(tree) for key, value in section.values.items()}
    names = list(dict.fromkeys(key.partition('.')[0] for key in values if '.' in key))
    if not names:
        raise UsageError(f'{path}: no parameters NAME.topic, NAME.noise_m and so on of a tracker')
    return [_tracker(path, one, values) for one in names]


def _tracker(path: Path, name: str, values: Mapping[str, Any]) -> TrackerPreset:
    own = {
        key.removeprefix(f'{name}.'): value
        for key, value in values.items()
        if key.startswith(f'{name}.')
    }
    known = {
        *(key.removeprefix('tracker.') for key in defaults('dmp') if key.startswith('tracker.')),
        *(key for key in defaults('hand_tracker') if key.startswith(SENSOR)),
    }
    unknown = sorted(set(own) - known)
    if unknown:
        raise UsageError(f'{path}: {name}.{unknown[0]} is no parameter of a tracker')
    told = {field.name for field in fields(Tracker)}
    try:
        return TrackerPreset(
            Tracker(name, **{key: _plain(one) for key, one in own.items() if key in told}),
            SensorModel(
                **{
                    key.removeprefix(SENSOR): _plain(one)
                    for key, one in own.items()
                    if key.startswith(SENSOR)
                }
            ),
            str(own.get('topic', defaults('dmp')['tracker.topic'])),
            own,
        )
    except (UsageError, TypeError, ValueError) as error:
        raise UsageError(f'{path}: {error}') from error


def _plain(value: Any) -> Any:
    return tuple(map(float, value)) if isinstance(value, list) else value
