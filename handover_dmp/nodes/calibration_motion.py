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

"""
Node `calibration_motion`: moves the arm to calibrate a tracker, in place of `priority_ik`.

It answers each joint state with joint velocities, zero before and after the motion, and publishes
the pose of the wrist. With `simulated_tracker.enabled` it also publishes the poses of a tracker.
"""

from __future__ import annotations

import sys
from time import sleep

from builtin_interfaces.msg import Time
from handover_dmp.common.settings import parameters_of
from handover_dmp.nodes.arm import limits_told, load_arm
from handover_dmp.nodes.conversions import (
    NANOSECONDS,
    nanoseconds,
    pose_message,
    quaternion_of,
    stamp,
    to_joint_command,
)
from handover_dmp.nodes.diagnostics import report_condition
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.nodes.parameters import ARM, DRIVER, fixed, parameters_from
from handover_dmp.nodes.spin import run
from handover_dmp.robot.calibration_motion import (
    MotionFollower,
    plan_calibration_motion,
    wrist_box,
)
from handover_dmp.robot.errors import UnreachableError
from handover_dmp.robot.joint_states import JointStateReader
from handover_dmp.topics import HAND_POSE, JOINT_COMMAND, JOINT_STATES, WRIST_POSE
from handover_dmp.tracking.simulated_tracker import SimulatedTracker, TrackerPlace
import numpy as np
from sensor_msgs.msg import JointState

TRACKER = 'simulated_tracker.'
MAX_STEP = 4.0
"""Maximum duration of a command after a late joint state, periods."""
LOOK_S = 0.02
SETTLE_S = 0.5
"""Time for which the arm is held after the motion, s."""


