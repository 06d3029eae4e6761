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

"""Small valid files of all readable formats, as seeds for the fuzzer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
import io
import json
from pathlib import Path
import struct
import tempfile

_TOPICS = ('/hand/pose', '/human/pose')
_POSE = 'geometry_msgs/msg/PoseStamped'


def trial_csv() -> list[bytes]:
    """Make trials."""
    rows = [f'{0.01 * k},0.1,{0.01 * k},1.0,0.5,{-0.01 * k},1.1' for k in range(12)]
    text = '\n'.join(['t,p1_x,p1_y,p1_z,p2_x,p2_y,p2_z', *rows]) + '\n'
    return [text.encode(), b'\xef\xbb\xbf' + text.replace('\n', '\r\n').encode()]


def data_set_csv() -> list[bytes]:
    """Make indexes of data sets."""
    head = 'file,configuration,exchange,trial\n'
    return [
        (head + 'a_give_1.csv,a,give,1\n').encode(),
        (head + 'b.csv,"b, c",take,2\n../x.csv,b,give,3\n').encode(),
    ]


def _reach(factor: float = 1.0) -> list[list[str]]:
    """Return the six coordinates of two reaching wrists, one row per frame."""
    rows = ((1.2 - k / 20, 0.2, 1.0 + k / 100, k / 20, 0.1, 0.9 + k / 100) for k in range(12))
    return [[f'{factor * value:.6g}' for value in row] for row in rows]


def _lines(lines: list[str]) -> bytes:
    return ('\r\n'.join(lines) + '\r\n').encode()


def qualisys_tsv() -> list[bytes]:
    """Make Qualisys exports: markers with and without titles, bodies, UTF-16."""
    head = ['NO_OF_FRAMES\t12', 'NO_OF_MARKERS\t2', 'FREQUENCY\t120', 'DATA_INCLUDED\t3D']
    names = 'MARKER_NAMES\tM_wrist\tA_wrist'
    titles = 'Frame\tTime\tM_wrist X\tM_wrist Y\tM_wrist Z\tA X\tA Y\tA Z'
    plain = ['\t'.join(row) for row in _reach(1e3)]
    numbered = [f'{k}\t{k / 120:.5f}\t{row}' for k, row in enumerate(plain)]
    turn = ['0', '0', '0', '1.2', *'100010001']
    bodies = ['\t'.join([*row[:3], *turn, *row[3:], *turn]) for row in _reach(1e3)]
    solid = [*head[:3], 'DATA_INCLUDED\t6D', 'BODY_NAMES\tM\tA']
    return [
        _lines([*head, names, titles, *numbered]),
        _lines([*head, names, *plain]),
        _lines([*solid, *bodies]),
        _lines([*head, names, *plain]).decode().encode('utf-16'),
    ]


def motive_csv() -> list[bytes]:
    """Make Motive exports."""
    about = 'Format Version,1.23,Length Units,Meters,Coordinate Space,Global'
    kinds, names = ['Rigid Body'] * 7 + ['Marker'] * 3, ['M'] * 7 + ['A'] * 3
    parts = ['Rotation'] * 4 + ['Position'] * 6
    heads = [',,' + ','.join(cells) for cells in (kinds, names, names, parts)]
    titles = 'Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,X,Y,Z'
    rows = [f'{k},{k / 120:.6f},0,0,0,1,{",".join(row)}' for k, row in enumerate(_reach())]
    return [_lines([about, '', *heads, titles, *rows])]


def vicon_text() -> list[bytes]:
    """Make Vicon Nexus exports."""
    head = [
        'Trajectories',
        '120',
        ',,M,,,A,,',
        'Frame,Sub Frame,X,Y,Z,X,Y,Z',
        ',,mm,mm,mm,mm,mm,mm',
    ]
    rows = [f'{k},0,{",".join(row)}' for k, row in enumerate(_reach(1e3), 1)]
    devices = ['Devices', '1200', ',,Force', 'Frame,Sub Frame,Fx', ',,N', '1,0,2', '']
    return [_lines([*head, *rows]), _lines([*devices, *head, *rows, '', 'Joints'])]


def trc() -> list[bytes]:
    """Make a TRC file."""
    head = [
        'PathFileType\t4\t(X/Y/Z)\ta.trc', 'DataRate\tNumFrames\tUnits', '120\t12\tm',
        'Frame#\tTime\tM\t\t\tA\t\t', '\t\tX1\tY1\tZ1\tX2\tY2\tZ2', '',
    ]  # fmt: skip
    rows = ['\t'.join([f'{k}', f'{k / 120:.6f}', *row]) for k, row in enumerate(_reach())]
    return [_lines([*head, *rows])]


def c3d() -> list[bytes]:
    """Make C3D files: a header block, a parameter block, then points as integers or floats."""
    return [_c3d_file(1.0, 'hhhh'), _c3d_file(-1.0, 'ffff')]


def _c3d_file(scale: float, kind: str) -> bytes:
    def parameter(name: str, kind: int, dimensions: list[int], data: bytes) -> bytes:
        rest = bytes([kind & 0xFF, len(dimensions), *dimensions]) + data + b'\0'
        head = struct.pack('bb', len(name), 1) + name.encode()
        return head + struct.pack('<h', len(rest) + 2) + rest

    header = struct.pack('<BBHHHHHfHH', 2, 80, 2, 0, 1, 12, 10, scale, 3, 0)
    header = (header + struct.pack('<f', 100.0)).ljust(512, b'\0')
    section = b'\1\x50\1\x54' + struct.pack('bb', 5, -1) + b'POINT' + struct.pack('<h', 3) + b'\0'
    for name, value in (('USED', 2), ('FRAMES', 12), ('DATA_START', 3)):
        section += parameter(name, 2, [], struct.pack('<h', value))
    section += parameter('SCALE', 4, [], struct.pack('<f', scale))
    section += parameter('RATE', 4, [], struct.pack('<f', 100.0))
    section += parameter('UNITS', -1, [2], b'mm') + parameter('LABELS', -1, [4, 2], b'handP2  ')
    section += parameter('X_SCREEN', -1, [2], b'+X') + parameter('Y_SCREEN', -1, [2], b'+Z')
    points = b''.join(
        struct.pack(f'<{kind}', *(round(float(value)) for value in place), -(k == 5))
        for k, row in enumerate(_reach(1e3))
        for place in (row[:3], row[3:])
    )
    return header + (section + b'\0\0').ljust(512, b'\0') + points.ljust(512, b'\0')


def _bag_file() -> bytes:
    """Record both wrists on the default topics."""
    from handover_dmp.recording import BagWriter

    with tempfile.TemporaryDirectory() as folder:
        with BagWriter(Path(folder) / 'bag', compression='none', chunk_size=500) as bag:
            for topic in _TOPICS:
                bag.add_topic(topic, _POSE)
            for topic, time_ns, message in _poses():
                bag.write(topic, message, time_ns)
        return (Path(folder) / 'bag' / 'bag_0.mcap').read_bytes()


def _poses() -> Iterator[tuple[str, int, bytes]]:
    from handover_dmp.recording.messages import encoder, pose_stamped

    encode = encoder(_POSE)
    for k, row in enumerate(_reach()):
        time_ns = 7 * 10**9 + k * 10**7
        for topic, place in zip(_TOPICS, (row[:3], row[3:]), strict=True):
            yield topic, time_ns, encode(pose_stamped(time_ns, [float(value) for value in place]))


def wrist_bag() -> list[bytes]:
    """Make an MCAP file of both wrists."""
    return [_bag_file()]


def compressed_bag() -> list[bytes]:
    """Make the same, compressed as a whole."""
    import zstandard

    return [zstandard.compress(_bag_file())]


def sqlite3_bag() -> list[bytes]:
    """Make sqlite3 bags in the format of ROS 2 Humble, with small pages."""
    import sqlite3

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'bag.db3'
        with closing(sqlite3.connect(path)) as connection:
            connection.executescript(
                'PRAGMA page_size = 512;'
                'CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT,'
                ' serialization_format TEXT, offered_qos_profiles TEXT);'
                'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER,'
                ' timestamp INTEGER, data BLOB);'
            )
            for number, topic in enumerate(_TOPICS):
                connection.execute(
                    "INSERT INTO topics VALUES(?, ?, ?, 'cdr', '')", (number, topic, _POSE)
                )
            for count, (topic, time_ns, message) in enumerate(_poses()):
                row = (count, _TOPICS.index(topic), time_ns, message)
                connection.execute('INSERT INTO messages VALUES(?, ?, ?, ?)', row)
            connection.commit()
        return [path.read_bytes()]


def mcap() -> list[bytes]:
    """Make MCAP files with various contents."""
    from mcap.writer import CompressionType, Writer

    files = []
    for compression, chunked in ((CompressionType.NONE, False), (CompressionType.ZSTD, True)):
        stream = io.BytesIO()
        writer = Writer(stream, 300, compression, use_chunking=chunked)
        writer.start(profile='ros2')
        text = 'string data\nfloat64[] values\nstring<=4 x\nstring[2] names'
        schema = writer.register_schema('a/msg/A', 'ros2msg', text.encode())
        channel = writer.register_channel('/a', 'cdr', schema)
        body = b'\0\1\0\0\3\0\0\0ab\0\0\1\0\0\0' + bytes(64)
        for number in range(4):
            writer.add_message(channel, number, body, number)
        writer.add_metadata('rosbag2', {'serialized_metadata': 'version: 9'})
        writer.finish()  # type: ignore[no-untyped-call]
        files.append(stream.getvalue())
    return files


def bag_metadata() -> list[bytes]:
    """Make the `metadata.yaml` of a bag."""
    from handover_dmp.recording import BagWriter

    with tempfile.TemporaryDirectory() as folder:
        with BagWriter(Path(folder) / 'bag') as bag:
            bag.add_topic('/a', 'std_msgs/msg/String')
        return [(Path(folder) / 'bag' / 'metadata.yaml').read_bytes()]


def model_json() -> list[bytes]:
    """Make a model."""
    from handover_dmp.dmp import learn, save_model
    import numpy as np

    times = np.linspace(0.0, 1.0, 40)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'model.json'
        save_model(learn(times, np.column_stack([times**2, times]), basis=4), path)
        text = path.read_text(encoding='utf-8')
    return [json.dumps(json.loads(text)).encode()]


def parameter_yaml() -> list[bytes]:
    """Make parameter files."""
    return [
        b'dmp:\n  ros__parameters:\n    stiffness: 200.0\n    mu: 0.75\n    formulation: stiff\n'
        b'    duration_scale: 1.1\nother: {ros__parameters: {a: [1, 2.5, {a: b}]}}\n',
        b'dmp: {ros__parameters: {sigma: 1e-2, damping: &a 3, mu: *a}, x: 2001-09-09}\n',
    ]
