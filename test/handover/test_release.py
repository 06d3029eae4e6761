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

"""When the giver lets go: on synthetic loads whose truth is known, and as a real person did."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from handover_dmp.common.errors import UsageError
from handover_dmp.handover.release import GRAVITY, ReleaseOptions, ReleaseRule
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from numpy.typing import NDArray
import pytest

RECORDING = Path(__file__).resolve().parents[3] / 'shared/data/kth_full/handover_1.csv'
BATON_KG = 0.8
DT = 0.005
OPTIONS = ReleaseOptions(share=0.5, pull_n=10.0, contact_n=1.5, window_s=0.15, tare_s=0.2)
AT_REST_S = 0.5
ENOUGH = settings(max_examples=40)
Array = NDArray[np.float64]

numbers = st.floats
directions = st.tuples(*[numbers(-1.0, 1.0)] * 3).filter(lambda v: np.hypot.reduce(v) > 0.1)
weights = numbers(2.0, 40.0)
biases = st.tuples(*[numbers(-5.0, 5.0)] * 3)


def unit(vector: Any) -> Array:
    """Make a vector one long."""
    return np.array(vector) / np.linalg.norm(vector)


def run(
    rule: ReleaseRule,
    weight_n: float,
    taker: Callable[[float], Any],
    *,
    acceleration: Callable[[float], Any] = lambda _t: np.zeros(3),
    told: bool = True,
    bias: Any = (0.0, 0.0, 0.0),
    noise_n: float = 0.0,
    duration_s: float = 2.5,
) -> Iterator[tuple[float, bool]]:
    """Feed what a sensor would measure at each time, by Newton: the taker begins at 0."""
    random = np.random.default_rng(5)
    for step in range(round((AT_REST_S + duration_s) / DT)):
        time_s = step * DT - AT_REST_S
        moved = np.array(acceleration(time_s)) if time_s > 0.0 else np.zeros(3)
        force = np.array([0.0, 0.0, -weight_n]) - weight_n / GRAVITY * moved + np.array(bias)
        if time_s > 0.0:
            force = force + np.array(taker(time_s))
        force = force + random.normal(0.0, noise_n, 3) if noise_n else force
        yield time_s, rule.update(force, DT, moved if told else (0.0, 0.0, 0.0))


@ENOUGH
@given(weights, biases, numbers(0.01, 0.3), numbers(0.2, 1.5), st.booleans())
def test_a_load_that_passes_over_opens_once_half_of_it_has(
    weight_n: float, bias: tuple[float, ...], noise_n: float, transfer_s: float, weighed: bool
) -> None:
    rule = ReleaseRule(OPTIONS)
    # who weighs the object with a sensor that is off along z weighs the bias, too
    bias = (*bias[:2], 0.0 if weighed else bias[2])
    rule.reset(None if weighed else weight_n)

    def share(time_s: float) -> float:
        return float(np.clip(time_s / transfer_s, 0.0, 1.0))

    opened = next(
        time_s
        for time_s, opens in run(
            rule,
            weight_n,
            lambda time_s: (0.0, 0.0, share(time_s) * weight_n),
            bias=bias,
            noise_n=noise_n,
        )
        if opens
    )
    # what noise leaves of itself in a median of 30, five times over
    error = 5.0 * 1.25 * noise_n / np.sqrt(30) / weight_n + 0.01
    needed = max(OPTIONS.share, OPTIONS.contact_n / weight_n)
    assert (needed - error) * transfer_s <= opened
    latest = (needed + error) * transfer_s + 0.5 * OPTIONS.window_s + 0.02
    assert opened <= max(latest, transfer_s if needed + error >= 1.0 else 0.0)
    assert rule.weight_n == pytest.approx(weight_n, abs=1.5 * noise_n + 1e-9)


@ENOUGH
@given(
    weights,
    biases,
    directions,
    directions,
    numbers(0.1, 3.0),
    numbers(0.2, 6.0),
    numbers(0.0, 0.3),
    st.booleans(),
)
def test_sway_of_the_arm_alone_opens_nothing(
    weight_n: float,
    bias: tuple[float, ...],
    one: tuple[float, ...],
    other: tuple[float, ...],
    most: float,
    frequency_hz: float,
    noise_n: float,
    told: bool,
) -> None:
    rule = ReleaseRule(OPTIONS)
    # a load that the arm's own acceleration makes as heavy as a pull needs that acceleration told
    most = most if told else min(most, 0.8 * OPTIONS.pull_n * GRAVITY / weight_n)
    rule.reset(weight_n)

    def acceleration(time_s: float) -> Array:
        angle = 2.0 * np.pi * frequency_hz * time_s
        return 0.5 * most * (unit(one) * np.sin(angle) + unit(other) * np.cos(0.7 * angle))

    for time_s, opens in run(
        rule,
        weight_n,
        lambda _t: np.zeros(3),
        acceleration=acceleration,
        told=told,
        bias=bias,
        noise_n=noise_n,
    ):
        assert not opens, time_s
        if told:
            assert not rule.contact
            assert abs(rule.share) < 0.1 + noise_n / weight_n


@ENOUGH
@given(weights, directions, numbers(5.0, 500.0), numbers(0.005, 0.07))
def test_a_bump_is_no_pull(
    weight_n: float, direction: tuple[float, ...], force_n: float, for_s: float
) -> None:
    rule = ReleaseRule(OPTIONS)
    rule.reset(weight_n)
    bump = force_n * unit(direction)
    for time_s, opens in run(
        rule, weight_n, lambda time_s: bump * (0.3 < time_s <= 0.3 + for_s), duration_s=1.0
    ):
        assert not opens, time_s


@ENOUGH
@given(numbers(0.5, 40.0), directions, numbers(10.5, 60.0))
def test_a_pull_opens(weight_n: float, direction: tuple[float, ...], force_n: float) -> None:
    # who pulls down or level carries nothing
    side = unit([direction[0], direction[1], -abs(direction[2])])
    rule = ReleaseRule(OPTIONS)
    rule.reset(weight_n)
    pull = run(rule, weight_n, lambda _t: force_n * side, duration_s=0.4)
    opened = [time_s for time_s, opens in pull if opens]
    assert opened
    assert 0.4 * OPTIONS.window_s < opened[0] < 0.6 * OPTIONS.window_s + 0.01


@ENOUGH
@given(numbers(2.0, 40.0), weights, numbers(0.0, 2.0 * np.pi), numbers(-0.3, 0.3))
def test_another_pull_is_obeyed(
    pull_n: float, weight_n: float, bearing: float, beyond: float
) -> None:
    rule = ReleaseRule(replace(OPTIONS, pull_n=pull_n))
    level = np.array([np.cos(bearing), np.sin(bearing), 0.0])
    rule.reset(weight_n)
    beyond = beyond + 0.02 if beyond >= 0.0 else beyond - 0.02
    taker = (1.0 + beyond) * pull_n * level
    opened = any(opens for _, opens in run(rule, weight_n, lambda _t: taker, duration_s=0.4))
    assert opened == (beyond > 0.0)
    assert rule.pull_n == pytest.approx((1.0 + beyond) * pull_n)


def test_nothing_opens_without_contact_whatever_the_share() -> None:
    rule = ReleaseRule(OPTIONS)
    rule.reset(1.2)  # all of it is less than a contact
    assert not any(opens for _, opens in run(rule, 1.2, lambda _t: (0.0, 0.0, 1.2), noise_n=0.01))
    assert rule.share == pytest.approx(1.0, abs=0.02)
    assert not rule.contact


def test_nothing_is_judged_before_the_force_at_rest_is_known() -> None:
    rule = ReleaseRule(OPTIONS)
    for step in range(200):  # a load that grows is none at rest
        assert not rule.update((0.0, 0.0, -0.5 * step), DT)
        assert rule.weight_n == 0.0
    for _ in range(round(OPTIONS.tare_s / DT) + 2):
        rule.update((0.0, 0.0, -8.0), DT)
    assert rule.weight_n == pytest.approx(8.0)
    rule.reset()
    assert rule.weight_n == 0.0


def test_where_nothing_was_held_the_share_is_what_has_come_over() -> None:
    rule = ReleaseRule(OPTIONS)
    rule.reset(8.0)
    for step in range(200):
        rule.update((0.3, 0.0, 0.2 - (6.0 if step > 100 else 0.0)), DT)
    assert rule.share == pytest.approx(-0.75)


def test_a_gap_and_numbers_that_are_none_open_nothing() -> None:
    rule = ReleaseRule(OPTIONS)
    rule.reset(8.0)
    for _ in range(100):
        rule.update((0.0, 0.0, -8.0), DT)
    assert not rule.update((np.nan, 0.0, 0.0), DT)
    assert not rule.update((0.0, 0.0, 0.0), DT, (np.inf, 0.0, 0.0))
    # a sensor that has died, whether it says so or not, is no taker
    for force in ((np.nan, 0.0, 0.0), (0.0, 0.0, 0.0)):
        assert not any(rule.update(force, DT) for _ in range(100))
        assert not rule.contact
    opened = [step for step in range(60) if rule.update((0.0, 0.0, -1.0), DT)]
    assert opened[0] == round(OPTIONS.window_s / DT)


@pytest.mark.parametrize('change', [{'share': 0.0}, {'pull_n': -1.0}, {'window_s': np.nan}])
def test_numbers_without_a_meaning_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(UsageError, match=f'release.{next(iter(change))}'):
        ReleaseOptions(**change)
    with pytest.raises(UsageError, match='weight'):
        ReleaseRule(OPTIONS).reset(-1.0)


# A real giver: P. Khanna, M. Björkman, C. Smith, RO-MAN 2023. The baton has a sensor between its
# two halves. Its y axis is vertical: it reads -2.2 N while the giver alone holds the baton, the
# weight of the taker's half, and +4.2 N once the taker does, that of the giver's half. What it
# reads beyond the first is what the taker does to the baton.


@pytest.fixture(scope='module')
def recorded() -> dict[str, Array]:
    if not RECORDING.is_file():
        pytest.skip('the recording is not there')
    names = RECORDING.read_text(encoding='utf-8').split('\n', 1)[0].split(',')
    values = np.loadtxt(RECORDING, delimiter=',', skiprows=1)
    columns = dict(zip(names, values.T, strict=True))
    sensor = np.column_stack([columns[f'interaction_wrench_f{axis}'] for axis in 'xzy'])
    return {
        't': columns['t'],
        'between': sensor,
        'giver_grip': -columns['giver_wrench_fz'],
        'taker_grip': -columns['taker_wrench_fz'],
    }


def replayed(recorded: dict[str, Array], weight_n: float, share: float) -> tuple[float, float]:
    """Let the rule be the giver; tell when it touched and when it let go, s."""
    times, between = recorded['t'], recorded['between']
    # the giver reaches, and nobody else has touched the baton yet
    reaching = (times > 2.3) & (times < 3.0)
    on_giver = between - between[reaching].mean(axis=0) - [0.0, 0.0, weight_n]
    rule = ReleaseRule(ReleaseOptions(share=share))
    rule.reset(weight_n)
    touched = np.inf
    for time_s, force in zip(times[times > 2.3], on_giver[times > 2.3], strict=True):
        if rule.update(force, 1.0 / 120.0):
            return touched, float(time_s)
        if rule.contact:
            touched = min(touched, float(time_s))
    return touched, np.inf


# by its mass, and by how much the sensor's reading changes in all
@pytest.mark.parametrize('weight_n', [BATON_KG * GRAVITY, 6.4])
@pytest.mark.parametrize('share', [0.4, 0.5, 0.6])
def test_the_rule_lets_go_when_the_person_did(
    recorded: dict[str, Array], weight_n: float, share: float
) -> None:
    times, giver, taker = (recorded[name] for name in ('t', 'giver_grip', 'taker_grip'))
    exchange = (times > 3.0) & (times < 4.0)
    let_go = times[exchange & (giver < 0.5)][0]
    assert 3.5 < let_go < 3.6
    touched, opened = replayed(recorded, weight_n, share)
    assert abs(opened - let_go) < 0.15
    # how hard the taker grips, beside how hard it does to carry the baton alone
    alone = np.median(taker[(times > 4.0) & (times < 5.0)])
    grips = taker[times == opened][0] / alone
    assert grips > share
    assert times[exchange & (taker > 0.5)][0] < touched < opened


def test_the_default_is_the_giver_within_a_twentieth_of_a_second(
    recorded: dict[str, Array],
) -> None:
    times, giver = recorded['t'], recorded['giver_grip']
    let_go = times[(times > 3.0) & (giver < 0.5)][0]
    _, opened = replayed(recorded, BATON_KG * GRAVITY, ReleaseOptions().share)
    assert abs(opened - let_go) < 0.05


def test_no_rest_of_the_recording_opens(recorded: dict[str, Array]) -> None:
    # from the pick-up to the first touch the arm accelerates at up to 1.8 m/s²
    times = recorded['t']
    before = (times > 2.0) & (recorded['taker_grip'] < 0.5) & (times < 3.5)
    rule = ReleaseRule()
    rule.reset(BATON_KG * GRAVITY)
    rest = recorded['between'][before].mean(axis=0)
    for force in recorded['between'][before] - rest - [0.0, 0.0, BATON_KG * GRAVITY]:
        assert not rule.update(force, 1.0 / 120.0)
        assert not rule.contact
