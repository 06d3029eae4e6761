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

"""The object obeys Newton, whoever holds it, and passes from hand to hand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import UsageError
from handover_dmp.common.quaternions import to_matrix
from handover_dmp.handover.release import ReleaseOptions
from handover_dmp.robot.model import RobotModel
from handover_dmp.simulation.arm import SimulatedArm
from handover_dmp.simulation.carried_object import CarriedObjectOptions, Holder
from handover_dmp.simulation.partner_grip import PartnerGrip, PartnerGripOptions, PULL_SHARE
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

MODEL = RobotModel.load('lwr4')
WRIST = MODEL.wrist_pose(MODEL.home)[0]
PERIOD_S = 0.005
GRAVITY = np.array([0.0, 0.0, -9.81])
STILL = np.zeros(MODEL.dof)
# where the partner's hand is to be for the object of `held`
BESIDE = WRIST + [0.3, 0.0, 0.0]
AWAY = np.array([0.8, 0.36, -0.48])
UNKNOWN = np.full(3, np.nan)


def held(mass_kg: float = 0.8, **changes: Any) -> CarriedObjectOptions:
    changes = {'position': (0.1, 0.0, 0.02), 'noise_n': 0.0} | changes
    return CarriedObjectOptions(mass_kg=mass_kg, **changes)


def advance(
    arm: SimulatedArm,
    duration_s: float,
    hand: Array | Callable[[float], Array] | None = None,
    velocity: Sequence[float] | Array = STILL,
) -> list[Holder]:
    """Let time pass, with a hand where it is told to be; return who had the object, in turn."""
    holders = []
    for step in range(round(duration_s / PERIOD_S)):
        if hand is not None:
            arm.set_partner_hand(hand(step * PERIOD_S) if callable(hand) else hand)
        arm.command(velocity)
        arm.advance(PERIOD_S)
        holders.append(arm.holder)
    return holders


def in_turn(holders: Sequence[Holder]) -> list[Holder]:
    return [h for k, h in enumerate(holders) if k == 0 or h is not holders[k - 1]]


@settings(max_examples=5)
@given(
    st.floats(0.05, 5.0),
    st.tuples(*[st.floats(-0.2, 0.2)] * 3),
    st.tuples(*[st.floats(-0.4, 0.4)] * 7),
)
def test_at_rest_the_wrist_feels_the_weight(
    mass_kg: float, position: tuple[float, ...], turns: tuple[float, ...]
) -> None:
    with SimulatedArm(MODEL, carried=held(mass_kg, position=position)) as arm:
        arm.reset(MODEL.home + turns)
        advance(arm, 0.05)
        weight = mass_kg * GRAVITY
        assert arm.wrench.force == pytest.approx(weight, abs=1e-3 * mass_kg)
        assert arm.wrench.torque == pytest.approx(np.cross(position, weight), abs=2e-3 * mass_kg)
        wrist = MODEL.wrist_pose(arm.joint_positions)[0]
        assert arm.object_pose[0] - wrist == pytest.approx(position, abs=1e-5)
        assert arm.holder is Holder.ROBOT


def test_in_motion_the_wrist_feels_what_newton_tells() -> None:
    mass_kg = 1.5
    with SimulatedArm(MODEL, carried=held(mass_kg)) as arm:
        carried = arm._carried
        assert carried is not None
        turned = MODEL.home + [0.2, -0.3, 0.4, 0.1, 0.5, -0.2, 0.3]
        arm.reset(turned)
        advance(arm, 0.02)
        most = 0.0
        for step in range(200):
            before = carried.velocity
            speed = 0.8 * np.sin(0.05 * step)
            advance(arm, PERIOD_S, velocity=[speed, -speed, speed, speed, speed, -speed, speed])
            acceleration = (carried.velocity - before) / PERIOD_S
            expected = mass_kg * (GRAVITY - acceleration)
            assert arm.wrench.force == pytest.approx(expected, abs=0.02)
            most = max(most, float(np.linalg.norm(acceleration)))
        assert most > 1.0  # else nothing was shown


def test_what_both_do_to_the_object_is_what_moves_it() -> None:
    mass_kg = 0.8
    with SimulatedArm(MODEL, carried=held(mass_kg)) as arm:
        carried = arm._carried
        assert carried is not None
        pulled = 0.0
        for step in range(240):
            before = carried.velocity
            # first at rest to be gripped, then it tears, and the arm moves, too
            tears = max(0, step - 120)
            hand = BESIDE + 2e-4 * tears * np.array([1.0, 0.5, 0.5])
            speed = 0.3 * np.sin(0.1 * tears)
            advance(arm, PERIOD_S, hand, velocity=STILL + speed)
            change = mass_kg * ((carried.velocity - before) / PERIOD_S - GRAVITY)
            assert arm.partner_force - arm.wrench.force == pytest.approx(change, abs=0.02)
            pulled = max(pulled, float(arm.wrench.force[0]))
        assert arm.holder is Holder.BOTH
        assert pulled > 3.0


def test_the_load_passes_over_and_comes_back() -> None:
    weight_n = 0.8 * 9.81
    with SimulatedArm(MODEL, carried=held()) as arm:
        loads = [0.0]
        holders = [arm.holder]
        for _ in range(160):
            holders += advance(arm, PERIOD_S, BESIDE)
            loads.append(-float(arm.wrench.force[2]) / weight_n)
        assert in_turn(holders) == [Holder.ROBOT, Holder.BOTH]
        assert np.all(np.diff(loads[2:]) < 1e-3)
        assert loads[1] == pytest.approx(1.0, abs=1e-3)
        assert loads[-1] == pytest.approx(0.0, abs=1e-3)
        between = sum(0.05 < load < 0.95 for load in loads) * PERIOD_S
        assert between == pytest.approx(0.9 * PartnerGripOptions().grip_s, abs=0.02)

        arm.set_gripper(False)
        assert arm.holder is Holder.PARTNER
        # the partner uses it elsewhere; it follows as if it were fixed to the hand
        way = np.array([0.15, -0.1, 0.1])
        moved = advance(arm, 1.5, lambda t: BESIDE + way * (1.0 - np.cos(2.0 * np.pi * t / 1.5)))
        advance(arm, 0.5, BESIDE)
        assert set(moved) == {Holder.PARTNER}
        assert arm.object_pose[0] == pytest.approx(WRIST + [0.1, 0.0, 0.02], abs=0.002)

        arm.set_gripper(True)
        holders = advance(arm, 1.0, BESIDE)
        assert in_turn(holders) == [Holder.BOTH, Holder.ROBOT]
        assert -arm.wrench.force[2] == pytest.approx(weight_n, abs=1e-3)
        # the hand that has let go does not take again what it has just given
        assert set(advance(arm, 0.6, BESIDE)) == {Holder.ROBOT}
        advance(arm, 0.5, BESIDE + [0.5, 0.0, 0.0])
        assert in_turn(advance(arm, 1.2, BESIDE)) == [Holder.ROBOT, Holder.BOTH]


def test_a_hand_that_is_kept_waiting_pulls_towards_itself() -> None:
    options = PartnerGripOptions()
    with SimulatedArm(MODEL, carried=held()) as arm:
        advance(arm, options.reaction_s + options.pulls_after_s, BESIDE)
        calm_n = arm.wrench.force
        assert np.linalg.norm(calm_n) < 0.1
        advance(arm, 2.5, BESIDE)
        assert arm.holder is Holder.BOTH
        towards = BESIDE - arm.object_pose[0]
        towards /= np.linalg.norm(towards)
        pull_n = options.stiffness * PULL_SHARE * options.slip_m
        assert arm.wrench.force == pytest.approx(pull_n * towards, abs=0.5)
        assert pull_n > ReleaseOptions().pull_n
        arm.set_gripper(False)
        advance(arm, 1.0, BESIDE)
        assert arm.holder is Holder.PARTNER
        # what it has is nearer to it now, and goes back without a struggle
        arm.set_gripper(True)
        assert in_turn(advance(arm, 1.0, BESIDE)) == [Holder.BOTH, Holder.ROBOT]


def test_what_nobody_holds_falls_and_lies() -> None:
    with SimulatedArm(MODEL, carried=held()) as arm:
        advance(arm, 0.1)
        height = float(arm.object_pose[0][2])
        arm.set_gripper(False)
        assert arm.holder is Holder.NOBODY
        for time_s in (0.1, 0.2, 0.3):
            advance(arm, 0.1)
            fallen = height - float(arm.object_pose[0][2])
            assert fallen == pytest.approx(0.5 * 9.81 * time_s**2, abs=2e-3)
        advance(arm, 1.0)
        assert arm.object_pose[0][2] == pytest.approx(0.02, abs=1e-4)
        arm.set_gripper(True)
        assert arm.holder is Holder.NOBODY
        assert not np.any(arm.wrench.force)
        arm.reset()
        assert arm.holder is Holder.ROBOT


def place_in_gripper(arm: SimulatedArm) -> tuple[Array, Array]:
    """Where the object is in the wrist's axes, and its own axes there."""
    wrist, rotation = MODEL.wrist_pose(arm.joint_positions)
    position, quaternion = arm.object_pose
    return rotation.T @ (position - wrist), rotation.T @ to_matrix(quaternion.tolist())


