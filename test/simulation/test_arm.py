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

"""The simulated arm obeys good commands, and no command at all makes it break a limit."""

from __future__ import annotations

from handover_dmp.common.errors import UsageError
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.velocity_driver import ArmOptions, ArmState, CommandOutcome
from handover_dmp.simulation.arm import SimulatedArm
from handover_dmp.simulation.partner_figure import FigureBodies, PartnerFigure
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

PERIOD_S = 0.005
MODEL = RobotModel.load('lwr4')
LIMITS = MODEL.limits


@pytest.fixture
def arm():
    with SimulatedArm(MODEL) as made:
        yield made


class Watch:
    """Advances an arm by 1 ms at a time and holds every step against the limits."""

    def __init__(self, arm):
        self.arm = arm
        self.velocity = np.zeros(arm.model.dof)
        self.acceleration = np.zeros(arm.model.dof)
        self.position = arm.joint_positions.copy()

    def advance(self, duration_s):
        limits = self.arm.model.limits
        for _ in range(round(duration_s * 1e3)):
            before = self.arm.reference_positions
            self.arm.advance(1e-3)
            reference = self.arm.reference_positions
            velocity = (reference - before) / 1e-3
            acceleration = (velocity - self.velocity) / 1e-3
            assert np.all(reference <= limits.upper + 1e-9)
            assert np.all(reference >= limits.lower - 1e-9)
            assert np.all(np.abs(velocity) <= limits.velocity * (1 + 1e-6))
            assert np.all(np.abs(acceleration) <= limits.acceleration * (1 + 1e-6))
            # The torque runs out at times where all joints reverse at full acceleration.
            assert np.abs(self.arm.joint_positions - reference).max() < 2e-4
            self.velocity, self.acceleration = velocity, acceleration


def drive(arm, velocity, duration_s):
    for _ in range(round(duration_s / PERIOD_S)):
        arm.command(velocity)
        arm.advance(PERIOD_S)


def test_reaches_and_holds_the_velocity_it_is_told(arm):
    wanted = np.array([0.3, -0.2, 0.1, 0.25, -0.4, 0.35, 0.5])
    drive(arm, wanted, 0.5)
    assert arm.joint_velocities == pytest.approx(wanted, abs=1e-4)
    before = arm.joint_positions
    drive(arm, wanted, 0.1)
    assert arm.joint_positions - before == pytest.approx(0.1 * wanted, abs=1e-5)
    assert arm.time_s == pytest.approx(0.6)
    assert arm.report.accepted == 120
    assert arm.report.last_fault == ''


def test_wrist_follows_the_reference_within_a_micrometre(arm):
    random = np.random.default_rng(3)
    velocity = np.zeros(7)
    for _ in range(300):
        velocity += random.uniform(-0.5, 0.5, 7) * LIMITS.acceleration * PERIOD_S
        velocity = np.clip(velocity, -0.4 * LIMITS.velocity, 0.4 * LIMITS.velocity)
        arm.command(velocity)
        arm.advance(PERIOD_S)
        there, _ = MODEL.wrist_pose(arm.joint_positions)
        wanted, _ = MODEL.wrist_pose(arm.reference_positions)
        assert np.linalg.norm(there - wanted) < 1e-6


@pytest.mark.parametrize(
    'wrong',
    [
        [0.1] * 6,
        [0.1] * 8,
        [],
        0.1,
        [[0.1] * 7],
        [0.1, 0.1, float('nan'), 0.1, 0.1, 0.1, 0.1],
        [0.1, float('inf'), 0.1, 0.1, 0.1, 0.1, 0.1],
        [0.1, -float('inf'), 0.1, 0.1, 0.1, 0.1, 0.1],
        ['a'] * 7,
        [None] * 7,
        None,
        [10**400] * 7,
        {'joint_1': 0.1},
    ],
)
def test_senseless_commands_are_refused_and_change_nothing(arm, wrong):
    drive(arm, [0.2] * 7, 0.3)
    assert arm.command([0.2] * 7) is CommandOutcome.ACCEPTED
    assert arm.command(wrong) is CommandOutcome.REFUSED
    arm.advance(PERIOD_S)
    assert arm.joint_velocities == pytest.approx([0.2] * 7, abs=1e-4)
    assert arm.report.refused == 1
    assert arm.report.last_fault.startswith('a command')


