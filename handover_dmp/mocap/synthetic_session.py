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
Synthetic sessions in a garage, recorded whole, as in Section III.A of Prada et al. 2013.

P2 picks up the tool, gives it to P1 and withdraws; P1 uses it; P2 takes it back, and both
withdraw. The two reaches of a session are those of the synthetic data set of the same seed,
configuration and number, `synthetic.py`. The motions between them follow the same rules:

- Hands move to the tool, back from the exchange, and to their waiting positions by corrected
  minimum-jerk reaches.
- The object changes hands while both hold still for 0.3 to 0.6 s. The receiver leaves first.
- P1 works, before the give and with the tool after it, by strokes of some centimetres.
- P1's hand sways all the time.
- On request, the wrists turn as in the same give and take, and turn back after each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
import math

from handover_dmp.common.arrays import Array
from handover_dmp.mocap.garage import CONFIGURATIONS, SCENES
from handover_dmp.mocap.segmentation import Segment
from handover_dmp.mocap.session import RecordedSession
from handover_dmp.mocap.synthetic import (
    check_request,
    NOISE_M,
    plan_handover,
    RATE_HZ,
    REST_SPREAD_M,
    TRIALS,
)
from handover_dmp.mocap.synthetic_motion import (
    bump,
    CorrectedReach,
    drawn_about,
    HandSway,
    spread,
)
from handover_dmp.mocap.synthetic_turns import draw_turns, measured_turns, WristTurn
from handover_dmp.mocap.trial import DIRECTIONS
from handover_dmp.mocap.wrists import WristMotion
import numpy as np
from numpy.random import RandomState

_SESSION = 2
"""Number of a session in the key of a random stream; a give has 0 and a take 1."""
_STROKE_M = np.array([0.025, 0.050, 0.030])
_STROKE_SPREAD = 0.3
_PACE_SPREAD = 0.08
_PICK_UP_SHARE = 0.70
_WAY_BACK_SHARE = 0.90
_PARTNER_SHARE = 0.80
"""Durations of motions, as shares of P2's reach in this scene."""


def synthesize_sessions(
    seed: int = 0,
    trials: int = TRIALS,
    *,
    configurations: Sequence[str] = CONFIGURATIONS,
    rate_hz: float = RATE_HZ,
    noise_m: float = NOISE_M,
    orientation: bool = False,
) -> list[RecordedSession]:
    """
    Make synthetic sessions, a give and a take each.

    Args:
        seed: number from 0 to 2³² − 1; the same seed gives the same sessions.
        trials: number of sessions for each configuration.
        configurations: configurations, of `CONFIGURATIONS`.
        rate_hz: sampling rate of the sensor, Hz.
        noise_m: standard deviation of the sensor's noise on each axis, m.
        orientation: whether to add orientations; the positions stay the same.

    Returns:
        The sessions, by configuration, then number from 1.

    Raises:
        UsageError: seed, number, rate or noise out of range, or an unknown configuration.

    """
    check_request(seed, trials, configurations, rate_hz, noise_m)
    return [
        _make_session(seed, configuration, number, rate_hz, noise_m, orientation)
        for configuration in configurations
        for number in range(1, trials + 1)
    ]


@dataclass(eq=False)
class _Way:
    """
    The motion of one hand over a session: reaches from point to point, and strokes of work.

    Attributes:
        start: (3,) m, its first rest position.
        reaches: reaches in order; each starts at the end of the previous one.
        strokes: onset s, duration s and size (3,) m of each.

    """

    start: Array
    reaches: list[CorrectedReach] = field(default_factory=list)
    strokes: list[tuple[float, float, Array]] = field(default_factory=list)

    @property
    def place(self) -> Array:
        return self.reaches[-1].goal if self.reaches else self.start

    @property
    def free_s(self) -> float:
        """End of its last motion so far, s."""
        return max(
            [0.0]
            + [reach.end_s for reach in self.reaches[-1:]]
            + [onset + duration for onset, duration, _ in self.strokes[-1:]]
        )

    def go(self, random: RandomState, onset_s: float, duration_s: float, goal: Array) -> None:
        reach = CorrectedReach.draw(random, onset_s, duration_s, self.place, goal)
        self.reaches.append(reach)

    def work(self, random: RandomState, until_s: float) -> None:
        """Make strokes of some centimetres, as with a ratchet, while there is time."""
        size = _STROKE_M + spread(random, _STROKE_SPREAD * _STROKE_M)
        onset_s = self.free_s + random.uniform(0.10, 0.30)
        while True:
            duration_s = random.uniform(0.50, 0.80)
            if onset_s + duration_s > until_s:
                return
            self.strokes.append((onset_s, duration_s, size * drawn_about(random, 1.0, 0.2)))
            onset_s += duration_s + random.uniform(0.0, 0.15)

    def at(self, times: Array) -> Array:
        path = np.tile(self.start, (len(times), 1))
        for reach in self.reaches:
            path += reach.at(times) - reach.start
        for onset_s, duration_s, size in self.strokes:
            path += bump((times - onset_s) / duration_s)[:, None] * size
        return path


