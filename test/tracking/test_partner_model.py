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

"""The partner model: its equations, its guards, and what it is worth on people."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from math import erf, log, sqrt
import tracemalloc

from handover_dmp.common.errors import DataError
from handover_dmp.common.settings import settings_of
from handover_dmp.dmp import DecoupledDmp, DmpParameters, learn, relearn
from handover_dmp.tracking.partner_model import (
    PartnerModel,
    PartnerOptions,
    rollout_expecting,
    with_goal_weight_of,
)
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
Hand = Callable[[float], Array]

PERIOD_S = 0.005
PAPER = PartnerOptions(mu=0.75, sigma=0.05, following=0.0, trust_within_m=0.0)
"""With these, nothing is expected, and the goal weight is the paper's."""


@lru_cache(maxsize=8)
def person(duration_s: float = 1.2, way_m: float = 0.4) -> DecoupledDmp:
    """Learn from two people whose hands meet by minimum jerk, one with a bow in its way."""
    times = np.arange(0.0, duration_s + 1e-9, PERIOD_S)
    u = times / times[-1]
    done = 10 * u**3 - 15 * u**4 + 6 * u**5
    wrist = np.outer(done, [0.5, 0.05, 0.1])
    wrist[:, 2] += 0.05 * np.sin(np.pi * u) ** 2
    hand = [1.0, 0.1, 0.2] + way_m * np.outer(1.0 - done, [0.8, 0.3, -0.5])
    nodes = np.linspace(0.0, times[-1], 101)
    path = np.stack([np.interp(nodes, times, column) for column in hand.T], axis=1)
    model = learn(times, wrist, DmpParameters(), regression='ridge', primitive=DecoupledDmp)
    return model.with_goal_offset(wrist[-1] - hand[-1]).with_partner_path(path)


def usual(model: DecoupledDmp) -> Callable[[float], Array]:
    """Give the learnt path of the hand over time in units of τ, at rest before and after."""
    path = model.partner_path
    assert path is not None
    nodes = np.linspace(0.0, 1.0, len(path))
    return lambda u: np.array([np.interp(u, nodes, column) for column in path.T])


def aside(model: DecoupledDmp) -> Array:
    path = model.partner_path
    assert path is not None
    side = np.cross(path[-1] - path[0], [0.0, 0.0, 1.0])
    return np.asarray(side / np.linalg.norm(side))


@dataclass(frozen=True)
class Motion:
    """What came of a hand, period by period."""

    gaps_m: Array
    accelerations: Array
    rates: Array
    trusts: Array
    leads: Array
    positions: Array
    phases: Array


def meet(
    model: DecoupledDmp,
    hand: Hand,
    duration_s: float,
    options: PartnerOptions | None = None,
    start: Array | None = None,
) -> Motion:
    """Run primitive and partner model against a hand, as evaluation and controller do."""
    options = options or PartnerOptions()
    movement = with_goal_weight_of(model, options)
    partner = PartnerModel(movement, options)
    state = movement.initial_state(None if start is None else start.tolist())
    rows = []
    for k in range(round(duration_s / PERIOD_S)):
        now_s = k * PERIOD_S
        place, after = hand(now_s), hand(now_s + PERIOD_S)
        velocity = (hand(now_s + 1e-5) - hand(now_s - 1e-5)) / 2e-5
        expected = partner.expect(tuple(place.tolist()), tuple(velocity.tolist()), state, PERIOD_S)
        moved = movement.step(
            state, expected.goal, expected.goal_velocity, PERIOD_S, expected.phase_rate
        )
        change = np.subtract(moved.velocity, state.velocity) / PERIOD_S
        state = moved
        gap = np.linalg.norm(np.array(state.position) - after - model.goal_offset)
        values = expected.phase_rate, expected.trust, expected.lead
        rows.append([gap, np.linalg.norm(change), *values, *state.position, state.phase])
    table = np.array(rows)
    gaps, accelerations, rates, trusts, leads = table[:, :5].T
    return Motion(gaps, accelerations, rates, trusts, leads, table[:, 5:8], table[:, 8])


