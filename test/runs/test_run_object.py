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

"""A bag of a run in which an object is simulated tells of it; one without is as it was."""

from __future__ import annotations

from pathlib import Path

from handover_dmp.handover.lockstep import Handover, Period
from handover_dmp.handover.scenario import make_scenario
from handover_dmp.recording import bag_information, read_bag
from handover_dmp.runs.bag import write_run_bag
from handover_dmp.simulation.arm import SimulatedArm
from handover_dmp.simulation.carried_object import CarriedObjectOptions
from handover_dmp.topics import (
    GRIPPER_COMMAND,
    OBJECT_HOLDER,
    OBJECT_POSE,
    WRIST_WRENCH,
)


def test_wrench_pose_holder_and_gripper_are_in_the_bag(tmp_path: Path) -> None:
    scenario = make_scenario()
    handover = Handover(scenario)
    periods: list[Period] = []
    with SimulatedArm(
        scenario.robot, carried=CarriedObjectOptions(mass_kg=0.5, noise_n=0.0)
    ) as arm:
        arm.reset(scenario.q_start)
        for number in range(20):
            arm.set_gripper(number < 10)
            arm.advance(handover.period_s)
            periods.append(handover.step()._replace(object_state=arm.object_state))
    handover.close()

    without = [period._replace(object_state=None) for period in periods]
    write_run_bag(tmp_path / 'without', scenario, without, {})
    topics = {t.name for t in (GRIPPER_COMMAND, WRIST_WRENCH, OBJECT_POSE, OBJECT_HOLDER)}
    assert not topics & set(bag_information(tmp_path / 'without').topics)

    write_run_bag(tmp_path / 'bag', scenario, periods, {})
    assert topics <= set(bag_information(tmp_path / 'bag').topics)
    read: dict[str, list] = {name: [] for name in topics}
    for topic, message, _ in read_bag(tmp_path / 'bag', sorted(topics)):
        read[topic].append(message)
    lifted = [-message.wrench.force.z for message in read[WRIST_WRENCH.name]]
    assert len(lifted) == len(read[OBJECT_POSE.name]) == len(periods)
    assert min(lifted[:10]) > 4.8 and max(map(abs, lifted[10:])) < 1e-9
    heights = [message.pose.position.z for message in read[OBJECT_POSE.name]]
    assert heights[0] - heights[-1] > 0.01
    assert [message.data for message in read[OBJECT_HOLDER.name]] == ['robot', 'nobody']
    assert [message.data for message in read[GRIPPER_COMMAND.name]] == [True, False]
