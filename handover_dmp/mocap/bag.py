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

"""Reader of bags: the wrists of both partners from two topics of poses."""

from __future__ import annotations

from contextlib import suppress
import json
from pathlib import Path
import re
from typing import Any

from handover_dmp.common.errors import DataError
from handover_dmp.mocap.filtering import interpolate
from handover_dmp.mocap.markers import MAX_GAP_S, WristMotion
from handover_dmp.mocap.trial import describe, DIRECTIONS
from handover_dmp.topics import INFO
import numpy as np
from numpy.typing import NDArray

PARTNER_TOPIC = '/hand/pose'
DEMONSTRATOR_TOPIC = '/human/pose'
_MIN_POSES = 4
_MAX_POSES = 2_000_000


def read_bag_wrists(
    path: str | Path,
    partner_topic: str = PARTNER_TOPIC,
    demonstrator_topic: str = DEMONSTRATOR_TOPIC,
) -> WristMotion:
    """
    Read the wrists of both partners from a bag.

    Any message with a header and a point, pose or transform will do. Times are the stamps of the
    messages (where these are zero, when they were recorded), counted from the first; P2 is
    interpolated at the times of P1.

    Args:
        path: a rosbag2 folder or an MCAP file.
        partner_topic: poses of P1's wrist.
        demonstrator_topic: poses of P2's wrist.

    Returns:
        Both wrists where their topics overlap in time, in metres.

    Raises:
        DataError: the bag or a topic is missing, its poses make no sense or are in two frames.

    """
    path = Path(path)
    (partner_times, partner), (demonstrator_times, demonstrator) = _read_poses(
        path, partner_topic, demonstrator_topic
    )
    start = partner_times[0]
    inside = (partner_times >= demonstrator_times[0]) & (partner_times <= demonstrator_times[-1])
    # Between two poses of P2 that are far apart, nothing is known of it.
    after = np.clip(
        np.searchsorted(demonstrator_times, partner_times), 1, len(demonstrator_times) - 1
    )
    inside &= demonstrator_times[after] - demonstrator_times[after - 1] <= MAX_GAP_S
    times = partner_times[inside]
    if len(times) == 0:
        raise DataError(f'{path}: {partner_topic} and {demonstrator_topic} do not overlap in time')
    return WristMotion(
        times - start,
        partner[inside],
        interpolate(demonstrator_times, demonstrator)(times),
        source=path.name,
    ).checked()


def describe_bag(path: str | Path) -> tuple[str, str, int]:
    """
    Tell what a bag is a recording of.

    Args:
        path: a rosbag2 folder, an MCAP file or the folder of a run.

    Returns:
        Configuration, exchange and number: those that the bag carries along, else those of the
        run that it records, else by its name.

    Raises:
        DataError: there is no such bag, or it is damaged.

    """
    # Not at the top: mocap files are read without the libraries that bags need.
    from handover_dmp.recording.bag_reader import bag_custom_data

    told = bag_custom_data(path)
    if 'exchange' not in told:
        told = _run_info(path)
    configuration, direction, number = describe(Path(path))
    if told.get('exchange') in DIRECTIONS:
        direction = told['exchange']
    if re.fullmatch('[0-9]{1,9}', told.get('trial', ''), re.ASCII):
        number = int(told['trial'])
    return told.get('configuration') or configuration, direction, number


def _run_info(path: str | Path) -> dict[str, str]:
    """Return what a run says that it replayed, in the words of a trial's bag."""
    from handover_dmp.recording import read_bag

    for _, message, _ in read_bag(path, [INFO.name]):
        with suppress(AttributeError, RecursionError, TypeError, ValueError):
            info = json.loads(message.data)
            told = {key: str(info.get(key, '')) for key in ('configuration', 'exchange')}
            return told | {'trial': str(info.get('number', ''))}
    return {}


def _read_poses(path: Path, *topics: str) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    # Not at the top: mocap files are read without the libraries that bags need.
    from handover_dmp.recording import read_bag

    found: dict[str, list[list[float]]] = {topic: [] for topic in topics}
    frames: dict[str, str] = {}
    zero_ns: int | None = None
    for topic, message, log_time_ns in read_bag(path, topics):
        stamp_ns, frame, place = _place(path, topic, message)
        stamp_ns = stamp_ns or log_time_ns
        # Seconds since 1970 leave a double only some tenths of a microsecond.
        zero_ns = stamp_ns if zero_ns is None else zero_ns
        found[topic].append([(stamp_ns - zero_ns) * 1e-9, *place])
        if frames.setdefault(topic, frame) != frame:
            raise DataError(f'{path}: {topic} changes from frame {frames[topic]!r} to {frame!r}')
        if len(found[topic]) > _MAX_POSES:
            raise DataError(f'{path}: more than {_MAX_POSES} poses on {topic}')
    for topic in topics:
        if len(found[topic]) < _MIN_POSES:
            raise DataError(f'{path}: {len(found[topic])} poses on {topic}')
    if len(set(frames.values())) > 1:
        first, second = topics
        raise DataError(
            f'{path}: {first} is in frame {frames[first]!r}, {second} in {frames[second]!r}'
        )
    return [_in_order(path, topic, np.array(found[topic])) for topic in topics]


def _in_order(
    path: Path, topic: str, rows: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sort poses by stamp and leave repeated ones out."""
    if not np.isfinite(rows).all():
        raise DataError(f'{path}: a pose on {topic} is not finite')
    _, unique = np.unique(rows[:, 0], return_index=True)
    if len(unique) < _MIN_POSES:
        raise DataError(f'{path}: {len(unique)} stamps on {topic}')
    return rows[unique, 0], rows[unique, 1:]


def _place(path: Path, topic: str, message: Any) -> tuple[int, str, list[float]]:
    """Return stamp in ns, frame and x, y, z in m of a message."""
    place = message
    for name in ('pose', 'pose', 'position', 'point', 'transform', 'translation'):
        place = getattr(place, name, place)
    try:
        stamp = message.header.stamp
        stamp_ns = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
        frame = str(message.header.frame_id)
        return stamp_ns, frame, [float(place.x), float(place.y), float(place.z)]
    except AttributeError as error:
        raise DataError(f'{path}: {topic} holds no stamped poses') from error