@settings(max_examples=4)
@given(st.tuples(*[st.floats(-0.04, 0.04)] * 3), st.tuples(*[st.floats(-0.1, 0.1)] * 7))
def test_wherever_the_gripper_closes_it_holds_the_object_at_its_place(
    off: tuple[float, ...], turns: tuple[float, ...]
) -> None:
    with SimulatedArm(MODEL, carried=held()) as arm:
        place, axes = place_in_gripper(arm)
        advance(arm, 0.6, BESIDE)
        arm.set_gripper(False)
        # the hand goes elsewhere with it, and the arm comes turned otherwise
        way = np.array(off)
        advance(arm, 0.5, lambda t: BESIDE + way * t / 0.5, velocity=np.array(turns))
        misplaced = float(np.linalg.norm(place_in_gripper(arm)[0] - place))
        arm.set_gripper(True)
        holders, forces = [], []
        for _ in range(400):
            holders += advance(arm, PERIOD_S, BESIDE + off)
            forces.append(arm.wrench.force)
        assert in_turn(holders) == [Holder.BOTH, Holder.ROBOT]
        now, turned = place_in_gripper(arm)
        assert now == pytest.approx(place, abs=1e-4)
        assert turned == pytest.approx(axes, abs=1e-4)
        # it is drawn against the hand's spring, not torn
        most_n = PartnerGripOptions().stiffness * misplaced + 2.0 * 0.8 * 9.81
        assert np.abs(forces).max() < most_n


