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

"""Everything that a run of a session needs: the recorded session, both movements, the arm."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
import math
from pathlib import Path

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.common.settings import defaults
from handover_dmp.handover.object_profile import DEFAULT_OBJECT, object_profile, ObjectProfile
from handover_dmp.handover.recordings import example_sessions, read_model
from handover_dmp.handover.scenario import expected_path, placed_arm
from handover_dmp.handover.session import SessionModels, SessionOptions
from handover_dmp.handover.teaching import learn_from_trials
from handover_dmp.handover.withdrawal import WithdrawalOptions
from handover_dmp.mocap import HandoverTrial
from handover_dmp.mocap.segmentation import Segmentation, SegmentedMotion
from handover_dmp.mocap.session import read_session, RecordedSession
from handover_dmp.robot.descriptions import ArmChoice
from handover_dmp.robot.model import BasePlacement, RobotModel
from handover_dmp.simulation.carried_object import CarriedObjectOptions
import numpy as np


@dataclass(frozen=True)
class SessionScenario:
    """
    One session to run.

    Attributes:
        session: the recording, low-pass filtered; its P1 is the partner, its P2 for comparison.
        models: the learnt movements.
        robot: the arm, placed.
        q_start: (n,), rad, with the wrist at the position of P2's before the give.
        seed: random seed.
        partner_model: `auto`, to use the partner models of the movements, or `off`.
        profile: profile of the handed-over object; the movements are adapted to it.
        pick_up: (3,), m, wrist position at which the object is picked up; None: it is held
            already.

    """

    session: RecordedSession
    models: SessionModels
    robot: RobotModel
    q_start: Array
    seed: int
    partner_model: str = field(default_factory=lambda: defaults('dmp')['partner_model'])
    profile: ObjectProfile = field(default_factory=lambda: object_profile(DEFAULT_OBJECT))
    pick_up: Array | None = None

    @property
    def orientation(self) -> str:
        """Orientation task of the wrist."""
        return self.profile.task_for(self.models.give)

    @property
    def rules(self) -> SessionOptions:
        """Rules of the session: those of `config/`, except for the pick-up."""
        if self.pick_up is None:
            return SessionOptions()
        x, y, z = self.pick_up.tolist()
        return SessionOptions(pick_up=True, pick_up_position=(x, y, z))

    def carried(self, mass_kg: float | None = None) -> CarriedObjectOptions:
        """
        Return the handed-over object, which lies between the two wrists at an exchange.

        Args:
            mass_kg: mass, kg; that of its profile if left out.

        Returns:
            The object, in the gripper or on the table.

        """
        mass_kg = self.profile.mass_kg if mass_kg is None else mass_kg
        return CarriedObjectOptions.between(self.models.give.goal_offset, mass_kg, self.pick_up)


def trials_of(session: RecordedSession) -> list[HandoverTrial]:
    """
    Cut a session into its handovers, each with P2's way back.

    Args:
        session: the recording.

    Returns:
        One trial per exchange, in order.

    """
    cut = SegmentedMotion(session.motion, Segmentation(), list(session.exchanges), [])
    return cut.trials(session.configuration, way_back=True)


def learn_from_session(session: RecordedSession) -> SessionModels:
    """
    Learn the movements of a session from its first give and its first take.

    Args:
        session: the recording.

    Returns:
        The movements.

    Raises:
        DataError: the session has no give, or no take.

    """
    found = {}
    for trial in reversed(trials_of(session)):
        found[trial.direction] = learn_from_trials([trial])
    missing = [direction for direction in ('give', 'take') if direction not in found]
    if missing:
        raise DataError(f'{session.motion.source}: contains no {missing[0]}')
    return SessionModels(found['give'], found['take'])


def make_session_scenario(
    session: Path | RecordedSession | None = None,
    *,
    model: Path | None = None,
    take_model: Path | None = None,
    models: SessionModels | None = None,
    arm: ArmChoice | None = None,
    base: BasePlacement | None = None,
    seed: int = 0,
    partner_model: str | None = None,
    profile: ObjectProfile | None = None,
    pick_up: bool = False,
) -> SessionScenario:
    """
    Assemble a scenario.

    The movements are learnt from the replayed session, unless they are given; those of the
    example are learnt from another session. The base is placed so that both reaches are well
    inside the reach of the arm.

    Args:
        session: the recording, or its file; by default the example.
        model: file of a learnt give.
        take_model: file of a learnt take.
        models: both movements, instead of files.
        arm: the arm; the LWR 4+ if left out.
        base: base placement; found if left out.
        seed: seed of the synthetic data.
        partner_model: `auto` or `off`; that of `config/` if left out.
        profile: profile of the handed-over object; a rod if left out.
        pick_up: whether the object is first picked up where the recorded person did so; ignored
            if the session does not contain a pick-up.

    Returns:
        The scenario.

    Raises:
        DataError: a file cannot be used, or a session has no give or no take.
        UnreachableError: the arm cannot reach the path from any placement.

    """
    if session is None:
        taught, replayed = example_sessions(seed)
    else:
        taught = replayed = read_session(session) if isinstance(session, Path) else session
    learnt = models or learn_from_session(taught)
    if model is not None:
        learnt = replace(learnt, give=read_model(model))
    if take_model is not None:
        learnt = replace(learnt, take=read_model(take_model))
    carried = profile or object_profile(DEFAULT_OBJECT)
    learnt = SessionModels(carried.movement_with(learnt.give), carried.movement_with(learnt.take))
    replayed = replayed.low_passed(defaults('hand_tracker')['cutoff_hz'])
    wrist_path = expected_session_path(learnt, replayed)
    place = replayed.pick_up if pick_up else None
    if place is not None:
        fetching = _fetching_path(wrist_path[0], place, replayed)
        wrist_path = np.vstack([fetching, fetching[::-1], wrist_path])
    task, hand = carried.task_for(learnt.give), trials_of(replayed)[0].partner[-1]
    robot, q_start = placed_arm(arm, base, wrist_path, task, hand)
    return SessionScenario(
        session=replayed,
        models=learnt,
        robot=robot,
        q_start=q_start,
        seed=seed,
        partner_model=partner_model or defaults('dmp')['partner_model'],
        profile=carried,
        pick_up=place,
    )


def expected_session_path(models: SessionModels, session: RecordedSession) -> Array:
    """
    Predict the path of the wrist for a recorded session.

    Args:
        models: the movements.
        session: the recording.

    Returns:
        (n, 3), m: the path to each exchange and back, except for the last way back.

    """
    trials = trials_of(session)
    home = trials[0].demonstrator[0]
    parts = []
    for trial in trials:
        movement = models.give if trial.direction == 'give' else models.take
        there = expected_path(movement, trial, home)
        parts += [there, there[::-1]]
    return np.vstack(parts[:-1])


def _fetching_path(home: Array, place: Array, session: RecordedSession) -> Array:
    """Return the straight path to the object, sampled like the session."""
    times = session.motion.times
    step_m = WithdrawalOptions().speed * float(times[1] - times[0])
    count = max(2, math.ceil(float(np.linalg.norm(place - home)) / step_m))
    return np.linspace(home, place, count)
