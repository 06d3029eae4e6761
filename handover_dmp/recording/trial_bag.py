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

"""Trials as bags, which `ros2 bag play` or any other player sends in place of a tracker."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from handover_dmp.errors import DataError
from handover_dmp.recording.bag_writer import BagWriter
from handover_dmp.recording.messages import pose_stamped
from handover_dmp.recording.qos import SENSOR

if TYPE_CHECKING:
    from handover_dmp.hand import HandoverTrial

HAND_TOPIC = '/hand/pose'
HUMAN_TOPIC = '/human/pose'
POSE = 'geometry_msgs/msg/PoseStamped'
FRAME = 'world'
# a stamp of zero means in ROS that there is none
START_NS = 10**9


def write_trial_bag(trial: HandoverTrial, folder: Path | str, compression: str = 'zstd') -> None:
    """
    Write one trial as a bag: P1's wrist on `/hand/pose`, P2's on `/human/pose`.

    Stamps and log times are those of the trial, from 1 s on; positions in frame `world`, m;
    orientations are none, (0, 0, 0, 1), for a trial has none.

    Args:
        trial: what to write.
        folder: of the bag; must not exist.
        compression: of its chunks, `zstd`, `lz4` or `none`.

    Raises:
        DataError: the folder exists, or cannot be written.

    """
    about = {
        'configuration': trial.configuration,
        'exchange': trial.exchange,
        'trial': str(trial.number),
        'source': trial.source,
    }
    with BagWriter(folder, compression=compression, custom_data=about) as bag:
        for topic in (HAND_TOPIC, HUMAN_TOPIC):
            bag.add_topic(topic, POSE, SENSOR)
        for time_s, p1, p2 in zip(trial.times - trial.times[0], trial.p1, trial.p2, strict=True):
            time_ns = START_NS + round(time_s * 1e9)
            for topic, position in ((HAND_TOPIC, p1), (HUMAN_TOPIC, p2)):
                bag.write_message(topic, pose_stamped(time_ns, position, frame=FRAME), time_ns)


def write_trial_bags(
    trials: Sequence[HandoverTrial],
    folder: Path | str,
    compression: str = 'zstd',
    progress: Callable[[int], None] = lambda done: None,
) -> list[Path]:
    """
    Write trials as bags `<configuration>_<exchange>_<number>` within one folder.

    Args:
        trials: what to write.
        folder: where to; made if need be.
        compression: of the chunks, `zstd`, `lz4` or `none`.
        progress: called with the number of bags done.

    Returns:
        The folders of the bags.

    Raises:
        DataError: one of the bags exists already, and then none is written; or the disk is full.

    """
    from handover_dmp.hand.data_set import file_name

    bags = [Path(folder) / Path(file_name(trial)).stem for trial in trials]
    for bag in bags:
        if bag.exists():
            raise DataError(f'{bag}: exists already; a bag is never overwritten')
    for done, (trial, bag) in enumerate(zip(trials, bags, strict=True), 1):
        write_trial_bag(trial, bag, compression)
        progress(done)
    return bags
