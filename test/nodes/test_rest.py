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

"""A recorder leaves out what is said while no handover is on, save the second before one."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from handover_dmp.nodes.rest import is_left_out_at_rest, REPEATED_S, Reports, Rest
from handover_dmp.topics import (
    DIAGNOSTICS,
    GRIPPER_COMMAND,
    INFO,
    OBJECT_HOLDER,
    ROBOT_DESCRIPTION,
    SIGNAL,
    STATE,
    TF_STATIC,
    TOPICS,
)

PERIOD_NS = 5_000_000
SECOND_NS = 10**9


def record(rest: Rest, until_s: float, begin_s: float, *, after_s: float = 0.0) -> list[int]:
    """Give the times of a stream that are recorded; a handover begins at a time, s."""
    recorded = []
    for time_ns in range(round(after_s * SECOND_NS), round(until_s * SECOND_NS), PERIOD_NS):
        if time_ns == round(begin_s * SECOND_NS):
            recorded += [kept_ns for _, _, kept_ns in rest.hear('reaching', time_ns)]
        if not rest.keeps('/hand/pose', b'', time_ns):
            recorded.append(time_ns)
    return recorded


def test_a_stream_is_left_out_at_rest_and_back_a_second_before_a_handover() -> None:
    rest = Rest(10.0)
    assert rest.hear('idle', 0) == []
    recorded = record(rest, 60.0, 50.0)
    left_out = sorted(set(range(0, 60 * SECOND_NS, PERIOD_NS)) - set(recorded))
    assert recorded == sorted(recorded)
    assert left_out[0] == 10 * SECOND_NS + PERIOD_NS
    assert left_out[-1] == 49 * SECOND_NS - 2 * PERIOD_NS
    # ten seconds of the rest after it
    assert rest.hear('done', 60 * SECOND_NS) == []
    after = record(rest, 600.0, -1.0, after_s=60.0)
    assert after[-1] == 70 * SECOND_NS


def test_a_recorder_alone_leaves_nothing_out() -> None:
    assert len(record(Rest(10.0), 60.0, -1.0)) == 60 * 200
    rest = Rest(0.0)
    rest.hear('idle', 0)
    assert len(record(rest, 60.0, -1.0)) == 60 * 200


def test_what_is_rarely_said_and_nothing_else_is_never_left_out() -> None:
    rare = {topic for topic in TOPICS if not is_left_out_at_rest(topic)}
    once = {INFO, ROBOT_DESCRIPTION, TF_STATIC}
    assert rare == {DIAGNOSTICS, SIGNAL, STATE, GRIPPER_COMMAND, OBJECT_HOLDER} | once


def report(name: str, message: str = 'ok', stage: str = 'running') -> DiagnosticArray:
    values = [KeyValue(key='stage', value=stage), KeyValue(key='age (s)', value='0.1')]
    return DiagnosticArray(status=[DiagnosticStatus(name=name, message=message, values=values)])


def test_a_report_is_news_where_it_says_something_else_or_after_a_while() -> None:
    reports = Reports()
    told = [
        reports.are_news(report(node), second * SECOND_NS)
        for second in range(130)
        for node in ('dmp', 'robot_sim')
    ]
    assert [i // 2 for i, news in enumerate(told) if news] == [0, 0, 60, 60, 120, 120]
    assert REPEATED_S == 60.0
    now_ns = 130 * SECOND_NS
    assert reports.are_news(report('dmp', 'no fresh hand: braking (× 2)'), now_ns)
    assert not reports.are_news(report('dmp', 'no fresh hand: braking (× 31)'), now_ns)
    assert not reports.are_news(report('robot_sim'), now_ns)
    assert reports.are_news(report('robot_sim', stage='end'), now_ns)
