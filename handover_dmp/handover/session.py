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
A session: give an object, wait while it is used, take it back, go home.

A `SessionController` is a `HandoverController` that continues after the exchange. The give and the
take are ordinary reaches, each with its own learnt movement; between and after them the wrist
goes home along a path (`withdrawal`). The controller also commands the gripper: it opens in the
exchange of a give, and nowhere else. docs/topics.md lists the transitions of the states.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from math import dist, hypot, inf, isfinite

from handover_dmp.common.arrays import Vector
from handover_dmp.common.errors import DataError
from handover_dmp.common.settings import dmp_setting, settings_of
from handover_dmp.common.vectors import dot, minus, plus
from handover_dmp.dmp import DecoupledDmp
from handover_dmp.handover.controller import (
    HandoverController,
    HandoverOptions,
    HandoverState,
    movement_for,
    MOVING,
    WRIST_RETURNED_M,
    WristCommand,
)
from handover_dmp.handover.release import ReleaseOptions, ReleaseRule
from handover_dmp.handover.withdrawal import (
    Trace,
    Way,
    way_back,
    WAY_SHARE,
    WayFollower,
    WithdrawalOptions,
)
from handover_dmp.tracking import GoalEstimator, HandEstimate

OWN_WAYS = (HandoverState.PICKING_UP, HandoverState.RELEASED, HandoverState.WITHDRAWING)
"""States in which the wrist moves or stands without the primitive."""
HOLDING = (HandoverState.IDLE, HandoverState.WAITING, HandoverState.DONE)
"""States in which the wrist stands until a handover begins."""
NO_SHIFT: Vector = (0.0, 0.0, 0.0)


class Leg(str, Enum):
    """Which of the two handovers of a session."""

    GIVE = 'give'
    TAKE = 'take'


@dataclass(frozen=True)
class SessionModels:
    """
    The movements of a session.

    Attributes:
        give: movement of the give.
        take: movement of the take.

    Raises:
        DataError: a movement does not have three dimensions.

    """

    give: DecoupledDmp
    take: DecoupledDmp

    def __post_init__(self) -> None:
        """Check the dimensions."""
        for movement in (self.give, self.take):
            if movement.dimensions != 3:
                raise DataError(
                    f'a movement of a session must have 3 dimensions, not {movement.dimensions}'
                )


@dataclass(frozen=True)
class SessionOptions:
    """
    The rules of a session, besides those of its handovers.

    Attributes:
        release: conditions for opening the gripper in a give, if the force is measured.
        withdrawal: options of the way back.

    Raises:
        DataError: `take_start` is unknown, or the position is not three numbers.

    """

    take_start: str = dmp_setting(
        'session.take_start',
        "Trigger of the take: signal (the partner's signal) or motion (the hand comes towards "
        'the robot)',
        choices=('signal', 'motion'),
    )
    take_approach_m: float = dmp_setting(
        'session.take_approach_m',
        'Distance by which the hand must approach the wrist without a pause to trigger a take by '
        'motion, m',
        0.0,
        5.0,
    )
    pick_up: bool = dmp_setting(
        'session.pick_up',
        'Whether the robot picks the object up first; if not, the gripper already holds it',
    )
    pick_up_position: Vector = dmp_setting(
        'session.pick_up_position', 'Wrist position at which the object is picked up, m'
    )
    grip_s: float = dmp_setting(
        'session.grip_s', 'Time that the gripper takes to close, s', 0.0, 60.0
    )
    released_s: float = dmp_setting(
        'session.released_s',
        'Time for which the wrist stands still after the object is released, s',
        0.0,
        60.0,
    )
    wait_timeout_s: float = dmp_setting(
        'session.wait_timeout_s',
        'Time after which the robot stops waiting for a take and ends the session, s; 0: never',
        0.0,
        86400.0,
    )
    exchange_timeout_s: float = dmp_setting(
        'session.exchange_timeout_s',
        'Duration of an exchange after which a warning is given, s; 0: never',
        0.0,
        86400.0,
    )
    withdraws_untaken: bool = dmp_setting(
        'session.withdraws_untaken',
        'Whether the wrist goes home with the object if nobody has touched it within '
        'exchange_timeout_s',
    )
    held_share: float = dmp_setting(
        'session.held_share',
        'Share of the weight that the robot must carry in a take before it withdraws, if the '
        'force on the wrist is measured',
        0.0,
        1.0,
    )
    wrench_timeout_s: float = dmp_setting(
        'session.wrench_timeout_s',
        'Age of the wrench, by arrival, beyond which it is ignored, s',
        0.01,
        5.0,
    )
    release: ReleaseOptions = field(default_factory=ReleaseOptions)
    withdrawal: WithdrawalOptions = field(default_factory=WithdrawalOptions)

    def __post_init__(self) -> None:
        """Check `take_start` and the position."""
        if fault := settings_of(SessionOptions)['take_start'].fault(self.take_start):
            raise DataError(f'take_start {fault}')
        place = tuple(map(float, self.pick_up_position))
        if len(place) != 3 or not all(abs(x) < inf for x in place):
            raise DataError(f'pick_up_position {list(place)} is not three numbers')
        object.__setattr__(self, 'pick_up_position', place)


