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

from pathlib import Path
import sys

from handover_dmp.common.errors import DataError
from handover_dmp.recording.message_definitions import message_definition
import pytest

TYPES = [
    'builtin_interfaces/msg/Time',
    'diagnostic_msgs/msg/DiagnosticArray',
    'geometry_msgs/msg/PoseStamped',
    'geometry_msgs/msg/TwistStamped',
    'rosgraph_msgs/msg/Clock',
    'sensor_msgs/msg/JointState',
    'sensor_msgs/msg/PointCloud2',
    'std_msgs/msg/Float64MultiArray',
    'std_msgs/msg/String',
    'visualization_msgs/msg/MarkerArray',
]


@pytest.fixture
def fresh() -> None:
    message_definition.cache_clear()
    yield
    message_definition.cache_clear()


@pytest.mark.parametrize('type_name', TYPES)
def test_the_text_defines_a_type_of_the_hash_it_comes_with(type_name: str) -> None:
    # an independent parser of the text and an independent implementation of the hash
    typesys = pytest.importorskip('rosbags.typesys')
    definition = message_definition(type_name)
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    store.register(typesys.get_types_from_msg(definition.text, type_name))
    assert store.hash_rihs01(type_name) == definition.type_hash


def test_the_text_is_laid_out_as_rosbag2_does() -> None:
    text = message_definition('geometry_msgs/msg/PoseStamped').text
    parts = text.split('\n' + '=' * 80 + '\n')
    assert parts[0].startswith('# A Pose with reference coordinate frame')
    # depth first and by name
    assert [part.splitlines()[0] for part in parts[1:]] == [
        'MSG: geometry_msgs/Pose',
        'MSG: geometry_msgs/Point',
        'MSG: geometry_msgs/Quaternion',
        'MSG: std_msgs/Header',
        'MSG: builtin_interfaces/Time',
    ]


def test_without_message_packages_the_library_serves(
    fresh: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pytest.importorskip('rosbags.typesys')
    installed = message_definition('geometry_msgs/msg/PoseStamped')
    message_definition.cache_clear()
    monkeypatch.setattr(sys, 'prefix', str(tmp_path))
    monkeypatch.setenv('AMENT_PREFIX_PATH', '')
    elsewhere = message_definition('geometry_msgs/msg/PoseStamped')
    assert elsewhere.type_hash == installed.type_hash
    assert 'MSG: std_msgs/Header' in elsewhere.text


def test_a_sourced_ros_comes_first(
    fresh: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    source = Path(sys.prefix) / 'share' / 'std_msgs' / 'msg'
    target = tmp_path / 'share' / 'std_msgs' / 'msg'
    target.mkdir(parents=True)
    (target / 'String.json').write_bytes((source / 'String.json').read_bytes())
    (target / 'String.msg').write_text('# of the sourced ROS\nstring data\n')
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'{tmp_path / "absent"}:{tmp_path}')
    assert message_definition('std_msgs/msg/String').text.startswith('# of the sourced ROS')


@pytest.mark.parametrize(
    'name', ['', 'String', 'std_msgs/String', '../msg/String', 'a/msg/b/../c']
)
def test_what_is_no_type_name_is_said_so(name: str) -> None:
    with pytest.raises(DataError, match='not the name of a message type'):
        message_definition(name)


def test_an_unknown_type_tells_the_way_out() -> None:
    with pytest.raises(DataError, match=r'nowhere_msgs/msg/Thing.*pip install'):
        message_definition('nowhere_msgs/msg/Thing')