def test_refused_commands_are_no_sign_of_life(arm):
    drive(arm, [0.3] * 7, 0.3)
    for _ in range(200):
        arm.command([float('nan')] * 7)
        arm.advance(PERIOD_S)
    assert np.abs(arm.joint_velocities).max() < 1e-6
    assert arm.report.timeouts == 1
    assert arm.report.refused == 200


def test_too_fast_is_slowed_down_in_the_same_direction(arm):
    wanted = 3.0 * LIMITS.velocity * np.array([1, -0.5, 0.2, 0.1, 0, -0.3, 0.4])
    assert arm.command(wanted) is CommandOutcome.CLIPPED
    drive(arm, wanted, 0.4)
    assert arm.joint_velocities == pytest.approx(wanted / 3.0, abs=1e-3)
    assert arm.report.clipped == 81
    assert 'joint_1 commanded to 5.24 rad/s, limit 1.75' in arm.report.last_fault


def test_a_flood_does_not_matter_but_for_the_last_one():
    with SimulatedArm(MODEL) as calm, SimulatedArm(MODEL) as flooded:
        random = np.random.default_rng(0)
        for _ in range(20):
            for noise in random.uniform(-9, 9, (50, 7)):  # 10,000 a second
                flooded.command(noise)
            for each in (calm, flooded):
                each.command([0.3] * 7)
                each.advance(PERIOD_S)
        assert np.array_equal(calm.joint_positions, flooded.joint_positions)
        assert np.array_equal(calm.joint_velocities, flooded.joint_velocities)


def test_caller_cannot_change_a_command_or_the_state_afterwards(arm):
    wanted = np.full(7, 0.3)
    arm.command(wanted)
    wanted[:] = 100.0
    arm.advance(PERIOD_S)
    home = MODEL.home.copy()
    arm.reference_positions[:] = 7.0
    assert np.abs(arm.reference_positions - home).max() < 0.1
    drive(arm, [0.3] * 7, 0.3)
    assert arm.joint_velocities == pytest.approx([0.3] * 7, abs=1e-4)


def test_lost_commands_brake_within_limits_neither_at_once_nor_never(arm):
    watch = Watch(arm)
    wanted = 0.9 * LIMITS.velocity * np.array([1, -1, 1, -1, 1, -1, 1])
    for _ in range(60):
        arm.command(wanted)
        watch.advance(PERIOD_S)
    last = arm.time_s - PERIOD_S
    speed = arm.joint_velocities
    while arm.time_s < last + 0.049:
        watch.advance(1e-3)
    assert arm.joint_velocities == pytest.approx(speed, abs=1e-2)
    assert arm.report.timeouts == 0
    watch.advance(0.01)
    assert arm.report.timeouts == 1
    assert np.all(np.abs(arm.joint_velocities) < np.abs(speed))
    # The slowest joint needs v / a at full acceleration; jerk costs it a little more.
    needed = float(np.max(np.abs(speed) / LIMITS.acceleration))
    assert np.abs(arm.joint_velocities).max() > 0.1
    watch.advance(needed + 0.15)
    assert np.abs(arm.joint_velocities).max() < 1e-4
    still = arm.joint_positions
    watch.advance(0.5)
    assert arm.joint_positions == pytest.approx(still, abs=1e-6)


def test_what_no_command_could_come_in_does_not_count_as_silence(arm):
    drive(arm, [0.3] * 7, 0.3)
    # a clock that goes on by 25 ms at once, and by 75 where two of its messages are late
    for jump in (0.025, 0.075, 0.025):
        arm.advance(jump, jump - PERIOD_S)
        assert arm.report.state is ArmState.READY
    for _ in range(8):
        arm.advance(0.025, 0.025 - PERIOD_S)
    assert arm.report.state is ArmState.WAITING


