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

The model:

- The scenes are those of Prada et al. 2013, whose recordings are not public: a mechanic (P1) at an
  engine bay, lying under a car, and standing under a car on a hydraulic lift; an assistant (P2)
  gives a tool and takes it back. Positions and heights are plausible for people of medium size,
  not measured; the reach of the assistant's wrist is 0.4 to 0.7 m.
- Hands reach along minimum-jerk profiles (Flash and Hogan 1985). People aim a little beside the
  meeting point and correct on the way, by a second, overlapping minimum-jerk movement (Meyer et
  al. 1988). The path is slightly curved, always to the same side.
- The spread of rest positions, meeting point, path, duration and start times from trial to trial
  has the size seen in recordings of real handovers. In some gives the mechanic's hand is already
  there and only sways; in the takes it always moves, bringing the tool out.
- Each trial has a short rest before the assistant starts, and a short hold after the hands met.
- The sensor: 200 Hz, white noise of 0.1 mm on each axis, values rounded to a micrometre.
- Orientations of the wrists, on request only and from a separate random stream, so that the
  positions stay the same to the byte: see `synthetic_turns.py`.

The data are made of sums, products and square roots, on a generator with a frozen stream
(`numpy.random.RandomState`), and rounded, so that one seed gives the same bytes on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import UsageError
from handover_dmp.mocap.garage import CONFIGURATIONS, SCENES
from handover_dmp.mocap.synthetic_motion import (
    CorrectedReach,
    drawn_about,
    HandSway,
    spread,
    spread_curve,
)
from handover_dmp.mocap.synthetic_turns import draw_turns, measured_turns
from handover_dmp.mocap.trial import DIRECTIONS, HandoverTrial
import numpy as np
from numpy.random import RandomState

RATE_HZ = 200.0
NOISE_M = 1e-4
TRIALS = 5

REST_SPREAD_M = np.array([0.020, 0.020, 0.015])
MAX_SEED = 2**32 - 1
_MEETING_SPREAD_M = np.array([0.025, 0.025, 0.020])
_OFFSET_SPREAD_M = np.array([0.008, 0.008, 0.006])
_DURATION_SPREAD = 0.10
_HOLD_S = 0.06


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

    Every trial has its own random stream, so the first five are the same whether five or fifty
    are made.

    Args:
        seed: number from 0 to 2³² − 1; the same seed gives the same trials.
        trials: number of trials for each configuration and exchange.
        configurations: configurations, of `CONFIGURATIONS`.
        rate_hz: sampling rate of the sensor, Hz.
        noise_m: standard deviation of the sensor's noise on each axis, m.
        orientation: whether to add orientations; the positions stay the same.

    Returns:
        The trials, by configuration, then give before take, then number from 1.

    Raises:
        UsageError: seed, number, rate or noise out of range, or an unknown configuration.

    """
    check_request(seed, trials, configurations, rate_hz, noise_m)
    return [
        _make_trial(seed, configuration, direction, number, rate_hz, noise_m, orientation)
        for configuration in configurations
        for direction in DIRECTIONS
        for number in range(1, trials + 1)
    ]


def check_request(
    seed: int, trials: int, configurations: Sequence[str], rate_hz: float, noise_m: float
) -> None:
    """
    Check the arguments.

    Args:
        seed: seed of the random numbers.
        trials: number of trials of each kind.
        configurations: configurations.
        rate_hz: sampling rate of the sensor, Hz.
        noise_m: standard deviation of the sensor's noise on each axis, m.

    Raises:
        UsageError: seed, number, rate or noise out of range, or an unknown configuration.

    """
    unknown = [name for name in configurations if name not in SCENES]
    if unknown:
        raise UsageError(f'no configuration {unknown[0]!r}; there are {", ".join(CONFIGURATIONS)}')
    if not 0 <= seed <= MAX_SEED:
        raise UsageError(f'seed {seed} is not between 0 and {MAX_SEED}')
    if not 1 <= trials <= 100_000:
        raise UsageError(f'{trials} trials: between 1 and 100000 can be made')
    if not 20.0 <= rate_hz <= 2000.0:
        raise UsageError(f'a rate of {rate_hz:g} Hz is not between 20 and 2000')
    if not 0.0 <= noise_m <= 0.1:
        raise UsageError(f'noise of {noise_m:g} m is not between 0 and 0.1')


@dataclass(frozen=True, eq=False)
class PlannedHandover:
    """
    A handover before it is sampled; its clock starts when the first hand is about to move.

    Attributes:
        end_s: time at which the hands have met and have held for a moment, s.
        demonstrator: the reach of P2.
        partner: the reach of P1; None if the hand is there already.
        meeting: (3,) m, position of P1's hand at the end, without sway.
        work: (3,) m, position of P1's hand before its reach.
        sway: sway of P1's hand.

    """

    end_s: float
    demonstrator: CorrectedReach
    partner: CorrectedReach | None
    meeting: Array
    work: Array
    sway: HandSway

    def partner_at(self, times: Array) -> Array:
        """Return the positions of P1's hand at times (n,) s; (n, 3) m."""
        if self.partner is None:
            return np.tile(self.meeting, (len(times), 1)) + self.sway.at(times)
        return self.partner.at(times) + self.sway.at(times)


