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

"""A recorded handover, ready to be drawn: the robot on its base, and the scene around it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.report import load_run, RunRecord
from handover_dmp.report.legs import legs_of
from handover_dmp.report.session import is_session, release_of
from handover_dmp.robot.descriptions import ArmChoice, Description, known_arms, read_description
from handover_dmp.robot.errors import RobotDescriptionError
from handover_dmp.robot.model import BasePlacement, RobotModel
from handover_dmp.simulation.carried_object import Holder
from handover_dmp.simulation.stances import stance_of
from handover_dmp.topics import ROBOT_DESCRIPTION
from handover_dmp.view.scene import Scene
from handover_dmp.view.surroundings import SURROUNDINGS
import numpy as np

BEFORE_S = 0.3
"""Shown time before the robot moves, s."""


@dataclass(frozen=True, eq=False)
class Stage:
    """
    A recorded handover, ready to be drawn at any moment.

    Attributes:
        record: the recorded run.
        robot: the arm, on its base.
        scene: the scene to draw.

    """

    record: RunRecord
    robot: RobotModel
    scene: Scene

    @property
    def span_s(self) -> tuple[float, float]:
        """Shown time span, from shortly before the robot moves to the end, s."""
        first, last = float(self.scene.times[0]), float(self.scene.times[-1])
        reaching = self.record.reaching_time_s
        begins = (
            time_s
            for time_s, state in self.record.states
            if state == 'picking_up' and (reaching is None or time_s < reaching)
        )
        begin = next(begins, reaching)
        return (first if begin is None else max(first, begin - BEFORE_S)), last

    def frame_times(self, rate_hz: float) -> Array:
        """
        Spread frames evenly over the span.

        Args:
            rate_hz: frames per second, Hz.

        Returns:
            (n,), s; the last one is the end of the span.

        """
        begin, end = self.span_s
        count = max(2, round((end - begin) * rate_hz) + 1)
        return end - np.arange(count)[::-1] / rate_hz

    def state_at(self, time_s: float) -> str:
        """
        Return the state of the handover.

        Args:
            time_s: time, s.

        Returns:
            The state; empty if none was recorded.

        """
        passed = [name for begin, name in self.record.states if begin <= time_s]
        return passed[-1] if passed else ''


@contextmanager
def set_up(
    path: Path, choice: ArmChoice | None = None, namespace: str | None = None
) -> Iterator[Stage]:
    """
    Read a recorded run and build its scene.

    Args:
        path: folder of a run, folder of its bag, or MCAP file.
        choice: the arm; empty fields come from the bag.
        namespace: namespace of the graph, if the bag contains several; None: the only one.

    Yields:
        The stage.

    Raises:
        DataError: the run is missing, or does not identify its arm.

    """
    record = load_run(path, namespace)
    model = _robot(record, choice or ArmChoice())
    model = model.placed(_base(record, model))
    times = record.joint_times
    joints = record.joint_positions[:, _order(record, model)]
    hand = _interpolated(times, record.hand_times, record.hand_positions)
    configuration = str(record.info.get('configuration') or '')
    first_s, back_s = _passes(record)
    with Scene(
        model,
        times,
        joints,
        hand,
        direction='give' if is_session(record) else record.info.get('exchange') or 'give',
        exchange_time_s=first_s,
        back_time_s=back_s,
        pick_up_time_s=_pick_up(record),
        stance=stance_of(configuration),
        surroundings=SURROUNDINGS.get(configuration),
        carried=record.info.get('object'),
    ) as scene:
        yield Stage(record, model, scene)


def _interpolated(times: Array, at: Array, positions: Array) -> Array:
    """Interpolate recorded positions, (n, 3), at other times."""
    return np.column_stack([np.interp(times, at, axis) for axis in positions.T])


def _passes(record: RunRecord) -> tuple[float | None, float | None]:
    """Return the times of the exchange and, in a session, of the second exchange, s."""
    if not is_session(record):
        return (record.exchange_time_s if record.handed_over else None), None
    passes: list[float | None] = [None, None]
    for number, leg in enumerate(legs_of(record)[:2]):
        release, span = release_of(record, leg), leg.run.exchange_span_s
        if leg.run.handed_over and span is not None:
            passes[number] = release['passed_s'] or release['gripper_s'] or span[1]
    return passes[0], passes[1]


def _pick_up(record: RunRecord) -> float | None:
    """Return the time at which the robot picked the object up from the table, s."""
    for (_, before), (time_s, after) in pairwise(record.holders):
        if (before, after) == (Holder.TABLE.value, Holder.ROBOT.value):
            return time_s
    return None


def _robot(record: RunRecord, choice: ArmChoice) -> RobotModel:
    """Load the chosen arm, or the one that the bag describes or names."""
    told = {key: str(record.info.get(key) or '') for key in ('wrist_frame', 'base_frame')}
    wrist_frame = choice.wrist_frame or ('' if choice.robot else told['wrist_frame'])
    base_frame = choice.base_frame or ('' if choice.robot else told['base_frame'])
    description = read_description(choice.robot) if choice.robot else _description(record)
    return RobotModel.load(description, wrist_frame=wrist_frame, base_frame=base_frame)


def _description(record: RunRecord) -> Description:
    """Return the recorded description, or its file if that is equal and has the meshes."""
    name, told = record.info.get('robot'), str(record.info.get('robot_description') or '')
    known = [key for key, entry in known_arms().items() if name in (key, entry.urdf_name)]
    text = record.robot_description
    for source in filter(None, [told, *known]):
        with suppress(RobotDescriptionError, OSError):
            found = read_description(source)
            if found.text == text or not text:
                return found
    if not text:
        raise DataError(f'{record.source}: does not tell which arm it was: name it with --robot')
    return Description(ROBOT_DESCRIPTION.name, '', Path(ROBOT_DESCRIPTION.name), text)


def _order(record: RunRecord, model: RobotModel) -> list[int]:
    missing = set(model.joint_names) - set(record.joint_names)
    if missing:
        raise DataError(
            f'{record.source}: no joint states of {", ".join(sorted(missing))}, '
            f'which {model.name} has: is it another arm? Name it with --robot'
        )
    return [record.joint_names.index(name) for name in model.joint_names]


def _base(record: RunRecord, model: RobotModel) -> BasePlacement:
    """Return the recorded base placement, or the one that explains the wrist positions."""
    told = record.info.get('base_position_m')
    if isinstance(told, list) and len(told) == 3:
        x, y, z = map(float, told)
        yaw, roll, pitch = (
            float(record.info.get(f'base_{name}_rad', 0.0)) for name in ('yaw', 'roll', 'pitch')
        )
        return BasePlacement((x, y, z), yaw, roll, pitch)
    at_origin = model.placed(BasePlacement())
    joints = record.joint_positions[:, _order(record, model)]
    reached = np.array([at_origin.wrist_pose(q)[0] for q in joints])
    measured = _interpolated(record.joint_times, record.wrist_times, record.wrist_positions)
    here, there = reached - reached.mean(axis=0), measured - measured.mean(axis=0)
    across = np.sum(here[:, 0] * there[:, 1] - here[:, 1] * there[:, 0])
    yaw = float(np.arctan2(across, np.sum(here[:, :2] * there[:, :2])))
    turn = BasePlacement(yaw=yaw).rotation
    x, y, z = measured.mean(axis=0) - turn @ reached.mean(axis=0)
    return BasePlacement((float(x), float(y), float(z)), yaw)
