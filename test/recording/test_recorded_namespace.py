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

"""Bags of graphs in namespaces: the one in it is found, of several one is to be chosen."""

from __future__ import annotations

from pathlib import Path

from handover_dmp.common.errors import DataError
from handover_dmp.mocap.bag import read_bag_wrists
from handover_dmp.recording import BagWriter, recorded_namespace, SENSOR
from handover_dmp.recording.messages import pose_stamped
from handover_dmp.topics import DEMONSTRATOR_POSE, HAND_POSE
from handover_dmp.tracking.playback import PlayedBag
import numpy as np
import pytest

PLACE = {'/': 1.0, '/left': 2.0, '/lab/right': 3.0}


def bag_of(folder: Path, *namespaces: str) -> Path:
    """Write a bag in which the hands of each graph move in a plane of their own."""
    with BagWriter(folder) as bag:
        for space in namespaces:
            for topic in (HAND_POSE, DEMONSTRATOR_POSE):
                bag.add_topic(topic.within(space), topic.type_name, SENSOR)
                for count in range(1, 21):
                    time_ns = count * 10_000_000
                    pose = pose_stamped(time_ns, (PLACE[space], 0.02 * count, 0.2))
                    bag.write_message(topic.within(space), pose, time_ns)
    return folder


@pytest.mark.parametrize('space', PLACE)
def test_the_only_graph_is_found(tmp_path: Path, space: str) -> None:
    bag = bag_of(tmp_path / 'bag', space)
    assert recorded_namespace(bag, [HAND_POSE]) == space
    np.testing.assert_allclose(read_bag_wrists(bag).partner[:, 0], PLACE[space])
    played = PlayedBag(bag)
    played.start(0.0)
    assert {sample.position[0] for sample in played.hands(0.1)[0]} == {PLACE[space]}


def test_of_several_one_is_to_be_chosen(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / 'bag', '/', '/left')
    with pytest.raises(DataError, match='several graphs, / and /left'):
        recorded_namespace(bag, [HAND_POSE])
    with pytest.raises(DataError, match='several graphs'):
        read_bag_wrists(bag)
    assert recorded_namespace(bag, [HAND_POSE], 'left') == '/left'
    assert recorded_namespace(bag, [HAND_POSE], '/') == '/'
    with pytest.raises(DataError, match='no graph in namespace /right; those in it are: /, /left'):
        recorded_namespace(bag, [HAND_POSE], 'right')
    chosen = read_bag_wrists(bag, '/left/hand/pose', '/left/human/pose')
    np.testing.assert_allclose(chosen.partner[:, 0], PLACE['/left'])
