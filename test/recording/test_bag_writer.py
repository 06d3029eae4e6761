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
import subprocess
import sys

from handover_dmp.common.errors import DataError, UsageError
from handover_dmp.recording import bag_files, bag_information, BagWriter, Qos, read_bag
from handover_dmp.recording.messages import string
from mcap.reader import make_reader
import pytest
import yaml

START_NS = 1_700_000_000_000_000_000


def test_metadata_is_what_rosbag2_of_jazzy_writes(
    write_bag: Callable[..., Path], tmp_path: Path
) -> None:
    write_bag(tmp_path / 'run', 100, START_NS)
    metadata = yaml.safe_load((tmp_path / 'run' / 'metadata.yaml').read_text())
    information = metadata['rosbag2_bagfile_information']
    assert list(metadata) == ['rosbag2_bagfile_information']
    assert list(information) == [
        'version',
        'storage_identifier',
        'duration',
        'starting_time',
        'message_count',
        'topics_with_message_count',
        'compression_format',
        'compression_mode',
        'relative_file_paths',
        'files',
        'custom_data',
        'ros_distro',
    ]
    assert information['version'] == 9
    assert information['storage_identifier'] == 'mcap'
    assert information['duration'] == {'nanoseconds': 99 * 5_000_000}
    assert information['starting_time'] == {'nanoseconds_since_epoch': START_NS}
    assert information['message_count'] == 401
    assert information['relative_file_paths'] == ['run_0.mcap']
    assert information['files'] == [
        {
            'path': 'run_0.mcap',
            'starting_time': {'nanoseconds_since_epoch': START_NS},
            'duration': {'nanoseconds': 99 * 5_000_000},
            'message_count': 401,
        }
    ]
    topics = {
        one['topic_metadata']['name']: one for one in information['topics_with_message_count']
    }
    pose = topics['/hand/pose']
    assert pose['message_count'] == 100
    assert list(pose['topic_metadata']) == [
        'name',
        'type',
        'serialization_format',
        'offered_qos_profiles',
        'type_description_hash',
    ]
    assert pose['topic_metadata']['type_description_hash'].startswith('RIHS01_')
    assert pose['topic_metadata']['offered_qos_profiles'][0]['reliability'] == 'best_effort'
    info = topics['/handover/info']['topic_metadata']
    assert info['offered_qos_profiles'][0]['durability'] == 'transient_local'


@pytest.mark.parametrize('compression', ['zstd', 'lz4', 'none'])
def test_every_compression_reads_back(
    write_bag: Callable[..., Path], tmp_path: Path, compression: str
) -> None:
    bag = write_bag(tmp_path / 'run', 300, compression=compression)
    messages = [message for topic, message, _ in read_bag(bag) if topic == '/hand/pose']
    assert [message.pose.position.x for message in messages] == [
        index * 1e-3 for index in range(300)
    ]


def test_a_bag_is_never_overwritten(write_bag: Callable[..., Path], tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'run', 10)
    before = {file: file.read_bytes() for file in bag.iterdir()}
    with pytest.raises(DataError, match='exists already'):
        BagWriter(bag)
    assert {file: file.read_bytes() for file in bag.iterdir()} == before


