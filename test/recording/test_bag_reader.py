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

from handover_dmp.common.errors import DataError
from handover_dmp.recording import bag_files, bag_information, BagWriter, read_bag
from handover_dmp.recording.bag_reader import bag_custom_data
from handover_dmp.recording.messages import string
from hypothesis import given, settings
from hypothesis import strategies as st
import pytest
import yaml


def test_only_the_topics_asked_for(write_bag: Callable[..., Path], tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'run', 20)
    topics = [topic for topic, _, _ in read_bag(bag, ['/hand/pose', '/absent'])]
    assert topics == ['/hand/pose'] * 20


def test_information(write_bag: Callable[..., Path], tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'run' / 'bag', 201, 10**18)
    information = bag_information(tmp_path / 'run')
    assert information.complete
    assert information.duration_s == pytest.approx(1.0)
    assert information.first_ns == 10**18
    assert information.size == (bag / 'bag_0.mcap').stat().st_size
    pose = information.topics['/hand/pose']
    assert (pose.type_name, pose.count) == ('geometry_msgs/msg/PoseStamped', 201)
    assert pose.rate_hz == pytest.approx(200.0)
    assert information.topics['/handover/info'].rate_hz == 0.0
    (bag / 'metadata.yaml').unlink()
    assert not bag_information(bag).complete


def test_custom_data(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'run', custom_data={'robot': 'lwr4'}):
        pass
    assert bag_custom_data(tmp_path / 'run') == {'robot': 'lwr4'}


def test_files_come_in_the_order_of_their_numbers(
    write_bag: Callable[..., Path], tmp_path: Path
) -> None:
    bag = write_bag(tmp_path / 'run', 240, split_duration_s=0.1)
    (bag / 'metadata.yaml').unlink()
    assert [file.name for file in bag_files(bag)] == [f'run_{number}.mcap' for number in range(12)]


def test_a_bag_written_by_rosbags_reads(tmp_path: Path) -> None:
    rosbag2 = pytest.importorskip('rosbags.rosbag2')
    typesys = pytest.importorskip('rosbags.typesys')
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    text = store.types['std_msgs/msg/String']
    with rosbag2.Writer(
        tmp_path / 'run', version=9, storage_plugin=rosbag2.StoragePlugin.MCAP
    ) as writer:
        topic = writer.add_connection('/chatter', 'std_msgs/msg/String', typestore=store)
        for number in range(30):
            data = store.serialize_cdr(text(str(number)), 'std_msgs/msg/String')
            writer.write(topic, number, data)
    read = [(message.data, time_ns) for _, message, time_ns in read_bag(tmp_path / 'run')]
    assert read == [(str(number), number) for number in range(30)]


def edit_metadata(bag: Path, **changes: object) -> None:
    path = bag / 'metadata.yaml'
    tree = yaml.safe_load(path.read_text())
    tree['rosbag2_bagfile_information'].update(changes)
    path.write_text(yaml.safe_dump(tree))


@pytest.mark.parametrize(
    ('changes', 'fault'),
    [
        ({'storage_identifier': 'rocksdb'}, 'stored as rocksdb.*ros2 bag convert'),
        ({'compression_format': 'brotli'}, 'compressed with brotli.*ros2 bag convert'),
        ({'relative_file_paths': []}, 'names no files'),
        ({'relative_file_paths': ['run_1.mcap']}, 'run_1.mcap: missing'),
        ({'relative_file_paths': ['../../etc/passwd']}, 'not the name of a file'),
        ({'relative_file_paths': [7]}, '7 is not the name of a file'),
    ],
)
def test_metadata_that_leads_nowhere(
    write_bag: Callable[..., Path], tmp_path: Path, changes: dict[str, object], fault: str
) -> None:
    bag = write_bag(tmp_path / 'run', 5)
    edit_metadata(bag, **changes)
    with pytest.raises(DataError, match=fault):
        list(read_bag(bag))


@pytest.mark.parametrize(
    'text',
    [
        '',
        'a: [',
        '- 1',
        '\0',
        'a: &a [1]\nb: *a',
        '!!python/object/apply:os.getcwd []',
        '[' * 9999,
    ],
)
def test_metadata_that_is_none(write_bag: Callable[..., Path], tmp_path: Path, text: str) -> None:
    bag = write_bag(tmp_path / 'run', 5)
    (bag / 'metadata.yaml').write_text(text)
    with pytest.raises(DataError, match=r'metadata\.yaml: not the metadata of a bag'):
        list(read_bag(bag))


