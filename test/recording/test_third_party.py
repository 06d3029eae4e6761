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

"""Bags of ours in the hands of others: rosbags, mcap-ros2-support, @mcap/core (JavaScript)."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
import shutil
import subprocess

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
import pytest

START_NS = 1_700_000_000_000_000_000
COUNTS = {
    '/handover/info': 1,
    '/hand/pose': 300,
    '/wrist/twist_command': 300,
    '/joint_states': 300,
    '/handover/phase': 300,
}

COMPRESSIONS = pytest.mark.parametrize('compression', ['zstd', 'lz4', 'none'])


@COMPRESSIONS
def test_rosbags_reads(write_bag: Callable[..., Path], tmp_path: Path, compression: str) -> None:
    highlevel = pytest.importorskip('rosbags.highlevel')
    bag = write_bag(tmp_path / 'run', 300, START_NS, compression=compression, split_duration_s=0.7)
    with highlevel.AnyReader([bag]) as reader:
        assert reader.message_count == sum(COUNTS.values())
        assert reader.start_time == START_NS
        assert {c.topic: c.msgcount for c in reader.connections} == COUNTS
        for connection, time_ns, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            if connection.topic == '/joint_states':
                index = (time_ns - START_NS) // 5_000_000
                np.testing.assert_array_equal(message.position, [index * 1e-3] * 7)


def test_rosbags_reads_what_stands_beside_the_messages(
    write_bag: Callable[..., Path], tmp_path: Path
) -> None:
    rosbag2 = pytest.importorskip('rosbags.rosbag2')
    with rosbag2.Reader(write_bag(tmp_path / 'run', 10)) as reader:
        assert reader.ros_distro == 'jazzy'
        topics = {connection.topic: connection for connection in reader.connections}
        (qos,) = topics['/handover/info'].ext.offered_qos_profiles
        assert qos.durability.name == 'TRANSIENT_LOCAL'
        assert topics['/hand/pose'].digest.startswith('RIHS01_')
        assert '# A Pose with reference coordinate frame' in topics['/hand/pose'].msgdef.data


def test_rosbags_converts(write_bag: Callable[..., Path], tmp_path: Path) -> None:
    convert = pytest.importorskip('rosbags.convert.converter')
    highlevel = pytest.importorskip('rosbags.highlevel')
    bag = write_bag(tmp_path / 'run', 100)
    arguments = {
        'srcs': [bag],
        'dst_storage': 'sqlite3',
        'dst_version': 9,
        'compress': None,
        'compress_mode': 'file',
        'default_typestore': None,
        'typestore': None,
        'exclude_topics': (),
        'include_topics': (),
        'exclude_msgtypes': (),
        'include_msgtypes': (),
    }
    for target in (tmp_path / 'converted', tmp_path / 'converted.bag'):
        convert.convert(dst=target, **arguments)
        with highlevel.AnyReader([target]) as reader:
            assert reader.message_count == 401


@COMPRESSIONS
def test_mcap_ros2_support_reads(
    write_bag: Callable[..., Path], tmp_path: Path, compression: str
) -> None:
    bag = write_bag(tmp_path / 'run', 300, compression=compression)
    with (bag / 'run_0.mcap').open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == 'ros2'
        counts: dict[str, int] = {}
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ('ros2msg', 'cdr')
            assert set(channel.metadata) == {'offered_qos_profiles', 'topic_type_hash'}
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
            if channel.topic == '/hand/pose':
                assert decoded.header.stamp.nanosec == message.log_time % 10**9
        assert counts == COUNTS
        summary = reader.get_summary()
        assert summary is not None
        # one schema a type, not one a topic
        assert len(summary.schemas) == len({schema.name for schema in summary.schemas.values()})
        records = [record for record in reader.iter_metadata() if record.name == 'rosbag2']
        assert 'message_count: 1201' in records[-1].metadata['serialized_metadata']


SCRIPT = """
const {McapIndexedReader} = require('@mcap/core');
const {FileHandleReadable} = require('@mcap/nodejs');
const {loadDecompressHandlers} = require('@mcap/support');
const {open} = require('node:fs/promises');

(async () => {
  const result = {counts: {}, schemas: [], metadata: []};
  const reader = await McapIndexedReader.Initialize({
    readable: new FileHandleReadable(await open(process.argv[2], 'r')),
    decompressHandlers: await loadDecompressHandlers(),
  });
  result.profile = reader.header.profile;
  for (const schema of reader.schemasById.values()) result.schemas.push(schema.encoding);
  for await (const message of reader.readMessages()) {
    const {topic} = reader.channelsById.get(message.channelId);
    result.counts[topic] = (result.counts[topic] ?? 0) + 1;
  }
  for await (const record of reader.readMetadata()) result.metadata.push(record.name);
  console.log(JSON.stringify(result));
})();
"""


@pytest.fixture(scope='session')
def node_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the reader that Foxglove is built on; skips where it cannot be had."""
    node, npm = shutil.which('node'), shutil.which('npm')
    if node is None or npm is None:
        pytest.skip('no node and npm on this machine')
    folder = tmp_path_factory.mktemp('node')
    (folder / 'package.json').write_text('{"private": true}')
    (folder / 'read.js').write_text(SCRIPT)
    packages = ['@mcap/core', '@mcap/nodejs', '@mcap/support']
    installed = subprocess.run(
        [npm, 'install', '--no-audit', '--no-fund', *packages],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    if installed.returncode != 0:
        pytest.skip(f'npm cannot install {packages}')
    return folder


@pytest.mark.slow
@COMPRESSIONS
def test_mcap_core_in_javascript_reads(
    write_bag: Callable[..., Path], node_folder: Path, tmp_path: Path, compression: str
) -> None:
    bag = write_bag(tmp_path / 'run', 300, compression=compression)
    read = subprocess.run(
        ['node', 'read.js', str(bag / 'run_0.mcap')],
        cwd=node_folder,
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    result = json.loads(read.stdout)
    assert result['counts'] == COUNTS
    assert result['profile'] == 'ros2'
    assert set(result['schemas']) == {'ros2msg'}
    assert set(result['metadata']) == {'rosbag2'}
