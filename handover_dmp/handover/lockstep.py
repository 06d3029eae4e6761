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
One handover in one process: the objects of the graph in lockstep, without ROS.

The objects and their order are those of the five nodes on simulated time, so both give the same
motion. The result is the same every time, to the last bit with one thread for linear algebra
(`OPENBLAS_NUM_THREADS=1`), as the commands and nodes have it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from handover_dmp.common.arrays import Array
from handover_dmp.common.closing import Closing
from handover_dmp.common.quaternions import from_matrices, normalized, to_matrix
from handover_dmp.handover.controller import (
    AFTERWARDS_S,
    HandoverController,
    HandoverState,
    WristCommand,
)
from handover_dmp.handover.scenario import make_scenario, Scenario
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.partner import Partner
from handover_dmp.robot.priority_ik import PriorityIk
from handover_dmp.robot.tasks import WristTarget
from handover_dmp.robot.wrist_controller import JointCommand, WristController
from handover_dmp.simulation.arm import SimulatedArm
from handover_dmp.simulation.carried_object import CarriedObjectOptions, ObjectState
from handover_dmp.tracking import GoalEstimator, HandEstimate
from handover_dmp.tracking.playback import HandSample, Replay, TrackedHand
from handover_dmp.tracking.tracker_preset import TrackerPreset
import numpy as np

NANOSECONDS = 1_000_000_000
REPLAY_AT_S = 0.5
MAX_EXTRA_S = 5.0
STILL = np.zeros(3)


class Period(NamedTuple):
    """
    All inputs and outputs of one period.

    Attributes:
        time_ns: its start, ns.
        joint_positions: (n,), rad, measured.
        joint_velocities: (n,), rad/s, measured.
        wrist_position: (3,), m, measured.
        wrist_rotation: (3, 3), measured.
        hands: for each tracker, the poses of the partner's hand that arrived.
        estimate: estimate of the hand from all of them; None before the first.
        command: wrist command.
        answer: result of the inverse kinematics.
        object_state: state of the handed-over object; None if none is simulated.
        hand: (3,), m, where the controller takes the partner's hand to be; None if unknown.
        exchange_position: (3,), m, of the wrist when the exchange began; None before that.

    """

    time_ns: int
    joint_positions: Array
    joint_velocities: Array
    wrist_position: Array
    wrist_rotation: Array
    hands: list[list[HandSample]]
    estimate: HandEstimate | None
    command: WristCommand
    answer: JointCommand
    object_state: ObjectState | None = None
    hand: Sequence[float] | None = None
    exchange_position: Sequence[float] | None = None


class LockstepLoop(Closing, ABC):
    """
    The objects of the graph with a controller and a simulated arm, stepped period by period.

    Subclasses define the partner and other events in the world.

    Attributes:
        period_s: length of a period, s.
        controller: controller of the wrist.
        wrist_controller: controller of the joints.
        arm: the simulated arm.

    """

    period_s = 0.005

    def __init__(
        self,
        robot: RobotModel,
        q_start: Array,
        controller: HandoverController,
        *,
        tasks: Mapping[str, Any],
        carried: CarriedObjectOptions | None = None,
    ) -> None:
        """
        Connect the objects.

        Args:
            robot: the arm, placed.
            q_start: (n,), rad, its configuration at the start.
            controller: controller of the wrist.
            tasks: parameters of the inverse kinematics that differ from the defaults.
            carried: the handed-over object; None: no object with a mass.

        """
        self.controller = controller
        self.wrist_controller = WristController(robot, PriorityIk(robot, **tasks))
        self.arm = SimulatedArm(robot, carried=carried)
        self.arm.reset(q_start)
        self._robot = robot
        self._time_ns = 0
        self._phase_rate = 1.0
        self._rotation: Array | None = None

    @property
    def time_s(self) -> float:
        """Return the simulated time, s."""
        return self._time_ns / NANOSECONDS

    @abstractmethod
    def hands_at(self, now_s: float) -> list[list[HandSample]]:
        """
        Return for each tracker the poses that arrive in a period.

        Args:
            now_s: its start, s.

        Returns:
            The poses, in order.

        """

    def before_control(self, now_s: float) -> None:
        """
        Pass further inputs of a period to the controller.

        Args:
            now_s: its start, s.

        """

    def before_motion(self) -> None:
        """Apply other events to the world before it moves."""

    def step(self) -> Period:
        """
        Run one period: all of its messages, then the arm's motion.

        Returns:
            Its inputs and outputs.

        """
        now_s, robot = self.time_s, self._robot
        positions, velocities = self.arm.joint_positions, self.arm.joint_velocities
        self.wrist_controller.set_joint_state(robot.joint_names, positions, velocities, now_s)
        wrist, rotation = robot.wrist_pose(positions)
        if self._rotation is None:
            self._rotation = rotation
        samples = self.hands_at(now_s)
        seen = self._take(samples, now_s)
        turned = None
        if self.controller.turns:
            turned = normalized(from_matrices(rotation).tolist())
        self.controller.set_wrist(tuple(wrist.tolist()), turned)
        object_state = self.arm.object_state
        self.before_control(now_s)
        command = self.controller.step(now_s, self.period_s, self._phase_rate)
        assert command is not None
        place, velocity = np.array(command.position), np.array(command.velocity)
        target = WristTarget(place, velocity, self._rotation, STILL)
        if command.orientation is not None:
            turning = np.array(command.angular_velocity)
            target = WristTarget(place, velocity, to_matrix(command.orientation), turning)
        self.wrist_controller.set_target(target, now_s)
        estimate = self.controller.estimator.estimate(now_s)
        if seen and estimate is not None:
            known = Partner(np.array(estimate.position), np.array(estimate.velocity))
            self.wrist_controller.set_hand(known, now_s, self.controller.estimator.timeout_s)
        answer = self.wrist_controller.update(now_s, self.period_s)
        self._phase_rate = answer.speed_scale
        if answer.velocities is not None:
            self.arm.command(answer.velocities)
        period = Period(
            self._time_ns, positions, velocities, wrist, rotation, samples, estimate,
            command, answer, object_state,
            self.controller.hand, self.controller.exchange_position,
        )  # fmt: skip
        self.before_motion()
        self.arm.advance(self.period_s)
        self._time_ns += round(self.period_s * NANOSECONDS)
        return period

    def _take(self, hands: Sequence[Sequence[HandSample]], now_s: float) -> bool:
        """Process the poses of a period in the order of the nodes; return whether one was used."""
        poses = [
            (sample.stamp_s, number, sample)
            for number, samples in enumerate(hands)
            for sample in samples
        ]
        refusals = [
            self.controller.set_hand(
                sample.stamp_s,
                tuple(sample.position.tolist()),
                now_s,
                now_s,
                sample.orientation,
                tracker=self.controller.estimator.trackers[number].name,
            )
            for _, number, sample in sorted(poses, key=lambda pose: pose[:2])
        ]
        return not all(refusals)

    def close(self) -> None:
        """Close the simulated world."""
        self.arm.close()