def textbook(model: DecoupledDmp, hands: Array, velocities: Array) -> list[tuple[Array, Array]]:
    """Write the equations of docs/method.md down once more, with matrices, as they stand there."""
    options, tau, dt = PartnerOptions(), model.duration_s, PERIOD_S
    path = model.partner_path
    assert path is not None
    whole = path[-1] - path[0]
    length = float(np.linalg.norm(whole))
    direction = whole / length
    nodes = np.linspace(0.0, 1.0, len(path))
    slope = np.gradient(path, nodes, axis=0)

    def at(values: Array, u: float) -> Array:
        return np.array([np.interp(u, nodes, column) for column in values.T])

    def derivative(u: float) -> Array:
        return at(slope, u) if 0.0 < u < 1.0 else np.zeros(3)

    lead_amplitude = np.zeros(2)
    spread = np.diag([options.lead_deviation**2, (options.reach_deviation_m / length) ** 2])
    state, u, phi, found = model.initial_state(), 0.0, 0.0, []
    farthest = 0.0
    at_first = float(np.linalg.norm(hands[0] - path[0]))
    for hand, velocity in zip(hands, velocities, strict=True):
        spread[0, 0] += options.lead_drift**2 * dt / tau
        e, a = lead_amplitude
        usual_way = (at(path, u + e) - path[0]) @ direction
        row = np.array([(1 + a) * derivative(u + e) @ direction, usual_way])
        noise = options.noise_time_s * options.noise_m**2 / dt
        gain = spread @ row / (row @ spread @ row + noise)
        way = (hand - hands[0]) @ direction
        lead_amplitude = lead_amplitude + gain * (way - (1 + a) * usual_way)
        lead_amplitude = np.clip(lead_amplitude, [-2.0, -0.8], [2.0, 1.0])
        spread = spread - np.outer(gain, row @ spread)
        e, farthest = lead_amplitude[0], max(farthest, way)
        mean = at(path, u + e)
        off = np.array(state.start) - model.start
        stray = max(float(np.linalg.norm(hand - mean - off)), at_first)
        stray += 4.0 * (farthest - way)
        trust = np.clip((options.trust_within_m - stray) / options.trust_width_m, 0.0, 1.0)
        late = (phi - options.release) / (options.release_width * sqrt(2))
        q = trust * 0.5 * (1 - erf(late))
        goal = hand + model.goal_offset + q * (path[-1] - mean)
        goal_velocity = velocity - q * derivative(u + e) / tau
        ahead = u + trust * options.following * e - phi
        rate = float(np.clip(1 + ahead * tau / options.following_time_s, 0.0, 1.5))
        state = model.step(state, tuple(goal.tolist()), tuple(goal_velocity.tolist()), dt, rate)
        phi += rate * dt / tau
        u += dt / tau
        found.append((np.array([*goal, *goal_velocity, rate, trust, e]), np.array(state.position)))
    return found


@pytest.mark.parametrize('pace', [0.7, 1.0, 1.4])
def test_it_is_what_the_equations_say(pace: float) -> None:
    model = with_goal_weight_of(person(), PartnerOptions())
    way = usual(model)
    times = np.arange(0.0, 2.0, PERIOD_S)
    side = 0.1 * np.sin(2.0 * times)[:, None] * aside(model)
    hands = np.array([way(pace * t / model.duration_s) for t in times]) + side
    velocities = np.gradient(hands, times, axis=0)
    partner, state = PartnerModel(model), model.initial_state()
    for (hand, velocity), (wanted, position) in zip(
        zip(hands.tolist(), velocities.tolist(), strict=True),
        textbook(model, hands, velocities),
        strict=True,
    ):
        found = partner.expect(tuple(hand), tuple(velocity), state, PERIOD_S)
        values = [
            *found.goal,
            *found.goal_velocity,
            found.phase_rate,
            found.trust,
            found.lead,
        ]
        assert values == pytest.approx(wanted.tolist(), abs=1e-9)
        state = model.step(state, found.goal, found.goal_velocity, PERIOD_S, found.phase_rate)
        assert state.position == pytest.approx(position.tolist(), abs=1e-9)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31), st.lists(st.floats(1e-4, 0.05), min_size=30, max_size=60))
