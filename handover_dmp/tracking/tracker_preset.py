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
Presets for kinds of trackers: their parameters, and the sensor model of a simulated one.

A preset is a file of ROS parameters, `config/trackers/NAME.yaml` or a user's own. Nodes read it as
any other parameter file; this module reads it without ROS.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from handover_dmp.common.errors import UsageError
from handover_dmp.common.plain_yaml import read_plain
from handover_dmp.common.resources import share_path
from handover_dmp.common.ros_parameters import sections
from handover_dmp.common.settings import defaults
from handover_dmp.tracking.sensor_model import SensorModel
from handover_dmp.tracking.tracker import Tracker

SENSOR = 'sensor.'
LARGEST_FILE_BYTES = 200_000


@dataclass(frozen=True)
class TrackerPreset:
    """
    The preset of a tracker.

    Attributes:
        tracker: its parameters.
        sensor: its sensor model.
        topic: topic of its poses.
        parameters: all values, by the names of ROS parameters without the tracker's name.

    """

    tracker: Tracker = field(default_factory=Tracker)
    sensor: SensorModel = field(default_factory=SensorModel)
    topic: str = field(default_factory=lambda: str(defaults('dmp')['tracker.topic']))
    parameters: Mapping[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the tracker."""
        return self.tracker.name

    @property
    def absolute_topic(self) -> str:
        """Topic of its poses, in the root namespace."""
        return '/' + self.topic.lstrip('/')


def read_trackers(names: Sequence[str], seed: int = 0) -> list[TrackerPreset]:
    """
    Read presets.

    Args:
        names: names of presets in `config/trackers/`, or paths of such files.
        seed: random seed; each tracker gets its own stream.

    Returns:
        The trackers, in order.

    Raises:
        DataError: a file does not exist, or cannot be read.
        UsageError: a file has no tracker or an invalid one, or a name or topic occurs twice.

    """
    found = [
        replace(one, sensor=replace(one.sensor, seed=one.sensor.seed + 1000 * seed + number))
        for number, one in enumerate(tracker for name in names for tracker in _read(name))
    ]
    for what in ('name', 'topic'):
        values = [getattr(one, what) for one in found]
        if len(set(values)) < len(values):
            raise UsageError(f'two trackers have one {what}: {", ".join(values)}')
    return found


def _read(name: str) -> list[TrackerPreset]:
    path = Path(name)
    if path.suffix not in ('.yaml', '.yml'):
        path = share_path('config/trackers') / f'{name}.yaml'
        if not path.is_file():
            known = sorted(file.stem for file in path.parent.glob('*.yaml'))
            raise UsageError(
                f'tracker {name!r} is unknown: give one of {", ".join(known)}, or a .yaml file'
            )
    found = sections(read_plain(path, LARGEST_FILE_BYTES))
    values = {key: value for section in found for key, value in section.values.items()}
    names = list(dict.fromkeys(key.partition('.')[0] for key in values if '.' in key))
    if not names:
        raise UsageError(
            f'{path}: no parameters of a tracker; expected NAME.topic, NAME.noise_m, …'
        )
    return [_tracker(path, one, values) for one in names]


def _tracker(path: Path, name: str, values: Mapping[str, Any]) -> TrackerPreset:
    own = _within(f'{name}.', values)
    known = {
        *_within('tracker.', defaults('dmp')),
        *(SENSOR + key for key in _within(SENSOR, defaults('hand_tracker'))),
    }
    unknown = sorted(set(own) - known)
    if unknown:
        raise UsageError(f'{path}: {name}.{unknown[0]} is not a parameter of a tracker')
    told = {field.name for field in fields(Tracker)}
    try:
        return TrackerPreset(
            Tracker(name, **{key: _plain(one) for key, one in own.items() if key in told}),
            SensorModel(**{key: _plain(one) for key, one in _within(SENSOR, own).items()}),
            str(own.get('topic', defaults('dmp')['tracker.topic'])),
            own,
        )
    except (UsageError, TypeError, ValueError) as error:
        raise UsageError(f'{path}: {error}') from error


def _within(prefix: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values whose names have a prefix, by their names without it."""
    return {
        key.removeprefix(prefix): value for key, value in values.items() if key.startswith(prefix)
    }


def _plain(value: Any) -> Any:
    return tuple(map(float, value)) if isinstance(value, list) else value
