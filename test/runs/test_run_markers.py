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

"""A bag of a run without ROS shows what the graph shows: hands, learnt path, goal, exchange."""

from __future__ import annotations

from itertools import pairwise
from math import dist
from typing import Any

from handover_dmp.handover.lockstep import Period, simulate
from handover_dmp.handover.scenario import make_scenario, Scenario
from handover_dmp.handover.scene_markers import ADD, DELETE, EVERY, LINE_STRIP, SPHERE
from handover_dmp.recording import read_bag
from handover_dmp.runs.bag import write_run_bag
from handover_dmp.topics import FRAME, MARKERS
import pytest


@pytest.fixture(scope='module')
def run() -> tuple[Scenario, list[Period]]:
    scenario = make_scenario()
    return scenario, simulate(scenario)


@pytest.fixture(scope='module')
def shown(
    run: tuple[Scenario, list[Period]], tmp_path_factory: pytest.TempPathFactory
) -> list[tuple[int, dict[str, Any]]]:
    scenario, periods = run
    folder = tmp_path_factory.mktemp('run') / 'bag'
    write_run_bag(folder, scenario, periods, {})
    return [
        (time_ns, {marker.ns: marker for marker in message.markers})
        for _, message, time_ns in read_bag(folder, [MARKERS.name])
    ]


def place(point: Any) -> tuple[float, float, float]:
    return point.x, point.y, point.z


def test_everything_of_a_handover_is_shown(
    run: tuple[Scenario, list[Period]], shown: list[tuple[int, dict[str, Any]]]
) -> None:
    scenario, periods = run
    at = {period.time_ns: period for period in periods}
    assert len(periods) / EVERY / 3 < len(shown) <= len(periods) / EVERY
    for time_ns, markers in shown:
        assert place(markers['wrist'].pose.position) == tuple(at[time_ns].wrist_position)
        assert dist(place(markers['hand'].pose.position), at[time_ns].hand) < 1e-9
        for marker in markers.values():
            stamp = marker.header.stamp
            assert stamp.sec * 10**9 + stamp.nanosec == time_ns
            assert marker.header.frame_id == FRAME
    last = {name: marker for name, marker in shown[-1][1].items() if marker.action == ADD}
    assert set(last) == {
        'learnt path', 'hand', 'hand trail', 'wrist', 'wrist trail', 'exchange',
    }  # fmt: skip
    path = [place(point) for point in last['learnt path'].points]
    assert dist(path[-1], scenario.model.goal) < 0.02
    assert dist(place(last['exchange'].pose.position), periods[-1].wrist_position) < 0.02
    expected = [
        place(markers['expected meeting point'].pose.position)
        for _, markers in shown
        if markers.get('expected meeting point', last['hand']).action == ADD
        and 'expected meeting point' in markers
    ]
    assert dist(expected[len(expected) // 2], periods[-1].exchange_position) < 0.1


def test_viewers_can_draw_each_marker(shown: list[tuple[int, dict[str, Any]]]) -> None:
    """Lichtblick reports a line of one point, and needs a size, a colour and a rotation."""
    for _, markers in shown:
        for marker in markers.values():
            if marker.action == DELETE:
                continue
            turn = marker.pose.orientation
            assert (turn.x, turn.y, turn.z, turn.w) == (0.0, 0.0, 0.0, 1.0)
            assert marker.color.a > 0.0 and marker.scale.x > 0.0
            assert marker.type in (SPHERE, LINE_STRIP)
            assert marker.type == SPHERE or len(marker.points) > 1
    trails = [markers['wrist trail'].points for _, markers in shown]
    assert all(len(one) < len(two) for one, two in pairwise(trails))


def test_the_numbers_of_kinds_and_actions_are_those_of_the_message() -> None:
    marker = pytest.importorskip('visualization_msgs.msg').Marker
    assert (SPHERE, LINE_STRIP) == (marker.SPHERE, marker.LINE_STRIP)
    assert (ADD, DELETE) == (marker.ADD, marker.DELETE)
