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
A synthetic data set of handovers in a garage. No person was recorded for it.

What it is modelled on:

- The scenes are those of Prada et al. 2013, whose recordings are not public: a mechanic (P1) at an
  engine bay, lying under a car, and standing under a car on a hydraulic lift; an assistant (P2)
  gives a tool and takes it back. Places and heights are plausible ones for people of medium size,
  not measured ones; the reach of the assistant's wrist is 0.4 to 0.7 m.
- Hands reach along minimum-jerk profiles (Flash and Hogan 1985). People aim a little beside the
  place where they will meet and correct on the way: a second, overlapping minimum-jerk movement
  (Meyer et al. 1988). The path is slightly curved, always to the same side.
- Spread from trial to trial in rest places, meeting place, path, duration and who starts when is
  of the size seen in recordings of real handovers. In some gives the mechanic's hand is already
  there and only sways; in the takes it always moves, bringing the tool out.
- The ends: a short rest before the assistant starts, and a short hold when the hands have met.
- The sensor: 200 Hz, white noise of 0.1 mm on each axis, values rounded to a micrometre.
- How the wrists are turned, on request alone and from a random stream of its own, so that without
  it the same bytes are made: see `synthetic_turns`.

Made of sums, products and square roots alone on a generator whose stream is frozen
(`numpy.random.RandomState`), and rounded, so one seed gives the same bytes on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from handover_dmp.common.errors import UsageError
from handover_dmp.mocap.synthetic_turns import synthetic_turns
from handover_dmp.mocap.trial import DIRECTIONS, HandoverTrial
import numpy as np
from numpy.random import RandomState
from numpy.typing import NDArray

RATE_HZ = 200.0
NOISE_M = 1e-4
TRIALS = 5

_REST_SPREAD_M = np.array([0.020, 0.020, 0.015])
_MEETING_SPREAD_M = np.array([0.025, 0.025, 0.020])
_OFFSET_SPREAD_M = np.array([0.008, 0.008, 0.006])
_AIM_SPREAD_M = np.array([0.030, 0.030, 0.020])
_DURATION_SPREAD = 0.10
_CURVE_SPREAD = 0.25
_SWAY_M = 0.004
_SWAY_PERIOD_S = 0.35
_HOLD_S = 0.06


@dataclass(frozen=True)
class _Scene:
    """
    Where a configuration takes place; x from the assistant to the mechanic, z up from the floor.

    Attributes:
        mechanic_at_work: wrist of P1 while working, m.
        mechanic_meets: wrist of P1 at the exchange, m.
        assistant_at_rest: wrist of P2 before it starts, m.
        offset: wrist of P2 minus wrist of P1 at the exchange, m; the tool is between them.
        curve: how far the middle of P2's way lies off the straight line, m.
        duration_s: typical duration of P2's reach.

    """

    mechanic_at_work: tuple[float, float, float]
    mechanic_meets: tuple[float, float, float]
    assistant_at_rest: tuple[float, float, float]
    offset: tuple[float, float, float]
    curve: tuple[float, float, float]
    duration_s: float


_SCENES = {
    # The mechanic bends over the engine and reaches out sideways, about waist high.
    'engine_bay': _Scene(
        mechanic_at_work=(0.72, 0.14, 0.84),
        mechanic_meets=(0.36, -0.02, 0.98),
        assistant_at_rest=(-0.40, -0.28, 0.86),
        offset=(-0.27, -0.05, 0.03),
        curve=(0.00, -0.035, 0.040),
        duration_s=1.35,
    ),
    # The mechanic lies under the car, the hand comes out beside the sill; the assistant squats.
    'under_car': _Scene(
        mechanic_at_work=(0.74, 0.12, 0.44),
        mechanic_meets=(0.37, 0.03, 0.32),
        assistant_at_rest=(-0.38, -0.20, 0.62),
        offset=(-0.26, -0.03, 0.06),
        curve=(0.02, -0.020, 0.045),
        duration_s=1.55,
    ),
    # The mechanic works overhead under the lifted car and reaches down; the assistant stands.
    'hydraulic_lift': _Scene(
        mechanic_at_work=(0.60, 0.06, 1.76),
        mechanic_meets=(0.34, -0.01, 1.36),
        assistant_at_rest=(-0.36, -0.24, 1.02),
        offset=(-0.26, -0.04, -0.04),
        curve=(-0.02, -0.040, -0.020),
        duration_s=1.25,
    ),
}

