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

"""The simulated arm: speed, accuracy, and the cost of the human figure and the pictures."""

from __future__ import annotations

from collections.abc import Callable
from statistics import median
from time import perf_counter

from handover_dmp.bench.measurement import Measurement, time_call
from handover_dmp.common.arrays import Array
from handover_dmp.handover.lockstep import Handover
from handover_dmp.handover.scenario import make_scenario
from handover_dmp.robot.model import BasePlacement, RobotModel
from handover_dmp.simulation.arm import SimulatedArm
from handover_dmp.simulation.partner_figure import PartnerFigure
from handover_dmp.simulation.self_check import check_models
from handover_dmp.simulation.world import World
from handover_dmp.view.scene import Scene
import numpy as np

PERIOD_S = 0.005
PERIODS = 200


def run(progress: Callable[[str], None]) -> list[Measurement]:
    """
    Measure.

    Args:
        progress: called with the name of each measurement.

    Returns:
        The figures.

    """
    model = RobotModel.load('lwr4')
    progress('PyBullet alone')
    floor_s = _world_period_s(model)
    progress('simulated arm')
    with SimulatedArm(model) as arm:
        commands = _commands(model)
        period_s = time_call(lambda: _drive(arm, commands), rounds=9) / PERIODS
        error_m = _tracking_error_m(arm, commands)
    progress('human figure')
    ratio = _figure_ratio(model)
    progress('self-check')
    check_s = time_call(lambda: check_models(model), rounds=5)
    progress('lockstep handover')
    handover_speed = _handover_speed()
    progress('pictures')
    image_s = _image_s()
    return [
        Measurement(
            'PyBullet alone, five steps of 1 ms',
            1e6 * floor_s,
            'µs',
            note=f'{PERIOD_S / floor_s:.0f} times real time',
        ),
        Measurement(
            'simulated arm, period of 5 ms',
            1e6 * period_s,
            'µs',
            target=250.0,
            floor=1e6 * floor_s,
            note='check, jerk-limited interpolation, watchdog, five steps of physics, reading',
        ),
        Measurement(
            'lockstep handover: DMP, inverse kinematics, PyBullet',
            handover_speed,
            'times real time',
            target=12.0,
            floor=PERIOD_S / floor_s,
            higher_is_better=True,
            note='floor: PyBullet alone',
        ),
        Measurement('wrist beside the interpolated reference', 1e3 * error_m, 'mm', target=0.01),
        Measurement('world with the human figure to world without', ratio, '', target=1.5),
        Measurement('self-check of the two engines', 1e3 * check_s, 'ms'),
        Measurement('picture, 640 by 480', 1e3 * image_s, 'ms', target=400.0),
    ]


def _handover_speed() -> float:
    """Run whole handovers; return the median of simulated time over real time."""
    scenario = make_scenario()
    speeds = []
    for _ in range(9):
        handover = Handover(scenario)
        begun_s = perf_counter()
        handover.run()
        speeds.append(handover.time_s / (perf_counter() - begun_s))
        handover.close()
    return median(speeds)


def _commands(model: RobotModel) -> list[Array]:
    """Return a smooth motion of all joints well within the limits, 1 s."""
    times = PERIOD_S * np.arange(PERIODS)[:, None]
    phases = np.arange(model.dof)
    ramp = np.minimum(1.0, times / 0.25)
    return list(0.5 * model.limits.velocity * ramp * np.sin(2 * np.pi * times + phases))


def _drive(arm: SimulatedArm, commands: list[Array], hands: Array | None = None) -> None:
    arm.reset()
    for i, command in enumerate(commands):
        if hands is not None:
            arm.show_hand(hands[i])
        arm.command(command)
        arm.advance(PERIOD_S)


def _world_period_s(model: RobotModel) -> float:
    with World(model) as world:
        commands = [command.tolist() for command in _commands(model)]

        def drive() -> None:
            world.reset(model.home)
            for command in commands:
                for _ in range(5):
                    world.drive(command)
                    world.step()

        return time_call(drive, rounds=9) / PERIODS


def _tracking_error_m(arm: SimulatedArm, commands: list[Array]) -> float:
    arm.reset()
    worst = 0.0
    for command in commands:
        arm.command(command)
        arm.advance(PERIOD_S)
        there, _ = arm.model.wrist_pose(arm.joint_positions)
        wanted, _ = arm.model.wrist_pose(arm.reference_positions)
        worst = max(worst, float(np.linalg.norm(there - wanted)))
    return worst


def _hand_path() -> Array:
    u = np.linspace(0.0, 1.0, PERIODS)[:, None]
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    return np.asarray(np.array([1.35, 0.2, 0.85]) + s * np.array([-0.35, -0.2, 0.2]))


def _figure_ratio(model: RobotModel) -> float:
    """Measure with and without in turns; on a shared machine only the ratio is reliable."""
    hands = _hand_path()
    commands = _commands(model)
    figure = PartnerFigure(hands, np.array([0.5, 0.0, 1.0]))
    with SimulatedArm(model) as alone, SimulatedArm(model, figure=figure) as beside:
        _drive(alone, commands)
        _drive(beside, commands, hands)
        ratios = []
        for _ in range(15):
            start = perf_counter()
            _drive(alone, commands)
            middle = perf_counter()
            _drive(beside, commands, hands)
            ratios.append((perf_counter() - middle) / (middle - start))
    return median(ratios)


def _image_s() -> float:
    model = RobotModel.load('lwr4', base=BasePlacement((0.0, 0.0, 0.6), 0.0))
    times: Array = PERIOD_S * np.arange(PERIODS, dtype=np.float64)
    joints = np.tile(model.home, (PERIODS, 1))
    with Scene(model, times, joints, _hand_path()) as scene:
        return time_call(lambda: scene.image(0.8, 640, 480), rounds=7)
