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

"""Node `priority_ik`: computes joint velocities from wrist commands, publishes the wrist."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from statistics import median
import sys
from time import sleep
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, TwistStamped
from handover_dmp.common.settings import parameters_of
from handover_dmp.mocap.message_bodies import bodies
from handover_dmp.nodes.arm import limits_told, load_arm
from handover_dmp.nodes.conversions import (
    NANOSECONDS,
    nanoseconds,
    pose_message,
    position_of,
    quaternion_of,
    rotation_of,
    to_float_array,
    to_joint_command,
    velocities_of,
)
from handover_dmp.nodes.diagnostics import of_the_hand, report_condition
from handover_dmp.nodes.hand_input import HandInputs, HandPose
from handover_dmp.nodes.lockstep import HEAD_START_S, Lockstep
from handover_dmp.nodes.node import HandoverNode, MISSED_S
from handover_dmp.nodes.parameters import (
    ARM,
    DRIVER,
    fixed,
    on_change,
    parameters_from,
    Values,
)
from handover_dmp.nodes.spin import run
from handover_dmp.nodes.tracker_parameters import goal_estimator, HAND, ONE_TRACKER
from handover_dmp.robot.partner import Partner
from handover_dmp.robot.priority_ik import PriorityIk
from handover_dmp.robot.task_stack import TASKS
from handover_dmp.robot.tasks import WristTarget
from handover_dmp.robot.wrist_controller import (
    JointCommand,
    WristController,
    WristControllerOptions,
)
from handover_dmp.topics import (
    ELBOW_POSE,
    IK_STATUS,
    JOINT_COMMAND,
    JOINT_STATES,
    POSE_COMMAND,
    TWIST_COMMAND,
    WRIST_POSE,
)
import numpy as np
from rclpy.duration import Duration
from sensor_msgs.msg import JointState

MAX_STEP = 4.0
"""Maximum duration of one step, periods."""
MAX_DELIVERY_S = 1.0
"""Maximum wait at the end until the driver has the last command, s."""
COARSE = 0.8
"""Step of simulated time that is too long, as a share of the maximum age of an input."""
OVERDUE_AT_REST = 8.0
"""Maximum duration of one step of an arm that stands at its target, periods."""
OVERDUE = 1.5
"""Periods without a step after which the watchdog steps."""
TIMEOUTS = parameters_from(WristControllerOptions)
TASK_PARAMETERS = parameters_from(*TASKS)


class PriorityIkNode(HandoverNode):
    """The inverse kinematics as a node."""

    NAME = 'priority_ik'
    PARAMETERS = (
        *ARM,
        *DRIVER,
        *HAND,
        *TIMEOUTS,
        *TASK_PARAMETERS,
        fixed(
            'rate_hz',
            'Rate of the wrist commands, and of the watchdog when they are missing, Hz',
            10.0,
            1000.0,
        ),
        fixed(
            'status_rate_at_rest_hz',
            'Rate of wrist/ik_status while the arm stands at its target, wall clock only, Hz',
            0.1,
            1000.0,
        ),
    )

    OF_EACH_TRACKER = ONE_TRACKER

    def __init__(self) -> None:
        """Load the arm, connect the topics, wait for joint states and commands."""
        super().__init__()
        self._model = load_arm(self)
        self._controller = WristController(
            self._model,
            PriorityIk(self._model, **_tasks(self.values)),
            _timeouts(self.values),
            joint_prefix=self.values['joint_prefix'],
        )
        on_change(self, TIMEOUTS + TASK_PARAMETERS, self._prepare)
        self._hand = goal_estimator(self.values)
        self._pose: PoseStamped | None = None
        self._twist: TwistStamped | None = None
        self._pair: tuple[PoseStamped, TwistStamped, float] | None = None
        self._answered_s: float | None = None
        self._commanded = False
        self._lockstep_s = 0.0
        self._followed_s = self._follows_since_s = nan
        self._measured_stamp: Time | None = None
        self._wrist: PoseStamped | None = None
        self._commands = False
        self._command: Any = None
        self._status: Any = None
        self._fault = 'no joint states yet'
        self._active: tuple[str, ...] = ()
        self._refused = 0
        self._refusal = ''
        self._twist_awaited = self._rests = False
        self._told_s = -inf
        self._told_every_s = 1.0 / self.values['status_rate_at_rest_hz'] - 0.5 * self.period_s
        self._tells = False
        self._watched_s = 0.0
        self._clock_steps_s: list[float] = []
        self._taken_ns: int | None = None
        self._lockstep = Lockstep(
            self.period_s,
            self._answer,
            self._publish_again,
            patience_s=lambda: self.patience_s() + HEAD_START_S,
            begun=lambda: self._taken_ns is not None or self._pose is not None,
            ready=self._ready,
        )
        self._connect()
        if not self.lockstep:
            self.every(self.period_s, self._watch)
        report_condition(self, self._condition)
        self.warn_when_in_vain(self._missing)
        if self.simulated and not self.lockstep:
            self.warn_when_in_vain(self._coarse_time, looks_before=2)
        self.say_changes(lambda: f'following {self.named(POSE_COMMAND)}', lambda: self._fault)
        self.say(
            f'moves {self._model.wrist_frame} of {self._model.name} in frame {self.frame}; '
            f'listens to {self.named(JOINT_STATES)}, {self.named(POSE_COMMAND)} and '
            f'{self._hands.named}'
        )

    def _missing(self) -> str:
        ages = self._controller.ages_s(self.arrival_s())
        for age, topic, who in (
            ('joint states', JOINT_STATES, 'the driver, or robot_sim,'),
            ('wrist command', POSE_COMMAND, 'dmp'),
        ):
            if ages[age] > MISSED_S:
                return f'waiting for {age} on {self.named(topic)}: is {who} running?'
        return ''

    def _coarse_time(self) -> str:
        """Return a warning if the clock steps by more than the maximum age of an input."""
        steps_s, self._clock_steps_s = self._clock_steps_s, []
        options = self._controller.options
        limit_s = min(options.joint_state_timeout_s, options.command_timeout_s)
        step_s = median(steps_s) if steps_s else 0.0
        if step_s <= COARSE * limit_s:
            return ''
        return (
            f'/clock advances by steps of {step_s:.3f} s, and inputs expire after {limit_s:g} s, '
            'so the arm brakes repeatedly; publish it more often, e.g. ros2 bag play --clock 100'
        )

    def _connect(self) -> None:
        self._wrist_pose = self.advertise(WRIST_POSE)
        self._joint_command = self.advertise(JOINT_COMMAND)
        self._ik_status = self.advertise(IK_STATUS)
        self.subscribe(JOINT_STATES, self._on_joint_states)
        self.subscribe(POSE_COMMAND, self._on_pose)
        self.subscribe(TWIST_COMMAND, self._on_twist)
        self._hands = HandInputs(self, self._on_hand, self._refuse_hand, self._lockstep.look)
        self.subscribe(ELBOW_POSE, self._on_elbow)

    # Inputs

    def _on_joint_states(self, message: JointState) -> None:
        time_ns = nanoseconds(message.header.stamp)
        arrival_s = time_ns / NANOSECONDS if self.lockstep else self.arrival_s()
        if not self._controller.set_joint_state(
            message.name, message.position, message.velocity, arrival_s
        ):
            if self._controller.joint_states.concerns(message.name):
                self._refuse('joint states')
            return
        self._measured_stamp = message.header.stamp
        if self.lockstep:
            self._publish_wrist()
            self._lockstep.ask(time_ns)

    def _publish_wrist(self) -> None:
        if self._measured_stamp is None:
            return
        assert self._controller.positions is not None
        position, rotation = self._model.wrist_pose(self._controller.positions)
        stamp, orientation = self._measured_stamp, quaternion_of(rotation)
        self._wrist = pose_message(
            stamp, position.tolist(), orientation, frame=self.frame, into=self._wrist
        )
        self._wrist_pose.publish(self._wrist)
        self._measured_stamp = None

    def _on_pose(self, message: PoseStamped) -> None:
        if message.header.frame_id != self.frame:
            self._refuse(f'wrist command in frame {message.header.frame_id!r}, not {self.frame!r}')
            return
        self._pose = message
        self._on_command()

    def _on_twist(self, message: TwistStamped) -> None:
        self._twist = message
        self._on_command()

    def _on_command(self) -> None:
        if self.lockstep:
            self._lockstep.look()
        elif (twist := self._twist_of_pose()) is not None:
            self._pair = self._pose, twist, self.arrival_s()
            self._pose = None
            # commands may arrive in a burst after a stall; the watchdog takes the newest
            if self._since_step_s() >= 0.5 * self.period_s:
                self._tick()
                self._commanded = True

    def _refuse_hand(self, tracker: str, reason: str, text: str) -> None:
        self._hand.refuse(reason, tracker)
        self._refuse(text)

    def _on_hand(self, hand: HandPose) -> None:
        now_s, pose = self._lockstep_s if self.lockstep else self.now_s(), hand.pose
        reason = self._hand.update(
            hand.stamp_ns / NANOSECONDS,
            pose.position,
            now_s,
            pose.orientation,
            pose.covariance,
            hand.tracker,
        )
        estimate = self._hand.estimate(now_s)
        if reason and reason != 'repeated':
            self._refuse(f'hand, {reason}')
        elif not reason and estimate is not None:
            known = Partner(np.array(estimate.position), np.array(estimate.velocity))
            arrival_s = now_s if self.lockstep else self.arrival_s()
            self._controller.set_hand(known, arrival_s, self._hand.timeout_s)

    def _on_elbow(self, message: PoseStamped) -> None:
        elbow = next(iter(bodies(message) or []), None)
        if elbow is None or elbow.is_lost:
            return
        place = self._hands.placed(elbow.position, message.header)
        if place is None:
            self._refuse(f'elbow in frame {message.header.frame_id!r}, not {self.frame!r}')
            return
        arrival_s = self._lockstep_s if self.lockstep else self.arrival_s()
        self._controller.set_elbow(np.array(place), arrival_s)

    def _twist_of_pose(self) -> TwistStamped | None:
        """Return the twist that belongs to the newest pose, if both have arrived."""
        pose, twist = self._pose, self._twist
        one = pose is not None and twist is not None and pose.header.stamp == twist.header.stamp
        return twist if one else None

    def _awaits_twist(self) -> bool:
        """Whether to wait one more period for the twist of the newest pose."""
        late = self._twist is not None and self._twist_of_pose() is None
        self._twist_awaited = late and not self._twist_awaited
        return self._twist_awaited

    def _take(self, pose: PoseStamped, twist: TwistStamped | None, arrival_s: float) -> None:
        """Pass on a command; without a twist, the wrist shall come to rest there."""
        linear, angular = map(np.array, velocities_of(twist or TwistStamped()))
        target = WristTarget(np.array(position_of(pose)), linear, rotation_of(pose), angular)
        if self._controller.set_target(target, arrival_s):
            self._followed_s = nanoseconds(pose.header.stamp) / NANOSECONDS
            self._follows_since_s = arrival_s
        else:
            self._refuse('wrist command')

    def _prepare(self, values: Values) -> Callable[[], None]:
        ik, timeouts = PriorityIk(self._model, **_tasks(values)), _timeouts(values)

        def apply() -> None:
            self._controller.ik = ik
            self._controller.options = timeouts

        return apply

    # Periods

    def _ready(self, tick_ns: int) -> bool:
        options, pose = self._controller.options, self._pose
        if self._twist_of_pose() and pose and nanoseconds(pose.header.stamp) == tick_ns:
            return self._hands.are_there(tick_ns, options.hand_timeout_s)
        # a sender without commands for so long is gone, and is not waited for
        timeout_ns = round(options.command_timeout_s * NANOSECONDS)
        return self._taken_ns is not None and tick_ns - self._taken_ns > timeout_ns

    def _answer(self, tick_ns: int, elapsed_s: float) -> None:
        now_s = tick_ns / NANOSECONDS
        self._lockstep_s = now_s
        self._hands.release()
        if self._pose is not None:
            # a dmp that wakes from a stall first answers old requests
            age_s = now_s - nanoseconds(self._pose.header.stamp) / NANOSECONDS
            if age_s <= self._controller.options.command_timeout_s:
                self._taken_ns = tick_ns
                self._take(self._pose, self._twist_of_pose(), now_s)
            self._pose = None
        self._solve(now_s, elapsed_s, tick_ns)

    def _watch(self) -> None:
        """Step without the wrist command, which did not arrive in time."""
        if self.simulated:
            now_s = self.arrival_s()
            self._clock_steps_s.append(now_s - self._watched_s)
            self._watched_s = now_s
        overdue = OVERDUE if self._commanded and self._pair is None else 0.5
        if self._rests and self._pair is None:
            overdue = OVERDUE_AT_REST
        if self._since_step_s() >= overdue * self.period_s:
            self._tick()
            self._commanded = False

    def _since_step_s(self) -> float:
        return inf if self._answered_s is None else self.arrival_s() - self._answered_s

    def _tick(self) -> None:
        time_ns = self.now_ns()
        now_s = self.arrival_s()
        last_s, self._answered_s = self._answered_s, now_s
        if self._pair is not None:
            self._take(*self._pair)
            self._pair = None
        elif self._pose is not None and not self._awaits_twist():
            self._take(self._pose, None, now_s)
            self._pose = None
        elapsed_s = self.period_s if last_s is None else max(now_s - last_s, 0.0)
        elapsed_s = min(elapsed_s, MAX_STEP * self.period_s)
        self._solve(now_s, elapsed_s, time_ns)
        # only now, since a period that is due would have to wait for this
        self._publish_wrist()

    def _solve(self, now_s: float, elapsed_s: float, time_ns: int) -> None:
        self.periods.tick()
        command = self._controller.update(now_s, elapsed_s)
        self._fault = command.reason
        self._commands = command.velocities is not None
        self._rests = False
        if command.velocities is not None:
            velocities = command.velocities.tolist()
            self._command = to_joint_command(time_ns, velocities, into=self._command)
            self._rests = not (self.lockstep or self._fault or any(velocities))
        # before the status: the arm waits for it
        self._publish_command()
        if self._rests:
            self.periods.rest()
        self._active = command.solution.active_limits if command.solution else ()
        self._tells = not (self._rests and 0.0 <= now_s - self._told_s < self._told_every_s)
        if self._tells:
            self._told_s = now_s
            self._tell(command, now_s, time_ns)
        self._publish_status()

    def _tell(self, command: JointCommand, now_s: float, time_ns: int) -> None:
        numbers = command.status_values(time_ns / NANOSECONDS) | {
            'command_stamp_s': self._followed_s,
            'command_age_s': now_s - self._follows_since_s,
            'period': self.periods.count,
        }
        self._status = to_float_array(numbers, into=self._status)

    def _publish_again(self) -> None:
        self._publish_command()
        self._publish_status()

    def _publish_command(self) -> None:
        if self._commands:
            self._joint_command.publish(self._command)

    def _publish_status(self) -> None:
        if self._tells and self._status is not None:
            self._ik_status.publish(self._status)

    def finish(self) -> None:
        """Bring the arm to rest, since a velocity controller keeps its last command for ever."""
        super().finish()
        while not self.lockstep:
            command = self._controller.stop('told to end', self.period_s)
            if command.velocities is None:
                # messages that the driver does not have yet would be lost with this node
                self._joint_command.wait_for_all_acked(Duration(seconds=MAX_DELIVERY_S))
                return
            self._joint_command.publish(to_joint_command(self.now_ns(), command.velocities))
            sleep(self.period_s)

    # Condition

    def _refuse(self, what: str) -> None:
        self._refused += 1
        self._refusal = f'refused: {what}'

    def _condition(self) -> tuple[str, dict[str, str]]:
        refused, self._refused = self._refused, 0
        refusal, self._refusal = self._refusal, ''
        ages = self._controller.ages_s(self.arrival_s())
        return '; '.join(filter(None, (self._fault, refusal))), {
            **{f'age of the {name} (s)': f'{age_s:.3f}' for name, age_s in ages.items()},
            'active limits': ', '.join(self._active) or 'none',
            'messages refused': str(refused),
            **of_the_hand(self._hand, self._hand.report(self.now_s())),
            **limits_told(self._model),
        }


def _timeouts(values: Values) -> WristControllerOptions:
    return WristControllerOptions(**parameters_of(WristControllerOptions, values))


def _tasks(values: Values) -> Values:
    return {p.name: values[p.name] for p in TASK_PARAMETERS}


def main() -> int:
    """Run the node."""
    return run(PriorityIkNode)


if __name__ == '__main__':
    sys.exit(main())