CONFIGURATIONS = tuple(_SCENES)


def synthesize(
    seed: int = 0,
    trials: int = TRIALS,
    *,
    configurations: Sequence[str] = CONFIGURATIONS,
    rate_hz: float = RATE_HZ,
    noise_m: float = NOISE_M,
    orientation: bool = False,
) -> list[HandoverTrial]:
    """
    Make the synthetic data set.

    Every trial has a random stream of its own, so the first five are the same whether five or
    fifty are made.

    Args:
        seed: any number from 0 to 2³² − 1; the same seed gives the same trials.
        trials: how many for each configuration and exchange.
        configurations: which of `CONFIGURATIONS`.
        rate_hz: sampling rate of the sensor, Hz.
        noise_m: standard deviation of the sensor's noise on each axis, m.
        orientation: whether the wrists have orientations, too; the positions stay the same.

    Returns:
        The trials, by configuration, then give before take, then number from 1.

    Raises:
        UsageError: seed, number, rate or noise out of range, or an unknown configuration.

    """
    unknown = [name for name in configurations if name not in _SCENES]
    if unknown:
        raise UsageError(f'no configuration {unknown[0]!r}; there are {", ".join(CONFIGURATIONS)}')
    if not 0 <= seed < 2**32:
        raise UsageError(f'seed {seed} is not between 0 and {2**32 - 1}')
    if not 1 <= trials <= 100_000:
        raise UsageError(f'{trials} trials: between 1 and 100000 can be made')
    if not 20.0 <= rate_hz <= 2000.0:
        raise UsageError(f'a rate of {rate_hz:g} Hz is not between 20 and 2000')
    if not 0.0 <= noise_m <= 0.1:
        raise UsageError(f'noise of {noise_m:g} m is not between 0 and 0.1')
    return [
        _make_trial(seed, configuration, direction, number, rate_hz, noise_m, orientation)
        for configuration in configurations
        for direction in DIRECTIONS
        for number in range(1, trials + 1)
    ]


def _make_trial(
    seed: int,
    configuration: str,
    direction: str,
    number: int,
    rate_hz: float,
    noise_m: float,
    orientation: bool,
) -> HandoverTrial:
    scene = _SCENES[configuration]
    place = CONFIGURATIONS.index(configuration), DIRECTIONS.index(direction)
    random = RandomState(np.array([seed, *place, number], dtype=np.uint32))

    duration = scene.duration_s * _bounded(random, 1.0, _DURATION_SPREAD)
    onset = random.uniform(0.04, 0.12)
    lead, mechanic_duration = _mechanic_timing(random, direction, number, duration)
    # The clock starts when the first hand is about to move.
    onset += max(lead, 0.0)
    mechanic_onset = onset - lead
    end = max(onset + duration, mechanic_onset + mechanic_duration) + _HOLD_S
    times = np.arange(round(end * rate_hz) + 1) / rate_hz

    meeting = np.array(scene.mechanic_meets) + _spread(random, _MEETING_SPREAD_M)
    work = np.array(scene.mechanic_at_work) + _spread(random, _REST_SPREAD_M)
    rest = np.array(scene.assistant_at_rest) + _spread(random, _REST_SPREAD_M)
    goal = meeting + np.array(scene.offset) + _spread(random, _OFFSET_SPREAD_M)

    if mechanic_duration > 0.0:
        partner = _reach(random, times, mechanic_onset, mechanic_duration, work, meeting)
    else:
        partner = np.tile(meeting, (len(times), 1))
    partner += _sway(random, times)
    demonstrator = _reach(random, times, onset, duration, rest, goal)
    curve = np.array(scene.curve) * _bounded(random, 1.0, _CURVE_SPREAD)
    demonstrator += _bump((times - onset) / duration)[:, None] * curve

    partner += noise_m * random.standard_normal(partner.shape)
    demonstrator += noise_m * random.standard_normal(demonstrator.shape)
    turns: dict[str, NDArray[np.float64]] = {}
    if orientation:
        own = RandomState(np.array([seed, *place, number, 1], dtype=np.uint32))
        reaches = mechanic_duration > 0.0
        mechanic = (times - mechanic_onset) / mechanic_duration if reaches else np.ones(len(times))
        shares = _minimum_jerk(mechanic), _minimum_jerk((times - onset) / duration)
        names = 'partner_orientation', 'demonstrator_orientation'
        turned = synthetic_turns(own, configuration, *shares, noise_m)
        turns = dict(zip(names, turned, strict=True))
    return HandoverTrial(
        times=np.round(times, 6),
        partner=np.round(partner, 6),
        demonstrator=np.round(demonstrator, 6),
        configuration=configuration,
        direction=direction,
        number=number,
        source=f'synthetic (seed {seed})',
        **turns,
    )


