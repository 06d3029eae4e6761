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

"""Bags: messages written and read per second, compared with `rosbags` and a plain file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from statistics import median
import tempfile
from time import perf_counter

from handover_dmp.bench.measurement import Measurement

COUNT = 20_000
ROUNDS = 5
PERIOD_NS = 200_000
# messages of the graph: mostly poses, twists and joint states
TOPICS = {
    '/hand/pose': 'geometry_msgs/msg/PoseStamped',
    '/wrist/pose': 'geometry_msgs/msg/PoseStamped',
    '/wrist/pose_command': 'geometry_msgs/msg/PoseStamped',
    '/wrist/twist_command': 'geometry_msgs/msg/TwistStamped',
    '/joint_states': 'sensor_msgs/msg/JointState',
}

Messages = list[tuple[str, bytes, int]]


def run(progress: Callable[[str], None]) -> list[Measurement]:
    """
    Measure the writer and the reader of bags.

    Args:
        progress: called with the name of each measurement.

    Returns:
        The figures.

    """
    progress('messages to write')
    messages = _messages()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        progress('recorder')
        # rounds of ours, the peer and the floor alternate, so that all see the same machine load
        times: dict[str, list[float]] = {'ours': [], 'floor': [], 'rosbags': []}
        stalls = []
        note = ''
        for number in range(ROUNDS):
            elapsed, stall = _write_ours(messages, folder / f'ours_{number}')
            times['ours'].append(elapsed)
            stalls.append(stall)
            times['floor'].append(_write_file(messages, folder / f'plain_{number}'))
            try:
                times['rosbags'].append(_write_rosbags(messages, folder / f'rosbags_{number}'))
            except ImportError:
                note = 'rosbags not installed'
        progress('reader')
        bag = folder / 'ours_0'
        read_s, read = _read_ours(bag)
        peer_s = _read_rosbags(bag)
    return [
        Measurement(
            'recorder',
            COUNT / median(times['ours']),
            'messages/s',
            target=5000.0,
            floor=COUNT / median(times['floor']),
            peers={'rosbags': COUNT / median(times['rosbags'])} if times['rosbags'] else {},
            higher_is_better=True,
            note=note
            or 'zstd; chunks of 64 kB, of the peer 1 MB; floor: the same bytes into a plain file',
        ),
        Measurement(
            'recorder, messages lost',
            float(COUNT - read),
            'messages',
            target=0.0,
            note=f'of {COUNT}, counted by reading them back',
        ),
        Measurement(
            'recorder, longest write',
            median(stalls) * 1e3,
            'ms',
            note='of a single message, with the chunk that it fills; median of the rounds',
        ),
        Measurement(
            'reader',
            COUNT / read_s,
            'messages/s',
            peers={'rosbags': COUNT / peer_s} if peer_s else {},
            higher_is_better=True,
            note='read and decoded, every length checked',
        ),
    ]


def _messages() -> Messages:
    from handover_dmp.recording.messages import (
        encoder,
        joint_state,
        pose_stamped,
        twist_stamped,
    )

    names = [f'joint_{number}' for number in range(1, 8)]
    messages = []
    for index in range(COUNT):
        topic, type_name = list(TOPICS.items())[index % len(TOPICS)]
        time_ns = index * PERIOD_NS
        value = index * 1e-4
        if type_name.endswith('PoseStamped'):
            message = pose_stamped(time_ns, (value, 0.1, 0.2))
        elif type_name.endswith('TwistStamped'):
            message = twist_stamped(time_ns, (value, 0.1, 0.2))
        else:
            message = joint_state(time_ns, names, [value] * 7, [0.1] * 7)
        messages.append((topic, encoder(type_name)(message), time_ns))
    return messages


def _write_ours(messages: Messages, folder: Path) -> tuple[float, float]:
    from handover_dmp.recording import BagWriter

    longest = 0.0
    start = perf_counter()
    with BagWriter(folder, compression='zstd') as bag:
        for topic, type_name in TOPICS.items():
            bag.add_topic(topic, type_name)
        before = perf_counter()
        for topic, data, time_ns in messages:
            bag.write(topic, data, time_ns)
            now = perf_counter()
            if now - before > longest:
                longest = now - before
            before = now
    return perf_counter() - start, longest


def _write_file(messages: Messages, path: Path) -> float:
    start = perf_counter()
    with path.open('wb') as stream:
        for _, data, _ in messages:
            stream.write(data)
    return perf_counter() - start


def _write_rosbags(messages: Messages, folder: Path) -> float:
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import get_typestore, Stores

    store = get_typestore(Stores.ROS2_JAZZY)
    start = perf_counter()
    writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer as bag:
        topics = {
            topic: bag.add_connection(topic, type_name, typestore=store)
            for topic, type_name in TOPICS.items()
        }
        for topic, data, time_ns in messages:
            bag.write(topics[topic], time_ns, data)
    return perf_counter() - start


def _read_ours(folder: Path) -> tuple[float, int]:
    from handover_dmp.recording import read_bag

    start = perf_counter()
    count = sum(1 for _ in read_bag(folder))
    return perf_counter() - start, count


def _read_rosbags(folder: Path) -> float | None:
    try:
        from rosbags.highlevel import AnyReader
    except ImportError:
        return None
    start = perf_counter()
    with AnyReader([folder]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
    return perf_counter() - start