def test_what_lies_on_a_table_is_picked_up_and_laid_down_there() -> None:
    on_table = WRIST + [0.12, 0.01, 0.0]
    options = held(holder='table', table=on_table.tolist())
    with SimulatedArm(MODEL, carried=options) as arm:
        assert set(advance(arm, 0.5)) == {Holder.TABLE}
        assert arm.object_pose[0] == pytest.approx(on_table, abs=1e-4)
        assert not np.any(arm.wrench.force)
        place = MODEL.wrist_pose(arm.joint_positions)[1].T @ [0.1, 0.0, 0.02]
        arm.set_gripper(True)
        assert set(advance(arm, 0.6)) == {Holder.ROBOT}
        assert place_in_gripper(arm)[0] == pytest.approx(place, abs=1e-4)
        assert arm.wrench.force[2] == pytest.approx(-0.8 * 9.81, abs=1e-3)
        # let go of just above the table, it is laid down on it
        arm.set_gripper(False)
        assert set(advance(arm, 0.5)) == {Holder.TABLE}
        assert arm.object_pose[0][2] == pytest.approx(on_table[2], abs=1e-4)
        arm.reset()
        assert arm.holder is Holder.TABLE
        arm.set_gripper(True)
        advance(arm, 1.0, velocity=[0.0, -0.3, 0.0, 0.0, 0.0, 0.0, 0.0])
        arm.set_gripper(False)
        # from higher up it is dropped
        assert advance(arm, PERIOD_S) == [Holder.NOBODY]


@pytest.mark.parametrize(
    ('mass_kg', 'after_s', 'sag_m'),
    [(3.0, 0.17, None), (3.0, 0.26, 0.03), (0.8, 0.17, 0.04), (0.8, 0.4, 0.002)],
)
def test_what_is_released_before_the_partner_grips_sags_or_drops(
    mass_kg: float, after_s: float, sag_m: float | None
) -> None:
    with SimulatedArm(MODEL, carried=held(mass_kg)) as arm:
        assert advance(arm, after_s, BESIDE)[-1] is Holder.BOTH
        height = float(arm.object_pose[0][2])
        arm.set_gripper(False)
        lowest = height
        for _ in range(60):
            holders = advance(arm, PERIOD_S, BESIDE)
            lowest = min(lowest, float(arm.object_pose[0][2]))
        assert holders[-1] is (Holder.NOBODY if sag_m is None else Holder.PARTNER)
        if sag_m is not None:
            assert height - lowest < sag_m


