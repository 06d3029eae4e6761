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

"""Every reader of files, thrown at what it was not made for: a value or one clear line."""

from __future__ import annotations

from functools import cache
import os
from pathlib import Path
import resource
import subprocess
import sys

from handover_dmp.bench.fuzz import READERS
from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
import pytest

MAX_MB = 500
PIECES = [b'nan', b'-1e999', b'0', b'\0', b'\xff' * 8, b'\n', b'"', b'[', b'\t', b',']

FOUND = {
    'Qualisys TSV': [
        b'FREQUENCY\t120\nMARKER_NAMES\tM\tA\nFrame\tTime\tM X\tM Y\tM Z\tA X\tA Y\tA Z\n7\n',
        b'FREQUENCY\nNO_OF_FRAMES\nDATA_INCLUDED\nMARKER_NAMES\tM\n1\t2\t3\n',
        # One sample alone between two gaps.
        READERS['Qualisys TSV'].examples()[0].replace(b'0.00833', b'383'),
    ],
    'parameter YAML': [
        b'[' * 5000,
        b'dmp: {ros__parameters: {mu: 1' + b'0' * 400 + b'}}',
        b'dmp: {ros__parameters: {x: !!bool maybe}}',
        b'dmp: {ros__parameters: {x: !!timestamp maybe}}',
        b'dmp: {ros__parameters: {x: 2001-99-99}}',
    ],
    'MCAP': [
        READERS['MCAP']
        .examples()[0]
        .replace(b'a/msg/A', b'\0\0\0\0\1\nA')
        .replace(b'<=4', b'\0\0\0')
    ],
    # A type that is no text, with a line end in it.
    'wrists of a sqlite3 bag': [
        READERS['wrists of a sqlite3 bag']
        .examples()[0]
        .replace(b'geometry_msgs/msg/PoseStamped', b'geometry_msgs/msg\xff\nPoseStampe'),
    ],
    'bag metadata YAML': [b'a: !!bool maybe', b'a: !!timestamp maybe', b'{' * 5000],
}
"""What fuzzing has found, one input a bug."""

CODE = {
    'parameter YAML': b'!!python/object/apply:os.mkdir ["%s"]\n',
    'bag metadata YAML': b'rosbag2_bagfile_information: !!python/object/apply:os.mkdir ["%s"]\n',
    'model JSON': b'{"format": "handover_dmp model", "__reduce__": ["os.mkdir", ["%s"]]}',
}

UNFOLDING = b'a: &a [x,x,x,x,x,x,x,x,x]\n' + b''.join(
    b'%c: &%c [%s]\n' % (98 + k, 98 + k, b','.join([b'*%c' % (97 + k)] * 9)) for k in range(20)
)

HEAVY = """
import sys, time
from pathlib import Path
from handover_dmp.bench.fuzz import READERS
name, path = sys.argv[1], Path(sys.argv[2])
begun = time.process_time()
held = READERS[name].read(path)
seconds = time.process_time() - begun
# ru_maxrss would begin with what the process that started this one holds
peak = next(line for line in open('/proc/self/status') if line.startswith('VmHWM'))
print(held, seconds, int(peak.split()[1]) / 1024)
"""


@cache
def examples(name: str) -> list[bytes]:
    return READERS[name].examples()


@pytest.mark.parametrize('name', READERS)
def test_the_examples_can_be_read(tmp_path: Path, name: str) -> None:
    path = READERS[name].place_in(tmp_path)
    for content in examples(name)[:1]:
        path.write_bytes(content)
        assert READERS[name].read(path)


@pytest.mark.parametrize('name', READERS)
@given(data=st.data())
@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_damage_gives_a_value_or_one_clear_line(
    tmp_path: Path, name: str, data: st.DataObject
) -> None:
    content = bytearray(data.draw(st.sampled_from(examples(name))))
    for _ in range(data.draw(st.integers(1, 5))):
        place = data.draw(st.integers(0, len(content)))
        length = data.draw(st.integers(0, 40))
        piece = data.draw(
            st.one_of(
                st.binary(max_size=30),
                st.sampled_from(PIECES),
                st.integers(0, 1500).map(lambda start: bytes(content[start:][:30])),
            )
        )
        content[place: place + length] = piece  # fmt: skip
    path = READERS[name].place_in(tmp_path)
    path.write_bytes(content)
    READERS[name].read(path)


@pytest.mark.parametrize('name', READERS)
@given(content=st.one_of(st.binary(max_size=500), st.text(max_size=500).map(str.encode)))
@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_noise_gives_a_value_or_one_clear_line(tmp_path: Path, name: str, content: bytes) -> None:
    path = READERS[name].place_in(tmp_path)
    path.write_bytes(content)
    READERS[name].read(path)


@pytest.mark.parametrize(
    ('name', 'content'), [(name, content) for name in FOUND for content in FOUND[name]]
)
def test_what_was_found_once_stays_an_error(tmp_path: Path, name: str, content: bytes) -> None:
    path = READERS[name].place_in(tmp_path)
    path.write_bytes(content)
    READERS[name].read(path)


@pytest.mark.parametrize('name', CODE)
def test_no_file_executes_code(tmp_path: Path, name: str) -> None:
    trap = tmp_path / 'trap'
    path = READERS[name].place_in(tmp_path)
    path.write_bytes(CODE[name].replace(b'%s', os.fsencode(trap)))
    assert not READERS[name].read(path)
    assert not trap.exists()


@pytest.mark.parametrize(
    ('name', 'content'),
    [
        ('parameter YAML', UNFOLDING + b'dmp: {ros__parameters: {duration_scale: *u}}\n'),
        ('bag metadata YAML', UNFOLDING),
        ('model JSON', b'[' * 10_000_000),
        ('trial CSV', b'0,' * 5_000_000),
        ('Qualisys TSV', b'MARKER_NAMES' + b'\tM' * 900_000),
        ('C3D', READERS['C3D'].examples()[0][:6] + b'\1\0\xff\xff' + b'\xff' * 1500),
    ],
    ids=lambda value: value if isinstance(value, str) else '',
)
def test_no_file_takes_all_the_memory_or_time(tmp_path: Path, name: str, content: bytes) -> None:
    path = READERS[name].place_in(tmp_path)
    path.write_bytes(content)
    done = subprocess.run(
        [sys.executable, '-c', HEAVY, name, str(path)],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (4 * 2**30, 4 * 2**30)),
    )
    assert done.returncode == 0, done.stderr
    held, seconds, peak_mb = done.stdout.split()
    assert held == 'False'
    assert float(seconds) < 10.0
    assert float(peak_mb) < MAX_MB