class CalibrationMotionNode(HandoverNode):
    """The motion as a node."""

    NAME = 'calibration_motion'
    PARAMETERS = (
        *ARM,
        *DRIVER,
        fixed('rate_hz', 'Rate of the joint states, Hz', 10.0, 1000.0),
        fixed('duration_s', 'Duration of the motion, s', 5.0, 600.0),
        fixed('wrist_speed', 'Maximum speed of the wrist, m/s', 0.01, 1.0),
        fixed(
            'start',
            'Trigger of the motion: auto (the first joint states) or service (~/start)',
            choices=('auto', 'service'),
        ),
        fixed(
            'joint_state_timeout_s',
            'Age of the joint states beyond which the arm brakes, s',
            0.005,
            10.0,
        ),
        fixed(TRACKER + 'enabled', 'Whether to simulate the tracker as well'),
        fixed(TRACKER + 'frame', 'Frame of the simulated poses'),
        *parameters_from(TrackerPlace),
    )

    def __init__(self) -> None:
        """Load the arm, connect the topics, wait for joint states."""
        super().__init__()
        values = self.values
        self._model = load_arm(self)
        self._reader = JointStateReader(self._model.joint_names, values['joint_prefix'])
        self._wanted = values['start'] == 'auto'
        self._follower: MotionFollower | None = None
        self._positions = self._model.home
        self._began_s = self._told_s = 0.0
        self._heard_s: float | None = None
        self._told_ns = -1
        self._fault = ''
        self._tracker: SimulatedTracker | None = None
        if values[TRACKER + 'enabled']:
            place = TrackerPlace(**parameters_of(TrackerPlace, values))
            self._tracker = SimulatedTracker(place)
            self._hand = self.advertise(HAND_POSE)
        self._command = self.advertise(JOINT_COMMAND)
        self._wrist = self.advertise(WRIST_POSE)
        self.subscribe(JOINT_STATES, self._on_joint_states)
        self.serve('start', self._start)
        if not self.lockstep:
            self.every(LOOK_S, self._watch)
        report_condition(self, self._condition)
        self.warn_when_in_vain(self._missing)
        self.say(
            f'moves {self._model.name} to calibrate a tracker: answers '
            f'{self.named(JOINT_STATES)} with {self.named(JOINT_COMMAND)}'
        )

    def _missing(self) -> str:
        if self._heard_s is None:
            states = self.named(JOINT_STATES)
            return f"no joint states yet on {states}: is robot_sim or the arm's driver running?"
        return ''

    def _start(self) -> None:
        self._wanted = True

    def _on_joint_states(self, message: JointState) -> None:
        if not self._reader.concerns(message.name):
            return
        found = self._reader.read(message.name, message.position, message.velocity)
        if isinstance(found, str):
            self._end(found)
            return
        self._positions = found[0]
        time_ns = nanoseconds(message.header.stamp)
        now_s = self._heard_s = self.arrival_s()
        if self.lockstep:
            now_s = time_ns / NANOSECONDS
        again = self.lockstep and time_ns == self._told_ns
        self.periods.tick()
        self._tell_where(message.header.stamp, now_s, again)
        if self._follower is None and self._wanted and not again:
            self._plan()
            # planning takes a while; the arm rests meanwhile
            now_s = now_s if self.lockstep else self.arrival_s()
            self._began_s = self._told_s = now_s
        self._answer(time_ns, now_s)

    def _tell_where(self, time: Time, now_s: float, again: bool) -> None:
        position, rotation = self._model.wrist_pose(self._positions)
        turn = quaternion_of(rotation)
        self._wrist.publish(pose_message(time, position, turn, frame=self.frame))
        if self._tracker is None or again:
            return
        for stamp_s, seen in self._tracker.see(now_s, position, rotation):
            time_ns = round(stamp_s * NANOSECONDS)
            if not self.lockstep:
                # ages and stamps are of different clocks
                time_ns += self.now_ns() - round(now_s * NANOSECONDS)
            frame = self.values[TRACKER + 'frame']
            self._hand.publish(pose_message(stamp(time_ns), seen, frame=frame))

    def _plan(self) -> None:
        try:
            motion = plan_calibration_motion(
                self._model,
                self._positions,
                self.values['duration_s'],
                self.values['wrist_speed'],
            )
        except UnreachableError as error:
            self._end(str(error))
            return
        low, high = wrist_box(self._model, motion).tolist()
        self.say(
            'the wrist will move within '
            + ', '.join(
                f'{axis} {a:.2f} to {b:.2f} m' for axis, a, b in zip('xyz', low, high, strict=True)
            )
        )
        self._follower = MotionFollower(self._model, motion)

    def _answer(self, time_ns: int, now_s: float) -> None:
        velocities = np.zeros(self._model.dof)
        if self._follower is not None and not self.ended:
            dt = min(max(now_s - self._told_s, 1e-3), MAX_STEP * self.period_s)
            time_s = now_s - self._began_s
            if self._fault or time_s >= self.values['duration_s'] + SETTLE_S:
                # the last command must be zero: a driver may keep it
                velocities = self._follower.brake(self._positions, dt)
                self.ended = self._follower.resting
            else:
                velocities, self._fault = self._follower.follow(time_s, self._positions, dt)
                self._look_for_others()
        self._told_s, self._told_ns = now_s, time_ns
        self._command.publish(to_joint_command(time_ns, velocities.tolist()))

    def _look_for_others(self) -> None:
        if not self._fault and self.count_publishers(self._command.topic_name) > 1:
            self._fault = 'another node also commands the arm: stop priority_ik first'
        if self._fault:
            self._end(self._fault)

    def _watch(self) -> None:
        """Brake without feedback if joint states are missing."""
        moving = self._follower is not None and not self._follower.resting
        late_s = self.arrival_s() - (self._heard_s or 0.0)
        if moving and late_s > self.values['joint_state_timeout_s']:
            self._end(f'no joint states for {late_s:.2f} s')
            self.finish_motion()
            self.ended = True

    def _end(self, fault: str) -> None:
        """Report a fault; the arm is braked, then the node ends."""
        if not self.exit_code:
            self.get_logger().error(fault)
        self._fault, self.exit_code = fault, 1
        self.ended = self._follower is None

    def finish_motion(self) -> None:
        """Bring the arm to rest within its limits, with or without joint states."""
        while self._follower is not None and not self._follower.resting:
            velocities = self._follower.brake(self._positions, self.period_s)
            self._command.publish(to_joint_command(self.now_ns(), velocities.tolist()))
            sleep(self.period_s)

    def finish(self) -> None:
        """Bring the arm to rest, then end."""
        if not self.lockstep:
            self.finish_motion()
        super().finish()

    def _condition(self) -> tuple[str, dict[str, str]]:
        return self._fault, {
            'moving': str(self._follower is not None and not self.ended),
            **limits_told(self._model),
        }


def main() -> int:
    """Run the node."""
    return run(CalibrationMotionNode)


if __name__ == '__main__':
    sys.exit(main())
