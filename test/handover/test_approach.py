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

"""The wrist never runs past a hand, wherever that is and whatever was learnt."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from handover_dmp.dmp import DecoupledDmp, DmpParameters, learn, save_model
from handover_dmp.evaluation.cases import Case, make_cases
from handover_dmp.evaluation.envelope import Envelope
from handover_dmp.evaluation.rollouts import learn_from_case, Learning, plan
from handover_dmp.evaluation.scores import judge
from handover_dmp.handover.approach import ApproachOptions, rollout_towards
from handover_dmp.handover.controller import HandoverController, HandoverOptions
from handover_dmp.handover.lockstep import Handover
from handover_dmp.handover.object_profile import object_profile, ObjectProfile
from handover_dmp.handover.scenario import make_scenario
from handover_dmp.mocap import HandoverTrial, read_data_set, write_trial
from handover_dmp.robot.errors import UnreachableError
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

PERIOD_S = 0.005
LIMIT = 20.0
"""m/s²; the acceleration limit of `config/handover.yaml`."""
MAX_BEYOND_M = 0.02
CROSSED_M = 0.1
"""A moving hand that comes so near to where the wrist started leaves no line to be beyond of."""
HAND_DECELERATION = 10.0
"""m/s²; how a hand stops."""
OFF = ApproachOptions(enabled=False)


@dataclass(frozen=True)
class Shape:
    """A demonstration: minimum jerk along x, bent, and longer on the way than at its end."""

    duration_s: float = 1.0
    length_m: float = 0.6
    bend: float = 0.0
    overshoot: float = 0.0
    stiffness: float = 200.0
    mu: float = 0.75
    sigma: float = 0.05
    formulation: str = 'stiff'


@lru_cache(maxsize=64)
def learnt(shape: Shape) -> DecoupledDmp:
    times = np.arange(0.0, shape.duration_s + 1e-9, PERIOD_S)
    u = times / times[-1]
    done = 10 * u**3 - 15 * u**4 + 6 * u**5
    bow = np.sin(np.pi * done)
    along = done + shape.overshoot * bow**2
    places = shape.length_m * np.stack([along, shape.bend * bow, 0.3 * shape.bend * bow], axis=1)
    parameters = DmpParameters(
        stiffness=shape.stiffness,
        mu=shape.mu,
        sigma=shape.sigma,
        formulation=shape.formulation,
    )
    model = learn(times, places, parameters, regression='ridge', primitive=DecoupledDmp)
    return model.with_goal_offset((-0.05, 0.02, 0.0))


@dataclass(frozen=True)
class Meeting:
    """Where the wrist starts, and where its goal is and how it moves until it stops."""

    start: tuple[float, float, float]
    goal: tuple[float, float, float]
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    stops_s: float = 1.0
    deceleration: float = HAND_DECELERATION

    def at(self, time_s: float) -> tuple[Array, Array]:
        velocity = np.array(self.velocity)
        speed = float(np.linalg.norm(velocity))
        braking_s = min(max(0.0, time_s - self.stops_s), speed / self.deceleration)
        left = 1.0 - braking_s * self.deceleration / speed if speed else 0.0
        moved_s = min(time_s, self.stops_s) + 0.5 * braking_s * (1.0 + left)
        return np.array(self.goal) + moved_s * velocity, left * velocity


@dataclass(frozen=True)
class Motion:
    """What came of it, (n, 3) each, m and m/s."""

    positions: Array
    velocities: Array
    goals: Array
    goal_velocities: Array
    limit: float = LIMIT

    @property
    def distances(self) -> Array:
        """Of the goal from where the wrist started, (n,) m."""
        found: Array = np.linalg.norm(self.goals - self.positions[0], axis=1)
        return found

    @property
    def line(self) -> Array:
        found: Array = (self.goals - self.positions[0]) / np.maximum(self.distances, 1e-9)[:, None]
        return found

    @property
    def counts(self) -> NDArray[np.bool_]:
        """When there is a line from the start to the goal."""
        moving = np.linalg.norm(self.goal_velocities, axis=1) > 0.0
        return ~np.maximum.accumulate(moving & (self.distances < CROSSED_M))

    @property
    def beyond(self) -> float:
        """How far the wrist was beyond the goal, along the line from its start, m."""
        further = ((self.positions - self.goals) * self.line).sum(axis=1)
        return float(further[self.counts].max(initial=-np.inf))

    @property
    def too_fast(self) -> float:
        """How much faster it came than it could brake before it is too far beyond, m/s."""
        left = ((self.goals - self.positions) * self.line).sum(axis=1) + MAX_BEYOND_M
        closing = ((self.velocities - self.goal_velocities) * self.line).sum(axis=1)
        excess = np.maximum(closing, 0.0) - np.sqrt(2 * self.limit * np.maximum(left, 0.0))
        return float(excess[self.counts].max(initial=-np.inf))

    @property
    def acceleration(self) -> Array:
        found: Array = np.diff(self.velocities, axis=0) / PERIOD_S
        return found

    @property
    def jerk(self) -> Array:
        found: Array = np.diff(self.acceleration, axis=0) / PERIOD_S
        return found

    @property
    def length(self) -> float:
        return float(np.linalg.norm(np.diff(self.positions, axis=0), axis=1).sum())


def meet(
    model: DecoupledDmp,
    meeting: Meeting,
    approach: ApproachOptions | None = None,
    phase_rates: Array | None = None,
    restart_s: float | None = None,
    limit: float = LIMIT,
) -> Motion:
    """Go through the controller, with a wrist that is where it is told to be."""
    options = HandoverOptions(exchange_hold_s=60.0, acceleration_limit=limit)
    if approach is not None:
        options = replace(options, approach=approach)
    controller = HandoverController(model, options)
    controller.set_wrist(meeting.start)
    rows = []
    offset = np.array(model.goal_offset)
    duration_s = 1.6 * model.duration_s + 0.6 + (restart_s or 0.0)
    started_at = 0
    for k in range(round(duration_s / PERIOD_S)):
        now_s = k * PERIOD_S
        goal, _ = meeting.at(now_s)
        controller.set_hand(now_s, tuple((goal - offset).tolist()), now_s, now_s)
        if k == 0:
            controller.start()
        if restart_s is not None and k == round(restart_s / PERIOD_S):
            controller.abort()
            controller.start()
            started_at = k
        rate = 1.0 if phase_rates is None else float(phase_rates[k % len(phase_rates)])
        command = controller.step(now_s, PERIOD_S, rate)
        assert command is not None
        after, moving = meeting.at(now_s + PERIOD_S)
        rows.append([command.position, command.velocity, tuple(after), tuple(moving)])
        controller.set_wrist(command.position)
    table = np.array(rows)[started_at:]
    first = np.array([meeting.start, (0.0, 0.0, 0.0), *meeting.at(0.0)])
    if not started_at:
        table = np.concatenate([first[None], table])
    stopping_limit = 0.0 if approach is None else approach.stopping_limit
    return Motion(*table.transpose(1, 0, 2), max(limit, stopping_limit))


SHAPES = [
    Shape(),
    Shape(duration_s=0.5, length_m=0.8),
    Shape(duration_s=2.0, length_m=0.3, bend=0.5),
    Shape(bend=0.3, overshoot=0.3, stiffness=1000.0),
    Shape(stiffness=20.0, mu=0.7, sigma=0.2),
    Shape(formulation='printed', bend=0.2),
]
USUAL_SHAPES = [SHAPES[0], SHAPES[2], Shape(bend=0.2, stiffness=400.0), SHAPES[5]]
"""Those that do not go beyond the hand, nor faster than any person reaches."""
COORDINATE = st.floats(-1.0, 1.0)
DIRECTION = st.tuples(COORDINATE, COORDINATE, COORDINATE).filter(lambda d: np.linalg.norm(d) > 0.1)


@st.composite
def meetings(draw: st.DrawFn) -> Meeting:
    start = np.array(draw(st.tuples(COORDINATE, COORDINATE, COORDINATE)))
    direction = np.array(draw(st.one_of(st.just((1.0, 0.0, 0.0)), DIRECTION)))
    direction /= np.linalg.norm(direction)
    distance = draw(st.floats(0.01, 1.5))
    aside = np.array(draw(DIRECTION))
    moving = draw(st.sampled_from(['rest', 'towards', 'away', 'any']))
    velocity = {'rest': 0 * aside, 'towards': -direction, 'away': direction, 'any': aside}[moving]
    velocity = velocity / max(float(np.linalg.norm(velocity)), 1.0) * draw(st.floats(0.0, 1.0))
    return Meeting(
        tuple(start.tolist()),
        tuple((start + distance * direction).tolist()),
        tuple(velocity.tolist()),
        draw(st.floats(0.1, 2.0)),
    )


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.sampled_from(SHAPES), meetings())
def test_never_runs_past_the_hand(shape: Shape, meeting: Meeting) -> None:
    motion = meet(learnt(shape), meeting)
    assert motion.beyond <= MAX_BEYOND_M
    assert motion.too_fast <= 0.0
    assert np.linalg.norm(motion.acceleration, axis=1).max() <= LIMIT * (1 + 1e-9)


@settings(max_examples=10, deadline=None, derandomize=True)
@given(
    st.sampled_from(SHAPES),
    meetings(),
    st.lists(st.floats(0.0, 1.0), min_size=1, max_size=7),
    st.one_of(st.none(), st.floats(0.1, 0.8)),
)
def test_nor_with_a_slow_arm_or_started_again(
    shape: Shape, meeting: Meeting, rates: list[float], restart_s: float | None
) -> None:
    motion = meet(learnt(shape), meeting, phase_rates=np.array(rates), restart_s=restart_s)
    # started in motion right before the hand, it may take its braking distance
    speed = float(np.linalg.norm(motion.velocities[0]))
    braking_m = speed**2 / (2 * LIMIT) if restart_s is not None else 0.0
    assert motion.beyond <= MAX_BEYOND_M + braking_m


GENTLE = [object_profile(name) for name in ('cup', 'box')]


def check_gently(profile: ObjectProfile, shape: Shape, meeting: Meeting) -> None:
    model, limit = profile.movement_with(learnt(shape)), profile.acceleration
    motion = meet(model, meeting, profile.handover_options('off').approach, limit=limit)
    assert motion.beyond <= MAX_BEYOND_M, (profile.name, shape, meeting)
    assert motion.too_fast <= 0.0, (profile.name, shape, meeting)
    # a hand that does not stop hard is met by the limit of the object alone
    calm = replace(meeting, deceleration=0.5 * limit)
    motion = meet(model, calm, limit=limit)
    assert motion.beyond <= MAX_BEYOND_M, (profile.name, shape, calm)
    assert motion.too_fast <= 0.0, (profile.name, shape, calm)
    assert np.linalg.norm(motion.acceleration, axis=1).max() <= limit * (1 + 1e-9)


@settings(max_examples=6, deadline=None, derandomize=True)
@given(st.sampled_from(GENTLE), st.sampled_from(SHAPES), meetings())
def test_nor_with_what_must_not_be_shaken(
    profile: ObjectProfile, shape: Shape, meeting: Meeting
) -> None:
    check_gently(profile, shape, meeting)


def test_rather_shakes_the_cup_than_runs_into_the_hand() -> None:
    cup, away = GENTLE[0], Meeting((0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (1.0, 0.0, 0.0), 0.8)
    model = cup.movement_with(learnt(Shape(duration_s=0.5, length_m=0.8)))
    assert meet(model, away, limit=cup.acceleration).beyond > MAX_BEYOND_M
    approach = cup.handover_options('off').approach
    motion = meet(model, away, approach, limit=cup.acceleration)
    assert motion.beyond <= MAX_BEYOND_M
    assert np.linalg.norm(motion.acceleration, axis=1).max() > 1.5 * cup.acceleration


def test_the_rules_are_needed() -> None:
    """Without them the wrist goes through the hand; each alone is not as good as both."""
    model, meeting = learnt(Shape()), Meeting((0.0, 0.0, 0.0), (0.16, 0.0, 0.0))
    assert meet(model, meeting, OFF).beyond > 0.3
    both = meet(model, meeting)
    bound = meet(model, meeting, replace(ApproachOptions(), near_m=0.001))
    assert max(both.beyond, bound.beyond) <= MAX_BEYOND_M
    assert np.abs(both.jerk).max() < 0.75 * np.abs(bound.jerk).max()
    weak = learnt(Shape(stiffness=20.0))
    assert meet(weak, meeting, replace(ApproachOptions(), beyond_m=1.0)).beyond > MAX_BEYOND_M


def test_comes_to_a_near_hand_as_softly_as_it_was_taught() -> None:
    meeting = Meeting((0.0, 0.0, 0.0), (0.16, 0.03, 0.02))
    taught, near = meet(learnt(Shape()), meeting, OFF), meet(learnt(Shape()), meeting)
    assert np.linalg.norm(near.positions[-1] - meeting.goal) < 1e-3
    size = np.linalg.norm
    assert size(near.acceleration, axis=1).max() < 1.2 * size(taught.acceleration, axis=1).max()
    assert np.sqrt((near.jerk**2).mean()) < 1.2 * np.sqrt((taught.jerk**2).mean())


@pytest.mark.parametrize('direction', [(-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-0.7, 0.0, 0.7)])
@pytest.mark.parametrize('distance', [0.1, 0.3, 0.6])
def test_reaches_a_hand_elsewhere_without_a_detour(
    direction: tuple[float, float, float], distance: float
) -> None:
    goal = distance * np.array(direction) / np.linalg.norm(direction)
    motion = meet(learnt(Shape()), Meeting((0.0, 0.0, 0.0), tuple(goal.tolist())))
    assert np.linalg.norm(motion.positions[-1] - goal) < 1e-3
    assert motion.length < 2.0 * distance


@settings(max_examples=12, deadline=None, derandomize=True)
@given(st.sampled_from(USUAL_SHAPES), st.floats(-0.05, 0.05), st.floats(-0.05, 0.05))
def test_changes_nothing_where_the_hand_is_as_far_as_learnt(
    shape: Shape, along: float, aside: float
) -> None:
    model = learnt(replace(shape, mu=0.75, sigma=0.05))
    goal = model.goal * (1.0 + along) + aside * np.array([0.0, model.goal[0], 0.0])
    meeting = Meeting((0.0, 0.0, 0.0), tuple(goal.tolist()))
    apart = meet(model, meeting).positions - meet(model, meeting, OFF).positions
    assert np.sqrt((apart**2).sum(axis=1).mean()) < 2e-3


def as_commanded(case: Case, model: DecoupledDmp, index: int, options: ApproachOptions) -> Array:
    samples = int(case.hands.samples[index])
    positions, _ = rollout_towards(
        model,
        case.hands.times[:samples],
        case.hands.positions[index, :samples] + model.goal_offset,
        case.hands.velocities[index, :samples],
        case.starts[index],
        options,
    )
    return positions


def model_of(case: Case, sources: tuple[int, ...]) -> DecoupledDmp:
    model, offset = learn_from_case(case, sources, 'decoupled', Learning())
    assert isinstance(model, DecoupledDmp)
    return model.with_goal_offset(offset)


@pytest.mark.parametrize(
    'every',
    [
        pytest.param(9, id='some'),
        pytest.param(1, id='all', marks=[pytest.mark.slow, pytest.mark.timeout(3600)]),
    ],
)
def test_moves_as_before_against_recorded_people(kth_folder: Path, every: int) -> None:
    squares = []
    pairs = [(c, i) for c in make_cases(read_data_set(kth_folder)) for i in range(len(c))]
    for case, index in pairs[::every]:
        model = model_of(case, (index,))
        on, off = (as_commanded(case, model, index, o) for o in (ApproachOptions(), OFF))
        squares.append(((on - off) ** 2).sum(axis=1).mean())
    assert np.sqrt(np.mean(squares)) < 1e-3
    assert np.sqrt(np.max(squares)) < 2e-3


def table(sigmas: Array) -> Array:
    """Give the shares within 1, 2 and 3 standard deviations, in per cent, as Table I has them."""
    return np.array([100.0 * float((sigmas <= k).mean()) for k in (1, 2, 3)])


def beyond_goal(positions: Array, goals: Array, start: Array) -> float:
    from_start = np.linalg.norm(positions - start, axis=1)
    return float((from_start - np.linalg.norm(goals - start, axis=1)).max())


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize('learn_from', ['single', 'mean'])
def test_table_i_stays_as_it_was_but_for_those_that_ran_through_the_hand(
    kth_folder: Path, learn_from: str
) -> None:
    """A rollout that without the rule is beyond the hand has to change; no other one does."""
    sigmas: dict[bool, list[Array]] = {True: [], False: []}
    passed = []
    for case in make_cases(read_data_set(kth_folder)):
        band = Envelope.of(case.curves)
        for task in plan(case, learn_from):
            model, tested = model_of(case, task.sources), list(task.tested)
            for enabled, options in ((False, OFF), (True, ApproachOptions())):
                rollouts = np.zeros((len(tested), int(case.hands.samples.max()), 3))
                for row, index in zip(rollouts, tested, strict=True):
                    positions = as_commanded(case, model, index, options)
                    row[: len(positions)] = positions
                    goals = case.hands.positions[index, : len(positions)] + model.goal_offset
                    beyond_m = beyond_goal(positions, goals, case.starts[index])
                    if enabled:
                        assert beyond_m <= MAX_BEYOND_M
                    else:
                        passed.append(beyond_m > MAX_BEYOND_M)
                curves = case.hands.time_normalise(rollouts, tested)
                scores = judge(curves[None], case.curves[tested], band)
                sigmas[enabled].append(scores.sigmas.reshape(len(tested), -1))
    before, after = (np.concatenate(sigmas[enabled]) for enabled in (False, True))
    assert (table(after) >= table(before) - 0.5).all()
    kept = np.where(np.array(passed)[:, None], before, after)
    assert np.abs(table(kept) - table(before)).max() <= 0.5
    assert 0.05 < np.mean(passed) < 0.2, 'the two parts of the table are both there'


def trial_of(meeting: Meeting, model: DecoupledDmp, duration_s: float) -> HandoverTrial:
    times = np.arange(0.0, duration_s, PERIOD_S)
    goals = np.array([meeting.at(t)[0] for t in times])
    reach = np.linspace(meeting.start, goals[-1], len(times))
    return HandoverTrial(times, goals - model.goal_offset, reach, 'approach', 'give', 1)


def simulated(meeting: Meeting, shape: Shape, folder: Path) -> tuple[Motion, bool]:
    """Give the measured wrist of the simulated arm, and whether it handed over."""
    model = learnt(shape)
    save_model(model, folder / 'model.json')
    write_trial(trial_of(meeting, model, 1.6 * shape.duration_s + 0.6), folder / 'trial.csv')
    scenario = make_scenario(folder / 'trial.csv', model=folder / 'model.json')
    handover = Handover(scenario)
    try:
        periods = handover.run()
    finally:
        handover.close()
    reaching = [p for p in periods if p.command.state.value in ('reaching', 'exchange')]
    wrist = np.array([p.wrist_position for p in reaching])
    goals = np.array([p.hands[0][-1].position for p in reaching]) + model.goal_offset
    motion = Motion(
        wrist,
        np.gradient(wrist, PERIOD_S, axis=0),
        goals,
        np.gradient(goals, PERIOD_S, axis=0),
    )
    return motion, periods[-1].command.state.value == 'done'


SIMULATED = {
    'near, at rest': Meeting((0.0, 0.0, 1.0), (0.16, 0.03, 1.02)),
    'comes nearer': Meeting((0.0, 0.0, 1.0), (0.75, 0.0, 1.0), (-0.5, 0.05, 0.0), 0.9),
    'elsewhere': Meeting((0.0, 0.0, 1.0), (-0.1, 0.3, 1.0)),
}


@pytest.mark.parametrize('meeting', SIMULATED.values(), ids=SIMULATED.keys())
def test_the_simulated_arm_does_not_either(meeting: Meeting, tmp_path: Path) -> None:
    motion, handed_over = simulated(meeting, Shape(duration_s=1.2), tmp_path)
    assert handed_over
    assert motion.beyond <= MAX_BEYOND_M
    assert motion.too_fast <= 0.0


@pytest.mark.slow
@pytest.mark.timeout(3600)
@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.sampled_from(SHAPES[:3]), meetings())
def test_nor_in_many_meetings(
    tmp_path_factory: pytest.TempPathFactory, shape: Shape, meeting: Meeting
) -> None:
    try:
        motion, _ = simulated(meeting, shape, tmp_path_factory.mktemp('meeting'))
    except UnreachableError:
        return
    assert motion.beyond <= MAX_BEYOND_M


def random_shape(rng: np.random.Generator) -> Shape:
    return Shape(
        duration_s=float(rng.uniform(0.4, 2.5)),
        length_m=float(rng.uniform(0.1, 1.0)),
        bend=float(rng.choice([0.0, 0.1, 0.3, 0.6])),
        overshoot=float(rng.choice([0.0, 0.0, -0.3, 0.3])),
        stiffness=float(np.exp(rng.uniform(np.log(20.0), np.log(1000.0)))),
        mu=float(rng.choice([0.7, 0.75, 0.9])),
        sigma=float(rng.choice([0.02, 0.05, 0.2])),
        formulation=str(rng.choice(['stiff', 'stiff', 'stiff', 'printed'])),
    )


def random_meeting(rng: np.random.Generator, shape: Shape) -> Meeting:
    along = np.array([1.0, 0.0, 0.0])
    directions = [rng.normal(size=3), along + 0.3 * rng.normal(size=3), -along]
    direction = directions[rng.choice(3, p=[0.4, 0.45, 0.15])]
    direction = direction / np.linalg.norm(direction)
    distance = shape.length_m * np.exp(rng.uniform(np.log(0.05), np.log(3.0)))
    sideways = np.cross(direction, rng.normal(size=3))
    moving = [0 * direction, -direction, direction, sideways, rng.normal(size=3)][rng.integers(5)]
    velocity = moving / max(float(np.linalg.norm(moving)), 1e-9) * rng.uniform(0.0, 1.0)
    start = rng.uniform(-1.0, 1.0, 3)
    return Meeting(
        tuple(start.tolist()),
        tuple((start + distance * direction).tolist()),
        tuple(velocity.tolist()),
        float(rng.uniform(0.2, 1.5) * shape.duration_s),
    )


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize('seed', range(10))
def test_ten_thousand_random_meetings(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(100):
        shape = random_shape(rng)
        model = learnt(shape)
        for _ in range(10):
            meeting = random_meeting(rng, shape)
            rates = rng.uniform(0.0, 1.0, 20) if rng.random() < 0.2 else None
            motion = meet(model, meeting, phase_rates=rates)
            assert motion.beyond <= MAX_BEYOND_M, (shape, meeting)
            assert motion.too_fast <= 0.0, (shape, meeting)


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_thousand_random_meetings_with_what_must_not_be_shaken() -> None:
    rng = np.random.default_rng(0)
    for _ in range(100):
        shape = random_shape(rng)
        for _ in range(5):
            for profile in GENTLE:
                check_gently(profile, shape, random_meeting(rng, shape))