def _mechanic_timing(
    random: RandomState, direction: str, number: int, duration: float
) -> tuple[float, float]:
    """Return how long before P2 the mechanic starts (s), and for how long he reaches (s)."""
    reach = 0.8 * duration * _bounded(random, 1.0, _DURATION_SPREAD)
    if direction == 'take':
        # He brings the tool out, the assistant follows.
        return random.uniform(0.05, 0.30), reach
    lead = random.uniform(-0.30, 0.0)
    if number % 5 in (2, 4):
        # His hand is already there and waits.
        return 0.0, 0.0
    return lead, reach


def _reach(
    random: RandomState,
    times: NDArray[np.float64],
    onset: float,
    duration: float,
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Aim a little beside the goal, correct from about half of the way on; (n, 3) m."""
    aim = goal + _spread(random, _AIM_SPREAD_M)
    correction_onset = onset + duration * random.uniform(0.40, 0.50)
    correction_duration = onset + duration - correction_onset
    first = _minimum_jerk((times - onset) / (0.95 * duration))[:, None] * (aim - start)
    second = _minimum_jerk((times - correction_onset) / correction_duration)[:, None]
    return start + first + second * (goal - aim)


def _sway(random: RandomState, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Wander smoothly between random places some millimetres apart; (n, 3) m."""
    position = times / _SWAY_PERIOD_S + random.uniform(0.0, 1.0)
    places = _SWAY_M * _clipped_normal(random, (int(position[-1]) + 2, 3))
    here = position.astype(int)
    share = _minimum_jerk(position - here)[:, None]
    wandering: NDArray[np.float64] = places[here] + share * (places[here + 1] - places[here])
    return wandering


def _minimum_jerk(u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Go from 0 to 1 while u does, at rest at both ends (Flash and Hogan 1985)."""
    u = np.clip(u, 0.0, 1.0)
    share: NDArray[np.float64] = u * u * u * (10.0 + u * (6.0 * u - 15.0))
    return share


def _bump(u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rise from 0 to 1 at u = 1/2 and fall to 0 again, at rest at both ends."""
    u = np.clip(u, 0.0, 1.0)
    arch = 4.0 * u * (1.0 - u)
    return arch * arch * arch


def _spread(random: RandomState, deviation: NDArray[np.float64]) -> NDArray[np.float64]:
    return deviation * _clipped_normal(random, 3)


def _bounded(random: RandomState, mean: float, deviation: float) -> float:
    return mean + deviation * float(_clipped_normal(random, 1)[0])


def _clipped_normal(random: RandomState, shape: int | tuple[int, int]) -> NDArray[np.float64]:
    """Draw normal numbers; what a person would not do, more than 2 deviations, is cut to 2."""
    drawn: NDArray[np.float64] = np.clip(random.standard_normal(shape), -2.0, 2.0)
    return drawn
