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

"""Node `robot_sim`: the arm in PyBullet behind the topics of a real driver, and its clock."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from math import inf
import sys
from time import monotonic, sleep

from handover_dmp.common.errors import UsageError
from handover_dmp.common.settings import parameters_of
from handover_dmp.nodes.arm import limits_told, load_arm
from handover_dmp.nodes.conversions import NANOSECONDS, period_of, stamp
from handover_dmp.nodes.diagnostics import report_condition
from handover_dmp.nodes.lockstep import ASK_AGAIN_S, HEAD_START_S, Pace
from handover_dmp.nodes.node import HandoverNode, MISSED_S
from handover_dmp.nodes.object_topics import carried_object, OBJECT, ObjectTopics
from handover_dmp.nodes.parameters import (
    ARM,
    declare,
    fixed,
    on_change,
    Parameter,
    parameters_from,
    Values,
)
from handover_dmp.nodes.spin import run
from handover_dmp.nodes.transforms import TransformPublisher
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.published_description import published_description
from handover_dmp.robot.velocity_driver import ArmOptions, ArmState
from handover_dmp.simulation.arm import SimulatedArm
from handover_dmp.topics import CLOCK, JOINT_COMMAND, JOINT_STATES, ROBOT_DESCRIPTION
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

LOOK_S = 0.02
PATIENCE_WHEN_LOST_S = 0.5

MIN_FACTOR = 0.01
"""Below this, a period would keep the node from its services and from ending."""
MAX_STEP_S = 1.0
"""Step of another simulator's clock above which it was started or reset, s."""

CHANGEABLE = (
    Parameter(
        'real_time_factor',
        'Ratio of simulated time to real time in lockstep; 0: as fast as possible',
        0.0,
        100.0,
    ),
)
POSTURE = (
    fixed('initial_positions', 'Initial joint positions, rad; not set: the home configuration'),
)