def _make_session(
    seed: int, configuration: str, number: int, rate_hz: float, noise_m: float, orientation: bool
) -> RecordedSession:
    scene = SCENES[configuration]
    random = RandomState(
        np.array([seed, CONFIGURATIONS.index(configuration), _SESSION, number], dtype=np.uint32)
    )
    give, take = (
        plan_handover(seed, configuration, direction, number, rate_hz)[0]
        for direction in DIRECTIONS
    )
    pace_s = scene.duration_s * drawn_about(random, 1.0, _PACE_SPREAD)
    demonstrator = _Way(np.array(scene.assistant_at_rest) + spread(random, REST_SPREAD_M))
    partner = _Way(give.work)

    # P2 picks up the tool and brings it to the start of the give
    tool = np.array(scene.tool) + spread(random, REST_SPREAD_M)
    demonstrator.go(random, random.uniform(0.30, 0.60), _PICK_UP_SHARE * pace_s, tool)
    grasped_s = demonstrator.free_s + random.uniform(0.25, 0.45)
    demonstrator.go(random, grasped_s, _PICK_UP_SHARE * pace_s, give.demonstrator.start)

    give_s = _sample_after(demonstrator.free_s + random.uniform(0.80, 1.20), rate_hz)
    if give.partner is None:
        # P1's hand is there before the give begins
        reach_s = _PARTNER_SHARE * pace_s
        onset_s = give_s - reach_s - random.uniform(0.30, 0.60)
        partner.work(random, onset_s - 0.1)
        partner.go(random, onset_s, reach_s, give.meeting)
    else:
        partner.work(random, give_s - 0.4)
        partner.reaches.append(_later(give.partner, give_s))
    demonstrator.reaches.append(_later(give.demonstrator, give_s))

    # the receiver of the tool leaves first
    given_s = give_s + give.end_s
    parted_s = given_s + random.uniform(0.30, 0.60)
    partner.go(random, parted_s, _PARTNER_SHARE * pace_s, take.work)
    leaves_s = parted_s + random.uniform(0.10, 0.30)
    demonstrator.go(random, leaves_s, _WAY_BACK_SHARE * pace_s, take.demonstrator.start)
    given = Segment(give_s, given_s, 'give', parted_s, (leaves_s, demonstrator.free_s))
    partner.work(random, partner.free_s + random.uniform(2.0, 3.0))

    free_s = max(partner.free_s, demonstrator.free_s)
    take_s = _sample_after(free_s + random.uniform(0.40, 0.80), rate_hz)
    demonstrator.reaches.append(_later(take.demonstrator, take_s))
    if take.partner is not None:
        partner.reaches.append(_later(take.partner, take_s))
    taken_s = take_s + take.end_s
    parted_s = taken_s + random.uniform(0.30, 0.60)
    rest = np.array(scene.assistant_at_rest) + spread(random, REST_SPREAD_M)
    demonstrator.go(random, parted_s, _WAY_BACK_SHARE * pace_s, rest)
    work = np.array(scene.mechanic_at_work) + spread(random, REST_SPREAD_M)
    leaves_s = parted_s + random.uniform(0.10, 0.30)
    partner.go(random, leaves_s, _PARTNER_SHARE * pace_s, work)
    taken = Segment(take_s, taken_s, 'take', parted_s, (parted_s, demonstrator.free_s))

    end_s = max(partner.free_s, demonstrator.free_s) + random.uniform(0.50, 0.90)
    times = np.arange(round(end_s * rate_hz) + 1) / rate_hz
    sway = HandSway.draw(random, float(times[-1]))
    first, second = partner.at(times), demonstrator.at(times)
    for planned, start_s in ((give, give_s), (take, take_s)):
        from_s, to_s = planned.sway.span_s
        sway = sway.without(start_s + from_s, start_s + to_s)
        first += planned.sway.at(times - start_s)
    first += sway.at(times)
    first += noise_m * random.standard_normal(first.shape)
    second += noise_m * random.standard_normal(second.shape)
    motion = WristMotion(
        np.round(times, 6),
        np.round(first, 6),
        np.round(second, 6),
        f'synthetic session {configuration} {number} (seed {seed})',
    )
    if orientation:
        give_turns, take_turns = (
            draw_turns(seed, configuration, direction, number) for direction in DIRECTIONS
        )
        # the first of P2's ways, to the tool and with it to the start of the give, turn nothing
        ways = partner.reaches, demonstrator.reaches[2:]
        first_turned, second_turned = (
            measured_turns(random, _turned(in_give, in_take, reaches, times), noise_m)
            for in_give, in_take, reaches in zip(give_turns, take_turns, ways, strict=True)
        )
        motion = replace(
            motion, partner_orientation=first_turned, demonstrator_orientation=second_turned
        )
    return RecordedSession(motion, (given, taken), configuration, number)


def _turned(
    give: WristTurn, take: WristTurn, reaches: Sequence[CorrectedReach], times: Array
) -> Array:
    """Turn a wrist as in the give and in the take, and back after each."""
    back, home = WristTurn.between(give.last, take.first), WristTurn.between(take.last, give.first)
    path = give.at(np.zeros(len(times)))
    for turn, reach in zip((give, back, take, home), reaches, strict=True):
        begun = times >= reach.onset_s
        path[begun] = turn.at(reach.share(times[begun]))
    return path


def _later(reach: CorrectedReach, by_s: float) -> CorrectedReach:
    return replace(
        reach,
        onset_s=reach.onset_s + by_s,
        correction_onset_s=reach.correction_onset_s + by_s,
    )


def _sample_after(time_s: float, rate_hz: float) -> float:
    return math.ceil(time_s * rate_hz) / rate_hz