def test_after_lost_commands_moves_only_when_told_to_resume(arm):
    drive(arm, [0.3] * 7, 0.3)
    arm.advance(1.0)
    assert arm.report.state is ArmState.STOPPED
    assert arm.report.last_fault == 'no command for 0.500 s'
    assert arm.report.timeouts == 1
    still = arm.joint_positions
    assert arm.command([0.3] * 7) is CommandOutcome.IGNORED
    drive(arm, [0.3] * 7, 0.5)
    assert arm.joint_positions == pytest.approx(still, abs=1e-6)
    assert arm.report.ignored == 101
    arm.resume()
    arm.advance(0.1)
    assert arm.joint_positions == pytest.approx(still, abs=1e-6)
    watch = Watch(arm)
    for _ in range(60):
        arm.command([0.3] * 7)
        watch.advance(PERIOD_S)
    assert arm.joint_velocities == pytest.approx([0.3] * 7, abs=1e-4)


def test_a_short_silence_brakes_and_goes_on_with_the_commands(arm):
    watch = Watch(arm)
    for silence_s in (0.2, 0.44):
        for _ in range(60):
            arm.command([0.3] * 7)
            watch.advance(PERIOD_S)
        assert arm.report.state is ArmState.READY
        assert arm.joint_velocities == pytest.approx([0.3] * 7, abs=1e-4)
        watch.advance(silence_s)
        assert arm.report.state is ArmState.WAITING
        assert arm.report.last_fault == 'no command for 0.050 s'
        assert np.abs(arm.joint_velocities).max() < 0.05
    assert arm.report.timeouts == 2
    assert arm.report.ignored == 0
    watch.advance(0.1)
    assert arm.report.state is ArmState.STOPPED


def test_where_no_silence_is_short_the_first_one_stops():
    with SimulatedArm(MODEL, options=ArmOptions(resume_within_s=0.0)) as arm:
        drive(arm, [0.3] * 7, 0.3)
        arm.advance(0.06)
        assert arm.report.state is ArmState.STOPPED
        assert arm.command([0.3] * 7) is CommandOutcome.IGNORED


def test_without_that_rule_motion_resumes_with_the_commands():
    with SimulatedArm(MODEL, options=ArmOptions(resume_required=False)) as arm:
        drive(arm, [0.3] * 7, 0.3)
        arm.advance(1.0)
        assert arm.report.timeouts == 1
        assert arm.report.state is ArmState.READY
        drive(arm, [0.3] * 7, 0.3)
        assert arm.joint_velocities == pytest.approx([0.3] * 7, abs=1e-4)


def test_silence_at_rest_is_no_fault(arm):
    arm.advance(1.0)
    drive(arm, [0.0] * 7, 0.1)
    arm.advance(1.0)
    assert arm.report.timeouts == 0
    assert arm.report.state is ArmState.READY
    drive(arm, [0.3] * 7, 0.3)
    assert arm.joint_velocities == pytest.approx([0.3] * 7, abs=1e-4)


def test_stop_on_request_brakes_and_holds(arm):
    drive(arm, [0.3] * 7, 0.3)
    arm.stop('the person is too near')
    watch = Watch(arm)
    watch.velocity = np.full(7, 0.3)
    watch.advance(0.4)
    assert np.abs(arm.joint_velocities).max() < 1e-6
    assert arm.report.state is ArmState.STOPPED
    assert arm.report.last_fault == 'the person is too near'
    assert arm.report.timeouts == 0


@pytest.mark.parametrize('direction', [1, -1])
def test_full_speed_into_the_end_stops_stops_before_them(arm, direction):
    watch = Watch(arm)
    for _ in range(900):
        arm.command(direction * LIMITS.velocity)
        watch.advance(PERIOD_S)
    end = LIMITS.upper if direction > 0 else LIMITS.lower
    assert np.abs(arm.joint_positions - end).max() < 0.01
    assert np.abs(arm.joint_velocities).max() < 0.01


@settings(deadline=None, max_examples=25)
@given(
    st.lists(
        st.tuples(
            st.lists(
                st.one_of(st.floats(-3, 3), st.floats(), st.just(0.0)), min_size=7, max_size=7
            ),
            st.integers(0, 40),
        ),
        max_size=30,
    )
)
def test_no_sequence_of_commands_breaks_a_limit(commands):
    with SimulatedArm(MODEL, options=ArmOptions(resume_required=False)) as arm:
        watch = Watch(arm)
        for velocities, periods in commands:
            arm.command(velocities)
            watch.advance(periods * 2e-3)
        report = arm.report
        assert report.accepted + report.clipped + report.refused == len(commands)