def plan_handover(
    seed: int, configuration: str, direction: str, number: int, rate_hz: float
) -> tuple[PlannedHandover, RandomState]:
    """
    Draw one handover of the data set.

    Args:
        seed: seed of the data set.
        configuration: one of `CONFIGURATIONS`.
        direction: `give` or `take`.
        number: number of the trial, from 1.
        rate_hz: sampling rate of the sensor, Hz; the handover ends at a sample.

    Returns:
        The handover, and the random stream for its noise.

    """
    scene = SCENES[configuration]
    place = CONFIGURATIONS.index(configuration), DIRECTIONS.index(direction)
    random = RandomState(np.array([seed, *place, number], dtype=np.uint32))

    duration = scene.duration_s * drawn_about(random, 1.0, _DURATION_SPREAD)
    onset = random.uniform(0.04, 0.12)
    lead, mechanic_duration = _mechanic_timing(random, direction, number, duration)
    # The clock starts when the first hand is about to move.
    onset += max(lead, 0.0)
    mechanic_onset = onset - lead
    end = max(onset + duration, mechanic_onset + mechanic_duration) + _HOLD_S
    end_s = round(end * rate_hz) / rate_hz

    meeting = np.array(scene.mechanic_meets) + spread(random, _MEETING_SPREAD_M)
    work = np.array(scene.mechanic_at_work) + spread(random, REST_SPREAD_M)
    rest = np.array(scene.assistant_at_rest) + spread(random, REST_SPREAD_M)
    goal = meeting + np.array(scene.offset) + spread(random, _OFFSET_SPREAD_M)

    partner = None
    if mechanic_duration > 0.0:
        partner = CorrectedReach.draw(random, mechanic_onset, mechanic_duration, work, meeting)
    sway = HandSway.draw(random, end_s)
    straight = CorrectedReach.draw(random, onset, duration, rest, goal)
    demonstrator = replace(straight, curve=spread_curve(random, scene.curve))
    return PlannedHandover(end_s, demonstrator, partner, meeting, work, sway), random


def _make_trial(
    seed: int,
    configuration: str,
    direction: str,
    number: int,
    rate_hz: float,
    noise_m: float,
    orientation: bool,
) -> HandoverTrial:
    planned, random = plan_handover(seed, configuration, direction, number, rate_hz)
    times = np.arange(round(planned.end_s * rate_hz) + 1) / rate_hz
    partner = planned.partner_at(times)
    demonstrator = planned.demonstrator.at(times)
    partner += noise_m * random.standard_normal(partner.shape)
    demonstrator += noise_m * random.standard_normal(demonstrator.shape)
    turns: dict[str, Any] = {}
    if orientation:
        mechanic, assistant = draw_turns(seed, configuration, direction, number)
        done = planned.partner.share(times) if planned.partner else np.ones(len(times))
        turns['partner_orientation'] = measured_turns(random, mechanic.at(done), noise_m)
        done = planned.demonstrator.share(times)
        turns['demonstrator_orientation'] = measured_turns(random, assistant.at(done), noise_m)
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
    """Return the mechanic's head start before P2 (s) and duration of reach (s)."""
    reach = 0.8 * duration * drawn_about(random, 1.0, _DURATION_SPREAD)
    if direction == 'take':
        # He brings the tool out, the assistant follows.
        return random.uniform(0.05, 0.30), reach
    lead = random.uniform(-0.30, 0.0)
    if number % 5 in (2, 4):
        # His hand is already there and waits.
        return 0.0, 0.0
    return lead, reach