def test_where_no_folder_can_be_made_it_is_said(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    with pytest.raises(DataError, match='cannot be made: Not a directory'):
        BagWriter(tmp_path / 'file' / 'run')
    with pytest.raises(UsageError, match='zip'):
        BagWriter(tmp_path / 'run', compression='zip')
    assert not (tmp_path / 'run').exists()


def test_split_by_duration(write_bag: Callable[..., Path], tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'run', 400, START_NS, split_duration_s=0.5)
    assert [file.name for file in bag_files(bag)] == [f'run_{number}.mcap' for number in range(4)]
    for file in bag_files(bag):
        assert bag_information(file).duration_s < 0.5
        # each file is a bag of its own, with the definitions of what it holds
        assert sum(1 for _ in read_bag(file, ['/hand/pose'])) == 100
    assert bag_information(bag).message_count == 1601
    files = yaml.safe_load((bag / 'metadata.yaml').read_text())['rosbag2_bagfile_information'][
        'files'
    ]
    assert [file['message_count'] for file in files] == [401, 400, 400, 400]


def test_split_by_size(write_bag: Callable[..., Path], tmp_path: Path) -> None:
    bag = write_bag(
        tmp_path / 'run', 1500, START_NS, split_size=100_000, compression='none', chunk_size=10_000
    )
    files = bag_files(bag)
    assert len(files) > 5
    assert [int(file.stem.split('_')[1]) for file in files] == list(range(len(files)))
    # what is beyond the size is one chunk and the indexes
    assert all(file.stat().st_size < 140_000 for file in files)
    times = [time for topic, _, time in read_bag(bag) if topic == '/hand/pose']
    assert times == [START_NS + index * 5_000_000 for index in range(1500)]


def test_topics_may_come_late_and_twice(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'run', split_duration_s=1.0) as bag:
        bag.add_topic('/a', 'std_msgs/msg/String')
        bag.write_message('/a', string('first'), 10)
        bag.add_topic('/b', 'std_msgs/msg/String', [Qos(), Qos(reliability='best_effort')])
        bag.add_topic('/a', 'std_msgs/msg/String')
        bag.write_message('/b', string('second'), 20)
        bag.write_message('/b', string('third'), 2 * 10**9)
        with pytest.raises(DataError, match='/c was not added'):
            bag.write('/c', b'', 30)
        with pytest.raises(DataError, match='time out of range'):
            bag.write_message('/a', string('before all time'), -1)
    read = [(topic, message.data) for topic, message, _ in read_bag(tmp_path / 'run')]
    assert read == [('/a', 'first'), ('/b', 'second'), ('/b', 'third')]


def test_what_was_offered_may_be_known_late(tmp_path: Path) -> None:
    offered = [Qos(), Qos(reliability='best_effort')]
    with BagWriter(tmp_path / 'run', split_duration_s=1.0) as bag:
        bag.set_offered('/a', offered)
        bag.add_topic('/a', 'std_msgs/msg/String', ())
        bag.write_message('/a', string('first'), 0)
        bag.set_offered('/a', offered)
        bag.write_message('/a', string('second'), 2 * 10**9)
    tree = yaml.safe_load((tmp_path / 'run' / 'metadata.yaml').read_text())
    (topic,) = tree['rosbag2_bagfile_information']['topics_with_message_count']
    expected = [profile.as_rosbag2() for profile in offered]
    assert topic['topic_metadata']['offered_qos_profiles'] == expected
    with (tmp_path / 'run' / 'run_1.mcap').open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    (channel,) = summary.channels.values()
    assert yaml.safe_load(channel.metadata['offered_qos_profiles']) == expected


def test_an_empty_bag_is_a_bag(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'run') as bag:
        bag.add_topic('/a', 'std_msgs/msg/String')
    assert list(read_bag(tmp_path / 'run')) == []
    information = bag_information(tmp_path / 'run')
    assert information.complete
    assert information.message_count == 0


def test_a_closed_bag_takes_no_more(tmp_path: Path) -> None:
    bag = BagWriter(tmp_path / 'run')
    bag.add_topic('/a', 'std_msgs/msg/String')
    bag.close()
    bag.close()
    with pytest.raises(DataError, match='closed'):
        bag.write('/a', b'', 0)


def test_messages_do_not_stay_in_memory(tmp_path: Path) -> None:
    bag = BagWriter(tmp_path / 'run', chunk_size=10**6, flush_period_s=0.0)
    bag.add_topic('/a', 'std_msgs/msg/String')
    for number in range(5):
        bag.write_message('/a', string(str(number)), number)
    # read by way of the file, while the writer still has it open
    read = [message.data for _, message, _ in read_bag(tmp_path / 'run')]
    assert read == [str(number) for number in range(5)]
    bag.close()


FULL_DISK = """
import resource, signal, sys
from pathlib import Path
from handover_dmp.common.errors import DataError
from handover_dmp.recording import BagWriter
from handover_dmp.recording.messages import string

# a file that may not grow beyond 200 kB fails as a full disk does: in the middle of a write
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
bag = BagWriter(Path(sys.argv[1]), compression='none')
bag.add_topic('/a', 'std_msgs/msg/String')
errors = []
for number in range(20_000):
    try:
        bag.write_message('/a', string(f'{number:060}'), number)
    except DataError as error:
        errors.append((number, str(error)))
bag.close()
print(errors[0][0], len(errors))
print(errors[0][1])
"""


def test_a_full_disk_is_one_clear_error_and_what_was_written_stays(tmp_path: Path) -> None:
    from handover_dmp.recording import repair_bag

    folder = tmp_path / 'run'
    result = subprocess.run(
        [sys.executable, '-c', FULL_DISK, str(folder)], capture_output=True, text=True, check=True
    )
    numbers, message = result.stdout.splitlines()
    first, count = map(int, numbers.split())
    assert message.startswith(f'{folder}: recording stopped: File too large')
    assert count == 20_000 - first
    repair_bag(folder)
    read = [int(message.data) for _, message, _ in read_bag(folder)]
    assert read == list(range(len(read)))
    # at most the chunk that did not fit is lost
    assert first - len(read) < 65536 / 60