def test_reversals_of_full_speed_break_no_limit(arm):
    watch = Watch(arm)
    random = np.random.default_rng(5)
    for _ in range(300):
        arm.command(random.choice([-1.0, 1.0], 7) * LIMITS.velocity)
        watch.advance(PERIOD_S)


def test_same_commands_same_motion_bit_for_bit():
    def motion(arm):
        random = np.random.default_rng(1)
        seen = []
        for _ in range(100):
            arm.command(random.uniform(-1, 1, 7))
            arm.advance(PERIOD_S)
            seen.append([arm.joint_positions, arm.joint_velocities])
        return np.array(seen)

    path = np.linspace([0.9, 0.1, 0.9], [0.6, 0.0, 1.1], 20)
    figure = PartnerFigure(path, np.zeros(3))
    with SimulatedArm(MODEL) as one, SimulatedArm(MODEL, figure=figure) as other:
        first = motion(one)
        one.reset()
        other.show_hand(path[3])
        assert np.array_equal(first, motion(one))
        assert np.array_equal(first, motion(other))


def test_figure_follows_the_hand_at_its_own_rate():
    path = np.linspace([0.9, 0.1, 0.9], [0.6, 0.0, 1.1], 200)
    figure = PartnerFigure(path, np.zeros(3))
    shown = []

    class Counted(FigureBodies):
        def show(self, hand, start=None):
            shown.append(np.array(hand))
            return super().show(hand, start)

    with SimulatedArm(MODEL, figure=figure) as arm:
        arm.world.bodies = Counted(figure, arm.world.engine)
        for point in path:
            arm.show_hand(point)
            arm.show_hand(np.array([np.nan, 0.0, 0.0]))
            arm.advance(PERIOD_S)
    assert len(shown) == pytest.approx(figure.options.update_rate_hz * 1.0, abs=1)
    assert shown[-1] == pytest.approx(path[195], abs=0.02)


def test_periods_that_are_no_whole_milliseconds_add_up(arm):
    for _ in range(300):
        arm.command([0.1] * 7)
        arm.advance(1 / 300)
    assert arm.time_s == pytest.approx(1.0, abs=5e-4)
    arm.advance(0.0)
    assert arm.time_s == pytest.approx(1.0, abs=5e-4)


@pytest.mark.parametrize('wrong', [-0.1, float('nan'), float('inf')])
def test_time_does_not_run_backwards(arm, wrong):
    with pytest.raises(UsageError, match='negative or not finite'):
        arm.advance(wrong)
    assert arm.time_s == 0.0


@pytest.mark.parametrize('wrong', [[0.0] * 6, [float('nan')] * 7, [3.2] + [0.0] * 6])
def test_impossible_postures_are_refused(arm, wrong):
    with pytest.raises(UsageError, match='configuration'):
        arm.reset(wrong)


def test_reset_starts_anew(arm):
    drive(arm, [0.5] * 7, 0.5)
    arm.advance(1.0)
    posture = MODEL.home + 0.1
    arm.reset(posture)
    assert arm.time_s == 0.0
    assert arm.report.state is ArmState.READY
    assert arm.report.timeouts == 0
    arm.advance(0.5)
    assert arm.joint_positions == pytest.approx(posture, abs=1e-5)


@pytest.mark.parametrize('robot', ['iiwa14', 'panda', 'ur5'])
def test_other_robots_obey_too(robot):
    model = RobotModel.load(robot)
    with SimulatedArm(model) as arm:
        watch = Watch(arm)
        for _ in range(60):
            arm.command(0.2 * model.limits.velocity)
            watch.advance(PERIOD_S)
        assert arm.joint_velocities == pytest.approx(0.2 * model.limits.velocity, abs=1e-3)


def test_an_arm_that_rests_may_wait_without_being_simulated(arm):
    arm.advance(0.1)
    assert arm.rests
    still, began_s = arm.joint_positions, arm.time_s
    arm.wait(0.5)
    assert arm.time_s == pytest.approx(began_s + 0.5)
    assert np.array_equal(arm.joint_positions, still)
    arm.command([0.3] * 7)
    assert not arm.rests
    drive(arm, [0.3] * 7, 0.3)
    assert not arm.rests
    assert arm.joint_velocities == pytest.approx([0.3] * 7, abs=1e-4)