class RobotSim(HandoverNode):
    """The simulated arm as a node."""

    NAME = 'robot_sim'
    MAKES_TIME = True
    PARAMETERS = (
        *ARM,
        *CHANGEABLE,
        fixed('rate_hz', 'Rate of the joint states, Hz', 10.0, 1000.0),
        fixed(
            'rate_at_rest_hz',
            'Rate of the joint states while the arm stands still, wall clock only, Hz',
            1.0,
            1000.0,
        ),
        *parameters_from(ArmOptions),
        fixed('paused', 'Whether simulated time stands still at the start'),
        *OBJECT,
    )

    def __init__(self) -> None:
        """Load the arm, compare it with Pinocchio's model, start the simulation."""
        super().__init__()
        _check_factor(self.values)
        model = load_arm(self)
        home = {'initial_positions': model.home.tolist()}
        self.values |= declare(self, POSTURE, defaults_from=home)
        self._arm = SimulatedArm(
            model,
            options=ArmOptions(**parameters_of(ArmOptions, self.values)),
            carried=carried_object(self.values),
        )
        self._start: Sequence[float] = self.values['initial_positions']
        self._arm.reset(self._start)
        self._period_ns = round(self.period_s * NANOSECONDS)
        self._tick_ns = 0
        self._looked_s = self._asked_s = monotonic()
        self._waited_s = 0.0
        self._pace = Pace()
        self._slept_s = 0.0
        self._answers = 0
        self._lost = False
        self._commanded_s = -inf
        self._timeouts_told = 0
        self._paused: bool = self.values['paused']
        self._connect(model)
        if self.lockstep:
            self.every(LOOK_S, self._wait, wall=True)
        else:
            self._stepped_s = self.arrival_s()
            self._told_s = -inf
            # half a period sooner, since it is checked once a period
            self._told_every_s = 1.0 / self.values['rate_at_rest_hz'] - 0.5 * self.period_s
            self.every(self.period_s, self._step_by_the_clock)
        report_condition(self, self._condition)
        self.warn_when_in_vain(self._missing)
        self.say_changes(self._doing, self._stopped)
        self.once_per_second.add(self._warn_of_silence)
        self.say(f'simulates {model.name}; listens to {self.named(JOINT_COMMAND)}')

    def _missing(self) -> str:
        if self._time_s() - self._commanded_s <= MISSED_S:
            return ''
        return f'waiting for a command on {self.named(JOINT_COMMAND)}: is priority_ik running?'

    def _doing(self) -> str:
        if self._paused:
            return 'time stands still until ~/pause is called with false'
        return 'no command yet' if self._commanded_s == -inf else 'following commands'

    def _stopped(self) -> str:
        report = self._arm.report
        if report.state is not ArmState.STOPPED:
            return ''
        return f'{report.reason}; moves again after ~/resume'

    def _warn_of_silence(self) -> None:
        report = self._arm.report
        times = report.timeouts - self._timeouts_told
        self._timeouts_told = report.timeouts
        if times > 0 and report.state is not ArmState.STOPPED:
            self.get_logger().warning(
                f'no command for {self.values["command_timeout_s"]:g} s (× {times}): braked, '
                'continues when commands are back. Is this machine too busy?'
            )

    def _connect(self, model: RobotModel) -> None:
        # on the wall clock nobody needs one, and `ros2 bag play --clock` publishes its own
        self._time_publisher = self.advertise(CLOCK) if self.lockstep else None
        self._time = Clock()
        self._states = self.advertise(JOINT_STATES)
        self._message = JointState(name=list(model.joint_names))
        self._still = [0.0] * model.dof
        # a description from a topic is not published again
        alone = self.values['robot'] != self.resolve_topic_name(ROBOT_DESCRIPTION.relative)
        if alone:
            folder = model.urdf_path.parent
            described = published_description(model.urdf_text, folder, self.frame)
            self.advertise(ROBOT_DESCRIPTION).publish(String(data=described))
        self._transforms = TransformPublisher(self, model, alone=alone)
        self._object = ObjectTopics(self, self._arm)
        self.subscribe(JOINT_COMMAND, self._on_command)
        self.serve_switch('pause', self._pause)
        self.serve('resume', self._arm.resume)
        self.serve('reset', lambda: self._arm.reset(self._start))
        on_change(self, CHANGEABLE, self._prepare)

    # Simulated time: a period ends when the command that answers it has arrived

    def _on_command(self, message: Float64MultiArray) -> None:
        self._commanded_s = self._time_s()
        if not self.lockstep:
            self._arm.command(message.data)
        elif period_of(message) in (self._tick_ns, None) and not self._paused:
            # a command without a period, as for controllers of ros2_control, means this one
            self._arm.command(message.data)
            self._answers += 1
            self._lost = False
            self._advance()
        else:
            # an answer to an earlier period: its sender is alive, and is waited for
            self._lost = False

    def _wait(self) -> None:
        """Repeat the request for a missing command; after a while, go on without it."""
        # also while time stands still, so that all nodes are connected before it runs
        now_s = monotonic()
        # no more than this at once: if all nodes stood still, none was slow
        self._waited_s += min(now_s - self._looked_s, ASK_AGAIN_S)
        self._looked_s = now_s
        if self._paused:
            self._waited_s = 0.0
        if self._answers and self._waited_s > self._patience_s():
            self._lost = True
            self._advance()
        elif now_s - self._asked_s > ASK_AGAIN_S:
            self._publish()

    def _patience_s(self) -> float:
        # `dmp` shall give up first, then `priority_ik`
        if self._lost:
            return min(self.patience_s(), PATIENCE_WHEN_LOST_S)
        return self.patience_s() + 2 * HEAD_START_S

    def _advance(self) -> None:
        self.periods.tick()
        self._object.before(self._tick_ns)
        self._arm.advance(self.period_s)
        self._tick_ns += self._period_ns
        factor = self.values['real_time_factor']
        if factor > 0.0:
            wait_s = self._pace.wait_s(monotonic(), self.period_s / factor)
            self._slept_s += wait_s
            sleep(wait_s)
        self._looked_s, self._waited_s = monotonic(), 0.0
        self._publish()

    # The wall clock, or that of another simulator

    def _step_by_the_clock(self) -> None:
        self.periods.tick()
        now_s = self.arrival_s()
        elapsed_s = now_s - self._stepped_s
        self._stepped_s = now_s
        leapt = self.simulated and not 0.0 <= elapsed_s <= MAX_STEP_S
        rests = self._arm.rests
        if not (self._paused or leapt):
            # a clock that is published 40 times a second advances by several periods at once
            jump_s = max(0.0, elapsed_s - self.period_s) if self.simulated else 0.0
            if rests:
                self._arm.wait(elapsed_s)
            else:
                self._arm.advance(elapsed_s, jump_s)
        if not (rests and 0.0 <= now_s - self._told_s < self._told_every_s):
            self._told_s = now_s
            self._publish()

    def _time_s(self) -> float:
        return self._tick_ns / NANOSECONDS if self.lockstep else self.arrival_s()

    def _publish(self) -> None:
        self._asked_s = monotonic()
        time = stamp(self._tick_ns if self.lockstep else self.now_ns())
        self._message.header.stamp = time
        self._message.position = self._arm.joint_positions.tolist()
        # an arm that is paused while time goes on does not move, whatever follows
        moves = self.lockstep or not self._paused
        self._message.velocity = self._arm.joint_velocities.tolist() if moves else self._still
        # the arm first, since its answer takes longer
        self._states.publish(self._message)
        if self._time_publisher is not None:
            self._time.clock = time
            self._time_publisher.publish(self._time)
        self._transforms.tell(time, self._arm.joint_positions)
        self._object.tell(time)

    def destroy_node(self) -> None:
        """Close the simulated world, then end."""
        self._arm.close()
        super().destroy_node()

    # Services, parameters, condition

    def _pause(self, paused: bool) -> None:
        self._paused = paused

    def _prepare(self, values: Values) -> Callable[[], None]:
        _check_factor(values)
        return lambda: self.values.update(values)

    def _condition(self) -> tuple[str, dict[str, str]]:
        report = self._arm.report
        values = {key: str(value) for key, value in asdict(report).items()}
        values |= limits_told(self._arm.model)
        if self._arm.carries:
            values['holder of the object'] = self._arm.holder.value
        values['age of the joint command (s)'] = f'{self._time_s() - self._commanded_s:.3f}'
        if self.lockstep:
            values |= {
                'simulated (s)': f'{self._tick_ns / NANOSECONDS:.3f}',
                'slept for real_time_factor (s)': f'{self._slept_s:.3f}',
            }
        return report.reason, values


def _check_factor(values: Values) -> None:
    factor = values['real_time_factor']
    if 0.0 < factor < MIN_FACTOR:
        raise UsageError(
            f'real_time_factor is {factor:g}; it must be 0, or at least {MIN_FACTOR:g}'
        )


def main() -> int:
    """Run the node."""
    return run(RobotSim)


if __name__ == '__main__':
    sys.exit(main())
