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

"""Trials as bags, so that `ros2 bag play` or another player can replace a tracker."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.common.quaternions import IDENTITY
from handover_dmp.recording.bag_writer import BagWriter
from handover_dmp.recording.message_definitions import message_definition
from handover_dmp.recording.messages import header, Message, pose_stamped
from handover_dmp.recording.qos import LATCHED, SENSOR
from handover_dmp.topics import DEMONSTRATOR_POSE, FRAME, HAND_POSE, SIGNAL, Topic
import numpy as np

if TYPE_CHECKING:
    from handover_dmp.mocap import HandoverTrial

# in ROS a stamp of zero means no stamp
START_NS = 10**9
REST_BEFORE_S = 0.5
REST_AFTER_S = 5.0
"""Longest duration of a handover after the end of its recording, s."""
_Pose = tuple[Sequence[float], Sequence[float]]
_Row = tuple[int, str, Message]


def write_trial_bag(trial: HandoverTrial, folder: Path | str, compression: str = 'zstd') -> None:
    """
    Write one trial as a bag: P1's wrist on `/hand/pose`, P2's on `/human/pose`, and the signal.

    The trial begins at 1 s, where the signal on `/handover/signal` starts the handover. As with
    the node `hand_tracker`, the hand rests before and after the trial: for 0.5 s, so that
    subscribers know the hand when the signal comes, and for 5 s, so that the handover can end. P2
    is only present during the trial, so a reader can find the trial within the bag. Stamps are log
    times; positions are in frame `world`, m; orientations are those of the trial, or (0, 0, 0, 1)
    if it has none.

    Args:
        trial: the trial.
        folder: folder of the bag; must not exist.
        compression: compression of its chunks, `zstd`, `lz4` or `none`.

    Raises:
        DataError: the folder exists or cannot be written, or no package on this machine defines
            the messages.

    """
    about = {
        'configuration': trial.configuration,
        'exchange': trial.direction,
        'trial': str(trial.number),
        'source': trial.source,
    }
    topics = ((HAND_POSE, SENSOR), (DEMONSTRATOR_POSE, SENSOR), (SIGNAL, LATCHED))
    for topic, _ in topics:
        message_definition(topic.type_name)  # where one is missing, no empty bag is left
    with BagWriter(folder, compression=compression, custom_data=about) as bag:
        for topic, quality in topics:
            bag.add_topic(topic.name, topic.type_name, quality)
        for time_ns, name, message in _rows(trial):
            bag.write_message(name, message, time_ns)


def _rows(trial: HandoverTrial) -> Iterator[_Row]:
    """Yield time, topic and message of the whole bag, in order."""
    times_ns = [START_NS + round(time * 1e9) for time in trial.times - trial.times[0]]
    step_ns = round(float(np.median(np.diff(trial.times))) * 1e9)
    before = range(-round(REST_BEFORE_S * 1e9 / step_ns), 0)
    after = range(1, round(REST_AFTER_S * 1e9 / step_ns) + 1)
    partner = _poses(trial.partner, trial.partner_orientation)
    demonstrator = _poses(trial.demonstrator, trial.demonstrator_orientation)
    for count in before:
        yield _pose(HAND_POSE, times_ns[0] + count * step_ns, partner[0])
    yield START_NS, SIGNAL.name, header(START_NS, FRAME)
    for time_ns, hand, other in zip(times_ns, partner, demonstrator, strict=True):
        yield _pose(HAND_POSE, time_ns, hand)
        yield _pose(DEMONSTRATOR_POSE, time_ns, other)
    for count in after:
        yield _pose(HAND_POSE, times_ns[-1] + count * step_ns, partner[-1])


def _poses(places: Array, quaternions: Array | None) -> list[_Pose]:
    turns = [IDENTITY] * len(places) if quaternions is None else quaternions.tolist()
    return list(zip(places.tolist(), turns, strict=True))


def _pose(topic: Topic, time_ns: int, pose: _Pose) -> _Row:
    position, orientation = pose
    return time_ns, topic.name, pose_stamped(time_ns, position, orientation, frame=FRAME)


def write_trial_bags(
    trials: Sequence[HandoverTrial],
    folder: Path | str,
    compression: str = 'zstd',
    progress: Callable[[int], None] = lambda done: None,
) -> list[Path]:
    """
    Write trials as bags `<configuration>_<exchange>_<number>` within one folder.

    Args:
        trials: the trials.
        folder: output folder; created if missing.
        compression: compression of the chunks, `zstd`, `lz4` or `none`.
        progress: called with the number of finished bags.

    Returns:
        The folders of the bags.

    Raises:
        DataError: one of the bags exists already (then none is written), or the disk is full.

    """
    from handover_dmp.mocap.data_set import file_name

    bags = [Path(folder) / Path(file_name(trial)).stem for trial in trials]
    for bag in bags:
        if bag.exists():
            raise DataError(f'{bag}: exists already; a bag is never overwritten')
    for done, (trial, bag) in enumerate(zip(trials, bags, strict=True), 1):
        write_trial_bag(trial, bag, compression)
        progress(done)
    return bags