def test_without_trust_it_is_the_paper_to_the_last_bit(seed: int, lengths: list[float]) -> None:
    model = person()
    assert with_goal_weight_of(model, PAPER) is model
    random = np.random.default_rng(seed)
    partner = PartnerModel(model, PAPER)
    offset = model.goal_offset.tolist()
    plain = expecting = model.initial_state((0.1, -0.2, 0.3))
    for dt in lengths:
        hand, velocity = random.normal(size=(2, 3)).tolist()
        arm = float(random.choice([1.0, 0.3]))
        goal = tuple(p + o for p, o in zip(hand, offset, strict=True))
        plain = model.step(plain, goal, tuple(velocity), dt, arm)
        found = partner.expect(tuple(hand), tuple(velocity), expecting, dt, arm)
        expecting = model.step(
            expecting, found.goal, found.goal_velocity, dt, arm * found.phase_rate
        )
        assert found.trust == 0.0
        assert expecting == plain


def test_a_hand_as_it_was_learnt_is_met_where_it_was_met() -> None:
    model = person()
    way = usual(model)
    motion = meet(model, lambda t: way(t / model.duration_s), 2.0 * model.duration_s)
    assert np.allclose(motion.leads, 0.0, atol=1e-3)
    assert motion.rates == pytest.approx(1.0, abs=0.02)
    assert motion.trusts.min() == 1.0
    assert motion.gaps_m[round(model.duration_s / PERIOD_S) - 1] < 2e-3


def test_the_goal_is_where_the_hand_will_be() -> None:
    """In the middle of the way of a hand that goes twice as far."""
    model = with_goal_weight_of(person(), PartnerOptions())
    way = usual(model)
    partner, state = PartnerModel(model), model.initial_state()
    for k in range(round(0.5 * model.duration_s / PERIOD_S)):
        hand = way(k * PERIOD_S / model.duration_s)
        found = partner.expect(tuple(hand.tolist()), (0.0, 0.0, 0.0), state, PERIOD_S)
    expected = way(1.0) + model.goal_offset
    assert np.linalg.norm(hand - way(1.0)) > 0.15
    assert np.linalg.norm(np.array(found.goal) - expected) < 0.005


@pytest.mark.parametrize(('pace', 'sign'), [(1.3, 1.0), (0.8, -1.0)])
def test_the_phase_goes_along_with_the_lead_of_the_partner(pace: float, sign: float) -> None:
    model = person()
    way = usual(model)
    motion = meet(model, lambda t: way(pace * t / model.duration_s), 0.6 * model.duration_s)
    usually = np.exp(-model.parameters.alpha * 0.6)
    ahead = -log(motion.phases[-1] / usually) / model.parameters.alpha
    assert sign * motion.leads[-1] > 0.05
    share = ahead / motion.leads[-1]
    assert 0.3 < share <= 0.5 + 1e-6


# The guards


HANDS: dict[str, Callable[[DecoupledDmp], Hand]] = {
    'aside': lambda m: lambda t: usual(m)(t / m.duration_s) + 0.4 * aside(m),
    'turning back': lambda m: lambda t: usual(m)(min(t / m.duration_s, 1 - t / m.duration_s)),
    'stopping half way': lambda m: lambda t: usual(m)(min(t / m.duration_s, 0.5)),
    'already there': lambda m: lambda t: usual(m)(1.0),
}


@pytest.mark.parametrize('duration_s', [0.8, 1.2, 2.0])
@pytest.mark.parametrize('name', HANDS)
def test_is_at_the_hand_by_one_and_a_half_durations(name: str, duration_s: float) -> None:
    model = person(duration_s)
    motion = meet(model, HANDS[name](model), 1.6 * duration_s)
    arrived = round(1.5 * duration_s / PERIOD_S)
    assert motion.gaps_m[arrived:].max() <= 1e-3


def test_all_shifted_by_a_metre_changes_nothing() -> None:
    model, shift = person(), np.array([0.6, -0.64, 0.48])
    way = usual(model)
    here = meet(model, lambda t: way(t / model.duration_s), 1.6 * model.duration_s)
    there = meet(
        model,
        lambda t: way(t / model.duration_s) + shift,
        1.6 * model.duration_s,
        start=model.start + shift,
    )
    assert np.allclose(there.positions - shift, here.positions, atol=1e-9)
    assert there.gaps_m[-1] < 1e-3