def test_a_hand_takes_only_what_is_near_and_slow() -> None:
    with SimulatedArm(MODEL, carried=held()) as arm:
        assert set(advance(arm, 1.0, BESIDE + [0.2, 0.0, 0.0])) == {Holder.ROBOT}
        passing = advance(arm, 1.0, lambda t: BESIDE + [0.0, 0.6 * (t - 0.5), 0.0])
        assert set(passing) == {Holder.ROBOT}
        assert set(advance(arm, 0.5, np.full(3, np.nan))) == {Holder.ROBOT}


def test_what_slips_out_of_the_hand_is_taken_again() -> None:
    with SimulatedArm(MODEL, carried=held()) as arm:
        advance(arm, 0.5, BESIDE)
        torn = advance(arm, 0.3, lambda t: BESIDE + [0.3 * t, 0.0, 0.0])
        assert in_turn(torn) == [Holder.BOTH, Holder.ROBOT]
        assert advance(arm, 0.6, BESIDE)[-1] is Holder.BOTH


@pytest.mark.parametrize('mass_kg', [0.1, 0.8, 3.0])
def test_a_hand_that_is_told_to_jump_goes_there_with_the_object(mass_kg: float) -> None:
    with SimulatedArm(MODEL, carried=held(mass_kg)) as arm:
        advance(arm, 0.6, BESIDE)
        arm.set_gripper(False)
        elsewhere = BESIDE + [0.4, -0.3, 0.2]
        assert set(advance(arm, 0.2, elsewhere)) == {Holder.PARTNER}
        assert 0.1 < float(np.linalg.norm(arm.object_pose[0] - WRIST - [0.1, 0.0, 0.02])) < 0.3
        assert set(advance(arm, 1.5, elsewhere)) == {Holder.PARTNER}
        gone = arm.object_pose[0] - WRIST - [0.1, 0.0, 0.02]
        assert gone == pytest.approx([0.4, -0.3, 0.2], abs=0.002)


@pytest.mark.sample(2)
@pytest.mark.parametrize('mass_kg', [0.1, 0.8, 3.0])
@pytest.mark.parametrize('gap_s', [0.03, 0.06, 0.09, 0.15, 0.3])
def test_a_hand_that_is_not_heard_of_for_a_while_does_not_lose_the_object(
    mass_kg: float, gap_s: float
) -> None:
    """It goes away with the object, and a busy machine delays what is told of it."""

    def hand(time_s: float) -> Array:
        share = np.clip(time_s / 1.2, 0.0, 1.0)
        place: Array = BESIDE + 0.4 * share**3 * (10.0 - 15.0 * share + 6.0 * share**2) * AWAY
        return place

    with SimulatedArm(MODEL, carried=held(mass_kg)) as arm:
        advance(arm, 0.6, BESIDE)
        arm.set_gripper(False)
        advance(arm, 0.5, BESIDE)
        gap = 0.6, 0.6 + gap_s
        told = advance(arm, 2.5, lambda t: hand(t) if not gap[0] < t < gap[1] else UNKNOWN)
        assert set(told) == {Holder.PARTNER}
        assert arm.object_pose[0] == pytest.approx(
            hand(2.5) - [0.2, 0.0, -0.02], abs=0.003 * max(1.0, mass_kg)
        )


def test_what_the_partner_has_at_the_start_is_in_the_hand() -> None:
    with SimulatedArm(MODEL, carried=held(holder='partner')) as arm:
        assert set(advance(arm, 0.2)) == {Holder.PARTNER}
        away = BESIDE + [0.4, 0.1, 0.0]
        assert set(advance(arm, 0.5, away)) == {Holder.PARTNER}
        assert arm.object_pose[0] == pytest.approx(away - [0.1, 0.0, 0.02], abs=1e-4)
        arm.set_gripper(True)  # out of reach
        assert set(advance(arm, 0.2, away)) == {Holder.PARTNER}


def test_the_hand_keeps_the_object_turned_as_it_was_gripped() -> None:
    with SimulatedArm(MODEL, carried=held()) as arm:
        advance(arm, 0.6, BESIDE)
        gripped = arm.object_pose[1]
        advance(arm, 0.3, BESIDE, velocity=[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5])
        turned = arm.object_pose[1]
        assert abs(float(gripped @ turned)) < 0.998
        arm.set_gripper(False)
        advance(arm, 1.0, BESIDE)
        assert abs(float(gripped @ arm.object_pose[1])) == pytest.approx(1.0, abs=1e-6)


