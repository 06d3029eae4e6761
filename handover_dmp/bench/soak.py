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

"""The soak test: handovers in lockstep with random faults; every period is checked."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
import gc
from time import monotonic

from handover_dmp.bench.faults import FaultyHand, InvariantChecker, tracker_faults
from handover_dmp.bench.measurement import Measurement
from handover_dmp.common.arrays import Array
from handover_dmp.handover.controller import HandoverState, MOVING
from handover_dmp.handover.lockstep import Handover, Period
from handover_dmp.handover.scenario import make_scenario, Scenario
from handover_dmp.robot.tasks import WristTarget
from handover_dmp.robot.velocity_driver import ArmState, CommandOutcome
from handover_dmp.robot.wrist_controller import WristController
from handover_dmp.simulation.arm import SimulatedArm
import numpy as np
from numpy.typing import ArrayLike
import psutil

MINUTES = 30.0
SEEDS = 4
WARM_UP = 20
MAX_FAULTS = 3
FAULT_S = (0.02, 1.0)
"""Shortest and longest duration of a fault, s."""
EXTRA_S = 12.0
"""Additional time of a handover with faults, to resume after stops, s."""
TAKEN_UP_S = 0.5
"""Time from a stop until the motion is resumed, s."""
STOPPED_S = 0.6
"""Time within which a stopping arm stands still, s."""
STILL_RAD_S = 0.01
MAX_GROWTH = 5.0

JOINT_STATE_FAULTS = (
    'joint states stale',
    'joint states lack a joint',
    'joint states lack a position',
    'joint states name a joint twice',
    'joint states not finite',
    'joint states permuted',
    'joint states among unknown joints',
    'joint states of other joints alone',
)
TARGET_FAULTS = ('dmp silent', 'wrist command not finite')
SILENT, FLOOD = 'priority_ik silent', 'joint commands in a flood'
ALTERED_COMMANDS: dict[str, Callable[[Array], Array]] = {
    'joint command not finite': lambda sent: np.full(len(sent), np.nan),
    'joint command infinite': lambda sent: np.full(len(sent), np.inf),
    'joint command too short': lambda sent: sent[:-1],
    'joint command empty': lambda sent: sent[:0],
    'joint command over the limits': lambda sent: sent * 100.0 + 10.0 * np.sign(sent),
}
COMMAND_FAULTS = (SILENT, *ALTERED_COMMANDS, FLOOD)
ORDERS = ('abort', 'reset', 'start')
TRACKER = 'tracker '
TRACKER_FAULTS = tuple(TRACKER + name for name in tracker_faults(0))
FAULTS = (*TRACKER_FAULTS, *JOINT_STATE_FAULTS, *TARGET_FAULTS, *COMMAND_FAULTS, *ORDERS)


@dataclass(frozen=True)
class Span:
    """
    A fault that lasts from one time to another.

    Attributes:
        name: name of the fault.
        from_s: start, s.
        until_s: end, s.

    """

    name: str
    from_s: float
    until_s: float

    def holds(self, now_s: float) -> bool:
        """Tell whether it is active at a time, s."""
        return self.from_s <= now_s < self.until_s


class FaultyWristController(WristController):
    """The controller of `priority_ik`, with faulty inputs."""

    spans: Sequence[Span] = ()

    def _fails(self, name: str, now_s: float) -> bool:
        return any(span.name == name and span.holds(now_s) for span in self.spans)

    def set_joint_state(
        self,
        names: Sequence[str],
        positions: ArrayLike,
        velocities: ArrayLike,
        arrival_s: float,
    ) -> bool:
        """Take joint states as altered by the active fault."""
        names = list(names)
        place, speed = np.array(positions, float), np.array(velocities, float)
        if self._fails('joint states stale', arrival_s):
            return False
        if self._fails('joint states lack a joint', arrival_s):
            names, place, speed = names[:-1], place[:-1], speed[:-1]
        if self._fails('joint states lack a position', arrival_s):
            place = place[:-1]
        if self._fails('joint states name a joint twice', arrival_s):
            names = [names[0], *names[:-1]]
        if self._fails('joint states of other joints alone', arrival_s):
            names, place, speed = ['gripper'], np.array([7.0]), np.array([7.0])
        if self._fails('joint states not finite', arrival_s):
            place[-1] = np.nan
        if self._fails('joint states permuted', arrival_s):
            names, place, speed = names[::-1], place[::-1], speed[::-1]
        if self._fails('joint states among unknown joints', arrival_s):
            names = ['gripper', *names]
            place, speed = np.append(7.0, place), np.append(7.0, speed)
        return super().set_joint_state(names, place, speed, arrival_s)

    def set_target(self, target: WristTarget, arrival_s: float) -> bool:
        """Take a wrist command as altered by the active fault."""
        if self._fails('dmp silent', arrival_s):
            return False
        if self._fails('wrist command not finite', arrival_s):
            target = WristTarget(target.position * np.nan, target.velocity)
        return super().set_target(target, arrival_s)


class FaultyArm(SimulatedArm):
    """The arm, with faulty commands."""

    spans: Sequence[Span] = ()

    def command(self, velocities: Sequence[float] | Array) -> CommandOutcome:
        """Take a joint command as altered by the active fault."""
        sent = np.array(velocities, float)
        for name in [span.name for span in self.spans if span.holds(self.time_s)]:
            if name == SILENT:
                return CommandOutcome.IGNORED
            if name in ALTERED_COMMANDS:
                sent = ALTERED_COMMANDS[name](sent)
            elif name == FLOOD:
                for _ in range(50):
                    super().command(sent)
        return super().command(sent)


class Soak:
    """
    One handover after another on the same arm model, each with its own faults.

    Attributes:
        broken: violated invariants, one line each.
        periods: number of checked periods.
        done: number of completed handovers.
        handovers: number of handovers.
        faults: number of occurrences by name.
        stops: number of times the arm stopped by itself.
        drift: greatest difference of the final configurations of handovers without faults, rad.
        resident: memory at the end of the last handover with the arm still loaded, bytes. Memory
            without an arm says little: it depends on what the allocator returns.

    """

    def __init__(self, scenarios: Sequence[Scenario], seed: int = 0) -> None:
        """
        Prepare.

        Args:
            scenarios: scenarios, used in turn.
            seed: seed of all random numbers.

        """
        self._scenarios = scenarios
        self._random = np.random.default_rng(seed)
        self.broken: list[str] = []
        self.periods = 0
        self.done = 0
        self.handovers = 0
        self.faults: Counter[str] = Counter()
        self.stops = 0
        self.resident = 0
        self.drift = 0.0
        self._ends: dict[int, Array] = {}
        self._process = psutil.Process()

    def hand_over(self) -> None:
        """Run one handover with faults, and check every period."""
        turn = self.handovers % len(self._scenarios)
        scenario = self._scenarios[turn]
        self.handovers += 1
        spans = self._draw(scenario.trial.duration_s)
        self.faults.update(span.name for span in spans)
        with closing(self._prepare(scenario, spans)) as handover:
            self._run(handover, spans)
            if not spans:
                end = handover.arm.joint_positions
                difference = np.abs(end - self._ends.setdefault(turn, end)).max()
                self.drift = max(self.drift, float(difference))
            gc.collect()
            self.resident = int(self._process.memory_info().rss)

    def _draw(self, duration_s: float) -> list[Span]:
        random = self._random
        spans = []
        for _ in range(random.integers(0, MAX_FAULTS + 1)):
            from_s = random.uniform(0.2, duration_s)
            until_s = from_s + random.uniform(*FAULT_S)
            spans.append(Span(str(random.choice(FAULTS)), from_s, until_s))
        return spans

    def _prepare(self, scenario: Scenario, spans: Sequence[Span]) -> Handover:
        handover = Handover(scenario)
        arm = FaultyArm(scenario.robot)
        arm.reset(scenario.q_start)
        arm.spans = spans
        handover.arm.close()
        handover.arm = arm
        wrist = FaultyWristController(scenario.robot, handover.wrist_controller.ik)
        wrist.spans = spans
        handover.wrist_controller = wrist
        faults = tracker_faults(int(self._random.integers(2**31)))
        for span in spans:
            if span.name in TRACKER_FAULTS:
                fault = faults[span.name.removeprefix(TRACKER)]
                handover.hands[0] = FaultyHand(handover.hands[0], fault, span.from_s, span.until_s)
        return handover

    def _run(self, handover: Handover, spans: Sequence[Span]) -> None:
        checker = InvariantChecker(
            handover.scenario.robot.limits,
            handover.period_s,
            handover.controller.options.acceleration_limit,
        )
        orders = {span.name: span.from_s for span in spans if span.name in ORDERS}
        handover.begin()
        max_duration_s = handover.max_duration_s + EXTRA_S
        idle_since_s: float | None = None
        stopped_since_s: float | None = None
        while (
            handover.time_s < max_duration_s
            and handover.controller.state is not HandoverState.DONE
        ):
            now_s = handover.time_s
            for name in [name for name, at_s in orders.items() if now_s >= at_s]:
                getattr(handover.controller, name)()
                del orders[name]
            period = handover.step()
            broken = checker.check(period)
            was_stopped_s = stopped_since_s
            stopped_since_s = self._since(
                handover.arm.report.state is ArmState.STOPPED, stopped_since_s, now_s
            )
            self.stops += was_stopped_s is None and stopped_since_s is not None
            broken += _not_still(period, stopped_since_s, now_s)
            idle = handover.controller.state not in MOVING and now_s > handover.hands[0].start_s
            idle_since_s = self._since(idle, idle_since_s, now_s)
            if stopped_since_s is not None and now_s - stopped_since_s > STOPPED_S + TAKEN_UP_S:
                handover.arm.resume()
            if idle_since_s is not None and now_s - idle_since_s > TAKEN_UP_S:
                handover.controller.start()
            self.broken += [f'handover {self.handovers}, {line}' for line in broken]
        self.periods += checker.checked
        self.done += handover.controller.state is HandoverState.DONE

    @staticmethod
    def _since(holds: bool, since_s: float | None, now_s: float) -> float | None:
        if not holds:
            return None
        return now_s if since_s is None else since_s


def _not_still(period: Period, stopped_since_s: float | None, now_s: float) -> list[str]:
    if stopped_since_s is None or now_s - stopped_since_s < STOPPED_S:
        return []
    speed = float(np.abs(period.joint_velocities).max())
    return [f'a stopped arm moves at {speed:.3f} rad/s'] if speed > STILL_RAD_S else []


def run(
    progress: Callable[[str], None], minutes: float = MINUTES, maximum: int | None = None
) -> list[Measurement]:
    """
    Repeat handovers with random faults until the time is over.

    Args:
        progress: called with the present step.
        minutes: duration on the wall clock, min.
        maximum: largest number of handovers; None: as many as the time permits.

    Returns:
        The figures.

    """
    progress('making the scenarios')
    soak = Soak([make_scenario(seed=seed) for seed in range(SEEDS)])
    begun_s = monotonic()
    first = 0
    while monotonic() - begun_s < 60.0 * minutes and soak.handovers != maximum:
        soak.hand_over()
        if soak.handovers == WARM_UP:
            first = soak.resident
        passed = (monotonic() - begun_s) / 60.0
        progress(f'{soak.handovers} handovers, {len(soak.broken)} faults, {passed:.1f} min')
    growth = 100.0 * (soak.resident / first - 1.0) if first else 0.0
    struck = ', '.join(f'{name} {count}' for name, count in sorted(soak.faults.items()))
    return [
        Measurement(
            'soak: invariants broken',
            len(soak.broken),
            'times',
            target=0.0,
            note='; '.join(soak.broken[:5]) or f'in {soak.periods} periods',
        ),
        Measurement('soak: handovers', soak.handovers, 'handovers', note=f'struck by: {struck}'),
        Measurement(
            'soak: handovers that came to their end',
            100.0 * soak.done / max(soak.handovers, 1),
            '%',
            target=100.0,
            higher_is_better=True,
            note=f'the arm stopped by itself {soak.stops} times and was told to go on',
        ),
        Measurement('soak: drift of handovers that nothing struck', soak.drift, 'rad', target=0.0),
        Measurement(
            'soak: growth of the memory',
            growth,
            '%',
            target=MAX_GROWTH,
            note=f'after the first {WARM_UP} handovers',
        ),
    ]