@pytest.mark.parametrize('duration_s', [0.8, 1.2, 2.0])
def test_waits_for_a_hand_that_never_moves_and_arrives_all_the_same(duration_s: float) -> None:
    model = person(duration_s)
    still = usual(model)(0.0)
    motion = meet(model, lambda _: still, 2.6 * duration_s)
    plain = meet(model, lambda _: still, 2.6 * duration_s, PAPER)
    middle = round(duration_s / PERIOD_S)
    assert motion.gaps_m[middle] > 2.0 * plain.gaps_m[middle]
    arrived = round(2.5 * duration_s / PERIOD_S)
    assert motion.gaps_m[arrived:].max() <= 1e-3


def test_is_calmer_than_the_primitive_alone_with_a_hand_one_second_late() -> None:
    model = person(0.84)
    way = usual(model)

    def late(time_s: float) -> Array:
        return way((time_s - 1.0) / model.duration_s)

    plain, expecting = meet(model, late, 4.0, PAPER), meet(model, late, 4.0)
    assert plain.accelerations.max() > 17.0
    assert expecting.accelerations.max() <= 10.0
    assert expecting.gaps_m[-1] < 1e-6


@settings(max_examples=10, deadline=None)
@given(
    st.integers(0, 2**31),
    st.floats(0.0, 0.05),
    st.floats(0.1, 3.0),
    st.sampled_from([0.0, 0.001, 0.01, 0.1, 0.4]),
)
def test_whatever_the_hand_does(seed: int, dt_spread: float, pace: float, way_m: float) -> None:
    """Bounded rates, finite goals, and a phase that comes to its end."""
    model = with_goal_weight_of(person(way_m=way_m), PartnerOptions())
    options = PartnerOptions()
    random = np.random.default_rng(seed)
    way, partner = usual(model), PartnerModel(model)
    state, now_s, walk = model.initial_state(), 0.0, np.zeros(3)
    while now_s < 3.5 * model.duration_s:
        dt = PERIOD_S + dt_spread * float(random.random())
        walk += 0.02 * random.normal(size=3) * (random.random() < 0.3)
        hand = way(pace * now_s / model.duration_s) + walk
        if random.random() < 0.02:
            hand = hand + random.normal(size=3)
        found = partner.expect(tuple(hand.tolist()), (0.0, 0.0, 0.0), state, dt)
        assert np.isfinite([*found.goal, *found.goal_velocity, found.lead]).all()
        assert 0.0 <= found.trust <= 1.0
        assert 0.0 <= found.phase_rate <= options.max_phase_rate
        expected = np.array(found.goal) - hand - model.goal_offset
        assert np.linalg.norm(expected) <= way_m * 1.2 + 1e-9
        state = model.step(state, found.goal, found.goal_velocity, dt, found.phase_rate)
        now_s += dt
    assert -log(state.phase) / model.parameters.alpha > options.release
    assert np.isfinite(state.position).all()


def test_a_partner_that_stood_still_in_the_demonstration() -> None:
    """No direction, no lead: the phase runs as it does without the model."""
    model = person(way_m=0.0)
    still = usual(model)(0.0)
    motion = meet(model, lambda _: still, 1.6 * model.duration_s)
    assert np.all(motion.rates == 1.0) and np.all(motion.leads == 0.0)
    assert motion.gaps_m[-1] < 1e-3


def test_a_period_of_no_length_changes_nothing() -> None:
    model = with_goal_weight_of(person(), PartnerOptions())
    hand, still = tuple(usual(model)(0.3).tolist()), (0.0, 0.0, 0.0)
    partner, state = PartnerModel(model), model.initial_state()
    first = partner.expect(hand, still, state, 0.0)
    assert first.lead == 0.0 and first.phase_rate == 1.0
    assert partner.expect(hand, still, state, 0.0) == first


def test_an_unseen_hand_is_taken_to_have_moved_on() -> None:
    """The expectation after a gap is the one that a hand seen all the time gives, or nearly."""
    model = with_goal_weight_of(person(), PartnerOptions())
    way = usual(model)
    found = {}
    for gap in (False, True):
        partner, state = PartnerModel(model), model.initial_state()
        for k in range(round(0.7 * model.duration_s / PERIOD_S)):
            hand = way(k * PERIOD_S / model.duration_s)
            if gap and 0.2 < k * PERIOD_S / model.duration_s < 0.5:
                partner.wait(PERIOD_S)
            else:
                found[gap] = partner.expect(tuple(hand.tolist()), (0.0,) * 3, state, PERIOD_S)
    assert found[True].goal == pytest.approx(found[False].goal, abs=2e-3)
    assert found[True].phase_rate == pytest.approx(1.0, abs=0.1)