def test_without_a_mass_nothing_changes_to_the_bit() -> None:
    def drive(arm: SimulatedArm) -> Array:
        with arm:
            arm.set_gripper(True)
            rows = []
            for step in range(60):
                advance(arm, PERIOD_S, BESIDE, velocity=STILL + 0.5 * np.sin(0.1 * step))
                rows.append([*arm.joint_positions, *arm.joint_velocities])
            assert arm.holder is Holder.NOBODY
            assert not arm.carries
            with pytest.raises(UsageError, match='no object'):
                _ = arm.object_pose
        return np.array(rows)

    alone = drive(SimulatedArm(MODEL))
    massless = drive(SimulatedArm(MODEL, carried=CarriedObjectOptions(mass_kg=0.0)))
    assert np.array_equal(alone, massless)

    # and what is carried bends the motion by less than its motors err
    with SimulatedArm(MODEL, carried=held(2.0)) as arm:
        for step in range(60):
            advance(arm, PERIOD_S, velocity=STILL + 0.5 * np.sin(0.1 * step))
        assert arm.joint_positions == pytest.approx(alone[-1, :7], abs=1e-5)


def test_the_same_hands_give_the_same_object_to_the_bit() -> None:
    def once() -> Array:
        with SimulatedArm(MODEL, carried=held()) as arm:
            rows = []
            for step in range(100):
                advance(arm, PERIOD_S, BESIDE + 1e-4 * step, velocity=STILL + 0.05)
                if step == 80:
                    arm.set_gripper(False)
                rows.append([*arm.object_pose[0], *arm.wrench.force])
            return np.array(rows)

    assert np.array_equal(once(), once())


def test_an_object_between_two_wrists_is_within_the_reach_of_both() -> None:
    # the wrists of people who hand over a baton of 0.8 kg are 0.41 m apart
    offset = np.array([-0.36, 0.18, 0.06])
    options = CarriedObjectOptions.between(offset, 0.8)
    assert options.parameters == {
        'object.mass_kg': 0.8,
        'object.position': pytest.approx([0.18, -0.09, -0.03]),
        'object.holder': 'robot',
        'object.table': [0.0, 0.0, 0.0],
    }
    with SimulatedArm(MODEL, carried=options) as arm:
        assert advance(arm, 0.6, WRIST - offset)[-1] is Holder.BOTH
        arm.set_gripper(False)
        assert advance(arm, 0.1, WRIST - offset)[-1] is Holder.PARTNER
        arm.set_gripper(True)
        assert advance(arm, 1.0, WRIST - offset)[-1] is Holder.ROBOT


def test_the_sensor_has_noise_of_its_own() -> None:
    with SimulatedArm(MODEL, carried=held(noise_n=0.1)) as arm:
        felt = []
        for _ in range(300):
            advance(arm, PERIOD_S)
            felt.append(arm.wrench.force)
            assert np.array_equal(felt[-1], arm.wrench.force)
    assert np.std(felt, axis=0) == pytest.approx([0.1] * 3, rel=0.15)
    assert np.mean(felt, axis=0) == pytest.approx([0.0, 0.0, -0.8 * 9.81], abs=0.03)


@pytest.mark.parametrize(
    ('changes', 'named'),
    [
        ({'mass_kg': -1.0}, 'mass_kg'),
        ({'mass_kg': 0.001}, 'mass_kg'),
        ({'size': (0.1, 0.0, 0.1)}, 'size'),
        ({'position': (0.1, 0.1)}, 'position'),
        ({'holder': 'nobody'}, 'holder'),
        ({'table': (0.0, float('nan'), 0.0)}, 'table'),
        ({'grip_s': 0.0}, 'grip_s'),
        ({'grip_speed': -1.0}, 'grip_speed'),
    ],
)
def test_an_object_that_cannot_be_is_refused(changes: dict[str, Any], named: str) -> None:
    with pytest.raises(UsageError, match=f'object.{named}'):
        CarriedObjectOptions(**changes)
    with pytest.raises(UsageError, match='partner'):
        PartnerGripOptions(grip_s=0.0)


def test_what_the_partner_lets_go_is_not_taken_again_while_it_slides_out_of_the_hand() -> None:
    grip, still = PartnerGrip(1.0, 9.81, PartnerGripOptions()), np.zeros(3)
    grip.set_hand(np.zeros(3), still)
    grip.hold(np.array([0.2, 0.0, 0.0]))
    place, opened = np.array([0.2, 0.0, 0.0]), False
    for _ in range(2000):
        grip.set_hand(np.zeros(3), still)
        grip.force(place, still, 9.81, 1e-3)
        if grip.strength < 1.0 and not opened:
            # drawn by the robot while the hand opens
            opened, place = True, place + [0.06, 0.0, 0.0]
    assert opened
    assert not grip.holds