def test_what_is_no_bag(tmp_path: Path) -> None:
    (tmp_path / 'old.db3').write_bytes(b'SQLite format 3')
    (tmp_path / 'text.txt').write_text('text')
    for path, fault in [
        (tmp_path / 'absent', 'no such bag'),
        (tmp_path / 'text.txt', 'not an MCAP file'),
        (tmp_path, 'not a sqlite3 bag that can be read'),
    ]:
        with pytest.raises(DataError, match=fault):
            list(read_bag(path))


@pytest.fixture(scope='module')
def small_bag(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """One file of each compression."""
    files = {}
    for compression in ('zstd', 'lz4', 'none'):
        folder = tmp_path_factory.mktemp('small') / 'run'
        with BagWriter(folder, compression=compression, chunk_size=300) as bag:
            bag.add_topic('/a', 'std_msgs/msg/String')
            for number in range(30):
                bag.write_message('/a', string(f'number {number}'), number)
        files[compression] = (folder / 'run_0.mcap').read_bytes()
    return files


@given(data=st.data())
@settings(max_examples=120, deadline=None)
def test_damage_of_any_kind_is_an_error_or_a_value(
    small_bag: dict[str, bytes], tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    content = bytearray(small_bag[data.draw(st.sampled_from(['zstd', 'lz4', 'none']))])
    for _ in range(data.draw(st.integers(1, 4))):
        position = data.draw(st.integers(0, len(content) - 1))
        match data.draw(st.sampled_from(['set', 'cut', 'drop', 'insert', 'length'])):
            case 'set':
                content[position] = data.draw(st.integers(0, 255))
            case 'cut':
                del content[position:]
            case 'drop':
                del content[position: position + data.draw(st.integers(1, 64))]  # fmt: skip
            case 'insert':
                content[position:position] = data.draw(st.binary(max_size=64))
            case 'length':
                length = slice(position, position + 8)
                content[length] = data.draw(
                    st.sampled_from([b'\xff' * 8, b'\x00' * 8, b'\x00\x00\x00\x00\x01\0\0\0'])
                )
        if not content:
            break
    file = tmp_path_factory.getbasetemp() / 'damaged.mcap'
    file.write_bytes(content)
    try:
        for topic, message, time_ns in read_bag(file):
            assert isinstance(topic, str)
            assert isinstance(time_ns, int)
            assert message is not None
    except DataError as error:
        assert str(file) in str(error)
        assert '\n' not in str(error)


HOSTILE = '''
"""Write files that mean harm, read each, and tell what came of it and how much memory it took."""

import io, struct, sys, time, zlib
from pathlib import Path

import lz4.frame
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk
from mcap.writer import CompressionType, Writer
import zstandard

from handover_dmp.common.errors import DataError
from handover_dmp.recording import read_bag, repair_bag

folder = Path(sys.argv[1])
MAGIC = bytes([137, 77, 67, 65, 80, 48, 13, 10])


def bag_of(definition, data, type_name='a/msg/A', count=1, encoding='ros2msg'):
    stream = io.BytesIO()
    writer = Writer(stream, compression=CompressionType.NONE)
    writer.start(profile='ros2')
    schema = writer.register_schema(type_name, encoding, definition.encode())
    channel = writer.register_channel('/a', 'cdr', schema)
    for index in range(count):
        writer.add_message(channel, index, data, index)
    writer.finish()
    return stream.getvalue()


def chunk(data, size, compression, start=b''):
    builder = RecordBuilder()
    Chunk(compression, data, 0, 0, 0, size).write(builder)
    return MAGIC + start + builder.end() + MAGIC


zeros = bytes(2**20)
zstd_bomb = zstandard.ZstdCompressor()
bomb = io.BytesIO()
with zstd_bomb.stream_writer(bomb, closefd=False) as out:
    for _ in range(4096):
        out.write(zeros)
bomb = bomb.getvalue()
with lz4.frame.LZ4FrameCompressor() as lz4_frame:
    lz4_bomb = lz4_frame.begin() + b''.join(lz4_frame.compress(zeros) for _ in range(1024))
    lz4_bomb += lz4_frame.flush()
body = b'\\0\\1\\0\\0' + bytes(64)
nested = '\\n'.join(['a/B0 b'] + [
    '=' * 80 + f'\\nMSG: a/B{i}\\n' + '\\n'.join(f'a/B{i + 1} f{k}' for k in range(30))
    for i in range(20)
] + ['=' * 80 + '\\nMSG: a/B20\\nuint8[1] x'])
cases = {
    'huge record': MAGIC + struct.pack('<BQ', 6, 2**62) + MAGIC,
    'huge record, unknown kind': MAGIC + struct.pack('<BQ', 0x90, 2**63) + MAGIC,
    'huge text': MAGIC + struct.pack('<BQI', 1, 8, 2**32 - 1) + bytes(4) + MAGIC,
    'huge chunk': chunk(b'', 2**60, 'zstd'),
    'zstd bomb': chunk(bomb, 4096 * 2**20, 'zstd'),
    'zstd bomb, small claim': chunk(bomb, 1000, 'zstd'),
    'zstd bomb, claim at the limit': chunk(bomb, 128 * 2**20, 'zstd'),
    'lz4 bomb': chunk(lz4_bomb, 1024 * 2**20, 'lz4'),
    'lz4 bomb, claim at the limit': chunk(lz4_bomb, 128 * 2**20, 'lz4'),
    'chunk of zeros': chunk(bytes(2**20), 2**20, ''),
    'chunk within itself': chunk(chunk(b'', 0, '')[8:-8] * 1000, 49 * 1000, ''),
    'unknown compression': chunk(b'abc', 3, 'brotli'),
    'endless array of nothing': bag_of('a/B[] b\\n' + '=' * 80 + '\\nMSG: a/B\\nuint8[1] x',
        b'\\0\\1\\0\\0' + b'\\xff' * 4),
    'endless fixed array of nothing': bag_of('a/B[2000000000] b\\n' + '=' * 80
        + '\\nMSG: a/B\\nuint8[1] x', body),
    'endless array of numbers': bag_of('float64[] x', b'\\0\\1\\0\\0' + b'\\xff' * 4 + bytes(16)),
    'endless fixed array of bytes': bag_of('uint8[9999999999999] x', body),
    'endless text': bag_of('string x', b'\\0\\1\\0\\0' + b'\\xff' * 4 + b'abc'),
    'types without end': bag_of(nested, body),
    'a type of itself': bag_of('a/A a', body),
    'an unknown type within': bag_of('b/B b', body),
    'many fields': bag_of('\\n'.join(f'bool f{i}' for i in range(100_000)), body),
    'many spaces in a comment': bag_of('# [' + ' ' * 1_000_000 + '\\nbool x', body),
    'a long default': bag_of('string[] x [' + '"a",' * 1_000_000 + ']', body),
    'a definition of noise': bag_of('%&/()=?', body),
    'a definition that is no text': bag_of('bool x', body).replace(b'bool x', b'bo\\xffl x'),
    'a definition in another language': bag_of('bool x', body, encoding='protobuf'),
    'no message at all': bag_of('float64 x', b''),
    'half a message': bag_of('float64 x', b'\\0\\1\\0\\0\\0'),
    'text that is no text': bag_of('string x', b'\\0\\1\\0\\0\\3\\0\\0\\0\\xff\\xff\\0'),
}
worst = 0.0
for number, (name, content) in enumerate(cases.items()):
    path = folder / f'{number}' / 'bag_0.mcap'
    path.parent.mkdir()
    path.write_bytes(content)
    before = time.perf_counter()
    try:
        count = sum(1 for _ in read_bag(path))
        outcome = f'{count} messages'
    except DataError as error:
        outcome = 'DataError'
        assert str(path) in str(error), error
        assert len(str(error)) < 400, error
    try:
        repair_bag(path.parent)
    except DataError:
        pass
    print(f'{name}: {outcome}')
    worst = max(worst, time.perf_counter() - before)
# ru_maxrss would begin with what the process that started this one holds
peak = next(l for l in open('/proc/self/status') if l.startswith('VmHWM'))
print(f'{worst:.3f}', int(peak.split()[1]) // 1024)
'''


def test_files_that_mean_harm_do_none(tmp_path: Path) -> None:
    result = subprocess.run(
        [sys.executable, '-c', HOSTILE, str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=250,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    # neither a traceback nor what the library's parser tells the terminal
    assert result.stderr == ''
    *outcomes, last = result.stdout.splitlines()
    assert int(last.split()[1]) < 500, f'{last.split()[1]} MB'
    harmless = {'many spaces in a comment: 1 messages'}
    for outcome in outcomes:
        assert outcome.endswith(': DataError') or outcome in harmless, outcome