class Handover(LockstepLoop):
    """A handover that is stepped period by period."""

    def __init__(
        self,
        scenario: Scenario,
        *,
        trackers: Sequence[TrackerPreset] = (),
    ) -> None:
        """
        Connect the objects.

        Args:
            scenario: trial, movement and arm.
            trackers: trackers of the hand; a perfect one if left out.

        """
        self.scenario = scenario
        trackers = trackers or (TrackerPreset(),)
        estimator = GoalEstimator(trackers=[one.tracker for one in trackers])
        rules = scenario.carried.handover_options(scenario.partner_model)
        super().__init__(
            scenario.robot,
            scenario.q_start,
            HandoverController(scenario.model, rules, estimator),
            tasks=scenario.carried.node_parameters(scenario.model)['priority_ik'],
        )
        replay = Replay(scenario.trial.times, scenario.trial.partner)
        self.hands = [TrackedHand(replay, one.sensor) for one in trackers]

    @property
    def max_duration_s(self) -> float:
        """Return the simulated time after which an unfinished handover is given up, s."""
        return self.hands[0].start_s + self.scenario.trial.duration_s + MAX_EXTRA_S

    def begin(self) -> None:
        """Make the partner signal and move, soon."""
        for hand in self.hands:
            hand.start(REPLAY_AT_S)
        self.controller.signal(REPLAY_AT_S)

    def hands_at(self, now_s: float) -> list[list[HandSample]]:
        """
        Return for each tracker the poses that arrive in a period.

        Args:
            now_s: its start, s.

        Returns:
            The poses, in order.

        """
        return [hand.due(now_s) for hand in self.hands]

    def run(self, progress: Callable[[float], None] = lambda _share: None) -> list[Period]:
        """
        Run until the handover is done, or given up.

        Args:
            progress: called with the share of the maximum time that has passed.

        Returns:
            All periods; the state of the last command shows whether the object changed hands.

        """
        self.begin()
        periods: list[Period] = []
        while (
            self.controller.state is not HandoverState.DONE and self.time_s < self.max_duration_s
        ):
            periods.append(self.step())
            progress(self.time_s / self.max_duration_s)
        periods += [self.step() for _ in range(round(AFTERWARDS_S / self.period_s))]
        return periods


def simulate(
    scenario: Scenario | None = None,
    progress: Callable[[float], None] = lambda _share: None,
    trackers: Sequence[TrackerPreset] = (),
) -> list[Period]:
    """
    Simulate one handover from start to end.

    Args:
        scenario: trial, movement and arm, see `scenario.make_scenario`; the example if left out.
        progress: called with the completed share.
        trackers: trackers of the hand; a perfect one if left out.

    Returns:
        All periods, in order.

    Raises:
        UnreachableError: the arm of the example cannot reach the path from any placement.

    """
    with Handover(scenario or make_scenario(), trackers=trackers) as handover:
        return handover.run(progress)
