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

"""The node `hand_tracker` alone with a session: its partner waits until the object has passed."""

from __future__ import annotations

from pathlib import Path
import time
from typing import Any

from handover_dmp.mocap.session import write_sessions
from handover_dmp.mocap.synthetic_session import synthesize_sessions
from handover_dmp.nodes.conversions import position_of
from handover_dmp.nodes.graph import Graph
from handover_dmp.nodes.qos import message_class, qos_profile
from handover_dmp.topics import (
    CLOCK,
    DEMONSTRATOR_POSE,
    GRIPPER_COMMAND,
    HAND_POSE,
    HAND_TRUTH,
    OBJECT_HOLDER,
    SIGNAL,
    Topic,
    WRIST_POSE,
)
import numpy as np
import pytest
from rclpy.duration import Duration
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, String

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

PERIOD_NS = 50_000_000
TOPICS = (HAND_POSE, HAND_TRUTH, DEMONSTRATOR_POSE, SIGNAL)


class Partner:
    """Hears what the node says, and stands in for `robot_sim` and `dmp`."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.heard: dict[str, list[Any]] = {topic.name: [] for topic in TOPICS}
        for topic in TOPICS:
            graph.node.create_subscription(
                message_class(topic.type_name),
                topic.name,
                self.heard[topic.name].append,
                qos_profile(topic.quality),
            )

    def publisher(self, topic: Topic) -> Any:
        kind, profile = message_class(topic.type_name), qos_profile(topic.quality)
        return self.graph.node.create_publisher(kind, topic.name, profile)

    def tell(self, publisher: Any, message: Any) -> None:
        """Publish a latched message, and wait until the node has it."""
        self.until(publisher.get_subscription_count)
        publisher.publish(message)
        assert publisher.wait_for_all_acked(Duration(seconds=40.0))

    def until(self, done: Any, act: Any = lambda: None, every_s: float = 0.15) -> None:
        end, due = time.monotonic() + 40.0, 0.0
        while not done():
            now = time.monotonic()
            assert now < end, {name: len(found) for name, found in self.heard.items()}
            if now >= due:
                act()
                due = now + every_s
            self.graph.spin(0.002)

    def seconds(self, topic: Topic) -> list[float]:
        heard = self.heard[topic.name]
        stamps = [(one if topic is SIGNAL else one.header).stamp for one in heard]
        return [stamp.sec + 1e-9 * stamp.nanosec for stamp in stamps]


def test_in_lockstep_the_partner_waits_for_the_object(tmp_path: Path) -> None:
    session = synthesize_sessions(2, 1, configurations=['under_car'])[0]
    write_sessions([session], tmp_path / 'recorded')
    values = {
        'source': 'session',
        'trial': str(tmp_path / 'recorded' / session.file_name),
        'session.lead_s': 0.5,
        'rate_hz': 20.0,
        'replay_at_s': 0.2,
        'lockstep': True,
        'use_sim_time': True,
    }
    with Graph(
        tmp_path, {'hand_tracker': values}, lockstep=False, nodes=('hand_tracker',)
    ) as graph:
        partner = Partner(graph)
        clock, holder = partner.publisher(CLOCK), partner.publisher(OBJECT_HOLDER)
        # or it would play on until it discovers who tells it of the object
        partner.tell(holder, String(data='robot'))
        poses = partner.heard[HAND_POSE.name]
        still, passed = 0, []
        for count in range(1, 600):
            tick = Clock()
            tick.clock.sec, tick.clock.nanosec = divmod(count * PERIOD_NS, 10**9)
            now_s = count * PERIOD_NS * 1e-9
            partner.until(
                lambda now_s=now_s: bool(poses) and partner.seconds(HAND_POSE)[-1] > now_s - 1e-6,
                lambda tick=tick: clock.publish(tick),
            )
            moved = len(poses) > 1 and position_of(poses[-1]) != position_of(poses[-2])
            signals = len(partner.heard[SIGNAL.name])
            still = 0 if moved else still + 1
            # 0.4 s after it stands still, the object has passed
            if still > 8 and signals > len(passed) and len(passed) < 2:
                holder.publish(String(data='partner' if not passed else 'robot'))
                passed.append(now_s)
            if len(passed) == 2 and now_s > passed[-1] + 2.0:
                break
    give, take = session.exchanges
    signals = partner.seconds(SIGNAL)
    # 0.1 s is lost by starting softly
    assert signals[0] == pytest.approx(0.2 + 0.1 + 0.5, abs=1e-6)
    assert len(signals) == len(passed) == 2
    assert passed[0] > signals[0] + give.exchange_s - give.start_s + 0.4
    assert signals[1] - passed[0] == pytest.approx(take.start_s - give.parting_s, abs=0.5)
    # held out to where the recording has it, as true as the tracker says it
    held = [position_of(message) for message in poses]
    row = int(np.searchsorted(session.motion.times, give.parting_s - 0.1))
    number = int(np.searchsorted(partner.seconds(HAND_POSE), passed[0]))
    np.testing.assert_allclose(held[number], session.motion.partner[row], atol=2e-3)
    # who sees perfectly sees the truth; some messages may be overwritten by the next
    seen = dict(zip(partner.seconds(HAND_POSE), held, strict=True))
    truth = dict(zip(partner.seconds(HAND_TRUTH), partner.heard[HAND_TRUTH.name], strict=True))
    both = seen.keys() & truth.keys()
    assert len(both) > 0.5 * len(seen)
    assert all(position_of(truth[stamp]) == pytest.approx(seen[stamp]) for stamp in both)
    assert len(partner.heard[DEMONSTRATOR_POSE.name]) > 0.5 * len(poses)


def test_on_the_wall_clock_it_begins_by_itself_and_the_gripper_tells_of_the_object(
    tmp_path: Path,
) -> None:
    values = {'source': 'session', 'session.lead_s': 0.3, 'replay_at_s': 0.1, 'rate_hz': 100.0}
    with Graph(
        tmp_path, {'hand_tracker': values}, lockstep=False, nodes=('hand_tracker',)
    ) as graph:
        partner = Partner(graph)
        gripper = partner.publisher(GRIPPER_COMMAND)
        partner.tell(gripper, Bool(data=True))
        partner.publisher(WRIST_POSE)
        poses = partner.heard[HAND_POSE.name]

        def waits() -> bool:
            places = [position_of(message) for message in poses[-30:]]
            return bool(partner.heard[SIGNAL.name]) and len(set(places)) == 1

        partner.until(waits)
        held = np.array(position_of(poses[-1]))
        partner.tell(gripper, Bool(data=False))
        partner.until(lambda: np.linalg.norm(np.array(position_of(poses[-1])) - held) > 0.2)
    assert len(partner.heard[SIGNAL.name]) == 1
