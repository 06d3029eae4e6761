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

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import random
import signal
import subprocess
import sys

from handover_dmp.common.errors import DataError
from handover_dmp.recording import bag_information, read_bag, repair_bag
import pytest

WRITER = """
import sys, time
from pathlib import Path
from handover_dmp.recording import BagWriter
from handover_dmp.recording.messages import encoder, pose_stamped

bag = BagWriter(Path(sys.argv[1]), compression=sys.argv[2])
bag.add_topic('/hand/pose', 'geometry_msgs/msg/PoseStamped')
encode = encoder('geometry_msgs/msg/PoseStamped')
print('writing', time.time_ns(), flush=True)
number = 0
while True:
    now_ns = time.time_ns()
    bag.write('/hand/pose', encode(pose_stamped(now_ns, (number, 0.0, 0.0))), now_ns)
    number += 1
    if number % 10 == 0:
        print(number, now_ns, flush=True)
        time.sleep(0.004)
"""


def read_plain(path: Path) -> list[tuple[str, str, int]]:
    # classes are made anew for every file, so messages of two files are compared by what they say
    return [(topic, repr(message), time_ns) for topic, message, time_ns in read_bag(path)]


def kill_while_writing(folder: Path, after_s: float, compression: str) -> tuple[int, int]:
    """Write until killed; return when that began and when the last message known was written."""
    process = subprocess.Popen(
        [sys.executable, '-c', WRITER, str(folder), compression],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    word, begin_ns = process.stdout.readline().split()
    assert word == 'writing'
    try:
        process.wait(after_s)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
    last_ns = int(begin_ns)
    for line in process.stdout:
        words = line.split()
        if line.endswith('\n') and len(words) == 2:
            last_ns = int(words[1])
    assert process.wait() == -signal.SIGKILL
    return int(begin_ns), last_ns


def check_repaired(folder: Path, begin_ns: int, last_ns: int) -> None:
    rosbag2 = pytest.importorskip('rosbags.rosbag2')
    broken = read_plain(folder)
    repair = repair_bag(folder)
    assert repair.metadata_written
    assert repair.dropped_chunks == 0
    messages = list(read_bag(folder))
    # nothing that could be read before is lost, nothing is missing in between
    assert read_plain(folder) == broken
    assert [message.pose.position.x for _, message, _ in messages] == list(range(len(messages)))
    with rosbag2.Reader(folder) as reader:
        assert reader.message_count == len(messages) == repair.message_count
    assert bag_information(folder).complete
    kept_until_ns = messages[-1].log_time_ns if messages else begin_ns
    assert last_ns - kept_until_ns < 10**9
    assert not repair_bag(folder).rewritten


@pytest.mark.parametrize('compression', ['zstd', 'lz4', 'none'])
def test_a_killed_recorder_loses_less_than_a_second(tmp_path: Path, compression: str) -> None:
    after_s = random.Random(compression).uniform(0.4, 0.8)
    times = kill_while_writing(tmp_path / 'run', after_s, compression)
    check_repaired(tmp_path / 'run', *times)


@pytest.mark.slow
@pytest.mark.parametrize('seed', range(50))
def test_a_recorder_killed_at_any_moment(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    after_s = rng.choice([rng.uniform(0.0, 0.05), rng.uniform(0.0, 3.0)])
    times = kill_while_writing(tmp_path / 'run', after_s, rng.choice(['zstd', 'lz4', 'none']))
    check_repaired(tmp_path / 'run', *times)


@pytest.mark.parametrize('compression', ['zstd', 'lz4', 'none'])
def test_a_file_cut_anywhere_is_repaired(
    write_bag: Callable[..., Path], tmp_path: Path, compression: str
) -> None:
    rosbag2 = pytest.importorskip('rosbags.rosbag2')
    whole = write_bag(tmp_path / 'whole', 100, compression=compression, chunk_size=4096)
    data = (whole / 'whole_0.mcap').read_bytes()
    messages = read_plain(whole)
    rng = random.Random(compression)
    cuts = [0, 4, 8, 9, 40, len(data) - 1, *rng.sample(range(len(data)), 10)]
    counts = []
    for cut in sorted(cuts):
        folder = tmp_path / str(cut)
        folder.mkdir()
        (folder / 'bag_0.mcap').write_bytes(data[:cut])
        repair = repair_bag(folder)
        assert read_plain(folder) == messages[: repair.message_count]
        with rosbag2.Reader(folder) as reader:
            assert reader.message_count == repair.message_count
        counts.append(repair.message_count)
    assert counts == sorted(counts)
    assert counts[0] == 0
    assert counts[-1] == len(messages)


def test_a_damaged_chunk_is_left_out(write_bag: Callable[..., Path], tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'run', 400, compression='none', chunk_size=8192)
    file = bag / 'run_0.mcap'
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 0xFF
    file.write_bytes(data)
    with pytest.raises(
        DataError, match=r'run_0\.mcap: damaged chunk at byte \d+: wrong check sum'
    ):
        list(read_bag(bag))
    repair = repair_bag(bag)
    assert repair.dropped_chunks == 1
    assert repair.rewritten == (file,)
    assert 1601 - 8192 / 60 < repair.message_count < 1601
    assert sum(1 for _ in read_bag(bag)) == repair.message_count


def test_a_whole_bag_stays_as_it_is(write_bag: Callable[..., Path], tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'run', 50, split_duration_s=0.1)
    before = {file: (file.read_bytes(), file.stat().st_mtime_ns) for file in bag.iterdir()}
    repair = repair_bag(bag)
    assert not repair.rewritten
    assert not repair.metadata_written
    assert repair.message_count == 201
    assert {f: (f.read_bytes(), f.stat().st_mtime_ns) for f in bag.iterdir()} == before


def test_lost_metadata_comes_back_as_it_was(
    write_bag: Callable[..., Path], tmp_path: Path
) -> None:
    bag = write_bag(tmp_path / 'run', 50, split_duration_s=0.1, custom_data={'robot': 'lwr4'})
    metadata = bag / 'metadata.yaml'
    before = metadata.read_text()
    for content in (None, '', 'rosbag2_bagfile_information: 1', '{', 'a: &a [*a]'):
        metadata.unlink()
        if content is not None:
            metadata.write_text(content)
        repair = repair_bag(bag)
        assert repair.metadata_written
        assert not repair.rewritten
        assert metadata.read_text() == before


def test_a_run_folder_and_a_single_file(write_bag: Callable[..., Path], tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'run' / 'bag', 50)
    (bag / 'metadata.yaml').unlink()
    assert repair_bag(tmp_path / 'run').metadata_written
    file = bag / 'bag_0.mcap'
    file.write_bytes(file.read_bytes()[:-20])
    repair = repair_bag(file)
    assert repair.rewritten == (file,)
    assert not repair.metadata_written
    assert repair.message_count == 201


def test_what_is_no_bag_is_said_and_left_alone(tmp_path: Path) -> None:
    with pytest.raises(DataError, match='no such bag'):
        repair_bag(tmp_path / 'absent')
    with pytest.raises(DataError, match='no bag in this folder'):
        repair_bag(tmp_path)
    text = tmp_path / 'text.mcap'
    text.write_text('a text that is no bag at all')
    with pytest.raises(DataError, match='not an MCAP file'):
        repair_bag(text)
    assert text.read_text() == 'a text that is no bag at all'
    assert list(tmp_path.iterdir()) == [text]