class SessionController(HandoverController):
    """
    Moves the wrist and the gripper through a session.

    Attributes:
        leg: the current handover, or the next one.
        gripper_closed: whether the gripper is commanded to be closed.
        session: the rules of the session.

    """

    def __init__(
        self,
        models: SessionModels,
        options: HandoverOptions | None = None,
        estimator: GoalEstimator | None = None,
        session: SessionOptions | None = None,
    ) -> None:
        """
        Take the learnt movements and the rules.

        Args:
            models: movements of the give and of the take.
            options: the rules of both handovers; the defaults of `config/` if left out.
            estimator: estimator of the hand's position and velocity.
            session: the rules of the session; the defaults of `config/` if left out.

        """
        self.leg = Leg.GIVE
        self.state = HandoverState.IDLE
        self.session = session or SessionOptions()
        self.gripper_closed = not self.session.pick_up
        self._trace: Trace | None = None
        self._way: WayFollower | None = None
        self._last_seen: Vector | None = None
        self._rule = ReleaseRule(self.session.release)
        self._weight_n: float | None = None
        self._lies = False
        self._force: Vector | None = None
        self._force_arrival_s = -inf
        super().__init__(models.give, options, estimator)
        self.use_session(models, self.options, self.session)

    def use_session(
        self, models: SessionModels, options: HandoverOptions, session: SessionOptions
    ) -> None:
        """
        Change movements and rules from the next period on.

        Args:
            models: movements of the give and of the take.
            options: the rules of both handovers.
            session: the rules of the session.

        """
        # both in advance: relearning takes longer than a period
        self._movements = {
            Leg.GIVE: movement_for(models.give, options),
            Leg.TAKE: movement_for(models.take, options),
        }
        self.session = session
        self._rule.options = session.release
        self.use(self._movements[self.leg], options)

    def reset(self) -> None:
        """
        Forget the hand and the progress of the session; brake if necessary, then hold.

        The gripper stays as it is, and the holder of the object is remembered.
        """
        self._break_off()
        super().reset()
        self._since_s = 0.0
        self._nearer_m = 0.0
        self._dt = 0.0
        self._arrived = False
        self._returning = False
        self._shift = NO_SHIFT
        self._lets_go = False
        self._overdue = False
        self._speed_before: Vector | None = None

    def abort(self) -> None:
        """Brake and hold until `start` or `reset`; the gripper stays as it is."""
        self._break_off()
        super().abort()

    def _break_off(self) -> None:
        """Leave the present motion; keep the holder of the object and the force at rest."""
        leg, self.leg = self.leg, self.next_leg
        if self._lies and not self.gripper_closed:
            self.leg = Leg.GIVE
        self._leave_way()
        if leg is Leg.TAKE or not self.gripper_closed:
            self._begin_to_feel()
        # otherwise the partner may hold it already, and the earlier force at rest remains valid

    def set_wrench(self, force: Vector, arrival_s: float) -> None:
        """
        Process the force on the wrist; after the first one, the gripper opens only by force.

        Args:
            force: (3,), force of the held object, N, in the axes of `world`.
            arrival_s: the time, s, on the clock of the arrivals.

        """
        if all(map(isfinite, force)):
            self._force, self._force_arrival_s = force, arrival_s

    def begin_with(self, holder: str) -> bool:
        """
        Process the holder of the object: before the first handover, or when it is on the table.

        Args:
            holder: `robot`, `partner`, `both`, `table` or another word, as on `object/holder`.

        Returns:
            Whether this changed the state. If the partner has the object, the gripper is open and
            the take comes first; if it is on the table, the give. An object that the robot holds,
            too, is never released. Other holders change nothing.

        """
        self._lies = holder == 'table'
        if self.state is not HandoverState.IDLE or (self._trace is not None and not self._lies):
            return False
        if self._lies and self.leg is Leg.TAKE and not self.gripper_closed:
            self.leg = Leg.GIVE
        elif holder == 'partner' and self.next_leg is Leg.GIVE:
            self.leg, self.gripper_closed = Leg.TAKE, False
        elif holder in ('robot', 'both') and not self.gripper_closed:
            self.leg, self.gripper_closed = Leg.GIVE, True
        else:
            return False
        self._begin_to_feel()
        return True

    @property
    def is_overdue(self) -> bool:
        """Whether the exchange takes, or took, too long because the partner does not act."""
        return self._overdue and self.state in (HandoverState.EXCHANGE, HandoverState.WITHDRAWING)

    @property
    def home(self) -> Vector | None:
        """Position to which the wrist returns, m; None before the first session."""
        return None if self._trace is None else self._trace.start

    @property
    def next_leg(self) -> Leg:
        """Return the handover that begins with the next start."""
        if self.state in (HandoverState.RELEASED, HandoverState.WITHDRAWING):
            given = self.leg is Leg.GIVE and not self.gripper_closed
            return Leg.TAKE if given else Leg.GIVE
        waits = self.leg is Leg.TAKE and self.state is not HandoverState.DONE
        if self.gripper_closed or (self.session.pick_up and not waits):
            return Leg.GIVE
        return Leg.TAKE

    @property
    def starts_by(self) -> str:
        """Return what starts the next handover: `signal`, `motion` or `service`."""
        return self.options.start if self.next_leg is Leg.GIVE else self.session.take_start

    @property
    def listens(self) -> bool:
        """Whether a signal is followed now, or as soon as the wrist is home."""
        return self.state in (*HOLDING, HandoverState.RELEASED, HandoverState.WITHDRAWING)

    def signal(self, at_s: float) -> None:
        """
        Process the partner's signal: the next handover starts then, or once the wrist is home.

        Args:
            at_s: time of the start, s; a time in the past means now.

        """
        if self.listens and self.starts_by == 'signal':
            self._signal_s = at_s

    def start(self) -> bool:
        """
        Start the next handover from the present wrist position.

        Returns:
            Whether it started; not during a handover, nor before the wrist is known.

        """
        if self.state in MOVING or self.wrist is None:
            return False
        self.leg = self.next_leg
        here = self.wrist
        if self._primitive is not None:
            here = self._anchored(self._primitive).position
        if self._trace is None:
            self._trace = Trace(here)
        if self.leg is Leg.GIVE and not self.gripper_closed:
            self._signal_s = inf
            self._returning = False
            self._begun_at = here
            self._walk(self.session.pick_up_position, here)
            self.state = HandoverState.PICKING_UP
            return True
        return self._reach()

    def _reach(self) -> bool:
        self.model = self._movements[self.leg]
        self._arrived = self._overdue = False
        self._shift = NO_SHIFT
        return super().start()

    def step(
        self, now_s: float, dt: float, phase_rate: float = 1.0, arrival_s: float | None = None
    ) -> WristCommand | None:
        """
        Advance by one period.

        Args:
            now_s: the time at the start of the period, s, on the clock of the stamps.
            dt: its length, s.
            phase_rate: maximum speed of the phase, 0 to 1; below 1 if the arm cannot keep up.
            arrival_s: the same time on the clock of the arrivals, if that differs.

        Returns:
            The command for the end of the period; None until the wrist is known.

        """
        if self.hand is not None:
            self._last_seen = self.hand
        self._dt = dt
        arrival_s = now_s if arrival_s is None else arrival_s
        self._feel(arrival_s, dt)
        age = self.hand_age_s(arrival_s)
        fresh = self.hand is not None and age <= self.hand_timeout_s
        before = self.state
        if before in OWN_WAYS:
            command = self._go(now_s, dt, phase_rate, fresh, age)
        else:
            found = super().step(now_s, dt, phase_rate, arrival_s)
            if found is None:
                return None
            command = found
        if before is HandoverState.EXCHANGE:
            feels_now = self._feels_now(arrival_s)
            self._judge_release(now_s, fresh, feels_now)
            self._overdue = False
            if self.state is before:
                self._judge_patience(now_s, feels_now)
        elif before is HandoverState.WAITING and self.state is before:
            limit_s = self.session.wait_timeout_s
            if 0.0 < limit_s <= now_s - self._since_s:
                self._enter(HandoverState.DONE, now_s)
        if self._trace is not None and self.state is not HandoverState.WITHDRAWING:
            self._trace.add(command.position)
        return command._replace(state=self.state)

    def _enter(self, state: HandoverState, now_s: float) -> None:
        self.state = state
        self._since_s = now_s
        self._nearer_m = 0.0

    # Start of a handover

    def _start_if_signalled(self, now_s: float, hand: HandEstimate | None) -> None:
        if self.state not in HOLDING or hand is None:
            return
        if now_s >= self._signal_s or (self.starts_by == 'motion' and self._is_asked_by(hand)):
            self.start()

    def _is_asked_by(self, hand: HandEstimate) -> bool:
        """Return whether the hand moves; for a take, whether it has approached the wrist."""
        assert self.wrist is not None
        if self.next_leg is Leg.GIVE:
            moves = hypot(*hand.velocity) > self.options.motion_threshold
            return moves and self.state is HandoverState.IDLE
        between = minus(self.wrist, hand.position)
        distance = hypot(*between)
        speed = dot(hand.velocity, between) / distance if distance > 0.0 else 0.0
        comes = speed > self.options.motion_threshold
        self._nearer_m = self._nearer_m + speed * self._dt if comes else 0.0
        return self._nearer_m >= self.session.take_approach_m

    # Exchange

    def _goal(self, hand: HandEstimate) -> Vector:
        return plus(super()._goal(hand), self._shift)

    def _stay_with(self, hand: HandEstimate) -> None:
        """
        Keep the present distance to the hand.

        With both hands on the object, closing the remaining gap would push or pull.
        """
        assert self._primitive is not None
        # the meeting point is known by now
        self._partner = None
        self._shift = minus(self._primitive.position, super()._goal(hand))

    def _judge_exchange(self, now_s: float, hand: HandEstimate) -> None:
        self._arrived = self._is_at(hand)
        if self.state is HandoverState.EXCHANGE:
            return
        super()._judge_exchange(now_s, hand)
        if self.exchange_position is not None and self._force is not None:
            self._stay_with(hand)

    def _judge_release(self, now_s: float, fresh: bool, feels_now: bool) -> None:
        """Give: open the gripper once the partner has the object. Take: close it, and hold."""
        arrived = self._arrived and fresh and not self.estimator.is_disputed
        lasted_s = now_s - self._exchange_since_s
        if self.leg is Leg.GIVE:
            if self._force is None:
                opens = arrived and lasted_s >= self.options.exchange_hold_s
            else:
                opens = feels_now and self._lets_go
            if opens:
                self.gripper_closed = False
                self._weight_n = self._rule.weight_n if self._force is not None else None
                self._enter(HandoverState.RELEASED, now_s)
        elif not self.gripper_closed:
            if arrived:
                self.gripper_closed = True
                self._since_s = now_s
        elif self._holds(feels_now) and min(now_s - self._since_s, lasted_s) >= max(
            self.session.grip_s, self.options.exchange_hold_s
        ):
            self._withdraw(now_s)

    def _judge_patience(self, now_s: float, feels_now: bool) -> None:
        """Flag an exchange that takes too long; go home with an untaken object, if configured."""
        patience_s = self.session.exchange_timeout_s
        self._overdue = 0.0 < patience_s <= now_s - self._exchange_since_s
        # if the force measurement has stopped, it is unknown whose hand is on the object
        untouched = self._force is None or (feels_now and not self._rule.contact)
        gives = self.leg is Leg.GIVE and self.session.withdraws_untaken
        if self._overdue and gives and untouched:
            self._withdraw(now_s)

    # Force on the wrist

    def _begin_to_feel(self) -> None:
        """Restart the measurement of the force at rest, with or without an object."""
        self._rule.reset(None if self.gripper_closed else self._weight_n)
        self._lets_go = False

    def _feels_now(self, arrival_s: float) -> bool:
        return arrival_s - self._force_arrival_s <= self.session.wrench_timeout_s

    def _feel(self, arrival_s: float, dt: float) -> None:
        """Pass the force of the period, and the acceleration of the wrist, to the rule."""
        self._lets_go = False
        if self._primitive is None or self._force is None or not self._feels_now(arrival_s):
            self._speed_before = None
            return
        velocity, before = self._primitive.velocity, self._speed_before
        self._speed_before = velocity
        acceleration: Vector = (0.0, 0.0, 0.0)
        if before is not None and dt > 0.0:
            acceleration = tuple((v - b) / dt for v, b in zip(velocity, before, strict=True))
        self._lets_go = self._rule.update(self._force, dt, acceleration)

    def _holds(self, feels_now: bool) -> bool:
        """Return whether the robot carries the load; assumed if there is no force."""
        if self._force is None:
            return True
        if not feels_now:
            return False
        if self._weight_n is None:
            return self._rule.contact
        return -self._rule.share >= self.session.held_share

    # Motion without the primitive

    def _go(
        self, now_s: float, dt: float, phase_rate: float, fresh: bool, age: float
    ) -> WristCommand:
        assert self._primitive is not None
        self._expectation = None
        self._turning.rest(dt, back=self.state is HandoverState.WITHDRAWING)
        primitive = self._anchored(self._primitive)
        if self._way is None or self.state is HandoverState.RELEASED:
            self._phase_rate = 0.0
            self._primitive = self._brake(primitive, dt)
            if now_s - self._since_s >= self._rest_s or self._is_free():
                self._go_on(now_s)
        else:
            slower = phase_rate if self.options.phase_stopping else 1.0
            speed = slower * self._speed_on(self._way, primitive.position, now_s, fresh)
            if speed == 0.0 == self._way.rate:
                self._primitive = self._brake(primitive, dt)
            else:
                limit = self.options.acceleration_limit
                self._primitive = self._way.step(primitive, dt, speed, limit)
            self._phase_rate = self._way.rate
            self._arrive(self._way, now_s)
        return self._command(self._primitive, age)

    @property
    def _rest_s(self) -> float:
        if self.state is HandoverState.RELEASED:
            return self.session.released_s
        return self.session.grip_s if self.state is HandoverState.PICKING_UP else 0.0

    def _is_free(self) -> bool:
        """Return whether the released object no longer exerts a force."""
        if self.state is not HandoverState.RELEASED or self._speed_before is None:
            return False
        assert self._force is not None
        return hypot(*self._force) < self.session.release.contact_n

    def _speed_on(self, way: WayFollower, position: Vector, now_s: float, fresh: bool) -> float:
        """Return the maximum speed of the wrist on a way, m/s."""
        options, hand = self.session.withdrawal, self.estimator.estimate(now_s)
        if fresh and hand is not None:
            return options.speed_at(dist(position, self._goal(hand)))
        # it may move away from a lost hand, but never towards it
        if self.state is HandoverState.PICKING_UP or self._last_seen is None:
            return 0.0
        nearer = way.way.leads_nearer(way.time_s, self._last_seen)
        return 0.0 if nearer else options.near_speed

    def _arrive(self, way: WayFollower, now_s: float) -> None:
        assert self._primitive is not None and self.wrist is not None
        there = dist(self.wrist, way.way.end) < WRIST_RETURNED_M
        if not (there and way.has_arrived(self._primitive)):
            return
        self._way = None
        self._since_s = now_s
        if self.state is HandoverState.PICKING_UP and not self._returning:
            self.gripper_closed = True
            self._begin_to_feel()
        else:
            self._go_on(now_s)

    def _go_on(self, now_s: float) -> None:
        """Enter the state that follows a rest, or the end of a way."""
        if self.state is HandoverState.RELEASED:
            self._withdraw(now_s)
        elif self.state is HandoverState.WITHDRAWING:
            self._be_home(now_s)
        elif self._returning:
            self.state = HandoverState.IDLE
            self._reach()
        else:
            assert self._primitive is not None and self._begun_at is not None
            self._returning = True
            self._walk(self._begun_at, self._primitive.position)

    def _walk(self, end: Vector, start: Vector) -> None:
        acceleration = WAY_SHARE * self.options.acceleration_limit
        speed = self.session.withdrawal.speed
        self._way = WayFollower(Way([start, end], speed=speed, acceleration=acceleration))

    def _withdraw(self, now_s: float) -> None:
        assert self._trace is not None and self._primitive is not None
        self._enter(HandoverState.WITHDRAWING, now_s)
        way = way_back(
            self._trace,
            self._primitive.position,
            self.session.withdrawal,
            self.options.acceleration_limit,
            self._movements[self.leg].way_back,
        )
        self._way = None if way is None else WayFollower(way)

    def _be_home(self, now_s: float) -> None:
        assert self._trace is not None
        self._way = None
        self._trace = Trace(self._trace.start)
        if self.leg is Leg.GIVE and self.gripper_closed:
            self._enter(HandoverState.IDLE, now_s)
        elif self.leg is Leg.GIVE:
            self.leg = Leg.TAKE
            self._enter(HandoverState.WAITING, now_s)
        else:
            self._enter(HandoverState.DONE, now_s)
        self._begin_to_feel()

    def _leave_way(self) -> None:
        """Leave a way back: the rest of it becomes the trace."""
        if self._way is not None and self.state is HandoverState.WITHDRAWING:
            assert self._trace is not None
            trace = Trace(self._trace.start)
            for place in reversed(self._way.way.rest_of(self._way.time_s)):
                trace.add(place)
            self._trace = trace
        self._way = None