def test_nothing_begins_before_the_hand_is_seen() -> None:
    model = with_goal_weight_of(person(), PartnerOptions())
    hand, still = tuple(usual(model)(0.0).tolist()), (0.0, 0.0, 0.0)
    waited, fresh = PartnerModel(model), PartnerModel(model)
    waited.wait(5.0)
    state = model.initial_state()
    assert waited.expect(hand, still, state, 0.005) == fresh.expect(hand, still, state, 0.005)


def test_nothing_grows_with_time() -> None:
    model = with_goal_weight_of(person(), PartnerOptions())
    partner, state = PartnerModel(model), model.initial_state()
    way = usual(model)
    hands = [tuple(way(u).tolist()) for u in np.linspace(0.0, 1.0, 50)]

    def through(rounds: int) -> int:
        for _ in range(rounds):
            for hand in hands:
                partner.expect(hand, (0.0, 0.0, 0.0), state, PERIOD_S)
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        before = through(2)
        assert through(40) - before < 2000
    finally:
        tracemalloc.stop()


def test_a_step_at_another_rate_is_that_of_a_model_that_knew_no_other() -> None:
    model = person()
    state, goal, still = model.initial_state(), tuple(model.goal.tolist()), (0.1, 0.0, 0.0)
    for k in range(12):
        dt = 0.005 if k % 5 else 0.2
        rate = 0.5 + 0.08 * k
        fresh = replace(model).step(state, goal, still, dt, rate)
        state = model.step(state, goal, still, dt, rate)
        assert state == fresh


def test_relearning_for_its_goal_weight_keeps_the_movement() -> None:
    model = person()
    movement = with_goal_weight_of(model, PartnerOptions())
    assert (movement.parameters.mu, movement.parameters.sigma) == (0.67, 0.2)
    assert movement.partner_path is model.partner_path or np.array_equal(
        movement.partner_path, model.partner_path
    )
    times = np.linspace(0.0, model.duration_s, 101)
    there, here = (each.rollout(times, model.goal).positions for each in (movement, model))
    assert np.abs(there - here).max() < 1e-3


def test_a_rollout_is_its_steps() -> None:
    model = with_goal_weight_of(person(), PartnerOptions())
    way = usual(model)
    times = np.arange(0.0, 1.0, PERIOD_S)
    hands = np.array([way(1.2 * t / model.duration_s) for t in times])
    motion = rollout_expecting(model, times, hands, np.zeros_like(hands), model.start.tolist())
    partner, state = PartnerModel(model), model.initial_state()
    for hand in hands[:-1].tolist():
        found = partner.expect(tuple(hand), (0.0, 0.0, 0.0), state, PERIOD_S)
        state = model.step(state, found.goal, found.goal_velocity, PERIOD_S, found.phase_rate)
    assert motion.positions[-1] == pytest.approx(state.position, abs=1e-9)
    assert motion.phase[-1] == pytest.approx(state.phase, rel=1e-9)
    assert motion.goal_weight[-1] == pytest.approx(model.goal_weight(state.phase))


def test_a_model_without_the_path_is_refused() -> None:
    with pytest.raises(DataError, match='no path of the partner'):
        PartnerModel(person().with_partner_path(None))


@pytest.mark.parametrize('name', settings_of(PartnerOptions))
def test_constants_out_of_range_are_refused_by_name(name: str) -> None:
    what = settings_of(PartnerOptions)[name]
    assert what.low is not None and what.high is not None
    low, high = what.low, what.high
    for value in (low - 1.0, high + 1.0, float('nan')):
        with pytest.raises(DataError, match=f'partner.{name} is'):
            replace(PartnerOptions(), **{name: value})


def test_a_path_is_kept_by_what_changes_a_model() -> None:
    model = person()
    changed = relearn(model, stiffness=300.0).with_duration(2.0).with_goal_offset((0.0, 0.0, 0.1))
    assert np.array_equal(changed.partner_path, model.partner_path)
    for spoilt in (np.zeros((1, 3)), np.zeros((5, 2)), np.full((5, 3), np.nan), np.zeros(3)):
        with pytest.raises(DataError, match='partner_path'):
            model.with_partner_path(spoilt)
