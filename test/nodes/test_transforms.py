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


"""Live transforms of the arm: published by the arm, recorded once, the wrist where it is."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
import time
from typing import Any

from handover_dmp.nodes.graph import Graph
from handover_dmp.nodes.qos import message_class, qos_profile
from handover_dmp.recording import message_definition, read_bag
from handover_dmp.topics import TF, TF_STATIC, WRIST_POSE
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip('tf2_msgs.msg', reason='tf2_msgs is not installed')

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

NODES = ('recorder', 'priority_ik', 'robot_sim')
RECORDED = 20
"""Messages of `/tf` after which the bag is closed."""


def in_room(parts: dict[str, Any], frame: str, point: Any) -> Any:
    """Go up from frame to frame."""
    if frame not in parts:
        return point
    way, turn = parts[frame].transform.translation, parts[frame].transform.rotation
    turned = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).apply(point)
    return in_room(parts, parts[frame].header.frame_id, turned + [way.x, way.y, way.z])


def test_the_arm_publishes_its_links_and_the_recorder_writes_them_once(tmp_path: Path) -> None:
    arm = {'base_position': [0.3, -0.2, 0.5], 'base_yaw': 0.7}
    recorder = {**arm, 'folder': str(tmp_path / 'bag'), 'transforms': True}
    parameters = {'recorder': recorder, 'priority_ik': arm, 'robot_sim': arm}
    live: list[Any] = []
    with Graph(tmp_path, parameters, lockstep=False, nodes=NODES) as graph:
        kind = message_class(TF.type_name)
        graph.node.create_subscription(kind, TF.name, live.append, qos_profile(TF.quality))
        end_s = time.monotonic() + 60.0
        while len(live) < RECORDED:
            assert time.monotonic() < end_s
            graph.spin()
        for topic in (TF, TF_STATIC):
            (who,) = graph.node.get_publishers_info_by_topic(topic.name)
            assert who.node_name == 'robot_sim'
            # the bag has the type as it is defined here
            assert str(who.topic_type_hash) == message_definition(topic.type_name).type_hash
    stamps: Counter[tuple[int, int]] = Counter()
    parts: dict[str, Any] = {}
    for _, message, _ in read_bag(tmp_path / 'bag', [TF.name]):
        stamp = message.transforms[0].header.stamp
        stamps[stamp.sec, stamp.nanosec] += 1
        parts |= {part.child_frame_id: part for part in message.transforms}
    (fixed,) = [message for _, message, _ in read_bag(tmp_path / 'bag', [TF_STATIC.name])]
    parts |= {part.child_frame_id: part for part in fixed.transforms}
    assert len(stamps) >= RECORDED
    assert set(stamps.values()) == {1}
    # says another node, at rest
    *_, (_, wrist, _) = read_bag(tmp_path / 'bag', [WRIST_POSE.name])
    at = wrist.pose.position
    expected = [at.x, at.y, at.z]
    np.testing.assert_allclose(in_room(parts, 'wrist', [0.0, 0.0, 0.0]), expected, atol=1e-3)
