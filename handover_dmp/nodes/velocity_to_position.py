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

"""Node `velocity_to_position`: converts joint velocities to positions, for arms that need them."""

from __future__ import annotations

from dataclasses import asdict
import sys
from time import sleep

from handover_dmp.common.errors import UsageError
from handover_dmp.common.settings import parameters_of
from handover_dmp.nodes.arm import limits_told, load_arm
from handover_dmp.nodes.conversions import to_joint_command
from handover_dmp.nodes.diagnostics import report_condition
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.nodes.parameters import ARM, DRIVER, fixed, parameters_from
from handover_dmp.nodes.spin import run
from handover_dmp.robot.position_commander import PositionCommander, PositionCommanderOptions
from handover_dmp.robot.velocity_driver import ArmOptions, CommandOutcome
from handover_dmp.topics import JOINT_COMMAND, JOINT_POSITIONS, JOINT_STATES
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

MAX_STEP = 4.0
"""Maximum time that is made up for after a late period, periods."""


class VelocityToPosition(HandoverNode):
    """The integrator of joint velocities as a node."""

    NAME = 'velocity_to_position'
    PARAMETERS = (
        *ARM,
        *DRIVER,
        fixed('rate_hz', 'Rate of the joint positions, Hz', 10.0, 1000.0),
        *parameters_from(ArmOptions, PositionCommanderOptions),
    )

    def __init__(self) -> None:
        """Load the arm, connect the topics, wait for joint states and commands."""
        super().__init__()
        if self.lockstep:
            raise UsageError(
                f'{self.NAME}: lockstep is not possible with a real arm; set lockstep:=false'
            )
        values = self.values
        model = load_arm(self)
        self._commander = PositionCommander(
            model,
            ArmOptions(**parameters_of(ArmOptions, values)),
            PositionCommanderOptions(**parameters_of(PositionCommanderOptions, values)),
            joint_prefix=values['joint_prefix'],
        )
        self._answered_s = self.arrival_s()
        self._fault = ''
        self._message: Float64MultiArray | None = None
        self._positions = self.advertise(JOINT_POSITIONS)
        self.subscribe(JOINT_STATES, self._on_joint_states)
        self.subscribe(JOINT_COMMAND, self._on_command)
        self.serve('resume', self._commander.resume)
        self.every(self.period_s, self._answer)
        report_condition(self, self._condition)
        self.say_changes(lambda: 'following commands', lambda: self._fault)
        self.say(
            f'converts velocities to positions of {model.name}; listens to '
            f'{self.named(JOINT_COMMAND)} and {self.named(JOINT_STATES)}'
        )

    def _on_joint_states(self, message: JointState) -> None:
        self._commander.set_joint_state(
            message.name, message.position, message.velocity, self.arrival_s()
        )

    def _on_command(self, message: Float64MultiArray) -> None:
        outcome = self._commander.command(message.data, self.arrival_s())
        if outcome is CommandOutcome.REFUSED:
            fault = self._commander.report.last_fault
            self.get_logger().warning(f'refused: {fault}', throttle_duration_sec=1.0)

    def _answer(self) -> None:
        self.periods.tick()
        now_s = self.arrival_s()
        elapsed_s = min(max(now_s - self._answered_s, 0.0), MAX_STEP * self.period_s)
        self._answered_s = now_s
        self._publish(elapsed_s)

    def _publish(self, elapsed_s: float) -> bool:
        command = self._commander.update(self.arrival_s(), elapsed_s)
        self._fault = command.reason
        if command.positions is None:
            return False
        positions = command.positions.tolist()
        self._message = to_joint_command(self.now_ns(), positions, into=self._message)
        self._positions.publish(self._message)
        return True

    def finish(self) -> None:
        """Bring the arm to rest within its limits, then end."""
        self._commander.stop('told to end')
        while self._publish(self.period_s):
            sleep(self.period_s)
        super().finish()

    def _condition(self) -> tuple[str, dict[str, str]]:
        report = asdict(self._commander.report)
        limits = limits_told(self._commander.model)
        return self._fault, {key: str(value) for key, value in report.items()} | limits


def main() -> int:
    """Run the node."""
    return run(VelocityToPosition)


if __name__ == '__main__':
    sys.exit(main())
